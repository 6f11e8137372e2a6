// A procedural statue: a draped Venus, after the antique type whose arms are lost, on a turned pedestal.
#pragma once

#include "scene/scene.h"

namespace icbench {

/// The figure, 1 m high, standing on the origin, facing +z; smooth, closed, about 80,000 triangles. Sculpted once, then
/// copied.
Mesh venus(std::uint32_t material);

/// A round pedestal for it: `height` metres high, top radius 0.6 of it, standing on the origin.
Mesh pedestal(float height, std::uint32_t material);

}  // namespace icbench
