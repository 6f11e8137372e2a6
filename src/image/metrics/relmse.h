// Relative mean squared error: the squared error weighed by the brightness of the reference, so that dark and
// bright parts count alike (Rousselle, Knaus, Zwicker, Adaptive Sampling and Reconstruction using Greedy
// Error Minimization, 2011), taken per channel.
#pragma once

#include "image/metrics/metric.h"

namespace icbench {

/// Keeps black pixels from dividing by zero. It is an absolute amount, as is usual: it presumes images whose
/// white is about 1, and pixels much darker than its root, 0.1, count less. Images of other brightness are to
/// be scaled first, as scaled_relmse does.
inline constexpr double kRelmseEpsilon = 0.01;

/// mean((x - ref)^2 / (ref^2 + epsilon)) over channels and pixels; dimensionless. Map: the terms of the mean.
inline std::vector<MetricValue> relmse(const Image& reference, const Image& image, Image* map) {
  check_comparable(reference, image);
  const auto term = [](double a, double b) { return (b - a) * (b - a) / (a * a + kRelmseEpsilon); };
  fill_map(reference, image, map, term);
  return {{"", channel_mean(reference, image, term)}};
}

/// What brings the mean luminance of `reference` (Rec. 709) to 1; 1 where it has no light.
inline double relmse_scale(const Image& reference) {
  const double sum = parallel_sum(reference.pixels.size(), [&](std::size_t i) {
    const glm::vec3& L = reference.pixels[i];
    return 0.2126 * double{L.x} + 0.7152 * double{L.y} + 0.0722 * double{L.z};
  });
  return sum > 0.0 ? static_cast<double>(reference.pixels.size()) / sum : 1.0;
}

/// relmse of both images times relmse_scale(reference): the same however bright the light is.
inline double scaled_relmse(const Image& reference, const Image& image) {
  check_comparable(reference, image);
  const double scale = relmse_scale(reference);
  const double epsilon = kRelmseEpsilon / (scale * scale);
  return channel_mean(reference, image,
                      [&](double a, double b) { return (b - a) * (b - a) / (a * a + epsilon); });
}

}  // namespace icbench
