#include "scene/room.h"

#include <utility>

#include "scene/shapes.h"

namespace icbench {

void add_room(Scene& scene, const Bounds& inside, const RoomSides& sides) {
  struct Side {
    const char* name;
    int corners[4];  // counter-clockwise seen from inside
    std::uint32_t material;
  };
  const Side all[] = {
      {"floor", {0, 4, 5, 1}, sides.floor}, {"ceiling", {2, 3, 7, 6}, sides.ceiling},
      {"left", {0, 2, 6, 4}, sides.left},   {"right", {1, 5, 7, 3}, sides.right},
      {"back", {0, 1, 3, 2}, sides.back},   {"front", {4, 6, 7, 5}, sides.front},
  };
  for (const Side& side : all) {
    Mesh mesh{side.name, {}, {}, {{0, 1, 2}, {0, 2, 3}}, side.material};
    for (const int c : side.corners) mesh.positions.push_back(corner(inside, c));
    scene.meshes.push_back(std::move(mesh));
  }
}

void add_ceiling_panel(Scene& scene, float ceiling, const glm::vec2& centre, const glm::vec2& size,
                       std::uint32_t housing, std::uint32_t lamp) {
  constexpr float kThick = 0.05f, kFrame = 0.03f;
  const glm::vec2 low = centre - 0.5f * size, high = centre + 0.5f * size;
  const float top = ceiling - kStandingGap, bottom = top - kThick;
  scene.meshes.push_back(
      box("lamp housing", {{low.x - kFrame, bottom, low.y - kFrame}, {high.x + kFrame, top, high.y + kFrame}},
          housing));
  scene.meshes.push_back(
      quad("lamp", {low.x, bottom - kStandingGap, low.y}, {size.x, 0.0f, 0.0f}, {0.0f, 0.0f, size.y}, lamp));
}

}  // namespace icbench
