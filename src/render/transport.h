// The pieces every light transport estimator here is made of: a light sample, its counterpart when a ray hits
// a light by chance, and Russian roulette.
//
// At a surface point, irradiance from lights is estimated by two strategies that are weighted by the balance
// heuristic (Veach & Guibas 1995): a point drawn on the lights (density p_l), and a cosine-distributed ray
// that is traced with probability q (density q p_b). The weights sum to 1 for every direction, hence no bias;
// and because p_l + q p_b stands in every denominator, no estimate is unbounded where light and surface meet
// in a corner.
#pragma once

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "core/random.h"
#include "render/ray_tracer.h"

namespace icbench {

/// Light that reaches a point unless something lies on the ray.
struct LightProposal {
  Ray shadow;   ///< from the point to the light, t_max 1 at most
  glm::vec3 E;  ///< irradiance estimate, weighted, W/m^2
};

/// Irradiance that a point light, drawn with probability light.pdf_area, brings to `at` (I cos / d^2). Within epsilon
/// of the light the distance counts as epsilon, and the ray ends that much before it, so that a light in a surface
/// is not hidden by that.
inline bool propose_point_light(const RayTracer& rays, const Hit& at, const LightPoint& light,
                                LightProposal& out) noexcept {
  const glm::vec3 d = light.p - at.p;
  const float along_n = glm::dot(d, at.n);
  if (!(along_n > 0.0f && glm::dot(d, at.ng) > 0.0f)) return false;
  const float distance = std::max(glm::length(d), rays.epsilon());
  if (!std::isfinite(distance)) return false;  // farther than float reaches
  const float falloff = spot_falloff(*light.point, -glm::dot(d, light.n) / distance);
  if (!(falloff > 0.0f)) return false;
  const glm::vec3 from = rays.leave(at.p, at.ng);
  out.shadow = {from, 1.0f - rays.epsilon() / distance, light.p - from};
  out.E = falloff * (along_n / distance) / (distance * distance) / light.pdf_area * light.emission;
  return true;
}

/// Draws a point on the lights for `at`, where a cosine ray of length `reach` is traced with probability q. False if it
/// cannot contribute: no lights, or one of the two faces away.
inline bool propose_light(const RayTracer& rays, const Hit& at, float q, Pcg32& random, LightProposal& out,
                          float reach = std::numeric_limits<float>::infinity()) noexcept {
  const LightTable& lights = rays.scene().lights;
  if (lights.empty()) return false;
  const float u_light = random.uniform(), u1 = random.uniform(), u2 = random.uniform();
  const LightPoint light = lights.sample(u_light, u1, u2);
  if (light.point) return propose_point_light(rays, at, light, out);
  const glm::vec3 d = light.p - at.p;
  const float along_n = glm::dot(d, at.n), along_light = -glm::dot(d, light.n);
  if (!(along_n > 0.0f && along_light > 0.0f && glm::dot(d, at.ng) > 0.0f)) return false;
  const float d2 = glm::dot(d, d), distance = std::sqrt(d2);
  const float p_b = along_n / distance * std::numbers::inv_pi_v<float>;
  const float p_l = light.pdf_area * d2 * distance / along_light;
  const glm::vec3 from = rays.leave(at.p, at.ng);
  out.shadow = {from, 1.0f, rays.leave(light.p, light.n) - from};
  out.E = std::numbers::pi_v<float> * p_b / (p_l + (distance < reach ? q : 0.0f) * p_b) * light.emission;
  return true;
}

/// Weight of the emission found by a cosine ray (unit d, density p_b) that was traced with probability q.
inline float emitter_weight(const RayTracer& rays, const Hit& found, const glm::vec3& d, float p_b,
                            float q) noexcept {
  const float p_l = rays.scene().lights.pdf_area(rays.material(found).emission) * found.t * found.t /
                    std::abs(glm::dot(found.ng, d));
  return q * p_b / (p_l + q * p_b);
}

/// Even where everything is white a path goes on with this probability at most, or it might never end. Where the square
/// of the albedo is beyond it weights grow from one surface to the next, and variance has no bound.
inline constexpr float kMaxSurvival = 0.999f;

/// Probability with which a path of this weight goes on; 0 only if it carries nothing.
inline float survival(const glm::vec3& weight) noexcept {
  return std::min(kMaxSurvival, std::max({weight.x, weight.y, weight.z}));
}

}  // namespace icbench
