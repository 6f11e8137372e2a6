#include "render/radius_rays.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include "render/sampling.h"

namespace icbench {
namespace {

constexpr std::size_t kElevations = 3, kAzimuths = 7;
static_assert(kElevations * kAzimuths == kRadiusRays);

constexpr float kNearest = 1e-4f;  // of the diagonal

}  // namespace

RadiusRays::RadiusRays(const Bounds& bounds, const RadiusLimits& limits) noexcept : limits_(limits) {
  const float diagonal = glm::length(bounds.upper - bounds.lower);
  const double step = -std::log(static_cast<double>(kNearest)) / (kSteps - 1);
  for (std::size_t i = 0; i < kSteps; ++i)
    edges_[i] = static_cast<float>(kNearest * diagonal * std::exp(step * static_cast<double>(i)));
  edges_[kSteps] = edges_[kSteps - 1];
  inverse_.fill(0.0f);
  inverse_[0] = 1.0f / edges_[0];
  for (std::size_t i = 1; i < kSteps; ++i) inverse_[i] = 1.0f / std::sqrt(edges_[i - 1] * edges_[i]);
}

std::array<glm::vec3, kRadiusRays> RadiusRays::directions(const glm::vec3& n) noexcept {
  static const std::array<glm::vec3, kRadiusRays> around_z = [] {
    std::array<glm::vec3, kRadiusRays> out;
    const Basis basis({0.0f, 0.0f, 1.0f});
    for (std::size_t m = 0; m < kElevations; ++m)
      for (std::size_t k = 0; k < kAzimuths; ++k) {
        // Every other ring is turned by half a stratum.
        const float u = (static_cast<float>(m) + 0.5f) / static_cast<float>(kElevations);
        const float v =
            (static_cast<float>(k) + (m % 2 == 0 ? 0.25f : 0.75f)) / static_cast<float>(kAzimuths);
        out[m * kAzimuths + k] = cosine_direction(basis, u, v);
      }
    return out;
  }();
  std::array<glm::vec3, kRadiusRays> out;
  const Basis basis(n);
  for (std::size_t i = 0; i < kRadiusRays; ++i) out[i] = basis(around_z[i].x, around_z[i].y, around_z[i].z);
  return out;
}

void RadiusRays::trace(Tracer& tracer, const Hit& point, std::uint32_t which,
                       DistanceCodes& codes) const noexcept {
  const std::array<glm::vec3, kRadiusRays> d = directions(point.n);
  const glm::vec3 from = tracer.shared().leave(point.p, point.ng);
  for (std::size_t i = 0; i < kRadiusRays; ++i) {
    if ((which >> i & 1u) == 0) continue;
    if (!(glm::dot(d[i], point.ng) > 0.0f)) {  // into the surface, past a tilted shading normal
      codes[i] = kNotTraced;
      continue;
    }
    const Hit hit = tracer.intersect(Ray{from, edges_[kSteps], d[i]});
    const auto at = std::lower_bound(edges_.begin(), edges_.begin() + kSteps, hit.t);
    codes[i] = hit.missed() ? kFar : static_cast<std::uint8_t>(at - edges_.begin());
  }
}

float RadiusRays::radius(const DistanceCodes& codes) const noexcept {
  float sum = 0.0f;
  int traced = 0;
  for (const std::uint8_t code : codes) {
    sum += inverse_[code];
    traced += code != kNotTraced;
  }
  return limits_.clamp(sum > 0.0f ? static_cast<float>(traced) / sum
                                  : std::numeric_limits<float>::infinity());
}

}  // namespace icbench
