// The Cornell box with its lamp turned round: it lies in a tray under the ceiling and shines upwards, so that whatever
// stands in the box is lit by way of the ceiling alone.
#include "scene/cornell.h"
#include "scene/registry.h"
#include "scene/shapes.h"

namespace icbench {

Scene cornell_indirect() {
  constexpr float kTop = 4.55f, kRim = 0.12f;
  Scene s = cornell::room();
  s.materials[cornell::kLamp].emission *= 2.0f;
  const Bounds tray{{1.88f, kTop - 0.05f, 2.0f}, {3.68f, kTop, 3.6f}};
  s.meshes.push_back(box("tray", tray, cornell::kWhite));
  // The rim keeps the light off the lower walls.
  const glm::vec3 size = tray.upper - tray.lower;
  for (int side = 0; side < 4; ++side) {
    constexpr float kThick = 0.04f;
    Bounds wall{{tray.lower.x, kTop + cornell::kGap, tray.lower.z},
                {tray.upper.x, kTop + kRim, tray.upper.z}};
    if (side == 0) wall.upper.x = wall.lower.x + kThick;
    if (side == 1) wall.lower.x = wall.upper.x - kThick;
    if (side >= 2) {
      wall.lower.x += kThick + cornell::kGap;
      wall.upper.x -= kThick + cornell::kGap;
    }
    if (side == 2) wall.upper.z = wall.lower.z + kThick;
    if (side == 3) wall.lower.z = wall.upper.z - kThick;
    s.meshes.push_back(box("rim", wall, cornell::kWhite));
  }
  s.meshes.push_back(quad("lamp", tray.lower + glm::vec3(0.25f, 0.07f, 0.27f), {0, 0, size.z - 0.54f},
                          {size.x - 0.5f, 0, 0}, cornell::kLamp));
  cornell::add_statue(s);
  cornell::add_circling_bunny(s, 1.5f, cornell::kMiddle, 1.76f);
  return s;
}

}  // namespace icbench
