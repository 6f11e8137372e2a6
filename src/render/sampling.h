// Random directions, and the key that makes random numbers depend on pixel, sample and frame alone.
#pragma once

#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <numbers>

#include "core/random.h"

namespace icbench {

/// What a pixel's random numbers are for; each purpose has numbers of its own.
enum class Purpose : std::uint32_t { lens, direct, gather, path };

/// Names one sample of an image; equal keys give equal random numbers in any thread.
struct SampleKey {
  std::uint64_t seed = 0;
  std::uint32_t frame = 0;
  std::uint32_t sample = 0;

  SampleKey next_sample(std::uint32_t steps) const noexcept { return {seed, frame, sample + steps}; }

  /// Key of a pixel's random numbers.
  std::uint64_t of_pixel(std::uint32_t pixel, Purpose purpose) const noexcept {
    const auto use = static_cast<std::uint64_t>(purpose);
    return hash_keys(seed, std::uint64_t{frame} << 32 | sample, use << 32 | pixel);
  }
};

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

}  // namespace icbench
