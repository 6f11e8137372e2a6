// Random delays at the atomic steps of the shipping code.
//
// DelaySync and DelayPlainSync are Sync policies (core/sync.h) that do what StdSync and PlainSync do, but a
// thread now and then spins or gives up the processor before a step. That widens the windows in which another
// thread can interfere, above all where threads outnumber cores; it can produce no interleaving that the
// plain policy could not. No sleeps: a delay is at most some microseconds, or a yield.
#pragma once

#include <atomic>
#include <thread>

#include "core/random.h"
#include "core/sync.h"
#include "stress/hooked_atomic.h"
#include "stress/rebind.h"

namespace icbench::stress {

/// One thread's dice. Delays are off until `start`.
class Delays {
 public:
  /// One step in about `every` is delayed; 0 switches delays off.
  static void start(std::uint64_t seed, std::uint32_t every) noexcept {
    random_ = Pcg32(seed);
    threshold_ = every == 0 ? 0 : UINT32_MAX / every;
  }

  static void step() noexcept {
    if (threshold_ == 0 || random_() >= threshold_) return;
    const std::uint32_t choice = random_();
    if (choice % kYieldOneIn == 0) {
      std::this_thread::yield();
    } else {
      for (std::uint32_t i = choice >> 24; i > 0; --i) spin_pause();
    }
  }

 private:
  static constexpr std::uint32_t kYieldOneIn = 8;

  static constinit inline thread_local Pcg32 random_{0};
  static constinit inline thread_local std::uint32_t threshold_ = 0;
};

struct DelaySync : NoHooks {
  /// Between publication and writing, where the order of the two is wrong.
  static void writes(const void*, std::size_t) noexcept { Delays::step(); }
  template <class T>
  using Atomic = HookedAtomic<T, std::atomic<T>, Delays>;
  static constexpr bool kConcurrent = true;
};

struct DelayPlainSync : NoHooks {
  template <class T>
  using Atomic = HookedAtomic<T, PlainAtomic<T>, Delays>;
  static constexpr bool kConcurrent = false;
};

static_assert(sizeof(DelaySync::Atomic<std::uint32_t>) == 4, "delays must not change a structure's layout");

template <class T>
struct WithDelays {
  using type = T;
};
template <>
struct WithDelays<StdSync> {
  using type = DelaySync;
};
template <>
struct WithDelays<PlainSync> {
  using type = DelayPlainSync;
};

/// `Cache` with delays at its atomic steps.
template <class Cache>
using Delayed = Rebound<Cache, WithDelays>;

}  // namespace icbench::stress
