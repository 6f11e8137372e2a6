// glTF files: how keys move nodes, and what follows them.
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <numbers>
#include <string_view>
#include <vector>

#include "import_support.h"
#include "scene_files.h"

namespace icbench {
namespace {

using nlohmann::json;

constexpr double kPi = std::numbers::pi;

// A grey cube's motion: keys at times, in seconds, of 24 frames each.
Scene moved(const char* path, const std::vector<float>& times, const std::vector<float>& values,
            const char* way = "LINEAR") {
  GltfFile f = grey_cube();
  const bool is_rotation = std::string_view(path) == "rotation";
  f.animate(0, path, f.scalars(times), is_rotation ? f.vec4s(values) : f.vec3s(values), way);
  Scene scene = import_gltf(f).scene;
  prepare(scene);
  return scene;
}

TEST(ImportAnimation, RotationsGoTheShortWayAtAnEvenSpeed) {
  const auto turned = static_cast<float>(std::sin(kPi / 3.0)), rest = 0.5f;  // by 120 degrees about y
  for (const float sign : {1.0f, -1.0f}) {
    const Scene scene = moved("rotation", {0, 1}, {0, 0, 0, 1, 0, sign * turned, 0, sign * rest});
    for (const float frame : {0.0f, 3.0f, 6.0f, 12.0f, 21.0f, 24.0f}) {
      const double angle = frame / 24.0 * 2.0 * kPi / 3.0;
      expect_near(scene.meshes[0].pose(frame).linear * glm::vec3(1, 0, 0),
                  glm::vec3(std::cos(angle), 0.0, -std::sin(angle)), 1e-5f);
    }
  }
}

// glTF 2.0 is known without its extension, too: assimp would play steps as lines.
TEST(ImportAnimation, StepsAreStepsWithoutAnExtension) {
  GltfFile f = grey_cube();
  f.animate(0, "translation", f.scalars({0, 1}), f.vec3s({3, 0, 0, 5, 0, 0}), "STEP");
  const TemporaryFolder folder;
  for (const auto& [name, bytes] : {std::pair("text", "\n " + f.text()), std::pair("binary", f.glb())}) {
    write(folder / name, bytes);
    EXPECT_EQ(import_scene(folder / name).scene.meshes[0].pose(12.0f).shift.x, 3.0f) << name;
  }
}

TEST(ImportAnimation, CubicRotationsAreBroughtToLengthOne) {
  const float h = std::sqrt(0.5f);
  const Scene scene =
      moved("rotation", {0, 1}, {0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, h, 0, h, 0, 0, 0, 0},
            "CUBICSPLINE");
  const glm::mat3 m = scene.meshes[0].pose(12.0f).linear;
  EXPECT_NEAR(glm::determinant(m), 1.0f, 1e-5f);
  expect_near(m * glm::vec3(1, 0, 0), {h, 0, -h}, 1e-5f);
}

TEST(ImportAnimation, BeforeTheFirstKeyAndAfterTheLastTheyHold) {
  const auto x = [](const Scene& s, float frame) { return s.meshes[0].pose(frame).shift.x; };
  const Scene linear = moved("translation", {1, 2}, {3, 0, 0, 5, 0, 0});
  const Scene cubic =
      moved("translation", {1, 2}, {9, 0, 0, 3, 0, 0, 0, 0, 0, 0, 0, 0, 5, 0, 0, 9, 0, 0}, "CUBICSPLINE");
  for (const Scene* s : {&linear, &cubic}) {
    EXPECT_NEAR(x(*s, 0.0f), 3.0f, 1e-6f);
    EXPECT_NEAR(x(*s, 12.0f), 3.0f, 1e-6f);
    EXPECT_NEAR(x(*s, 36.0f), 4.0f, 1e-6f);
    EXPECT_NEAR(x(*s, 60.0f), 5.0f, 1e-6f);
  }
}

TEST(ImportAnimation, AScaleThatChangesItsSignKeepsItsFirst) {
  for (const float sign : {1.0f, -1.0f}) {
    GltfFile f = grey_cube();
    f.animate(0, "scale", f.scalars({0, 1}), f.vec3s({sign, 1, 1, -sign, 1, 1}));
    ImportedScene imported = import_gltf(f);
    EXPECT_TRUE(has_note(imported, "scale that passes through zero"));
    EXPECT_NO_THROW(prepare(imported.scene));
    const Mesh& mesh = imported.scene.meshes[0];
    for (const float frame : {0.0f, 6.0f, 24.0f})
      EXPECT_NEAR(volume(mesh, mesh.pose(frame)), frame == 0.0f ? 1.0 : frame == 6.0f ? 0.5 : 1e-3, 1e-5);
  }
}

TEST(ImportAnimation, TangentsOfAScaleAreNoScales) {
  GltfFile f = grey_cube();
  f.animate(0, "scale", f.scalars({0, 1}), f.vec3s({0, 0, 0, 1, 1, 1, -1, 0, 0, -1, 0, 0, 2, 2, 2, 0, 0, 0}),
            "CUBICSPLINE");
  ImportedScene imported = import_gltf(f);
  EXPECT_FALSE(has_note(imported, "passes through zero"));
  // (1 + 2) / 2 and, along x, tangents of the same slope that cancel in the middle.
  const Mesh& mesh = imported.scene.meshes[0];
  EXPECT_NEAR(volume(mesh, mesh.pose(12.0f)), 1.5 * 1.5 * 1.5, 1e-4);
}

TEST(ImportAnimation, ATangentAloneIsMotion) {
  const Scene scene =
      moved("translation", {0, 1}, {0, 0, 0, 3, 0, 0, 8, 0, 0, 0, 0, 0, 3, 0, 0, 0, 0, 0}, "CUBICSPLINE");
  ASSERT_TRUE(scene.moves());
  EXPECT_NEAR(scene.meshes[0].pose(12.0f).shift.x, 4.0f, 1e-5f);  // 8 / 8 more
}

TEST(ImportAnimation, ChannelsThatDoNotChangePlaceTheirNode) {
  GltfFile f = grey_cube();
  const auto times = f.scalars({0, 1});
  const float h = std::sqrt(0.5f);
  f.animate(0, "scale", times, f.vec3s({1, 2, 4, 1, 2, 4}));
  f.animate(0, "rotation", times, f.vec4s({0, 0, h, h, 0, 0, h, h}));  // x to y, y to -x
  const ImportedScene imported = import_gltf(f);
  EXPECT_FALSE(imported.scene.moves());
  Scene scene = imported.scene;
  prepare(scene);
  expect_near(scene.bounds.upper, {1, 0.5f, 2}, 1e-4f);
}

TEST(ImportAnimation, LastsAsLongAsItsLongestChannel) {
  GltfFile f = grey_cube();
  f.animate(0, "translation", f.scalars({0, 3}), f.vec3s({0, 0, 0, 1, 0, 0}));
  f.animate(0, "scale", f.scalars({0, 1.02f}), f.vec3s({1, 1, 1, 2, 2, 2}));
  EXPECT_EQ(import_gltf(f).scene.frames, 72u);
  GltfFile shorter = grey_cube();
  shorter.animate(0, "translation", shorter.scalars({0, 0.98f}), shorter.vec3s({0, 0, 0, 1, 0, 0}));
  EXPECT_EQ(import_gltf(shorter).scene.frames, 24u) << "23.5 frames and a little";
}

TEST(ImportAnimation, OfTwoForOneNodeTheFirstCounts) {
  GltfFile f = grey_cube();
  const auto times = f.scalars({0, 1});
  f.animate(0, "translation", times, f.vec3s({0, 0, 0, 2, 0, 0}));
  f.animate(0, "translation", times, f.vec3s({0, 0, 0, 8, 0, 0}));
  const ImportedScene imported = import_gltf(f);
  EXPECT_TRUE(has_note(imported, "two animations move the same node"));
  EXPECT_NEAR(imported.scene.meshes[0].pose(12.0f).shift.x, 1.0f, 1e-6f);
}

// By the bounds of its whole animation.
TEST(ImportAnimation, AFarSceneIsMovedWithAllThatMoves) {
  constexpr float kFar = 1e5f;
  GltfFile f = grey_cube();
  f.doc["extensions"]["KHR_lights_punctual"]["lights"] = {{{"type", "point"}}};
  f.doc["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 0.5}, {"znear", 0.1}}}}};
  const auto lamp = f.node({{"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
  const auto eye = f.node({{"camera", 0}});
  const auto times = f.scalars({0, 1});
  f.animate(0, "translation", times, f.vec3s({kFar, 0, 0, kFar + 8, 0, 0}));
  f.animate(lamp, "translation", times, f.vec3s({kFar, 2, 0, kFar + 8, 2, 0}));
  f.animate(eye, "translation", times, f.vec3s({kFar, 0, 6, kFar + 8, 0, 6}));
  ImportedScene imported = import_gltf(f);
  EXPECT_TRUE(has_note(imported, "far from its origin"));
  Scene& scene = imported.scene;
  ASSERT_TRUE(scene.change_light && scene.camera_path);
  // Frames 0 to 23 take the cube's centre from 0 to 8 * 23 / 24.
  const float middle = 4.0f * 23.0f / 24.0f;
  for (const float frame : {0.0f, 12.0f, 23.0f}) {
    const float x = 8.0f * frame / 24.0f - middle;
    expect_near(scene.meshes[0].pose(frame).shift, {x, 0, 0}, 1e-4f);
    scene.change_light(frame, scene.materials, scene.point_lights);
    expect_near(scene.point_lights[0].p, {x, 2, 0}, 1e-4f);
    expect_near(scene.camera_path(frame).eye, {x, 0, 6}, 1e-4f);
  }
}

TEST(ImportAnimation, ACameraTurnsWithItsNode) {
  GltfFile f = grey_cube();
  f.doc["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 0.5}, {"znear", 0.1}}}}};
  const auto eye = f.node({{"camera", 0}, {"translation", {0, 0, 6}}});
  const float h = std::sqrt(0.5f);
  f.animate(eye, "rotation", f.scalars({0, 1}), f.vec4s({0, 0, 0, 1, 0, 0, h, h}));  // rolls: up to -x
  const Scene scene = import_gltf(f).scene;
  expect_near(scene.camera_path(0.0f).up, {0, 1, 0}, 1e-6f);
  expect_near(scene.camera_path(24.0f).up, {-1, 0, 0}, 1e-6f);
}

}  // namespace
}  // namespace icbench
