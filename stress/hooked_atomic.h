// An atomic word with something to be done at its steps: what delays, counts of steps and tests put into the places of
// the shipping code's atomics.
#pragma once

#include <atomic>

namespace icbench::stress {

/// `Base`'s interface (std::atomic's, core/sync.h). Hook::step() comes before each operation; Hook::wrote(), if there
/// is one, after each that has stored.
template <class T, class Base, class Hook>
class HookedAtomic {
 public:
  HookedAtomic() noexcept = default;
  explicit(false) HookedAtomic(T value) noexcept : base_(value) {}

  T load(std::memory_order order) const noexcept {
    Hook::step();
    return base_.load(order);
  }
  void store(T value, std::memory_order order) noexcept {
    Hook::step();
    base_.store(value, order);
    wrote();
  }
  T fetch_add(T n, std::memory_order order) noexcept {
    Hook::step();
    const T old = base_.fetch_add(n, order);
    wrote();
    return old;
  }
  T exchange(T value, std::memory_order order) noexcept {
    Hook::step();
    const T old = base_.exchange(value, order);
    wrote();
    return old;
  }
  bool compare_exchange_strong(T& expected, T desired, std::memory_order success,
                               std::memory_order failure) noexcept {
    Hook::step();
    const bool is_stored = base_.compare_exchange_strong(expected, desired, success, failure);
    if (is_stored) wrote();
    return is_stored;
  }

 private:
  static void wrote() noexcept {
    if constexpr (requires { Hook::wrote(); }) Hook::wrote();
  }

  Base base_{};
};

}  // namespace icbench::stress
