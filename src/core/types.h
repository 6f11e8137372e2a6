// The values an irradiance cache exchanges with a renderer: surface points, records, irradiance.
//
// Units: positions and radii in metres (any consistent length will do), irradiance in W/m^2 per RGB channel.
// Everything here is trivially copyable and allocation-free. What a caller hands over may hold NaNs: it is judged by
// comparisons that are false for them without raising the invalid-operation flag.
#pragma once

#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <type_traits>

#if defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__
#error "icbench rejects NaNs and infinities by comparisons, which -ffinite-math-only takes away"
#endif

namespace icbench {

/// Diffuse irradiance E, RGB, W/m^2; finite and not negative wherever a cache returns it.
using Irradiance = glm::vec3;

/// Where irradiance is asked for. `n` has unit length and points to the side light arrives from.
struct SurfacePoint {
  glm::vec3 p;  ///< position, metres
  glm::vec3 n;  ///< unit surface normal
};

/// One cached sample of indirect irradiance.
///
/// The 32-bit id is the caller's: caches carry it unchanged, never interpret it, and tests use it to tell
/// records apart.
struct Record {
  glm::vec3 p;       ///< position, metres, inside the cache's bounds
  glm::vec3 n;       ///< unit surface normal
  float R;           ///< radius, metres, > 0: harmonic mean distance to the surfaces seen (Ward et al. 1988)
  Irradiance E;      ///< irradiance, W/m^2
  std::uint32_t id;  ///< caller's identifier
};
static_assert(sizeof(Record) == 44, "records are stored by the million; padding would be paid for each");
static_assert(std::is_trivially_copyable_v<Record>, "records are copied into raw pool memory");

/// Axis-aligned box, metres; `lower` <= `upper` in every component.
struct Bounds {
  glm::vec3 lower{0.0f};
  glm::vec3 upper{1.0f};

  bool contains(const glm::vec3& p) const noexcept {  // false for NaN
    return std::isgreaterequal(p.x, lower.x) && std::isgreaterequal(p.y, lower.y) &&
           std::isgreaterequal(p.z, lower.z) && std::islessequal(p.x, upper.x) &&
           std::islessequal(p.y, upper.y) && std::islessequal(p.z, upper.z);
  }
};

/// One of the eight corners, 0 <= which < 8: bit i of `which` chooses the upper side of axis i.
inline glm::vec3 corner(const Bounds& b, int which) noexcept {
  return {(which & 1) ? b.upper.x : b.lower.x, (which & 2) ? b.upper.y : b.lower.y,
          (which & 4) ? b.upper.z : b.lower.z};
}

/// What became of a record that was offered.
enum class InsertResult : std::uint8_t {
  inserted,  ///< stored: every later query under the cache's consistency condition sees it until clear
  full,      ///< the pool is used up; nothing changed
  rejected   ///< not a usable record (see is_storable); nothing changed
};

/// Answer of an update function for one record.
enum class UpdateResult : std::uint8_t { keep, drop };

inline bool is_finite(const glm::vec3& v) noexcept {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

/// |n|^2 within 2e-6 of 1: float normalisation errs by less than 1e-6, and validity at a record's own point rests on
/// it (core/interpolation.h). Normalise what comes from files or half precision. False for NaN.
inline bool is_unit(const glm::vec3& n) noexcept {
  return std::islessequal(std::abs(glm::dot(n, n) - 1.0f), 2e-6f);
}

/// Largest irradiance a record may bring, W/m^2: weighted sums of thousands of such records stay finite.
inline constexpr float kMaxIrradiance = 1e30f;

/// In [0, kMaxIrradiance] in every channel; false for NaN.
inline bool is_irradiance(const Irradiance& E) noexcept {
  const auto is_one = [](float e) {
    return std::isgreaterequal(e, 0.0f) && std::islessequal(e, kMaxIrradiance);
  };
  return is_one(E.x) && is_one(E.y) && is_one(E.z);
}

/// A query outside these terms is a miss (and counted as invalid).
inline bool is_askable(const SurfacePoint& x, const Bounds& bounds) noexcept {
  return bounds.contains(x.p) && is_unit(x.n);
}

/// A record outside these terms is rejected: finite, unit normal, positive radius, no negative irradiance, inside the
/// bounds.
inline bool is_storable(const Record& r, const Bounds& bounds) noexcept {
  return bounds.contains(r.p) && is_unit(r.n) && std::isgreater(r.R, 0.0f) && std::isfinite(r.R) &&
         is_irradiance(r.E);
}

}  // namespace icbench
