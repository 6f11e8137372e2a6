// The processor's time-stamp counter, for latencies of single operations, and its rate.
//
// ticks() is RDTSC on x86-64, CNTVCT_EL0 on AArch64, steady_clock elsewhere; all of them count at a constant
// rate on the processors of the last ten years, whatever the core's frequency (TickRate::invariant tells). It
// costs some 20 to 40 cycles and does not wait for earlier instructions: a stamp may be off by the depth of
// the out-of-order window, tens of nanoseconds at most. Stamping once per operation, so that the end of one
// is the start of the next, keeps the sum exact. It orders nothing: it is no clock for histories of
// concurrent operations. ticks_in_order() does wait, and costs some tens of nanoseconds.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string_view>

#if defined(__x86_64__)
#include <x86intrin.h>
#elif !defined(__aarch64__)
#include <chrono>
#endif

namespace icbench {

inline std::uint64_t ticks() noexcept {
#if defined(__x86_64__)
  return __rdtsc();
#elif defined(__aarch64__)
  std::uint64_t value;
  asm volatile("mrs %0, cntvct_el0" : "=r"(value));
  return value;
#else
  return static_cast<std::uint64_t>(std::chrono::steady_clock::now().time_since_epoch().count());
#endif
}

/// The same once every earlier instruction is done and what it wrote is there for others, before any later one begins:
/// for what a single operation takes by itself, without what the processor does of others meanwhile. Without such
/// instructions, as ticks().
inline std::uint64_t ticks_in_order() noexcept {
#if defined(__x86_64__)
  _mm_mfence();
  _mm_lfence();
  const std::uint64_t value = __rdtsc();
  _mm_lfence();
  return value;
#elif defined(__aarch64__)
  std::uint64_t value;
  asm volatile("dsb ish\n\tisb\n\tmrs %0, cntvct_el0\n\tisb" : "=r"(value)::"memory");
  return value;
#else
  return ticks();
#endif
}

/// Ticks from one stamp to a later one; 0 where the counters of two processors are so far out of step that it is not.
inline std::uint64_t ticks_between(std::uint64_t from, std::uint64_t to) noexcept {
  return to > from ? to - from : 0;
}

/// Processor time of the calling thread so far.
std::int64_t thread_cpu_ns() noexcept;

struct TickRate {
  double ns_per_tick = 1.0;  ///< > 0
  double spread = 0.0;  ///< relative difference between the slowest and the fastest try: trust in ns_per_tick
  bool invariant = true;  ///< the system says that the rate does not depend on the core's frequency
  std::string_view source = "steady_clock";  ///< "rdtsc", "cntvct" or "steady_clock"

  double to_ns(std::uint64_t n) const noexcept { return static_cast<double>(n) * ns_per_tick; }
  nlohmann::ordered_json to_json() const;
};

/// Measures the rate against steady_clock: the median of several tries, some 50 ms in all.
TickRate calibrate_ticks();

/// The same, measured once for the whole process.
const TickRate& tick_rate();

}  // namespace icbench
