// Lamps in the plane of another surface are told; lamps a little off one, lamps on lamps and point lights are not.
#include <gtest/gtest.h>

#include <vector>

#include "render/hidden_lamps.h"
#include "scene/directions.h"
#include "scene/registry.h"
#include "scene/room.h"
#include "scene/shapes.h"

namespace icbench {
namespace {

// A closed room that is turned, with a panel so far below the ceiling, metres.
RayTracer room_with_panel(float below) {
  Scene s;
  const auto grey = s.add_material({.albedo = glm::vec3(0.5f)});
  const auto lamp = s.add_material({.emission = glm::vec3(9.0f)});
  add_room(s, {{-1, 0, -1}, {1, 2, 1}}, {grey, grey, grey, grey, grey, grey});
  s.meshes.push_back(quad("panel", {-0.4f, 2.0f - below, -0.3f}, {0.8f, 0, 0}, {0, 0, 0.6f}, lamp));
  const Basis basis(glm::normalize(glm::vec3(0.3f, 0.2f, 0.9f)));
  for (Mesh& mesh : s.meshes)
    for (glm::vec3& p : mesh.positions) p = glm::mat3(basis.s, basis.t, basis.n) * p;
  return RayTracer(std::move(s));
}

TEST(HiddenLamps, APanelInTheCeilingIsToldByTheCeiling) {
  const RayTracer rays = room_with_panel(0.0f);
  const auto hidden = hidden_lamps(rays);
  ASSERT_TRUE(hidden);
  EXPECT_EQ(rays.scene().meshes[hidden->mesh].name, "ceiling");
  EXPECT_GT(hidden->share, 0.1);
  EXPECT_LE(hidden->share, 1.0);
}

TEST(HiddenLamps, OneAMillimetreBelowIsNot) { EXPECT_FALSE(hidden_lamps(room_with_panel(0.001f))); }

TEST(HiddenLamps, ALampBehindTheCeilingDoesNotShineAndIsNotMeant) {
  EXPECT_FALSE(hidden_lamps(room_with_panel(-0.001f)));
}

TEST(HiddenLamps, ALampWithBothItsFacesInOnePlaneIsToldByItself) {
  for (const float apart : {0.0f, 0.001f}) {
    Scene s;
    const auto lamp = s.add_material({.emission = glm::vec3(9.0f)});
    s.meshes.push_back(quad("front", {-1, apart, -1}, {0, 0, 2}, {2, 0, 0}, lamp));
    s.meshes.push_back(quad("back", {-1, 0, -1}, {2, 0, 0}, {0, 0, 2}, lamp));
    const RayTracer rays(std::move(s));
    EXPECT_EQ(hidden_lamps(rays).has_value(), apart == 0.0f);
  }
}

TEST(HiddenLamps, PointLightsMayLieInSurfaces) {
  Scene s;
  const auto grey = s.add_material({.albedo = glm::vec3(0.5f)});
  s.meshes.push_back(quad("floor", {-4, 0, -4}, {0, 0, 8}, {8, 0, 0}, grey));
  EXPECT_FALSE(hidden_lamps(RayTracer(s))) << "no lights at all";
  s.point_lights.push_back({.p = {0, 0, 0}, .intensity = glm::vec3(1)});
  EXPECT_FALSE(hidden_lamps(RayTracer(s)));
}

TEST(HiddenLamps, ScenesOfTheSuiteHaveNone) {
  for (const SceneEntry& entry : kScenes) {
    const RayTracer rays(entry.make());
    const auto hidden = hidden_lamps(rays);
    EXPECT_FALSE(hidden) << entry.name << ": " << rays.scene().meshes[hidden->mesh].name;
  }
}

}  // namespace
}  // namespace icbench
