// What the Cornell boxes have in common: the room, what stands in it, the camera.
//
// The room is that of Goral et al. 1984 with the dimensions of the Cornell box data page, ten times the size; it is
// open towards the camera, which looks along +z, so that +x is on its left.
#pragma once

#include <cstdint>

#include "scene/scene.h"

namespace icbench::cornell {

inline constexpr float kWidth = 5.56f, kHeight = 5.488f, kDepth = 5.592f;  ///< metres
inline constexpr float kPedestal = 1.0f;                                   ///< height of the pedestal, metres
inline constexpr float kGap = 0.001f;  ///< between things and what they stand on, metres

/// Materials of every Cornell box; a scene adds its own behind them.
enum : std::uint32_t { kWhite, kRed, kGreen, kMarble, kClay, kLamp };

/// Where the statue stands.
inline constexpr glm::vec3 kMiddle{0.5f * kWidth, 0.0f, 2.9f};

/// Floor, ceiling and three walls, all materials, and the camera.
Scene room();

/// The lamp in the ceiling.
void add_ceiling_lamp(Scene& scene);

/// Pedestal and Venus in the middle.
void add_statue(Scene& scene);

/// The bunny, `size` metres high, runs round a point once in a loop, `radius` metres off, facing where it goes.
void add_circling_bunny(Scene& scene, float size, const glm::vec3& centre, float radius);

/// The box with its lamp, the statue and a bunny that sits still.
Scene still_box();

}  // namespace icbench::cornell
