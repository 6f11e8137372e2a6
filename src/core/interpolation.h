// Which records are valid at a point, and how they are weighted: the one definition that caches, oracle and
// checkers share, bit for bit.
//
// Split-sphere weight (Ward, Rubinstein, Clear 1988, eq. 4):  w_i = 1 / (|p - p_i| / R_i + sqrt(1 - n.n_i)),
// usable where w_i > 1/a, that is where the error term below is less than a. E(p) = sum w_i E_i / sum w_i.
//
// Hard cases
//
//   p = p_i, n = n_i   the error term is rounding noise, at most 1.4e-3 for normals that pass is_unit; it is raised to
//                      kMinError before it is inverted, and accuracies start at kMinAccuracy, above the noise, so that
//                      a record is always valid where it was made.
//
//   n.n_i > 1          happens by rounding for a quarter of unit normals; clamped before the root.
//
//   coplanar records   (p - p_i).(n + n_i)/2 is 0 up to rounding; the in-front test tolerates kInFrontTolerance R_i.
//                      Rounding of p - p_i is at most 2.1e-7 of the largest coordinate (half an ulp of each point, on three
//                      axes), so no coplanar record is lost while R_i >= 2.1e-5 of that coordinate; RadiusLimits
//                      keeps it so.
//
//   huge and tiny E    w is at most 1/kMinError = 10^3 and E at most kMaxIrradiance = 1e30, so that w E is at most 1e33
//                      and every sum of so many as memory can hold is finite in double precision.
//
//   many records       w E is rounded to single precision, sums and the mean are of double precision; code that adds
//                      many records at once sums at most eight in single precision first. So the mean of n errs by at
//                      most a share of 2 (9 2^-24 + n 2^-53), less than 1.1e-6 up to 10^8 of them. Sums of floats alone
//                      would lose 2 % of 10^6 equal terms.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <optional>

#include "core/types.h"

namespace icbench {

/// Below this the split-sphere error term is rounding noise: sqrt(1 - n.n_i) of equal normalised normals reaches 6e-4.
inline constexpr float kMinError = 1e-3f;

/// Finest accuracy a cache can be asked for: above the noise of normals that just pass is_unit, sqrt(2e-6).
inline constexpr float kMinAccuracy = 2e-3f;

/// Share of R_i that the query point may lie in front of a record and still count as coplanar.
inline constexpr float kInFrontTolerance = 0.01f;

/// Smallest radius, as a share of the scene's largest coordinate, at which the in-front test is safe from
/// rounding.
inline constexpr float kMinRadiusShare = 2.1e-5f;

/// The split-sphere error term eps = |p - p_i| / R_i + sqrt(1 - n.n_i), >= 0; the weight is 1 / max(eps,
/// kMinError). Dimensionless. Infinite, so that the record is not valid, where |p - p_i| is 1.8e19 m or more.
inline float split_sphere_error(const SurfacePoint& x, const Record& r) noexcept {
  const glm::vec3 d = x.p - r.p;
  const float bend = 1.0f - std::min(glm::dot(x.n, r.n), 1.0f);
  return std::sqrt(glm::dot(d, d)) / r.R + std::sqrt(bend);
}

/// Whether `r` lies in front of the point: light that reached the record may not reach the point (Ward et al.
/// 1988).
inline bool lies_in_front(const SurfacePoint& x, const Record& r) noexcept {
  const float d = 0.5f * glm::dot(x.p - r.p, x.n + r.n);
  return d < -kInFrontTolerance * r.R;
}

/// Whether `r` is too far from the point to be valid for accuracy `a`, told without roots or divisions; never true of a
/// record that split_sphere_error has below `a`. The margin is a thousand times the rounding of both sides; squares
/// that lose bits to underflow may hide that a record is too far, never that it is not, since the error, too, is the
/// root of this square of the distance.
inline bool is_surely_too_far(const SurfacePoint& x, const Record& r, float a) noexcept {
  const glm::vec3 d = x.p - r.p;
  const float reach = a * r.R;
  return glm::dot(d, d) > 1.001f * (reach * reach);
}

/// Weight of `r` at `x` for accuracy `a` (larger is coarser), in [1/a, 1/kMinError]; 0 where the record is
/// not valid.
inline float split_sphere_weight(const SurfacePoint& x, const Record& r, float a) noexcept {
  if (is_surely_too_far(x, r, a)) return 0.0f;  // as most are that an octree hands over
  const float error = split_sphere_error(x, r);
  if (!(error < a) || lies_in_front(x, r)) return 0.0f;
  return 1.0f / std::max(error, kMinError);
}

/// The same number, computed without branches: for records that are valid as a rule, but not so surely that a processor
/// could tell beforehand.
inline float likely_split_sphere_weight(const SurfacePoint& x, const Record& r, float a) noexcept {
  const float error = split_sphere_error(x, r);
  const float weight = 1.0f / std::max(error, kMinError);
  const auto is_valid =
      static_cast<std::uint32_t>(error < a) & static_cast<std::uint32_t>(!lies_in_front(x, r));
  return std::bit_cast<float>(std::bit_cast<std::uint32_t>(weight) & (0u - is_valid));
}

/// Of irradiances the weighted sums of red, green and blue, W/m^2, and the sum of the weights.
using WeightedSums = std::array<double, 4>;

/// Weighted mean of irradiances.
class MeanIrradiance {
 public:
  void add(const Irradiance& E, float weight) noexcept {
    sums_[0] += static_cast<double>(weight * E.x);
    sums_[1] += static_cast<double>(weight * E.y);
    sums_[2] += static_cast<double>(weight * E.z);
    sums_[3] += static_cast<double>(weight);
  }

