#include "render/extrapolation.h"

#include <algorithm>
#include <limits>

#include "core/names.h"

namespace icbench {
namespace {

// Limits of valid distances a R, in pixels.
constexpr float kLeastPixels = 1.5f;
constexpr float kMostPixels = 20.0f;

constexpr float kMostTurn = 2.0f;  // as of light from one direction 63 degrees off the normal

constexpr float kMostReach = 0.2f;    // of the diagonal
constexpr float kMostStretch = 2.0f;  // of an ellipse by geometry alone
// Of one with occlusion: by how much less what is near faces the one axis than the other.
constexpr float kStretch = 1.5f, kMostStretchAlong = 6.0f;

// How far a record is valid along an eigenvector, as a share of a D: scale (E / (|lambda| D^2))^power, at least
// `least`.
struct ReachRule {
  float scale, power, least;
};
constexpr ReachRule kByGeometry{0.47f, 1.0f / 4.0f, 0.01f}, kWithOcclusion{0.32f, 1.0f / 6.0f, 0.005f};
constexpr float kMostSlope = 0.7f;   // of the mean or the record, by what the gradient promises along an axis
constexpr float kMostOfMean = 3.0f;  // of the mean distance, times a
constexpr float kMostContrast = 64.0f;  // between a record and the picture, as far as its reach follows
constexpr float kLeastOfLimit = 0.1f;   // of that by the mean distance, for the brightest

glm::vec3 gradient_of_luminance(const IrradianceGradients& g) noexcept {
  return 0.2126f * g.translational[0] + 0.7152f * g.translational[1] + 0.0722f * g.translational[2];
}

// E / |gradient of E|, metres; infinite where nothing changes. Relative changes are what is squared: irradiance of 1e20
// or 1e-20 would leave the range of floats.
float change_length(const Irradiance& E, const IrradianceGradients& g) noexcept {
  const float brightness = luminance(E);
  if (!(brightness > 0.0f)) return std::numeric_limits<float>::infinity();
  return 1.0f / glm::length(gradient_of_luminance(g) / brightness);
}

// The irradiance by which the reach of a record of irradiance E goes, in a picture of that mean (0: unknown).
float judged_by(float E, float mean) noexcept {
  return mean > 0.0f ? std::clamp(mean, E / kMostContrast, kMostContrast * E) : E;
}

// How many times as long as wide an ellipse may be, by how much what is near faces its two axes.
float stretch(const Eigen2& faced) noexcept {
  if (!(faced.large > 0.0f)) return kStretch;
  constexpr float kLeast = kStretch / kMostStretchAlong;
  return kStretch / std::max(std::sqrt(faced.small / faced.large), kLeast);
}

// What limits the distances to which a record is valid, metres.
struct ReachLimits {
  float unit;  // a D
  float least, most;
};

// Those distances along two axes at right angles, and the axis of the smaller one in the record's basis.
struct Reach {
  float large, small;
  glm::vec2 across;
};

// To which distance the second derivative allows extrapolation; `lambda` as a share of E / D^2.
float by_derivative(float lambda, const ReachRule& rule, const ReachLimits& limits) noexcept {
  return lambda > 0.0f ? rule.scale * limits.unit / std::pow(lambda, rule.power) : limits.most;
}

// `longest`: how far gradients allow at all.
Reach reach_by_geometry(const glm::mat2& H, float longest, const ReachLimits& limits) noexcept {
  const Eigen2 e = magnitudes_of(H);
  const auto reach = [&](float lambda) {
    return std::clamp(std::min(by_derivative(lambda, kByGeometry, limits), longest), limits.least,
                      limits.most);
  };
  const float small = reach(e.large);
  return {std::min(reach(e.small), kMostStretch * small), small, e.axis};
}

// `widest`: how far distances allow across; `most_change`: of irradiance by its gradient, W/m^2.
Reach reach_along_what_is_near(const glm::mat2& H, const glm::mat2& facing, float widest,
                               const glm::vec2& gradient, float most_change,
                               const ReachLimits& limits) noexcept {
  const Eigen2 e = magnitudes_of(H), faced = magnitudes_of(facing);
  const glm::vec2 across = faced.large > 0.0f ? faced.axis : e.axis, along(-across.y, across.x);
  const auto allowed = [&](float lambda, const glm::vec2& axis) {
    const float slope = std::fabs(glm::dot(gradient, axis));
    return std::min(by_derivative(lambda, kWithOcclusion, limits),
                    slope > 0.0f ? most_change / slope : limits.most);
  };
  const float small = std::clamp(std::min(allowed(e.large, across), widest), limits.least, limits.most);
  const float large = std::min(allowed(std::fabs(glm::dot(along, H * along)), along), stretch(faced) * small);
  return {std::clamp(large, small, limits.most), small, across};
}

// By how much it is limited more closely than others for being bright.
float share_for_brightness(float E, float mean) noexcept {
  if (!(mean > 0.0f && E > mean)) return 1.0f;
  const float share = mean / E;
  return std::max(share * share * share, kLeastOfLimit);
}

}  // namespace

const InterpolationEntry& find_interpolation(std::string_view name) {
  return find_named("interpolation", name, kInterpolations);
}

void restrain(IrradianceGradients& gradients, const Irradiance& E, float R) noexcept {
  const auto limit = [](glm::vec3& v, float value, float most) {  // |v| <= value most
    const glm::vec3 relative = value > 0.0f ? v / value : glm::vec3(0.0f);
    const float length = glm::length(relative);
    if (!(value > 0.0f && std::isfinite(length)))
      v = glm::vec3(0.0f);  // nothing to change: black, or as good as that
    else if (length > most)
      v = relative * (most / length * value);
  };
  for (int c = 0; c < 3; ++c) {
    const auto channel = static_cast<std::size_t>(c);
    limit(gradients.translational[channel], E[c], 1.0f / R);
    limit(gradients.rotational[channel], E[c], kMostTurn);
  }
}

std::uint32_t RecordDetails::draft(unsigned thread) {
  Purse& purse = purses_[thread];
  if (purse.next == purse.end) {
    // Relaxed: the counter only has to give distinct blocks; nobody else looks at a block before its records are found
    // in the cache.
    if (next_block_.load(std::memory_order_relaxed) >= blocks_.size()) return kNone;
    const std::uint32_t b = next_block_.fetch_add(1, std::memory_order_relaxed);
    if (b >= blocks_.size()) return kNone;
    if (!blocks_[b]) blocks_[b] = std::make_unique<RecordDetail[]>(kBlock);
    purse = {b * kBlock, (b + 1) * kBlock};
  }
  return purse.next;
}

void RecordDetails::clear() noexcept {
  for (Purse& purse : purses_) purse = {};
  next_block_.store(0, std::memory_order_relaxed);  // quiescent
}

std::size_t RecordDetails::bytes() const noexcept {
  const auto taken =
      std::count_if(blocks_.begin(), blocks_.end(), [](const auto& block) { return block != nullptr; });
  return static_cast<std::size_t>(taken) * kBlock * sizeof(RecordDetail);
}

RecordShaper::RecordShaper(Interpolation level, float a, const Bounds& bounds, const RadiusLimits& limits,
                           int height) noexcept
    : level_(level),
      a_(a),
      diagonal_(glm::length(bounds.upper - bounds.lower)),
      limits_(limits),
      height_(static_cast<float>(height)) {}

void RecordShaper::look_from(const Camera& camera) noexcept {
  eye_ = camera.eye;
  pixel_of_unit_distance_ = 2.0f * std::tan(0.5f * camera.fov_y) / height_;
}

float RecordShaper::radius(const glm::vec3& p, float mean) const noexcept {
  const float R = limits_.clamp(mean);
  if (level_ == Interpolation::split_sphere) return R;
  const float pixel = pixel_of_unit_distance_ * glm::distance(p, eye_);
  const float least = std::max(kLeastPixels * pixel / a_, limits_.min);
  return std::clamp(R, least, std::max(least, kMostPixels * pixel / a_));
}

float RecordShaper::radius(const glm::vec3& p, float mean, const Irradiance& E,
                           const IrradianceGradients& gradients) const noexcept {
  return radius(p, std::min(mean, change_length(E, gradients)));
}

float RecordShaper::shape_of_vpls(float R, const Irradiance& E, const IrradianceGradients& gradients,
                                  RecordDetail& detail) const noexcept {
  detail.R = limits_.clamp(std::min(R, change_length(E, gradients)) / kTurnOfVpls);
  detail.gradients = gradients;
  restrain(detail.gradients, E, kTurnOfVpls * detail.R);
  return detail.R;
}

float RecordShaper::ellipse(const glm::vec3& p, const Hemisphere& seen, float mean, const Irradiance& E,
                            RecordDetail& detail, float farthest) const noexcept {
  // Geometry alone shrinks regions beside all that is near, lit or not; it needs no limit on the screen.
  const bool knows_light = level_ == Interpolation::occlusion_hessian;
  ReachLimits limits{.unit = a_ * diagonal_, .least = 0.0f, .most = kMostReach * diagonal_};
  limits.least = (knows_light ? kWithOcclusion : kByGeometry).least * limits.unit;
  if (knows_light) {
    const float pixels = kMostPixels * pixel_of_unit_distance_ * glm::distance(p, eye_);
    limits.most = std::clamp(pixels, limits.least, limits.most);
  }
  limits.most = std::clamp(farthest, limits.least, limits.most);
  const float near = 0.1f * limits.least;
  const float circle = std::clamp(a_ * limits_.clamp(mean), limits.least, limits.most);
  Reach reach{circle, circle, {0.0f, -1.0f}};
  const float brightness = luminance(E);
  if (seen.strata.count() >= kLeastCellsForHessian &&
      (!knows_light || (brightness > 0.0f && is_light_known(seen)))) {
    if (knows_light) {
      const glm::mat2 H =
          occlusion_hessian(seen, near) / judged_by(brightness, mean_irradiance_) * (diagonal_ * diagonal_);
      const NearSurfaces surfaces = near_surfaces(seen, near);
      const float lit = surfaces.distance_of_light;
      const float typical = std::isfinite(lit) ? std::sqrt(mean) * std::sqrt(lit) : mean;
      const float widest = a_ * share_for_brightness(brightness, mean_irradiance_) * kMostOfMean * typical;
      const glm::vec3 gradient = gradient_of_luminance(detail.gradients);
      const glm::vec2 slope(glm::dot(gradient, seen.basis.s), glm::dot(gradient, seen.basis.t));
      const float most_change = kMostSlope * std::max(brightness, mean_irradiance_);
      reach = reach_along_what_is_near(H, surfaces.facing, widest, slope, most_change, limits);
    } else {
      // Not of the irradiance that these samples found: where few see light, those that see none would reach farthest.
      reach = reach_by_geometry(relative_geometric_hessian(seen, near) * (diagonal_ * diagonal_),
                                a_ * change_length(E, detail.gradients), limits);
    }
  }
  detail.major = -reach.across.y * seen.basis.s + reach.across.x * seen.basis.t;
  detail.inverse_major = 1.0f / reach.large;
  detail.inverse_minor = 1.0f / reach.small;
  return kOverlap * reach.large / (search_reach(level_) * a_);
}

}  // namespace icbench
