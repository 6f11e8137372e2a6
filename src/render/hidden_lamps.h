// Lamps that lie in another surface: a file's ceiling and the panel in it may share a plane. Rays then meet either as
// rounding has it. Light that is drawn on the lamp arrives, since shadow rays end epsilon before it; what rays should
// have found there by chance is lost, as is the lamp itself in the picture.
#pragma once

#include <cstdint>
#include <optional>

#include "render/ray_tracer.h"

namespace icbench {

struct HiddenLamps {
  double share;        ///< of the rays that should meet lamps, in (0, 1]
  std::uint32_t mesh;  ///< the one that they meet most
};

/// What rays meet instead of lamps, within a few epsilon of them, to points and from directions drawn as they send
/// their light at the current frame. None where all meet lamps.
std::optional<HiddenLamps> hidden_lamps(const RayTracer& rays);

}  // namespace icbench
