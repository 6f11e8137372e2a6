#include "render/packed_normal.h"

#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>

namespace icbench {
namespace {

constexpr float kScale = 32767.0f;

// Folds the lower half of the octahedron over the upper one, or back.
glm::vec2 fold(const glm::vec2& v) noexcept {
  return {(1.0f - std::abs(v.y)) * std::copysign(1.0f, v.x),
          (1.0f - std::abs(v.x)) * std::copysign(1.0f, v.y)};
}

}  // namespace

PackedNormal PackedNormal::pack(const glm::vec3& n) noexcept {
  const glm::vec3 flat = n / (std::abs(n.x) + std::abs(n.y) + std::abs(n.z));
  glm::vec2 v(flat.x, flat.y);
  if (flat.z < 0.0f) v = fold(v);
  const auto coordinate = [](float x) {
    return static_cast<std::uint16_t>(
        static_cast<std::int16_t>(std::lround(kScale * glm::clamp(x, -1.0f, 1.0f))));
  };
  return {static_cast<std::uint32_t>(coordinate(v.x)) << 16 | coordinate(v.y)};
}

glm::vec3 PackedNormal::unpack() const noexcept {
  const auto coordinate = [](std::uint32_t x) {
    return static_cast<float>(static_cast<std::int16_t>(static_cast<std::uint16_t>(x))) / kScale;
  };
  glm::vec2 v(coordinate(bits >> 16), coordinate(bits));
  const float z = 1.0f - std::abs(v.x) - std::abs(v.y);
  if (z < 0.0f) v = fold(v);
  return glm::normalize(glm::vec3(v, z));
}

}  // namespace icbench
