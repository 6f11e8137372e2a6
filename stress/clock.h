// The stress clock: stamps of invocations and returns that never claim an order which was not there.
//
// Soundness: if a.ret < b.call, then everything a did was visible to all threads before b did anything. A
// release store may leave its insert while it still sits in the store buffer, and a counter that is read out
// of order may be read before or after its place in the program; so a bare time stamp accuses correct caches.
//
//   counter  One shared word, fetch_add with acq_rel: a's addition synchronises with every later one, so the
//            claim holds by happens-before. For the same reason it orders what the cache itself failed to
//            order between operations that do not overlap: it is the weaker detective.
//   tsc      The time-stamp counter between fences. Call: RDTSC; LFENCE, nothing of the operation starts
//            before the stamp is read. Return: MFENCE; LFENCE; RDTSC, all its stores are globally visible and
//            all its loads done before (Intel SDM vol. 2B, RDTSC; AMD64 APM vol. 3). On AArch64 DSB, ISB and
//            CNTVCT_EL0. Needs counters that agree between cores; tsc_is_usable tests it. It orders nothing
//            that the cache did not order, so it is the clock for ThreadSanitizer runs.
//
// This is the one place of the project where a fence may stand alone.
#pragma once

#include <atomic>

#include "core/sanitizers.h"
#include "core/sync.h"
#include "stress/history.h"

namespace icbench::stress {

enum class ClockSource : std::uint8_t { counter, tsc };

#if defined(__x86_64__) || defined(__aarch64__)
inline constexpr bool kHasTsc = true;
#else
inline constexpr bool kHasTsc = false;
#endif

/// Stamp before an operation: nothing of the operation happens earlier.
inline Stamp tsc_before() noexcept {
#if defined(__x86_64__)
  std::uint32_t low, high;
  asm volatile("rdtsc\n\tlfence" : "=a"(low), "=d"(high)::"memory");
  return (Stamp{high} << 32) | low;
#elif defined(__aarch64__)
  Stamp value;
  asm volatile("isb\n\tmrs %0, cntvct_el0\n\tisb" : "=r"(value)::"memory");
  return value;
#else
  return 0;
#endif
}

/// Stamp after an operation: everything it did is visible to all threads.
inline Stamp tsc_after() noexcept {
#if defined(__x86_64__)
  std::uint32_t low, high;
  asm volatile("mfence\n\tlfence\n\trdtsc" : "=a"(low), "=d"(high)::"memory");
  return (Stamp{high} << 32) | low;
#elif defined(__aarch64__)
  Stamp value;
  asm volatile("dsb sy\n\tisb\n\tmrs %0, cntvct_el0" : "=r"(value)::"memory");
  return value;
#else
  return 0;
#endif
}

class StressClock {
 public:
  explicit StressClock(ClockSource source) noexcept : source_(source) {}

  Stamp before() noexcept { return source_ == ClockSource::tsc ? tsc_before() : tick(); }
  Stamp after() noexcept { return source_ == ClockSource::tsc ? tsc_after() : tick(); }

 private:
  // acq_rel: every addition synchronises with all later ones (one release sequence).
  Stamp tick() noexcept { return counter_.fetch_add(1, std::memory_order_acq_rel); }

  ClockSource source_;
  alignas(kNoSharing) std::atomic<Stamp> counter_{1};
};

/// Whether the time-stamp counters of the cores that the scheduler gives us agree: threads pass a word to and
/// fro for some milliseconds, and none may read an earlier time than was passed to it.
bool tsc_is_usable();

}  // namespace icbench::stress
