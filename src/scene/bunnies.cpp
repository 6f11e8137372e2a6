// Stanford bunnies that bounce in a room: 1, 2, 4 or 9 of one shape, as in the Bunnies animations of Dubla 2012,
// section 6.3.2. Room, light and camera are the same for all, so that only the number of moving objects differs.
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "scene/import_mesh.h"
#include "scene/motion.h"
#include "scene/registry.h"
#include "scene/room.h"

namespace icbench {
namespace {

constexpr Bounds kRoom{{-4.0f, 0.0f, -4.0f}, {4.0f, 4.0f, 5.6f}};
constexpr float kSize = 1.3f;     // of a bunny, metres
constexpr float kLeap = 0.9f;     // height of a bounce, metres
constexpr float kBounces = 4.0f;  // a loop

constexpr std::array<glm::vec3, 9> kCoats{{{0.70f, 0.55f, 0.40f},
                                           {0.62f, 0.20f, 0.16f},
                                           {0.20f, 0.36f, 0.62f},
                                           {0.72f, 0.58f, 0.18f},
                                           {0.26f, 0.52f, 0.28f},
                                           {0.72f, 0.70f, 0.66f},
                                           {0.46f, 0.30f, 0.56f},
                                           {0.22f, 0.54f, 0.54f},
                                           {0.72f, 0.42f, 0.46f}}};

Scene empty_room() {
  Scene s;
  const auto white = s.add_material({.albedo = {0.75f, 0.74f, 0.71f}});
  const auto floor = s.add_material({.albedo = {0.55f, 0.50f, 0.44f}});
  const auto left = s.add_material({.albedo = {0.68f, 0.33f, 0.22f}});
  const auto right = s.add_material({.albedo = {0.26f, 0.40f, 0.58f}});
  const auto lamp = s.add_material({.emission = {15.0f, 13.8f, 12.0f}});
  add_room(s, kRoom, {floor, white, left, right, white, white});
  add_ceiling_panel(s, kRoom.upper.y, {-1.6f, -0.6f}, {1.6f, 1.6f}, white, lamp);
  add_ceiling_panel(s, kRoom.upper.y, {1.6f, -0.6f}, {1.6f, 1.6f}, white, lamp);
  s.camera = {.eye = {1.5f, 2.9f, 5.4f}, .target = {0.0f, 0.95f, -0.9f}, .up = {0, 1, 0}, .fov_y = 0.80f};
  s.frames = kLoopFrames;
  return s;
}

Motion bounce(int which, const glm::vec2& at) {
  const auto i = static_cast<float>(which);
  const float delay = i * (std::numbers::phi_v<float> - 1.0f);  // no two leap together
  // More or less to the camera.
  const float angle = 0.5f * std::numbers::pi_v<float> + 0.35f * std::sin(2.4f * i);
  return [=](float frame) {
    const float leap = kBounces * frame / static_cast<float>(kLoopFrames) + delay;
    const float t = leap - std::floor(leap);
    return turned(angle, {at.x, kStandingGap + 4.0f * kLeap * t * (1.0f - t), at.y}, kSize);
  };
}

// columns x rows bunnies; a pair stands side by side.
Scene bunnies(int columns, int rows) {
  Scene s = empty_room();
  const float step = columns == 3 ? 1.9f : 2.3f;
  const auto first = static_cast<std::uint32_t>(s.meshes.size());
  for (int i = 0; i < columns * rows; ++i) {
    const auto coat = s.add_material({.albedo = kCoats[static_cast<std::size_t>(i)]});
    Mesh bunny = i == 0 ? stanford_bunny(coat) : Mesh{"bunny", {}, {}, {}, coat};
    if (i > 0) bunny.instance_of = first;
    const float x = static_cast<float>(i % columns) - 0.5f * static_cast<float>(columns - 1);
    const float z = static_cast<float>(i / columns) - 0.5f * static_cast<float>(rows - 1);
    bunny.pose = bounce(i, {step * x, step * z - 1.1f});
    s.meshes.push_back(std::move(bunny));
  }
  return s;
}

}  // namespace

Scene bunnies_1() { return bunnies(1, 1); }
Scene bunnies_2() { return bunnies(2, 1); }
Scene bunnies_4() { return bunnies(2, 2); }
Scene bunnies_9() { return bunnies(3, 3); }

}  // namespace icbench
