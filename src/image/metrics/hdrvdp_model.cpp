#include "image/metrics/hdrvdp_model.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace icbench {
namespace {

constexpr double kPi = std::numbers::pi;

/// Daly's sensitivity before orientation and accommodation, over its factor P = 250.
double daly_s1(double frequency, double luminance, double area) noexcept {
  if (!(frequency > 0.0)) return 0.0;
  const double a = 0.801 * std::pow(1.0 + 0.7 / luminance, -0.2);
  const double b = 0.3 * std::pow(1.0 + 100.0 / luminance, 0.15);
  const double u = 0.9 * frequency;
  const double size =
      std::pow(std::pow(3.23 * std::pow(frequency * frequency * area, -0.3), 5.0) + 1.0, -0.2);
  // exp(-bu) sqrt(1 + 0.06 exp(bu)), in the form that does not overflow.
  return size * a * u * std::sqrt(std::exp(-2.0 * b * u) + 0.06 * std::exp(-b * u));
}

/// Centre of the transition of mesa k, cycles per pixel.
double corner(int k) noexcept { return std::ldexp(1.0, -k); }
double transition(int k) noexcept { return corner(k) * 2.0 / 3.0; }

const double kLogMin = std::log(kMinLuminance), kLogMax = std::log(kMaxLuminance);

}  // namespace

double pupil_diameter(double luminance) noexcept {
  return 4.9 - 3.0 * std::tanh(0.4 * std::log10(luminance));
}

double optical_transfer(double frequency, double pupil) noexcept {
  return std::exp(-std::pow(frequency / (20.9 - 2.1 * pupil), 1.3 - 0.07 * pupil));
}

double contrast_sensitivity(double frequency, double angle, const SensitivityConditions& at) noexcept {
  constexpr double kPeak = 250.0, kOblique = 0.78;
  const double accommodation = 0.856 * std::pow(at.distance, 0.14);
  const double orientation = (1.0 - kOblique) / 2.0 * std::cos(4.0 * angle) + (1.0 + kOblique) / 2.0;
  return kPeak * std::min(daly_s1(frequency / (accommodation * orientation), at.luminance, at.area),
                          daly_s1(frequency, at.luminance, at.area));
}

double peak_sensitivity(const SensitivityConditions& at) noexcept {
  // Over the logarithm of the frequency it rises to one peak and falls: search by thirds.
  double low = std::log(1e-2), high = std::log(1e3);
  const auto sensitivity = [&](double log) { return contrast_sensitivity(std::exp(log), 0.0, at); };
  while (high - low > 1e-6) {
    const double third = (high - low) / 3.0;
    if (sensitivity(low + third) < sensitivity(high - third)) {
      low += third;
    } else {
      high -= third;
    }
  }
  return sensitivity(0.5 * (low + high));
}

double threshold_contrast(double luminance) noexcept {
  return kPeakContrast * std::pow(1.0 + 0.7 / luminance, 0.2) * std::pow(1.0 + 100.0 / luminance, 0.15);
}

JndScale::JndScale() {
  constexpr std::size_t kSteps = 8192;
  const double step = (kLogMax - kLogMin) / kSteps;
  const auto slope = [&](double i) { return 1.0 / threshold_contrast(std::exp(kLogMin + i * step)); };
  table_.reserve(kSteps + 1);
  table_.push_back(0.0);
  for (std::size_t i = 0; i < kSteps; ++i) {  // Simpson's rule
    const auto x = static_cast<double>(i);
    table_.push_back(table_.back() + step / 6.0 * (slope(x) + 4.0 * slope(x + 0.5) + slope(x + 1.0)));
  }
}

double JndScale::operator()(double luminance) const noexcept {
  const double last = static_cast<double>(table_.size() - 1);
  const double log = std::log(std::clamp(luminance, kMinLuminance, kMaxLuminance));
  const double place = std::clamp((log - kLogMin) / (kLogMax - kLogMin) * last, 0.0, last);
  const std::size_t below = std::min(static_cast<std::size_t>(place), table_.size() - 2);
  return table_[below] + (place - static_cast<double>(below)) * (table_[below + 1] - table_[below]);
}

double mesa(int k, double frequency) noexcept {
  if (k == 0) return 1.0;
  const double width = transition(k);
  const double start = corner(k) - 0.5 * width;
  if (frequency <= start) return 1.0;
  if (frequency >= start + width) return 0.0;
  return 0.5 * (1.0 + std::cos(kPi * (frequency - start) / width));
}

double base_filter(double frequency) noexcept {
  const double end = corner(kBands) + 0.5 * transition(kBands);
  const double sigma = end / 3.0;
  return frequency < end ? std::exp(-frequency * frequency / (2.0 * sigma * sigma)) : 0.0;
}

double dom(int band, double frequency) noexcept {
  return mesa(band, frequency) - (band + 1 < kBands ? mesa(band + 1, frequency) : base_filter(frequency));
}

double fan(int orientation, double angle) noexcept {
  constexpr double kWidth = kPi / kOrientations;
  const double away = std::abs(std::remainder(angle - (orientation * kWidth - kPi / 2.0), kPi));
  return away < kWidth ? 0.5 * (1.0 + std::cos(kPi * away / kWidth)) : 0.0;
}

double threshold_elevation(double mask) noexcept {
  const double x = 6.0 * mask;
  return std::sqrt(std::sqrt(1.0 + x * x * x * x));
}

double detection_exponent(double c) noexcept { return c * c * c * std::sqrt(c); }

}  // namespace icbench
