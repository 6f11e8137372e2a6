// The Cornell box in changing light: the lamp dims and goes from warm to cold and back, while a spot light sweeps over
// the statue and the bunny.
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "scene/cornell.h"
#include "scene/motion.h"
#include "scene/registry.h"

namespace icbench {

Scene cornell_lamp() {
  Scene s = cornell::still_box();
  s.point_lights.push_back({.intensity = {45.0f, 36.0f, 20.0f}, .cos_inner = 0.96f, .cos_outer = 0.90f});
  s.frames = kLoopFrames;
  s.change_light = [warm = s.materials[cornell::kLamp].emission](float frame, std::span<Material> materials,
                                                                 std::span<PointLight> lights) {
    constexpr glm::vec3 kCold(3.0f, 4.2f, 6.5f);
    materials[cornell::kLamp].emission = glm::mix(warm, kCold, there_and_back(frame));
    const float phi = loop_angle(frame);
    lights[0].p = {2.78f + 2.2f * std::cos(phi), 4.6f, 0.6f};
    const glm::vec3 aim(2.3f - 0.9f * std::cos(phi), 1.2f + 0.7f * std::sin(phi), 2.5f);
    lights[0].axis = glm::normalize(aim - lights[0].p);
  };
  return s;
}

}  // namespace icbench
