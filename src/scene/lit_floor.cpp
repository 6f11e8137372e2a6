// Closed-form scene: a square light of 1 m side, 1 m above the origin, emits 10 W/(m^2 sr) downwards onto a
// floor of albedo 0.5. Nothing else is there and the light reflects nothing, so the irradiance of the floor
// is direct only and follows from Lambert's polygon formula.
#include "scene/registry.h"
#include "scene/shapes.h"

namespace icbench {

Scene lit_floor() {
  Scene s;
  const auto floor = s.add_material({.albedo = glm::vec3(0.5f)});
  const auto light = s.add_material({.emission = glm::vec3(10.0f)});
  s.meshes.push_back(quad("floor", {-4.0f, 0.0f, -4.0f}, {0.0f, 0.0f, 8.0f}, {8.0f, 0.0f, 0.0f}, floor));
  s.meshes.push_back(quad("light", {-0.5f, 1.0f, -0.5f}, {1.0f, 0.0f, 0.0f}, {0.0f, 0.0f, 1.0f}, light));
  s.camera = {.eye = {0.0f, 2.0f, 4.0f}, .target = {0.0f, 0.3f, 0.0f}, .up = {0, 1, 0}, .fov_y = 0.9f};
  return s;
}

}  // namespace icbench
