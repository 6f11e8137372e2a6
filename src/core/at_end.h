// What is to be done in any case when a scope ends.
#pragma once

namespace icbench {

/// Calls f when it goes out of scope, also where an exception is the reason.
template <class F>
struct AtEnd {
  F f;
  ~AtEnd() { f(); }
};
template <class F>
AtEnd(F) -> AtEnd<F>;

}  // namespace icbench
