// The radius of a record from a few fixed rays, in a form that is cheap to keep and to correct: harmonic mean of the
// distances (Ward et al. 1988), each kept in a byte.
//
// Distances are told apart in steps of 4 % between a ten thousandth of the scene's diagonal and the diagonal; what lies
// nearer counts as that near, what lies farther as not seen. The rounding is part of the definition, so that a radius
// made of kept bytes is the radius made anew, bit for bit. Rays are traced one by one: what one finds does not depend
// on which others are traced with it.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>

#include "core/interpolation.h"
#include "render/ray_tracer.h"

namespace icbench {

inline constexpr std::size_t kRadiusRays = 21;

/// A distance for each ray, in steps.
using DistanceCodes = std::array<std::uint8_t, kRadiusRays>;

class RadiusRays {
 public:
  RadiusRays(const Bounds& bounds, const RadiusLimits& limits) noexcept;

  /// Unit directions around `n`, stratified by cosine; the same for equal normals.
  static std::array<glm::vec3, kRadiusRays> directions(const glm::vec3& n) noexcept;

  /// Traces the rays of `which` (bit i is ray i) from a point and sets their codes.
  void trace(Tracer& tracer, const Hit& point, std::uint32_t which, DistanceCodes& codes) const noexcept;

  /// The farthest a ray of this code reached, metres.
  float reach(std::uint8_t code) const noexcept { return edges_[std::min<std::size_t>(code, kSteps)]; }

  /// Harmonic mean of the distances, clamped; the largest radius where nothing is seen.
  float radius(const DistanceCodes& codes) const noexcept;

  static constexpr std::uint32_t kAll = (1u << kRadiusRays) - 1;

 private:
  static constexpr std::size_t kSteps = 250;
  static constexpr std::uint8_t kFar = kSteps, kNotTraced = 255;  // codes

  RadiusLimits limits_;
  std::array<float, kSteps + 1> edges_;  // code i lies in (edges_[i - 1], edges_[i]]; metres
  std::array<float, 256> inverse_;       // of the distance a code stands for, 1/metres
};

}  // namespace icbench