  /// For code that adds many at once.
  WeightedSums& sums() noexcept { return sums_; }

  /// Of all that was added together.
  double weight() const noexcept { return sums_[3]; }

  /// nullopt exactly when nothing was added.
  std::optional<Irradiance> result() const noexcept {
    if (!(sums_[3] > 0.0)) return std::nullopt;
    const double share = 1.0 / sums_[3];
    const auto mean = [&](double sum) {
      // Rounding may lift the mean of the largest irradiances above them.
      return std::min(static_cast<float>(sum * share), kMaxIrradiance);
    };
    return Irradiance(mean(sums_[0]), mean(sums_[1]), mean(sums_[2]));
  }

 private:
  WeightedSums sums_{};
};

/// Interpolates between the records that are valid at a point. Caches may add to its sums many records at once, behind
/// operator()'s back: nothing may be derived from it.
class Interpolator final {
 public:
  void operator()(const Record& r, float weight) noexcept { mean_.add(r.E, weight); }

  /// For code that adds many records at once.
  WeightedSums& sums() noexcept { return mean_.sums(); }

  /// nullopt exactly when no record was valid.
  std::optional<Irradiance> result() const noexcept { return mean_.result(); }

 private:
  MeanIrradiance mean_;
};

/// Limits that keep radii useful and the arithmetic above safe. Metres.
struct RadiusLimits {
  float min;
  float max;

  /// Limits for a scene, shares of its diagonal: `min` at least kMinRadiusShare of the largest coordinate.
  static RadiusLimits for_scene(const Bounds& b, float min_share, float max_share) noexcept {
    const glm::vec3 size = b.upper - b.lower;
    // In units of a power of two near the longest side: exact, and no square overflows or vanishes.
    const float longest = std::max({size.x, size.y, size.z});
    const float unit = longest > 0.0f ? std::ldexp(1.0f, std::ilogb(longest)) : 1.0f;
    const float diagonal = std::sqrt(glm::dot(size / unit, size / unit));
    const glm::vec3 reach = glm::max(glm::abs(b.lower), glm::abs(b.upper));
    const float floor = kMinRadiusShare * std::max({reach.x, reach.y, reach.z});
    const float low = std::max(min_share * diagonal * unit, floor);
    return {low, std::max(max_share * diagonal * unit, low)};
  }

  /// Clamps R into [min, max]; NaN (a gather that saw nothing) becomes max.
  float clamp(float R) const noexcept { return !std::isless(R, max) ? max : std::max(R, min); }
};

}  // namespace icbench
