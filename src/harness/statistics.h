// Order statistics, bootstrap intervals and verdicts over them.
//
// Conventions, everywhere in this file:
//   - Samples are not modified and need no order. One NaN among them makes every result NaN; infinities are
//     ordered like any other value.
//   - An empty sample has median and quantiles NaN.
//   - Intervals are at 95 %. Fewer than kMinSamples values admit none at that level, nor does a sample with a
//     NaN: the interval is then (-inf, inf), from which no verdict but `undecided` follows. Equal samples give
//     a point.
//   - Results depend on the sample and the seed alone, on any platform.
#pragma once

#include <cstdint>
#include <limits>
#include <span>

namespace icbench {

/// Below six values not even [min, max] covers the median with 95 % (it does with 1 - 2^(1-n)).
inline constexpr std::size_t kMinSamples = 6;

/// Quantile by linear interpolation between order statistics (type 7 of Hyndman & Fan 1996, the default of R
/// and NumPy). `p` is clamped to [0, 1]. O(n).
double quantile(std::span<const double> samples, double p);
inline double median(std::span<const double> samples) { return quantile(samples, 0.5); }

struct Interval {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
};

/// 95 % percentile bootstrap interval of the median from kResamples resamples, "expanded" for small samples:
/// the plain one is too narrow there by sqrt((n-1)/n) and by the normal's quantile in place of Student's t
/// (Hesterberg 2014, What Teachers Should Know about the Bootstrap, arXiv:1411.5279). It covers the median of
/// independent samples of a continuous distribution in 93 to 99 % of cases (at 6 to 50 samples): of odd numbers
/// its ends are order statistics, so that this goes in steps, from 98.4 % at 7 to 93.5 % at 11. O(n * kResamples).
inline constexpr unsigned kResamples = 4000;
Interval bootstrap_median(std::span<const double> samples, std::uint64_t seed);

enum class Relation : std::uint8_t { at_most, at_least };
enum class Verdict : std::uint8_t { pass, fail, undecided };

const char* to_string(Relation relation) noexcept;
const char* to_string(Verdict verdict) noexcept;

/// Passes when the whole interval keeps the relation (touching the target keeps it), fails when the whole
/// interval breaks it; anything else, and any NaN, is undecided.
Verdict decide(const Interval& interval, Relation relation, double target) noexcept;

}  // namespace icbench
