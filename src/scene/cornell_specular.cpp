// The Cornell box with a ball that is a mirror, on the pedestal, round which the bunny runs, and one of glass.
#include "scene/cornell.h"
#include "scene/registry.h"
#include "scene/shapes.h"
#include "scene/statue.h"

namespace icbench {

Scene cornell_specular() {
  using cornell::kGap;
  Scene s = cornell::room();
  const auto mirror = s.add_material({.albedo = glm::vec3(0.9f), .surface = Surface::mirror});
  const auto glass = s.add_material({.albedo = glm::vec3(1.0f), .surface = Surface::dielectric, .ior = 1.5f});
  cornell::add_ceiling_lamp(s);
  const glm::vec3 centre(3.0f, 0.0f, 3.4f), up(0.0f, 1.0f, 0.0f);
  s.meshes.push_back(pedestal(cornell::kPedestal, cornell::kWhite));
  place(s.meshes.back(), 1.0f, 0.0f, centre + kGap * up);
  constexpr float kRadius = 0.8f;
  s.meshes.push_back(
      ball("mirror ball", centre + (cornell::kPedestal + kRadius + 2.0f * kGap) * up, kRadius, 5, mirror));
  s.meshes.push_back(ball("glass ball", {1.3f, 0.75f + kGap, 0.95f}, 0.75f, 5, glass));
  cornell::add_circling_bunny(s, 1.1f, centre, 1.42f);
  return s;
}

}  // namespace icbench
