#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <utility>
#include <vector>

#include "harness/statistics.h"

namespace icbench {
namespace {

using Sample = std::vector<double>;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();

Sample exponential(std::size_t n, std::mt19937_64& random) {
  Sample sample(n);
  for (double& x : sample) x = -std::log(1.0 - static_cast<double>(random() >> 11) * 0x1p-53);
  return sample;
}

TEST(Quantile, InterpolatesBetweenOrderStatistics) {
  const Sample s{4, 1, 3, 2};
  EXPECT_DOUBLE_EQ(quantile(s, 0.0), 1.0);
  EXPECT_DOUBLE_EQ(quantile(s, 0.25), 1.75);
  EXPECT_DOUBLE_EQ(quantile(s, 0.5), 2.5);
  EXPECT_DOUBLE_EQ(quantile(s, 0.9), 3.7);
  EXPECT_DOUBLE_EQ(quantile(s, 1.0), 4.0);
}

TEST(Quantile, OfOneValueIsThatValue) {
  for (const double p : {0.0, 0.3, 0.5, 1.0}) EXPECT_EQ(quantile(Sample{7.0}, p), 7.0);
}

TEST(Quantile, ClampsItsOrder) {
  EXPECT_EQ(quantile(Sample{1, 2}, -1.0), 1.0);
  EXPECT_EQ(quantile(Sample{1, 2}, 2.0), 2.0);
}

TEST(Quantile, OfNothingOrNaNIsNaN) {
  EXPECT_TRUE(std::isnan(median({})));
  EXPECT_TRUE(std::isnan(median(Sample{1, kNaN, 3})));
  EXPECT_TRUE(std::isnan(quantile(Sample{1, 2}, kNaN)));
}

TEST(Quantile, StandsExtremeValues) {
  EXPECT_EQ(median(Sample{1.7e308, 1.7e308}), 1.7e308);
  EXPECT_EQ(median(Sample{-1.7e308, 1.7e308}), 0.0);
  EXPECT_EQ(median(Sample{1e-320, 1e-320, 5.0}), 1e-320);
  EXPECT_EQ(median(Sample{1.0, kInf}), kInf);
  EXPECT_EQ(median(Sample{1.0, 2.0, kInf}), 2.0);
}

TEST(Bootstrap, HasNoIntervalBelowSixSamples) {
  Sample s;
  for (std::size_t n = 0; n < kMinSamples; ++n, s.push_back(1.0)) {
    EXPECT_EQ(bootstrap_median(s, 1).low, -kInf) << n;
    EXPECT_EQ(bootstrap_median(s, 1).high, kInf) << n;
  }
  EXPECT_EQ(bootstrap_median(s, 1).low, 1.0);  // six
}

TEST(Bootstrap, OfEqualSamplesIsAPoint) {
  for (const double x : {0.0, -3.5, 1e300, 1e-300}) {
    const Interval i = bootstrap_median(Sample(9, x), 3);
    EXPECT_EQ(i.low, x);
    EXPECT_EQ(i.high, x);
  }
}

TEST(Bootstrap, OfNaNIsOpen) {
  Sample s(10, 1.0);
  s[4] = kNaN;
  EXPECT_EQ(bootstrap_median(s, 1).low, -kInf);
  EXPECT_EQ(bootstrap_median(s, 1).high, kInf);
}

TEST(Bootstrap, DependsOnTheSeedAlone) {
  std::mt19937_64 random(5);
  const Sample s = exponential(30, random);
  const Interval a = bootstrap_median(s, 42), b = bootstrap_median(s, 42);
  EXPECT_EQ(a.low, b.low);
  EXPECT_EQ(a.high, b.high);
}

// For odd n the bootstrap median is an order statistic, and it is at most x_(k) when at least (n+1)/2 of n
// draws are: P = P(Binomial(n, k/n) >= (n+1)/2). The interval's ends are the smallest x_(k) at which P
// reaches 2.5 and 97.5 %.
TEST(Bootstrap, AgreesWithTheExactDistributionOfTheResampledMedian) {
  const std::pair<int, double> kSizes[] = {{7, 2.446912}, {11, 2.228139}, {21, 2.085963}, {51, 2.008559}};
  for (const auto& [size, t] : kSizes) {
    const int n = size;
    const double out = 0.5 * std::erfc(std::sqrt(n / (n - 1.0)) * t / std::sqrt(2.0));
    const auto exact = [n](int k) {
      const double p = static_cast<double>(k) / n;
      if (k == n) return 1.0;
      double sum = 0.0;
      for (int j = (n + 1) / 2; j <= n; ++j)
        sum += std::exp(std::lgamma(n + 1.0) - std::lgamma(j + 1.0) - std::lgamma(n - j + 1.0) +
                        j * std::log(p) + (n - j) * std::log1p(-p));
      return sum;
    };
    Sample s(static_cast<std::size_t>(n));
    std::iota(s.begin(), s.end(), 1.0);
    const Interval found = bootstrap_median(s, 11);
    // Six standard errors of a proportion from kResamples draws.
    const double slack = 6.0 * std::sqrt(out * (1.0 - out) / kResamples);
    EXPECT_GE(exact(static_cast<int>(found.low)), out - slack) << n;
    EXPECT_LE(exact(static_cast<int>(found.low) - 1), out + slack) << n;
    EXPECT_GE(exact(static_cast<int>(found.high)), 1.0 - out - slack) << n;
    EXPECT_LE(exact(static_cast<int>(found.high) - 1), 1.0 - out + slack) << n;
  }
}

// For odd n its ends are order statistics x_(k) and x_(n+1-k), which miss the median, whatever the distribution, with
// 2 P(Binomial(n, 1/2) < k).
TEST(Bootstrap, OfOddSizesCoversInSteps) {
  for (int n = 7; n < 50; n += 2) {
    Sample s(static_cast<std::size_t>(n));
    std::iota(s.begin(), s.end(), 1.0);
    Sample lows;  // now and then the draws put one a step farther out
    for (std::uint64_t seed = 1; seed <= 9; ++seed) lows.push_back(bootstrap_median(s, seed).low);
    const int k = static_cast<int>(median(lows));
    double below = 0.0;
    for (int j = 0; j < k; ++j)
      below += std::exp(std::lgamma(n + 1.0) - std::lgamma(j + 1.0) - std::lgamma(n - j + 1.0) -
                        n * std::log(2.0));
    const double covered = 1.0 - 2.0 * below;
    EXPECT_GE(covered, 0.93) << n;
    EXPECT_LE(covered, 0.99) << n;
    if (n == 7) {
      EXPECT_NEAR(covered, 0.984, 0.0005);
    }
    if (n == 11) {
      EXPECT_NEAR(covered, 0.935, 0.0005);
    }
  }
}

TEST(Bootstrap, CoversTheTrueMedianAsOftenAsItSays) {
  constexpr int kTrials = 600;
  for (const std::size_t n : {10u, 25u}) {
    std::mt19937_64 random(2024);
    int covered = 0;
    for (int trial = 0; trial < kTrials; ++trial) {
      const Interval i = bootstrap_median(exponential(n, random), static_cast<std::uint64_t>(trial));
      covered += i.low <= std::log(2.0) && std::log(2.0) <= i.high ? 1 : 0;
    }
    const double coverage = static_cast<double>(covered) / kTrials;
    EXPECT_GE(coverage, 0.93) << n;
    EXPECT_LE(coverage, 0.985) << n;
  }
}

TEST(Decide, NeedsTheWholeIntervalOnOneSide) {
  const Interval i{0.9, 1.1};
  EXPECT_EQ(decide(i, Relation::at_most, 1.2), Verdict::pass);
  EXPECT_EQ(decide(i, Relation::at_most, 1.1), Verdict::pass);
  EXPECT_EQ(decide(i, Relation::at_most, 1.0), Verdict::undecided);
  EXPECT_EQ(decide(i, Relation::at_most, 0.9), Verdict::undecided);
  EXPECT_EQ(decide(i, Relation::at_most, 0.8), Verdict::fail);
  EXPECT_EQ(decide(i, Relation::at_least, 0.8), Verdict::pass);
  EXPECT_EQ(decide(i, Relation::at_least, 0.9), Verdict::pass);
  EXPECT_EQ(decide(i, Relation::at_least, 1.0), Verdict::undecided);
  EXPECT_EQ(decide(i, Relation::at_least, 1.1), Verdict::undecided);
  EXPECT_EQ(decide(i, Relation::at_least, 1.2), Verdict::fail);
}

TEST(Decide, NeverDecidesOnNaNOrAnOpenInterval) {
  for (const Relation r : {Relation::at_most, Relation::at_least}) {
    EXPECT_EQ(decide({}, r, 1.0), Verdict::undecided);
    EXPECT_EQ(decide({kNaN, kNaN}, r, 1.0), Verdict::undecided);
    EXPECT_EQ(decide({0.5, 0.6}, r, kNaN), Verdict::undecided);
  }
}

}  // namespace
}  // namespace icbench
