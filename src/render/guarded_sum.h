// Sums of what records bring to a point, with suspects asked by rays: the guard against leaks at work
// (render/leak_guard.h).
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "core/types.h"
#include "render/extrapolation.h"
#include "render/leak_guard.h"
#include "render/ray_tracer.h"

namespace icbench {

/// Adds what suspects bring to a sum, but for those behind something (render/leak_guard.h) and those that are not worth
/// a ray. They wait until there are kLeakPacket of them, or no more.
class LeakGuard {
 public:
  LeakGuard(Tracer& tracer, LeakTests& tests, CoveredMean& sum) noexcept
      : tracer_(tracer), tests_(tests), sum_(sum) {}

  /// Whether it could still count for something that one would see.
  bool is_worth_a_ray(const Contribution& suspect) const noexcept {
    return suspect.w >= kLeakWorth * sum_.weight();
  }
  /// `ray`: what leak_ray gives.
  void add(const Contribution& suspect, const Ray& ray) noexcept {
    rays_[suspects_] = ray;
    held_[suspects_++] = suspect;
    if (suspects_ == kLeakPacket) judge();
  }
  void judge() noexcept;

 private:
  Tracer& tracer_;
  LeakTests& tests_;
  CoveredMean& sum_;
  std::uint32_t suspects_ = 0;
  std::array<Ray, kLeakPacket> rays_;
  std::array<Contribution, kLeakPacket> held_;
};

/// Sums what records bring to one point as the level of `shapes` has it, but for those that the guard stops. Rays are
/// traced while a cache is being visited, hence perhaps locked, only at points where many are valid.
class GuardedSum {
 public:
  GuardedSum(const RecordShapes& shapes, Tracer& tracer, const SurfacePoint& x, LeakTests& tests) noexcept
      : shapes_(shapes),
        extrapolates_(extrapolates(shapes.shaper.level())),
        extrapolator_(shapes, x),
        tracer_(tracer),
        x_(x),
        guard_(tracer, tests, sum_) {}

  /// As those of Extrapolator, or at lower levels of Interpolator.
  void operator()(const Record& r, float weight) noexcept {
    const Contribution c = extrapolates_ ? extrapolator_.of(r, weight) : Contribution{r.E, weight, true};
    if (!(c.w > 0.0f)) return;
    if (!is_suspect(x_, r, shapes_.details.marks(r.id)))
      sum_.add(c);
    else if (guard_.is_worth_a_ray(c))
      guard_.add(c, leak_ray(tracer_.shared(), x_, r));
  }
  std::optional<Irradiance> result() noexcept {
    guard_.judge();
    return sum_.result();
  }

 private:
  const RecordShapes& shapes_;
  bool extrapolates_;
  Extrapolator extrapolator_;
  Tracer& tracer_;
  SurfacePoint x_;
  CoveredMean sum_;
  LeakGuard guard_;
};

}  // namespace icbench
