// The image metrics. Adding one is a header in this folder and an entry here.
#pragma once

#include <array>

#include "image/metrics/block_rmse.h"
#include "image/metrics/flip.h"
#include "image/metrics/hdrvdp.h"
#include "image/metrics/mean_ratio.h"
#include "image/metrics/metric.h"
#include "image/metrics/relmse.h"
#include "image/metrics/rmse.h"

namespace icbench {

inline constexpr std::array kMetrics = {
    Metric{"rmse", unviewed<rmse>, 36, true, nullptr, "smaller is closer, 0 is equal; W/(m^2 sr)", "-"},
    Metric{"relmse", unviewed<relmse>, 36, true, nullptr, "smaller is closer, 0 is equal; epsilon 0.01",
           "Rousselle, Knaus, Zwicker 2011"},
    Metric{"mean_ratio", unviewed<mean_ratio>, 24, false, nullptr,
           "below 1 is darker than the reference, 1 has no bias", "-"},
    Metric{"block_rmse", unviewed<block_rmse>, 36, true, nullptr,
           "smaller is closer, 0 is equal up to pixel noise; share of the mean", "this project"},
    Metric{"flip", flip, 90, true, paint_flip,
           "smaller is closer, 0 is equal, 1 is the most; seen when flipping", "Andersson et al. 2020, 2021"},
    Metric{"hdrvdp", hdrvdp, 210, true, paint_hdrvdp,
           "0 is equal; percent of pixels seen with P > 75 % and > 95 %",
           "Mantiuk, Daly, Myszkowski, Seidel 2005"},
};

/// The metric of that name, or nullptr.
inline const Metric* find_metric(std::string_view name) noexcept {
  for (const Metric& metric : kMetrics) {
    if (metric.name == name) return &metric;
  }
  return nullptr;
}

}  // namespace icbench
