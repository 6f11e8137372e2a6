#include "harness/statistics.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace icbench {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

bool has_nan(std::span<const double> samples) {
  return std::any_of(samples.begin(), samples.end(), [](double x) { return std::isnan(x); });
}

/// Type 7 quantile; reorders `samples`, which is not empty and holds no NaN.
double quantile_in_place(std::span<double> samples, double p) {
  const double position = p * static_cast<double>(samples.size() - 1);
  const auto index = std::min(static_cast<std::size_t>(position), samples.size() - 1);
  const auto at = samples.begin() + static_cast<std::ptrdiff_t>(index);
  std::nth_element(samples.begin(), at, samples.end());
  const double low = *at;
  const double share = position - static_cast<double>(index);
  if (share <= 0.0) return low;
  const double high = *std::min_element(at + 1, samples.end());
  if (low == high) return low;
  // As a weighted sum: high - low may overflow.
  const double between = (1.0 - share) * low + share * high;
  return std::isnan(between) ? between : std::clamp(between, low, high);
}

/// Uniform in [0, n) by multiply-shift; the standard distributions differ from library to library.
std::size_t below(std::mt19937_64& random, std::size_t n) {
  return static_cast<std::size_t>(((random() >> 32) * static_cast<std::uint64_t>(n)) >> 32);
}

/// Share of resampled medians to leave out at each end: Phi(-sqrt(n / (n-1)) t(0.975, n-1)), 2.5 % in the
/// limit.
double tail(std::size_t n) {
  const double z = 1.959963984540054;  // Phi(z) = 0.975
  const double v = static_cast<double>(n - 1);
  // Student's t by its expansion in 1/v (Abramowitz & Stegun 26.7.5), good to 0.1 % from v = 5 on.
  const double z2 = z * z;
  const double t = z * (1.0 + (z2 + 1.0) / (4.0 * v) + (5.0 * z2 * z2 + 16.0 * z2 + 3.0) / (96.0 * v * v) +
                        (3.0 * z2 * z2 * z2 + 19.0 * z2 * z2 + 17.0 * z2 - 15.0) / (384.0 * v * v * v));
  return 0.5 * std::erfc(std::sqrt((v + 1.0) / v) * t / std::sqrt(2.0));
}

}  // namespace

double quantile(std::span<const double> samples, double p) {
  if (samples.empty() || has_nan(samples) || std::isnan(p)) return kNaN;
  std::vector<double> copy(samples.begin(), samples.end());
  return quantile_in_place(copy, std::clamp(p, 0.0, 1.0));
}

Interval bootstrap_median(std::span<const double> samples, std::uint64_t seed) {
  if (samples.size() < kMinSamples || has_nan(samples)) return {};
  std::mt19937_64 random(seed);
  std::vector<double> resample(samples.size());
  std::vector<double> medians(kResamples);
  for (double& m : medians) {
    for (double& x : resample) x = samples[below(random, samples.size())];
    m = quantile_in_place(resample, 0.5);
  }
  if (has_nan(medians)) return {};  // a resample straddled both infinities
  const double out = tail(samples.size());
  return {quantile_in_place(medians, out), quantile_in_place(medians, 1.0 - out)};
}

const char* to_string(Relation relation) noexcept {
  return relation == Relation::at_most ? "at_most" : "at_least";
}

const char* to_string(Verdict verdict) noexcept {
  switch (verdict) {
    case Verdict::pass:
      return "pass";
    case Verdict::fail:
      return "fail";
    case Verdict::undecided:
      break;
  }
  return "undecided";
}

Verdict decide(const Interval& interval, Relation relation, double target) noexcept {
  // Written so that every comparison with a NaN is false and leaves the verdict open.
  if (!(interval.low <= interval.high)) return Verdict::undecided;
  if (relation == Relation::at_most) {
    if (interval.high <= target) return Verdict::pass;
    if (interval.low > target) return Verdict::fail;
  } else {
    if (interval.low >= target) return Verdict::pass;
    if (interval.high < target) return Verdict::fail;
  }
  return Verdict::undecided;
}

}  // namespace icbench
