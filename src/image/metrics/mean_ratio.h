// Ratio of mean values: brightness gained or lost, the mark of bias that noise averages out of.
#pragma once

#include "image/metrics/metric.h"

namespace icbench {

/// mean(x) / mean(ref) over channels and pixels; dimensionless; 1 if both are black, none if only the
/// reference has no light. No map.
inline std::vector<MetricValue> mean_ratio(const Image& reference, const Image& image, Image*) {
  check_comparable(reference, image);
  const double base = channel_mean(reference);
  const double mean = channel_mean(image);
  if (base > 0.0) return {{"", mean / base}};
  if (base == 0.0 && mean == 0.0) return {{"", 1.0}};
  return {{"", std::nullopt}};
}

}  // namespace icbench
