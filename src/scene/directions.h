// Directions around an axis.
#pragma once

#include <algorithm>
#include <cmath>
#include <glm/vec3.hpp>
#include <numbers>

namespace icbench {

/// Two unit vectors that complete the unit vector n to a right-handed basis, without a branch or a division
/// by zero (Duff et al. 2017).
struct Basis {
  glm::vec3 s, t, n;

  explicit Basis(const glm::vec3& normal) noexcept : n(normal) {
    const float sign = std::copysign(1.0f, n.z);
    const float a = -1.0f / (sign + n.z);
    const float b = n.x * n.y * a;
    s = {1.0f + sign * n.x * n.x * a, sign * b, -sign * n.x};
    t = {b, sign + n.y * n.y * a, -n.y};
  }
  glm::vec3 operator()(float x, float y, float z) const noexcept { return x * s + y * t + z * n; }
};

/// Cosine-weighted direction around basis.n from two numbers uniform in [0, 1): density cos / pi.
inline glm::vec3 cosine_direction(const Basis& basis, float u_elevation, float u_azimuth) noexcept {
  const float phi = 2.0f * std::numbers::pi_v<float> * u_azimuth;
  const float r = std::sqrt(u_elevation);
  return basis(r * std::cos(phi), r * std::sin(phi), std::sqrt(1.0f - u_elevation));
}

/// Direction at a given versine (1 - cosine), in [0, 2], to basis.n: near that, cosines are too coarse.
inline glm::vec3 direction_at(const Basis& basis, float versine, float u_azimuth) noexcept {
  const float phi = 2.0f * std::numbers::pi_v<float> * u_azimuth;
  const float r = std::sqrt(std::max(0.0f, versine * (2.0f - versine)));
  return basis(r * std::cos(phi), r * std::sin(phi), 1.0f - versine);
}

}  // namespace icbench
