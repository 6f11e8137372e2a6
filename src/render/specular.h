// Mirrors and smooth dielectrics: where light goes at them, and following a ray through them.
//
// Throughput is of radiance: what is seen through a boundary is scaled by the inverse square of the relative index
// (Veach 1996), since a cone of directions narrows where light enters the denser side. Through a closed solid the
// factors cancel; light particles carry flux and take none of them.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <limits>

#include "core/random.h"
#include "render/ray_tracer.h"
#include "render/transport.h"

namespace icbench {

/// Share of unpolarised light that a smooth boundary reflects, in [0, 1] (Fresnel 1823). `cosine` >= 0 is the ray's to
/// the normal on its own side; eta > 0 is the index of refraction beyond the boundary over that on the ray's side. 1 at
/// grazing incidence and under total internal reflection.
inline float fresnel(float cosine, float eta) noexcept {
  const float sine2 = (1.0f - cosine) * (1.0f + cosine) / (eta * eta);  // beyond the boundary
  if (!(sine2 < 1.0f)) return 1.0f;
  const float beyond = std::sqrt(1.0f - std::max(sine2, 0.0f));
  const float parallel = (eta * cosine - beyond) / (eta * cosine + beyond);
  const float perpendicular = (cosine - eta * beyond) / (cosine + eta * beyond);
  const float share = 0.5f * (parallel * parallel + perpendicular * perpendicular);
  return share < 1.0f ? share : 1.0f;  // also where an index near 0 leaves 0 / 0
}

/// What becomes of a ray at a specular hit. Directions are unit.
struct SpecularSplit {
  glm::vec3 reflected;   ///< direction
  glm::vec3 refracted;   ///< direction; of no meaning where reflectance is 1
  float reflectance;     ///< share reflected; 1 - reflectance goes through
  float through_factor;  ///< by which radiance seen through the boundary is multiplied: 1 / eta^2
};

/// Splits at a hit whose material is specular the ray of unit direction d that made it. Where the shading normal would
/// send light to the wrong side of the surface the geometric normal takes its place, so that nothing is lost.
inline SpecularSplit split_specular(const Material& material, const Hit& hit, const glm::vec3& d) noexcept {
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

inline Ray reflected_ray(const RayTracer& rays, const Hit& hit, const SpecularSplit& split) noexcept {
  return {rays.leave(hit.p, hit.ng), std::numeric_limits<float>::infinity(), split.reflected};
}
inline Ray refracted_ray(const RayTracer& rays, const Hit& hit, const SpecularSplit& split) noexcept {
  return {rays.leave(hit.p, -hit.ng), std::numeric_limits<float>::infinity(), split.refracted};
}

/// Specular bounces in a row that a path is sure to make; roulette may end it after that.
inline constexpr std::uint32_t kSureBounces = 8;

/// Sends a ray of unit direction d on from the specular hit it made: reflected with the probability that is the share
/// reflected, refracted otherwise. `bounces` counts those in a row before this one. Multiplies `weight`, which is of
/// radiance. False if the path ends here.
inline bool scatter_specular(const RayTracer& rays, const Hit& hit, const glm::vec3& d, std::uint32_t bounces,
                             Pcg32& random, glm::vec3& weight, Ray& onward) noexcept {
  const SpecularSplit split = split_specular(rays.material(hit), hit, d);
  weight *= rays.albedo(hit);
  if (split.reflectance == 1.0f || random.uniform() < split.reflectance) {
    onward = reflected_ray(rays, hit, split);
  } else {
    onward = refracted_ray(rays, hit, split);
    weight *= split.through_factor;
  }
  if (bounces < kSureBounces) return weight != glm::vec3(0.0f);
  const float q = survival(weight);
  if (!(random.uniform() < q)) return false;
  weight /= q;
  return true;
}

/// What a ray that meets nothing yields.
inline Hit missed_hit() noexcept {
  Hit hit{};
  hit.t = std::numeric_limits<float>::infinity();
  return hit;
}

/// Traces a ray of unit direction, and on through specular surfaces until it meets a diffuse one or nothing at all: a
/// miss, also if roulette ends the path. Multiplies `weight`, and counts the specular bounces in `bounces`.
inline Hit intersect_beyond_specular(Tracer& tracer, Ray& ray, Pcg32& random, glm::vec3& weight,
                                     std::uint32_t& bounces) noexcept {
  const RayTracer& rays = tracer.shared();
  for (bounces = 0;; ++bounces) {
    const Hit hit = tracer.intersect(ray);
    if (hit.missed() || !rays.material(hit).is_specular()) return hit;
    if (!scatter_specular(rays, hit, ray.d, bounces, random, weight, ray)) return missed_hit();
  }
}

}  // namespace icbench
