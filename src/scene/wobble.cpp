// A column that a sine wave runs up, in a room: the deforming mesh of the Wobble animation of Dubla 2012, section
// 6.3.2.
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <span>
#include <vector>

#include "scene/motion.h"
#include "scene/registry.h"
#include "scene/room.h"
#include "scene/shapes.h"

namespace icbench {
namespace {

constexpr float kRadius = 0.42f, kHeight = 2.3f;  // of the column, metres
constexpr std::uint32_t kAround = 96, kUp = 128;

// How far the axis is bent sideways at a height, and its slope there. The foot stands still.
struct Bend {
  glm::vec2 offset, slope;  // along x and z
};

Bend bend(float y, float frame) {
  constexpr float kReach = 0.24f, kWaves = 3.0f * std::numbers::pi_v<float> / kHeight;
  const float t = y / kHeight;
  const float swing = kReach * t * (2.0f - t), growth = kReach * (2.0f - 2.0f * t) / kHeight;
  const float phase = kWaves * y - loop_angle(frame, 2.0f);
  const float sine = std::sin(phase), cosine = std::cos(phase);
  // Across the view more than along it.
  const glm::vec2 wave(sine, 0.35f * cosine), wave_slope(kWaves * cosine, -0.35f * kWaves * sine);
  return {swing * wave, growth * wave + swing * wave_slope};
}

// Rows of vertices round the column from its foot to its top; the two ends once more, and their middles.
void deform(float frame, std::span<glm::vec3> positions, std::span<glm::vec3> normals) {
  std::size_t v = 0;
  const auto add_row = [&](float y, float flat) {
    const Bend b = bend(y, frame);
    for (std::uint32_t a = 0; a < kAround; ++a, ++v) {
      const float phi =
          2.0f * std::numbers::pi_v<float> * static_cast<float>(a) / static_cast<float>(kAround);
      const glm::vec2 out(std::cos(phi), std::sin(phi));
      positions[v] = {kRadius * out.x + b.offset.x, y + kStandingGap, kRadius * out.y + b.offset.y};
      // Rows stay level, so the normal leans back by as much as the axis leans towards it.
      normals[v] = flat != 0.0f ? glm::vec3(0.0f, flat, 0.0f)
                                : glm::normalize(glm::vec3(out.x, -glm::dot(out, b.slope), out.y));
    }
  };
  for (std::uint32_t row = 0; row <= kUp; ++row)
    add_row(kHeight * static_cast<float>(row) / static_cast<float>(kUp), 0.0f);
  for (const float y : {0.0f, kHeight}) {
    const float up = y > 0.0f ? 1.0f : -1.0f;
    add_row(y, up);
    const Bend b = bend(y, frame);
    positions[v] = {b.offset.x, y + kStandingGap, b.offset.y};
    normals[v] = {0.0f, up, 0.0f};
    ++v;
  }
}

Mesh column(std::uint32_t material) {
  constexpr std::size_t kVertices = (kUp + 3) * kAround + 2;
  Mesh mesh{"column", std::vector<glm::vec3>(kVertices), std::vector<glm::vec3>(kVertices), {}, material};
  for (std::uint32_t row = 0; row < kUp; ++row)
    for (std::uint32_t a = 0; a < kAround; ++a) {
      const std::uint32_t here = row * kAround + a, next = row * kAround + (a + 1) % kAround;
      mesh.triangles.emplace_back(here, next + kAround, next);
      mesh.triangles.emplace_back(here, here + kAround, next + kAround);
    }
  for (const bool top : {false, true}) {
    const std::uint32_t first = (kUp + 1) * kAround + (top ? kAround + 1 : 0), middle = first + kAround;
    for (std::uint32_t a = 0; a < kAround; ++a) {
      const std::uint32_t here = first + a, next = first + (a + 1) % kAround;
      mesh.triangles.emplace_back(middle, top ? next : here, top ? here : next);
    }
  }
  deform(0.0f, mesh.positions, mesh.normals);
  mesh.deform = deform;
  return mesh;
}

}  // namespace

Scene wobble() {
  constexpr Bounds kRoom{{-2.6f, 0.0f, -2.4f}, {2.6f, 3.2f, 4.0f}};
  Scene s;
  const auto white = s.add_material({.albedo = {0.76f, 0.75f, 0.72f}});
  const auto floor = s.add_material({.albedo = {0.50f, 0.42f, 0.34f}});
  const auto left = s.add_material({.albedo = {0.64f, 0.26f, 0.14f}});
  const auto right = s.add_material({.albedo = {0.18f, 0.36f, 0.56f}});
  const auto skin = s.add_material({.albedo = {0.72f, 0.66f, 0.38f}});
  const auto lamp = s.add_material({.emission = {16.0f, 14.8f, 12.8f}});
  add_room(s, kRoom, {floor, white, left, right, white, white});
  add_ceiling_panel(s, kRoom.upper.y, {-1.0f, 0.5f}, {1.4f, 1.4f}, white, lamp);
  s.meshes.push_back(column(skin));
  s.camera = {.eye = {0.5f, 1.9f, 3.9f}, .target = {0.0f, 1.15f, 0.0f}, .up = {0, 1, 0}, .fov_y = 0.75f};
  s.frames = kLoopFrames;
  return s;
}

}  // namespace icbench
