// Closed-form scene: a sphere of radius R = 0.4 m that emits L = 10 W/(m^2 sr) hangs 1 m above a floor of albedo 0.5
// and reflects nothing. Where it is wholly above the horizon, irradiance is E = pi L (R/d)^2 cos(theta), d and theta
// those of its centre: as from a point there (configuration factor of a plane element to a sphere). It is made of
// 5,120 triangles, which send 0.1 % less.
#include "scene/registry.h"
#include "scene/shapes.h"

namespace icbench {

Scene sphere_light() {
  Scene s;
  const auto floor = s.add_material({.albedo = glm::vec3(0.5f)});
  const auto light = s.add_material({.emission = glm::vec3(10.0f)});
  s.meshes.push_back(quad("floor", {-4.0f, 0.0f, -4.0f}, {0.0f, 0.0f, 8.0f}, {8.0f, 0.0f, 0.0f}, floor));
  s.meshes.push_back(icosphere("light", {0.0f, 1.0f, 0.0f}, 0.4f, 4, light));
  s.camera = {.eye = {0.0f, 2.0f, 4.0f}, .target = {0.0f, 0.5f, 0.0f}, .up = {0, 1, 0}, .fov_y = 0.9f};
  return s;
}

}  // namespace icbench
