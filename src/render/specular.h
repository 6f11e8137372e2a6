// Mirrors and smooth dielectrics: where light goes at them, and following a ray through them.
//
// Throughput is of radiance: what is seen through a boundary is scaled by the inverse square of the relative index
// (Veach 1996), since a cone of directions narrows where light enters the denser side. Through a closed solid the
// factors cancel; light particles carry flux and take none of them.
#pragma once

#include <algorithm>
#include <cstdint>
#include <glm/vec3.hpp>
#include <limits>

#include "core/random.h"
#include "render/ray_tracer.h"

namespace icbench {

/// Share of unpolarised light that a smooth boundary reflects, in [0, 1] (Fresnel 1823). `cosine` >= 0 is the ray's to
/// the normal on its own side; eta > 0 is the index of refraction beyond the boundary over that on the ray's side. 1 at
/// grazing incidence and under total internal reflection.
float fresnel(float cosine, float eta) noexcept;

/// What becomes of a ray at a specular hit. Directions are unit.
struct SpecularSplit {
  glm::vec3 reflected;   ///< direction
  glm::vec3 refracted;   ///< direction; of no meaning where reflectance is 1
  float reflectance;     ///< share reflected; 1 - reflectance goes through
  float through_factor;  ///< by which radiance seen through the boundary is multiplied: 1 / eta^2
};

/// Splits at a hit whose material is specular the ray of unit direction d that made it. Where the shading normal would
/// send light to the wrong side of the surface the geometric normal takes its place, so that nothing is lost.
SpecularSplit split_specular(const Material& material, const Hit& hit, const glm::vec3& d) noexcept;

inline Ray reflected_ray(const RayTracer& rays, const Hit& hit, const SpecularSplit& split) noexcept {
  return {rays.leave(hit.p, hit.ng), std::numeric_limits<float>::infinity(), split.reflected};
}
inline Ray refracted_ray(const RayTracer& rays, const Hit& hit, const SpecularSplit& split) noexcept {
  return {rays.leave(hit.p, -hit.ng), std::numeric_limits<float>::infinity(), split.refracted};
}

/// Specular bounces in a row that a path is sure to make. After that roulette may end it, with a probability of going
/// on that is the albedo, and kMaxSpecularSurvival at most, or light trapped among mirrors would never end. Close to 1:
/// facets of glass hold light for long, and what then escapes must not weigh much more than the rest.
inline constexpr std::uint32_t kSureBounces = 8;
inline constexpr float kMaxSpecularSurvival = 0.99f;

/// What the weight of a path is a factor of: the radiance that a ray will find, or the flux that a light particle has.
enum class Carries : std::uint8_t { radiance, flux };

/// Sends a ray of unit direction d on from the specular hit it made: reflected with the probability that is the share
/// reflected, refracted otherwise. `bounces` counts those in a row before this one. Multiplies `weight`. False if the
/// path ends here. `random` has uniform(), in [0, 1).
template <Carries carries = Carries::radiance, class Random>
bool scatter_specular(const RayTracer& rays, const Hit& hit, const glm::vec3& d, std::uint32_t bounces,
                      Random& random, glm::vec3& weight, Ray& onward) noexcept {
  const SpecularSplit split = split_specular(rays.material(hit), hit, d);
  const glm::vec3 albedo = rays.albedo(hit);
  weight *= albedo;
  if (split.reflectance == 1.0f || random.uniform() < split.reflectance) {
    onward = reflected_ray(rays, hit, split);
  } else {
    onward = refracted_ray(rays, hit, split);
    if constexpr (carries == Carries::radiance) weight *= split.through_factor;
  }
  if (bounces < kSureBounces) return weight != glm::vec3(0.0f);
  const float q = std::min(kMaxSpecularSurvival, std::max({albedo.x, albedo.y, albedo.z}));
  if (!(random.uniform() < q)) return false;
  weight /= q;
  return true;
}

/// What a ray that meets nothing yields.
Hit missed_hit() noexcept;

/// Traces a ray of unit direction, and on through specular surfaces until it meets a diffuse one or nothing at all: a
/// miss, also if roulette ends the path. Multiplies `weight`, and counts the specular bounces in `bounces`.
template <Carries carries = Carries::radiance>
Hit intersect_beyond_specular(Tracer& tracer, Ray& ray, Pcg32& random, glm::vec3& weight,
                              std::uint32_t& bounces) noexcept {
  const RayTracer& rays = tracer.shared();
  for (bounces = 0;; ++bounces) {
    const Hit hit = tracer.intersect(ray);
    if (hit.missed() || !rays.material(hit).is_specular()) return hit;
    if (!scatter_specular<carries>(rays, hit, ray.d, bounces, random, weight, ray)) return missed_hit();
  }
}

}  // namespace icbench
