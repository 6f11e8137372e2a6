#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "harness/histogram.h"

namespace icbench {
namespace {

constexpr std::uint64_t kLargest = std::numeric_limits<std::uint64_t>::max();

/// |found - exact| <= exact / 64 without overflow.
bool within_bound(std::uint64_t found, std::uint64_t exact) {
  return (found > exact ? found - exact : exact - found) <= exact / 64;
}

TEST(Histogram, EmptyIsAllZero) {
  const Histogram h;
  EXPECT_EQ(h.count(), 0u);
  EXPECT_EQ(h.max(), 0u);
  for (const double q : {0.0, 0.5, 1.0}) EXPECT_EQ(h.percentile(q), 0u);
}

TEST(Histogram, SingleValuesComeBackWithinTheBoundAtEveryMagnitude) {
  std::mt19937_64 random(1);
  std::vector<std::uint64_t> values{0, 1, 31, 32, 33, 63, 64, 65, kLargest, kLargest - 1};
  for (unsigned bit = 0; bit < 64; ++bit)
    for (const std::uint64_t off : {~0ull, 0ull, 1ull}) values.push_back((1ull << bit) + off);
  for (int i = 0; i < 10'000; ++i) values.push_back(random() >> (random() % 64));
  for (const std::uint64_t v : values) {
    Histogram h;
    h.record(v);
    h.record(kLargest);  // so that the maximum does not help
    ASSERT_TRUE(within_bound(h.percentile(0.5), v)) << v << " came back as " << h.percentile(0.5);
  }
}

TEST(Histogram, SmallValuesAreExact) {
  for (std::uint64_t v = 0; v < 64; ++v) {
    Histogram h;
    h.record(v);
    h.record(1000);
    EXPECT_EQ(h.percentile(0.5), v);
  }
}

TEST(Histogram, PercentilesMatchTheSortedSampleWithinTheBound) {
  std::mt19937_64 random(7);
  std::vector<std::uint64_t> sample(20'001);
  Histogram h;
  for (std::uint64_t& v : sample) {
    v = random() >> (20 + random() % 40);
    h.record(v);
  }
  std::sort(sample.begin(), sample.end());
  EXPECT_EQ(h.count(), sample.size());
  EXPECT_EQ(h.max(), sample.back());
  for (const double q : {0.0, 0.001, 0.1, 0.5, 0.9, 0.99, 0.999, 0.9999, 1.0}) {
    const double rank = std::max(1.0, std::ceil(q * static_cast<double>(sample.size())));
    EXPECT_TRUE(within_bound(h.percentile(q), sample[static_cast<std::size_t>(rank) - 1])) << q;
  }
}

TEST(Histogram, MeanLeavesOutWhatIsAbove) {
  Histogram h;
  EXPECT_EQ(h.mean_up_to(kLargest), 0.0);
  for (const std::uint64_t v : {10u, 20u, 60u}) h.record(v);
  h.record(1'000'000);
  EXPECT_EQ(h.mean_up_to(60), 30.0);
  EXPECT_EQ(h.mean_up_to(59), 15.0);
  EXPECT_EQ(h.mean_up_to(9), 0.0);
  EXPECT_GT(h.mean_up_to(kLargest), 200'000.0);
}

TEST(Histogram, PercentileNeverExceedsTheMaximum) {
  Histogram h;
  h.record(1'000'000);
  for (const double q : {0.0, 0.5, 0.999, 1.0, 7.0}) EXPECT_LE(h.percentile(q), 1'000'000u);
  EXPECT_EQ(h.percentile(1.0), 1'000'000u);
}

TEST(Histogram, OddOrdersAreClamped) {
  Histogram h;
  for (std::uint64_t v = 1; v <= 10; ++v) h.record(v);
  EXPECT_EQ(h.percentile(-1.0), 1u);
  EXPECT_EQ(h.percentile(std::numeric_limits<double>::quiet_NaN()), 1u);
  EXPECT_EQ(h.percentile(0.1), 1u);
  EXPECT_EQ(h.percentile(0.11), 2u);
}

TEST(Histogram, TheSumErrsByTheBoundAtMost) {
  Histogram h;
  double exact = 0.0;
  for (std::uint64_t value = 1; value < 5'000'000; value += 1 + value / 7) {
    h.record(value);
    exact += static_cast<double>(value);
  }
  EXPECT_NEAR(static_cast<double>(h.sum()), exact, exact / 64.0);
  EXPECT_EQ(Histogram().sum(), 0u);
}

TEST(Histogram, MergingIsTheSameAsRecordingTogether) {
  std::mt19937_64 random(3);
  Histogram parts[3], together;
  for (int i = 0; i < 3000; ++i) {
    const std::uint64_t v = random() >> (random() % 64);
    parts[i % 3].record(v);
    together.record(v);
  }
  Histogram merged;
  for (const Histogram& part : parts) merged.merge(part);
  EXPECT_EQ(merged.count(), together.count());
  EXPECT_EQ(merged.max(), together.max());
  for (double q = 0.0; q <= 1.0; q += 0.01) ASSERT_EQ(merged.percentile(q), together.percentile(q));
}

TEST(Histogram, ClearForgetsEverything) {
  Histogram h;
  h.record(5);
  h.clear();
  EXPECT_EQ(h.count(), 0u);
  EXPECT_EQ(h.max(), 0u);
}

}  // namespace
}  // namespace icbench
