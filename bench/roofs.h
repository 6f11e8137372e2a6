// What bounds any program here: how long memory takes to answer, how many cache lines it gives at once, and how many
// instructions a nanosecond has room for.
#pragma once

#include <chrono>
#include <cstdint>
#include <numeric>
#include <vector>

#include "core/large_page_allocator.h"
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

  /// Nanoseconds a load.
  double ns_per_load() {
    using Clock = std::chrono::steady_clock;
    const Clock::time_point start = Clock::now();
    go(kLoads);
    return std::chrono::duration<double, std::nano>(Clock::now() - start).count() / kLoads;
  }
  /// The line that the loads came to: whoever prints it keeps them from being left out.
  std::uint32_t at() const noexcept { return at_; }

  static constexpr std::size_t kLoads = 200'000;
  static constexpr std::size_t kLineBytes = 64;

 private:
  struct alignas(kLineBytes) Line {
    std::uint32_t next;
  };
  void go(std::size_t n) noexcept {
    for (std::size_t i = 0; i < n; ++i) at_ = lines_[at_].next;
  }

  std::vector<Line, LargePageAllocator<Line>> lines_;
  std::uint32_t at_ = 0;
};

/// Loads from all over a block of memory, on large pages if the system has them, none of which waits for another: the
/// most cache lines that one thread gets.
class ScatteredLoads {
 public:
  explicit ScatteredLoads(std::size_t bytes) : lines_(bytes / sizeof(Line)) {}

  double lines_per_ns() {
    using Clock = std::chrono::steady_clock;
    const Clock::time_point start = Clock::now();
    std::uint64_t sum = 0;
    for (std::uint32_t i = 0; i < kLoads; ++i) {
      // Bits of a product (Knuth 1998, TAOCP 3, section 6.4, multiplicative hashing): a line that is not near the last.
      const std::uint64_t scattered = (next_++ * 0x9e3779b97f4a7c15u) >> 32;
      sum += lines_[(scattered * lines_.size()) >> 32].value;
    }
    sum_ += sum;
    return kLoads / std::chrono::duration<double, std::nano>(Clock::now() - start).count();
  }
  std::uint64_t sum() const noexcept { return sum_; }

  static constexpr std::uint32_t kLoads = 1'000'000;

 private:
  struct alignas(64) Line {
    std::uint64_t value = 1;
  };

  std::vector<Line, LargePageAllocator<Line>> lines_;
  std::uint64_t next_ = 0, sum_ = 0;
};

inline constexpr std::uint64_t kRoofRounds = 200'000, kRoofUnrolled = 16,
                               kRoofInstructions = kRoofRounds * kRoofUnrolled * (8 + 4);
/// Instructions a nanosecond of one thread that waits for nothing: additions to eight numbers in turn, and to every two
/// of them a load from the nearest cache. (Those of the loop, one in a hundred, are not counted.) Not inlined: the
/// numbers have to have registers.
[[gnu::noinline]] inline double instructions_per_ns() {
  using Clock = std::chrono::steady_clock;
  std::uint64_t n[8] = {};
  const volatile std::uint64_t near = 1;
  const Clock::time_point start = Clock::now();
  for (std::uint64_t round = 0; round < kRoofRounds; ++round) {
#pragma GCC unroll 16
    for (std::uint64_t u = 0; u < kRoofUnrolled; ++u) {
#pragma GCC unroll 8
      for (int i = 0; i < 8; ++i) {
        n[i] += 1;
        asm volatile("" : "+r"(n[i]));  // one addition, now
        if (i % 2 == 1) {
          const std::uint64_t loaded = near;
          asm volatile("" : : "r"(loaded));
        }
      }
    }
  }
  const double ns = std::chrono::duration<double, std::nano>(Clock::now() - start).count();
  return static_cast<double>(kRoofInstructions) / ns;
}

}  // namespace icbench
