// Closed-form scene: in a closed room where every surface reflects rho and emits 1 - rho, radiance is 1
// W/(m^2 sr) everywhere, so total irradiance is pi and its indirect part pi rho W/m^2.
#include "scene/registry.h"
#include "scene/shapes.h"

namespace icbench {

Scene white_furnace() {
  constexpr float kRho = 0.5f;
  Scene s;
  const auto wall = s.add_material({.albedo = glm::vec3(kRho), .emission = glm::vec3(1.0f - kRho)});
  s.meshes.push_back(box("room", {{-1.0f, 0.0f, -1.0f}, {1.0f, 2.0f, 1.0f}}, wall, true));
  s.meshes.push_back(box("block", {{-0.7f, 0.2f, -0.5f}, {-0.1f, 0.9f, 0.1f}}, wall));
  s.meshes.push_back(icosphere("ball", {0.4f, 0.6f, -0.2f}, 0.35f, 2, wall));
  s.camera = {.eye = {0.1f, 1.2f, 0.9f}, .target = {0.0f, 0.7f, -0.3f}, .up = {0, 1, 0}, .fov_y = 1.0f};
  return s;
}

}  // namespace icbench
