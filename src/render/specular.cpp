#include "render/specular.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

namespace icbench {

float fresnel(float cosine, float eta) noexcept {
  // Beyond the boundary; an index whose square vanishes reflects all.
  const float sine2 =
      (1.0f - cosine) * (1.0f + cosine) / std::max(eta * eta, std::numeric_limits<float>::min());
  if (!(sine2 < 1.0f)) return 1.0f;
  const float beyond = std::sqrt(1.0f - std::max(sine2, 0.0f));
  const float parallel = (eta * cosine - beyond) / (eta * cosine + beyond);
  const float perpendicular = (cosine - eta * beyond) / (cosine + eta * beyond);
  const float share = 0.5f * (parallel * parallel + perpendicular * perpendicular);
  return std::min(share, 1.0f);
}

SpecularSplit split_specular(const Material& material, const Hit& hit, const glm::vec3& d) noexcept {
  const auto about = [&](const glm::vec3& n) {
    const float cosine = std::clamp(-glm::dot(d, n), 0.0f, 1.0f);
    SpecularSplit out{glm::normalize(d + 2.0f * cosine * n), d, 1.0f, 1.0f};
    if (material.surface == Surface::mirror) return out;
    const float eta = hit.front ? material.ior : 1.0f / material.ior;
    out.reflectance = fresnel(cosine, eta);
    if (out.reflectance == 1.0f) return out;
    const float sine2 = (1.0f - cosine) * (1.0f + cosine) / (eta * eta);
    out.refracted = glm::normalize(d / eta + (cosine / eta - std::sqrt(1.0f - sine2)) * n);
    out.through_factor = 1.0f / (eta * eta);
    return out;
  };
  if (const SpecularSplit shaded = about(hit.n);
      glm::dot(d, hit.n) < 0.0f && glm::dot(shaded.reflected, hit.ng) > 0.0f &&
      (shaded.reflectance == 1.0f || glm::dot(shaded.refracted, hit.ng) < 0.0f))
    return shaded;
  return about(hit.ng);
}

Hit missed_hit() noexcept {
  Hit hit{};
  hit.t = std::numeric_limits<float>::infinity();
  return hit;
}

}  // namespace icbench
