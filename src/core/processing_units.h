// How many threads can run at once.
#pragma once

#include <sched.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <thread>

namespace icbench {

/// Most units that Linux can be configured for.
inline constexpr unsigned kMaxUnits = 8192;

/// Processing units that the calling thread, and those that it starts, may run on, at least 1: of a job or container
/// that was given some of them, these. std::thread::hardware_concurrency() counts all that are online.
inline unsigned processing_units() noexcept {
  std::array<std::uint64_t, kMaxUnits / 64> mask{};
  // The system call takes words of any number; glibc's type has a fixed one.
  if (::sched_getaffinity(0, sizeof mask, reinterpret_cast<cpu_set_t*>(mask.data())) != 0)
    return std::max(1u, std::thread::hardware_concurrency());
  unsigned units = 0;
  for (const std::uint64_t word : mask) units += static_cast<unsigned>(std::popcount(word));
  return std::max(1u, units);
}

}  // namespace icbench
