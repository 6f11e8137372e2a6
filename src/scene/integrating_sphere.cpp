// Closed-form scene: a hollow sphere of radius 1 m and albedo rho = 0.5 round a lamp of I = 2 W/sr that stands off its
// centre. Any two points of a sphere see each other by the same form factor density, 1/(4 pi R^2), so whatever reaches
// the wall is spread evenly by its first reflection: indirect irradiance is rho Phi / ((1 - rho) 4 pi R^2) = 2 W/m^2
// everywhere, with Phi = 4 pi I (theory of the integrating sphere: Jacquez & Kuppenheim 1955), although direct
// irradiance is not even. It is made of 5,120 triangles, whose area is 0.12 % less; by that the mean over the area is
// more, and single points differ from the mean by some tenths of a per cent.
#include "scene/registry.h"
#include "scene/shapes.h"

namespace icbench {

Scene integrating_sphere() {
  Scene s;
  const auto wall = s.add_material({.albedo = glm::vec3(0.5f)});
  s.meshes.push_back(icosphere("wall", {0.0f, 0.0f, 0.0f}, 1.0f, 4, wall));
  s.point_lights.push_back({.p = {0.3f, 0.4f, -0.2f}, .intensity = glm::vec3(2.0f)});
  s.camera = {.eye = {0.0f, 0.0f, 0.8f}, .target = {0.0f, 0.0f, 0.0f}, .up = {0, 1, 0}, .fov_y = 1.2f};
  return s;
}

}  // namespace icbench
