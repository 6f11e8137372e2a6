// Root of the mean squared error over all channels, in W/(m^2 sr). Dominated by the brightest pixels.
#pragma once

#include <cmath>

#include "image/metrics/metric.h"

namespace icbench {

/// sqrt(mean((x - ref)^2)) over channels and pixels. Map: |x - ref| per channel.
inline std::vector<MetricValue> rmse(const Image& reference, const Image& image, Image* map) {
  check_comparable(reference, image);
  fill_map(reference, image, map, [](double a, double b) { return std::abs(b - a); });
  const double mse = channel_mean(reference, image, [](double a, double b) { return (b - a) * (b - a); });
  return {{"", std::sqrt(mse)}};
}

}  // namespace icbench
