#include "render/leak_guard.h"

#include <algorithm>

namespace icbench {

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
    if (!(up < flat && s.t * flat < reach)) continue;
    marks.nearest = std::min(marks.nearest, s.t * flat * least_share);
    const std::uint32_t n = i % N;
    // From the beginning of the cell before to the end of the one behind, counted from N on: none is negative.
    const std::uint32_t first = kLeakSectors * (N + n - 1) / N;
    const std::uint32_t end = (kLeakSectors * (N + n + 2) + N - 1) / N;
    for (std::uint32_t sector = first; sector < end; ++sector) marks.sectors |= 1u << sector % kLeakSectors;
  }
  return marks;
}

}  // namespace icbench
