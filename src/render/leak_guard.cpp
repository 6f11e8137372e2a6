#include "render/leak_guard.h"

#include <algorithm>
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

}  // namespace icbench
