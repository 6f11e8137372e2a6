// The Cornell box whose left wall changes its paint from red to blue and back.
#include <glm/common.hpp>

#include "scene/cornell.h"
#include "scene/motion.h"
#include "scene/registry.h"

namespace icbench {

Scene cornell_paint() {
  Scene s = cornell::still_box();
  s.frames = kLoopFrames;
  s.change_light = [red = s.materials[cornell::kRed].albedo](float frame, std::span<Material> materials,
                                                             std::span<PointLight>) {
    constexpr glm::vec3 kBlue(0.06f, 0.13f, 0.62f);
    materials[cornell::kRed].albedo = glm::mix(red, kBlue, there_and_back(frame));
  };
  return s;
}

}  // namespace icbench
