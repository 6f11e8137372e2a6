#include "scene/cornell.h"

#include <cmath>
#include <numbers>

#include "scene/import_mesh.h"
#include "scene/motion.h"
#include "scene/shapes.h"
#include "scene/statue.h"

namespace icbench::cornell {

Scene room() {
  Scene s;
  s.add_material({.albedo = {0.73f, 0.71f, 0.68f}});    // kWhite
  s.add_material({.albedo = {0.60f, 0.06f, 0.05f}});    // kRed
  s.add_material({.albedo = {0.14f, 0.45f, 0.10f}});    // kGreen
  s.add_material({.albedo = {0.80f, 0.78f, 0.74f}});    // kMarble
  s.add_material({.albedo = {0.66f, 0.49f, 0.33f}});    // kClay
  s.add_material({.emission = {30.0f, 25.5f, 19.0f}});  // kLamp
  const glm::vec3 x(kWidth, 0, 0), y(0, kHeight, 0), z(0, 0, kDepth);
  s.meshes.push_back(quad("floor", {}, z, x, kWhite));
  s.meshes.push_back(quad("ceiling", y, x, z, kWhite));
  s.meshes.push_back(quad("back", z, y, x, kWhite));
  s.meshes.push_back(quad("left", x, z, y, kRed));
  s.meshes.push_back(quad("right", {}, y, z, kGreen));
  s.camera = {.eye = {2.78f, 2.73f, -8.0f}, .target = {2.78f, 2.73f, 0.0f}, .up = {0, 1, 0}, .fov_y = 0.686f};
  return s;
}

void add_ceiling_lamp(Scene& s) {
  s.meshes.push_back(quad("lamp", {2.13f, kHeight - 0.005f, 2.27f}, {1.30f, 0, 0}, {0, 0, 1.05f}, kLamp));
}

void add_statue(Scene& s) {
  s.meshes.push_back(pedestal(kPedestal, kWhite));
  place(s.meshes.back(), 1.0f, 0.0f, kMiddle + glm::vec3(0.0f, kGap, 0.0f));
  s.meshes.push_back(venus(kMarble));
  place(s.meshes.back(), 3.2f, 3.0f, kMiddle + glm::vec3(0.0f, kPedestal + 2.0f * kGap, 0.0f));
}

void add_circling_bunny(Scene& s, float size, const glm::vec3& centre, float radius) {
  s.frames = kLoopFrames;
  s.meshes.push_back(stanford_bunny(kClay));
  s.meshes.back().pose = [=](float frame) {
    constexpr float kStart = -2.46f;  // in front, on the right
    const float phi = kStart + loop_angle(frame);
    // The bunny looks along -x at rest.
    return turned(0.5f * std::numbers::pi_v<float> - phi,
                  centre + glm::vec3(radius * std::cos(phi), kGap, radius * std::sin(phi)), size);
  };
}

Scene still_box() {
  Scene s = room();
  add_ceiling_lamp(s);
  add_statue(s);
  s.meshes.push_back(stanford_bunny(kClay));
  place(s.meshes.back(), 1.5f, 3.75f, {1.35f, kGap, 1.75f});
  return s;
}

}  // namespace icbench::cornell
