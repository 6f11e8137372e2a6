// How long memory takes to answer: loads each of whose address is what the one before has read.
#pragma once

#include <chrono>
#include <cstdint>
#include <numeric>
#include <vector>

#include "core/large_pages.h"
#include "core/random.h"

namespace icbench {

/// A circle through all cache lines of a block of memory in random order, on large pages if the system has them.
class PointerChase {
 public:
  PointerChase(std::size_t bytes, std::uint64_t seed) : lines_(bytes / sizeof(Line)) {
    std::vector<std::uint32_t> order(lines_.size());
    std::iota(order.begin(), order.end(), 0u);
    Pcg32 random(seed);
    for (std::size_t i = order.size(); i > 1; --i)
      std::swap(order[i - 1], order[random.below(static_cast<std::uint32_t>(i))]);
    for (std::size_t i = 0; i < order.size(); ++i) lines_[order[i]].next = order[(i + 1) % order.size()];
    go(order.size());  // so that what fits into a cache is there
  }

  std::size_t bytes() const noexcept { return lines_.size() * sizeof(Line); }

  /// Nanoseconds a load.
  double ns_per_load() {
    using Clock = std::chrono::steady_clock;
    const Clock::time_point start = Clock::now();
    go(kLoads);
    return std::chrono::duration<double, std::nano>(Clock::now() - start).count() / kLoads;
  }
  /// What the loads came to: whoever prints it keeps them from being left out.
  std::uint32_t at() const noexcept { return at_; }

  static constexpr std::size_t kLoads = 200'000;

 private:
  struct alignas(64) Line {
    std::uint32_t next;
  };
  void go(std::size_t n) noexcept {
    for (std::size_t i = 0; i < n; ++i) at_ = lines_[at_].next;
  }

  std::vector<Line, LargePageAllocator<Line>> lines_;
  std::uint32_t at_ = 0;
};

}  // namespace icbench
