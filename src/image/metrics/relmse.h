// Relative mean squared error: the squared error weighed by the brightness of the reference, so that dark and
// bright parts count alike (Rousselle, Knaus, Zwicker, Adaptive Sampling and Reconstruction using Greedy
// Error Minimization, 2011), taken per channel.
#pragma once

#include "image/metrics/metric.h"

namespace icbench {

/// Keeps black pixels from dividing by zero. It is an absolute amount, as is usual: it presumes images whose
/// white is about 1, and pixels much darker than its root, 0.1, count less. Images of other brightness are to
/// be scaled first.
inline constexpr double kRelmseEpsilon = 0.01;

/// mean((x - ref)^2 / (ref^2 + epsilon)) over channels and pixels; dimensionless. Map: the terms of the mean.
inline std::vector<MetricValue> relmse(const Image& reference, const Image& image, Image* map) {
  check_comparable(reference, image);
  const auto term = [](double a, double b) { return (b - a) * (b - a) / (a * a + kRelmseEpsilon); };
  fill_map(reference, image, map, term);
  return {{"", channel_mean(reference, image, term)}};
}

}  // namespace icbench
