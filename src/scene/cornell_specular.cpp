// The Cornell box with a mirror, a pillar whose faces show the coloured walls, and a ball of glass; the bunny runs
// round the pillar.
#include <numbers>

#include "scene/cornell.h"
#include "scene/motion.h"
#include "scene/registry.h"
#include "scene/shapes.h"

namespace icbench {

Scene cornell_specular() {
  using cornell::kGap;
  Scene s = cornell::room();
  const auto mirror = s.add_material({.albedo = glm::vec3(0.9f), .surface = Surface::mirror});
  const auto glass = s.add_material({.albedo = glm::vec3(1.0f), .surface = Surface::dielectric, .ior = 1.5f});
  cornell::add_ceiling_lamp(s);
  const glm::vec3 centre(3.0f, 0.0f, 3.45f);
  s.meshes.push_back(box("pillar", {{-0.55f, 0.0f, -0.55f}, {0.55f, 3.3f, 0.55f}}, mirror));
  place(s.meshes.back(), turned(0.25f * std::numbers::pi_v<float>, centre + glm::vec3(0.0f, kGap, 0.0f)));
  s.meshes.push_back(ball("glass ball", {1.3f, 0.75f + kGap, 0.95f}, 0.75f, 5, glass));
  cornell::add_circling_bunny(s, 1.1f, centre, 1.42f);
  return s;
}

}  // namespace icbench
