#include "render/leak_guard.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numbers>

namespace icbench {

namespace {

/// The sector where cell `n` of `N` around the normal begins, counted from before the first or beyond the last as well.
std::uint32_t sector_at(float n, std::uint32_t N) noexcept {
  const float angle = 2.0f * std::numbers::pi_v<float> * n / static_cast<float>(N);
  return leak_sector(std::cos(angle), std::sin(angle));
}

}  // namespace

LeakMarks leak_marks(const Hemisphere& seen, float reach) noexcept {
  const std::uint32_t N = seen.strata.azimuths;
  LeakMarks marks;
  // Where a wall is nearest, a ray of that azimuth may be a cell away.
  const float least_share =
      std::max(0.0f, std::cos(2.0f * std::numbers::pi_v<float> / static_cast<float>(N)));
  for (std::uint32_t i = 0; i < seen.samples.size(); ++i) {
    const HemisphereSample& s = seen.samples[i];
    if (!std::isfinite(s.t)) continue;
    const float up = glm::dot(s.d, seen.basis.n);
    const float flat = std::sqrt(std::max(0.0f, 1.0f - up * up));
    const float nearest = s.t * flat * least_share;
    if (!(up < flat && nearest < reach)) continue;
    marks.nearest = std::min(marks.nearest, nearest);
    // From the beginning of the cell before to the end of the one behind.
    const auto n = static_cast<float>(i % N);
    const std::uint32_t last = sector_at(n + 2.0f, N);
    for (std::uint32_t at = sector_at(n - 1.0f, N); at != last; at = (at + 1) % kLeakSectors)
      marks.sectors |= 1u << at;
    marks.sectors |= 1u << last;
    if (N <= 3) marks.sectors = ~0u;  // that was once around
  }
  return marks;
}

void mark_low(LeakMarks& marks, Tracer& tracer, const Hit& at, const Basis& basis, float reach) noexcept {
  constexpr float kLeastShare = 0.96f;  // at most the cosine of a sector's width; as least_share above
  const glm::vec3 from = tracer.shared().leave(at.p, at.ng);
  std::array<Ray, kLeakSectors> rays;
  std::array<float, kLeakSectors> share_along;  // of a ray, along the tangent plane
  float x[kLeakSectors], y[kLeakSectors], z[kLeakSectors];
  for (std::uint32_t i = 0; i < kLeakSectors; ++i) {
    const glm::vec2 to = middle_of_leak_sector(i);
    const glm::vec3 flat = to.x * basis.s + to.y * basis.t;
    // It rises over the surface as it is, not as it is shaded, or it would run into that.
    const glm::vec3 d = flat + std::max(0.0f, kLeakLowSlope - glm::dot(flat, at.ng)) * at.ng;
    share_along[i] = std::max(0.0f, glm::dot(d, flat));
    // Where the sector is marked already, only what is nearer has something to tell.
    rays[i] = {from, (marks.sectors >> i & 1u) != 0 ? marks.nearest : reach, d};
    const glm::vec3 end = from + rays[i].t_max * d;
    x[i] = end.x, y[i] = end.y, z[i] = end.z;
  }
  // Most meet nothing, and shadow rays tell that sooner.
  std::uint32_t met = static_cast<std::uint32_t>(
      tracer.occluded_from(from, x, y, z, (std::uint64_t{1} << kLeakSectors) - 1, Packing::exact));
  for (; met != 0; met &= met - 1) {
    const auto i = static_cast<std::uint32_t>(std::countr_zero(met));
    const Hit hit = tracer.intersect(rays[i]);
    if (hit.missed()) continue;  // it brushes the end
    marks.nearest = std::min(marks.nearest, kLeastShare * share_along[i] * hit.t);
    for (const std::uint32_t sector : {i + kLeakSectors - 1, i, i + 1})
      marks.sectors |= 1u << sector % kLeakSectors;
  }
}

}  // namespace icbench
