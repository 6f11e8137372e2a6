// The Cornell box (Goral et al. 1984; dimensions of the Cornell box data page, ten times the size) with a
// statue in its middle and the Stanford bunny beside it, as in the Cornell Box animation of Dubla 2012,
// section 6.3.2.
#include "scene/import_mesh.h"
#include "scene/registry.h"
#include "scene/shapes.h"
#include "scene/statue.h"

namespace icbench {

Scene cornell_box() {
  constexpr float kWidth = 5.56f, kHeight = 5.488f, kDepth = 5.592f;
  Scene s;
  const auto white = s.add_material({.albedo = {0.73f, 0.71f, 0.68f}});
  const auto red = s.add_material({.albedo = {0.60f, 0.06f, 0.05f}});
  const auto green = s.add_material({.albedo = {0.14f, 0.45f, 0.10f}});
  const auto marble = s.add_material({.albedo = {0.80f, 0.78f, 0.74f}});
  const auto clay = s.add_material({.albedo = {0.66f, 0.49f, 0.33f}});
  const auto lamp = s.add_material({.emission = {30.0f, 25.5f, 19.0f}});

  const glm::vec3 x(kWidth, 0, 0), y(0, kHeight, 0), z(0, 0, kDepth);
  s.meshes.push_back(quad("floor", {}, z, x, white));
  s.meshes.push_back(quad("ceiling", y, x, z, white));
  s.meshes.push_back(quad("back", z, y, x, white));
  s.meshes.push_back(quad("left", x, z, y, red));  // the camera looks along +z, so +x is on its left
  s.meshes.push_back(quad("right", {}, y, z, green));
  s.meshes.push_back(quad("lamp", {2.13f, kHeight - 0.005f, 2.27f}, {1.30f, 0, 0}, {0, 0, 1.05f}, lamp));

  const glm::vec3 centre(0.5f * kWidth, 0.0f, 2.9f);
  constexpr float kPedestal = 1.0f;
  s.meshes.push_back(pedestal(kPedestal, white));
  place(s.meshes.back(), 1.0f, 0.0f, centre);
  s.meshes.push_back(venus(marble));
  place(s.meshes.back(), 3.2f, 3.0f, centre + glm::vec3(0.0f, kPedestal, 0.0f));
  s.meshes.push_back(stanford_bunny(clay));
  place(s.meshes.back(), 1.5f, 3.75f, {1.35f, 0.0f, 1.75f});

  s.camera = {.eye = {2.78f, 2.73f, -8.0f}, .target = {2.78f, 2.73f, 0.0f}, .up = {0, 1, 0}, .fov_y = 0.686f};
  return s;
}

}  // namespace icbench
