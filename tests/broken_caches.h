// Caches that a trial must find out: the wait-free one with a single fault each.
#pragma once

#include <optional>
#include <utility>

#include "caches/registry.h"

namespace icbench {

/// Shows the first of its records changed by `fault`, which returns whether it is shown at all.
template <class Counters, bool (*fault)(Record&)>
struct WithFault : WaitFree<Counters> {
  using WaitFree<Counters>::WaitFree;
  template <class F>
  void for_each_record(F&& f) const {
    bool is_first = true;
    WaitFree<Counters>::for_each_record([&](Record r) {
      if (!std::exchange(is_first, false) || fault(r)) f(r);
    });
  }
};

inline bool lose(Record&) { return false; }
inline bool tear(Record& r) { return r.E.y += 1.0f, true; }
inline bool invent(Record& r) { return r.id = 1'000'000, true; }

template <class Counters>
struct Losing : WithFault<Counters, lose> {
  using WithFault<Counters, lose>::WithFault;
};

template <class Counters>
struct Tearing : WithFault<Counters, tear> {
  using WithFault<Counters, tear>::WithFault;
};

template <class Counters>
struct Inventing : WithFault<Counters, invent> {
  using WithFault<Counters, invent>::WithFault;
};

/// Answers queries with what `change` makes of the true answer.
template <class Counters, void (*change)(std::optional<Irradiance>&)>
struct WithAnswer : WaitFree<Counters> {
  using WaitFree<Counters>::WaitFree;
  struct Session : WaitFree<Counters>::Session {
    explicit Session(typename WaitFree<Counters>::Session s) noexcept : WaitFree<Counters>::Session(s) {}
    std::optional<Irradiance> query(const SurfacePoint& x) noexcept {
      std::optional<Irradiance> E = WaitFree<Counters>::Session::query(x);
      change(E);
      return E;
    }
  };
  Session open_session(std::uint32_t thread) { return Session(WaitFree<Counters>::open_session(thread)); }
};

inline void hide(std::optional<Irradiance>& E) { E.reset(); }
inline void darken(std::optional<Irradiance>& E) {
  if (E) *E *= 0.999f;
}
inline void brighten(std::optional<Irradiance>& E) {
  if (E) *E *= 10.0f;
}

template <class Counters>
struct Blind : WithAnswer<Counters, hide> {
  using WithAnswer<Counters, hide>::WithAnswer;
};

template <class Counters>
struct Darkening : WithAnswer<Counters, darken> {
  using WithAnswer<Counters, darken>::WithAnswer;
};

template <class Counters>
struct Brightening : WithAnswer<Counters, brighten> {
  using WithAnswer<Counters, brighten>::WithAnswer;
};

/// Has room for fewer records than it was asked to promise.
template <class Counters>
struct Small : WaitFree<Counters> {
  explicit Small(CacheConfig config) : WaitFree<Counters>(with_little_room(config)) {}
  static CacheConfig with_little_room(CacheConfig config) {
    config.capacity = 64;
    return config;
  }
};

/// Loses all when it is tidied.
template <class Counters>
struct Sweeping : WaitFree<Counters> {
  using WaitFree<Counters>::WaitFree;
  void tidy() { WaitFree<Counters>::clear(); }
};

}  // namespace icbench
