// Closed rooms with a lamp under the ceiling.
#pragma once

#include <cstdint>
#include <glm/vec2.hpp>

#include "scene/scene.h"

namespace icbench {

/// Gap between things and what they stand on, hang on or lean against, metres: they do not share a plane.
inline constexpr float kStandingGap = 0.001f;

/// Materials of a room's six sides.
struct RoomSides {
  std::uint32_t floor, ceiling;
  std::uint32_t left, right;  ///< at the lower and the upper x
  std::uint32_t back, front;  ///< at the lower and the upper z
};

/// Adds the six sides, fronts inward; neighbours share their corners exactly.
void add_room(Scene& scene, const Bounds& inside, const RoomSides& sides);

/// Adds a flat lamp under a ceiling at this height: a panel of width x depth metres round (x, z) that shines down from
/// a shallow housing.
void add_ceiling_panel(Scene& scene, float ceiling, const glm::vec2& centre, const glm::vec2& size,
                       std::uint32_t housing, std::uint32_t lamp);

}  // namespace icbench
