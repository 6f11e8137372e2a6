// The Cornell box with nothing moving in it but the camera, which swings from side to side and comes nearer.
#include <cmath>

#include "scene/cornell.h"
#include "scene/motion.h"
#include "scene/registry.h"

namespace icbench {

Scene cornell_camera() {
  Scene s = cornell::still_box();
  s.frames = kLoopFrames;
  s.camera_path = [still = s.camera](float frame) {
    const float swing = std::sin(loop_angle(frame)), nearer = there_and_back(frame);
    Camera c = still;
    c.eye += glm::vec3(2.4f * swing, 0.8f * std::sin(loop_angle(frame, 2.0f)), 4.4f * nearer);
    c.target = {2.78f, 2.73f - 0.5f * nearer, 2.9f};
    return c;
  };
  return s;
}

}  // namespace icbench
