// What the built-in scenes' motions are made of.
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

#include "scene/scene.h"

namespace icbench {

/// Frames of a built-in animation. Each is a loop: the frame after the last is the first.
inline constexpr std::uint32_t kLoopFrames = 100;

/// Angle, radians, of something that goes round `turns` times in a loop.
inline float loop_angle(float frame, float turns = 1.0f) noexcept {
  return 2.0f * std::numbers::pi_v<float> * turns * frame / static_cast<float>(kLoopFrames);
}

/// There and back once in a loop, slow at both ends: 0 at frame 0, 1 in the middle.
inline float there_and_back(float frame) noexcept { return 0.5f - 0.5f * std::cos(loop_angle(frame)); }

/// Turns about the vertical axis (counter-clockwise seen from above, radians), scales, then shifts (metres).
inline Pose turned(float angle, const glm::vec3& shift, float scale = 1.0f) noexcept {
  const float c = scale * std::cos(angle), s = scale * std::sin(angle);
  return {{{c, 0.0f, -s}, {0.0f, scale, 0.0f}, {s, 0.0f, c}}, shift};
}

}  // namespace icbench
