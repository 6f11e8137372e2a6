// Radiance's files: what becomes of surfaces, materials, modifiers and views.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <glm/geometric.hpp>
#include <numbers>
#include <stdexcept>

#include "import_support.h"
#include "render/ray_tracer.h"

namespace icbench {
namespace {

constexpr double kPi = std::numbers::pi;

// The mesh of a .rad file whose material is `albedo`.
const Mesh& mesh_of(const Scene& scene, const glm::vec3& albedo) {
  for (const Mesh& mesh : scene.meshes)
    if (glm::distance(scene.materials[mesh.material].albedo, albedo) < 1e-4f) return mesh;
  throw std::runtime_error("no mesh of that colour");
}

constexpr const char* kRed = "void plastic red 0 0 5 .5 0 0 0 0\n";
constexpr glm::vec3 kRedAlbedo(0.5f, 0.0f, 0.0f);

double rad_volume(const std::string& surface) {
  return volume(import_text("s.rad", kRed + surface).scene.meshes[0]);
}

TEST(ImportRadiance, CurvedSurfacesFaceTheRightWayAndHaveTheRightSize) {
  EXPECT_NEAR(rad_volume("red sphere s 0 0 4 1 2 3 .5"), 4.0 / 3.0 * kPi * 0.125, 0.005);
  EXPECT_NEAR(rad_volume("red bubble s 0 0 4 1 2 3 .5"), -4.0 / 3.0 * kPi * 0.125, 0.005);
  // Open at both ends: the caps would add what a centred one lacks, a third of the volume.
  EXPECT_NEAR(rad_volume("red cylinder c 0 0 7 0 0 -1 0 0 1 .5"), 2.0 / 3.0 * kPi * 0.5, 0.01);
  EXPECT_NEAR(rad_volume("red tube c 0 0 7 0 0 -1 0 0 1 .5"), -2.0 / 3.0 * kPi * 0.5, 0.01);
  // From its tip a cone without its base shows no volume; from its base's centre all of it.
  EXPECT_NEAR(rad_volume("red cone c 0 0 8 0 0 0 0 0 3 1 0"), kPi, 0.02);
  EXPECT_NEAR(rad_volume("red cup c 0 0 8 0 0 0 0 0 3 1 0"), -kPi, 0.02);
  const Mesh ring =
      import_text("s.rad", std::string(kRed) + "red ring r 0 0 8 1 1 1 0 0 -2 1 .5").scene.meshes[0];
  EXPECT_NEAR(area(ring).z, -0.75 * kPi, 0.01);
}

TEST(ImportRadiance, CurvedSurfacesAreSmooth) {
  const Mesh ball = import_text("s.rad", std::string(kRed) + "red sphere s 0 0 4 1 0 0 .5").scene.meshes[0];
  ASSERT_EQ(ball.normals.size(), ball.positions.size());
  for (std::size_t i = 0; i < ball.positions.size(); ++i)
    expect_near(ball.normals[i], 2.0f * (ball.positions[i] - glm::vec3(1, 0, 0)), 1e-5f);
}

TEST(ImportRadiance, PolygonsMayBeConcaveAndHaveHoles) {
  const std::string with_hole =
      "red polygon p 0 0 30\n0 0 0 4 0 0 4 4 0 0 4 0 0 0 0\n1 1 0 1 3 0 3 3 0 3 1 0 1 1 0";
  const Scene scene = import_text("s.rad", kRed + with_hole).scene;
  EXPECT_NEAR(area(scene.meshes[0]).z, 12.0, 1e-5);
  const tbb::global_control serial(tbb::global_control::max_allowed_parallelism, 1);
  const RayTracer rays(scene);
  Tracer tracer(rays);
  EXPECT_TRUE(tracer.intersect({{2.1f, 2.2f, 1}, 9.0f, {0, 0, -1}}).missed()) << "the hole is filled";
  EXPECT_FALSE(tracer.intersect({{0.5f, 2.2f, 1}, 9.0f, {0, 0, -1}}).missed());
}

TEST(ImportRadiance, MaterialsAreMappedAsDocumented) {
  const auto read = [](const std::string& material) {
    return import_text("s.rad", "void " + material + "\nm polygon p 0 0 9 0 0 0 1 0 0 0 1 0")
        .scene.materials[0];
  };
  EXPECT_EQ(read("plastic m 0 0 5 .2 .4 .6 0 .1"), (Material{.albedo = {0.2f, 0.4f, 0.6f}}));
  EXPECT_NEAR(read("plastic m 0 0 5 .2 .4 .6 .05 .1").albedo.x, 0.95 * 0.2 + 0.05, 1e-6);
  EXPECT_EQ(read("metal m 0 0 5 .2 .4 .6 .9 .2"), (Material{.albedo = {0.2f, 0.4f, 0.6f}}));
  EXPECT_EQ(read("metal m 0 0 5 .2 .4 .6 .9 0").surface, Surface::mirror);
  EXPECT_EQ(read("mirror m 0 0 3 .9 .8 .7"),
            (Material{.albedo = {0.9f, 0.8f, 0.7f}, .surface = Surface::mirror}));
  EXPECT_EQ(read("light m 0 0 3 5 6 7"), (Material{.emission = {5, 6, 7}}));
  EXPECT_EQ(read("glow m 0 0 4 5 6 7 2"), (Material{.emission = {5, 6, 7}}));
  const Material glass = read("glass m 0 0 3 .81 .81 .81");
  EXPECT_EQ(glass.surface, Surface::dielectric);
  expect_near(glass.albedo, glm::vec3(0.9f), 1e-6f);
}

TEST(ImportRadiance, ModifiersAreFollowedToTheirMaterial) {
  const std::string polygon = " polygon p 0 0 9 0 0 0 1 0 0 0 1 0\n";
  const auto colour = [&](const std::string& text) {
    const ImportedScene s = import_text("s.rad", kRed + text);
    return s.scene.materials[s.scene.meshes.at(0).material].albedo;
  };
  EXPECT_EQ(colour("void alias crimson red\ncrimson" + polygon), kRedAlbedo);
  EXPECT_EQ(colour("void colorpict wood 1 x 0 0\nwood alias crimson red\ncrimson" + polygon), kRedAlbedo);
  EXPECT_EQ(colour("red brightfunc dirt 2 dirt dirt.cal 0 0\ndirt" + polygon), kRedAlbedo);
  EXPECT_EQ(colour("nobody" + polygon), glm::vec3(0.5f));
  // A name counts as it was last defined before.
  EXPECT_EQ(colour("red" + polygon + "void plastic red 0 0 5 0 0 1 0 0\n"), kRedAlbedo);
  const ImportedScene odd =
      import_text("s.rad", kRed + ("nobody" + polygon + "nobody" + polygon + "void" + polygon) +
                               "void source sun 0 0 4 0 0 1 .5\nvoid trans t 0 0 7 1 1 1 0 0 0 0\n");
  EXPECT_TRUE(has_note(odd, "grey stands for the modifiers nobody"));
  EXPECT_TRUE(has_note(odd, "not known: source trans"));
  EXPECT_TRUE(has_note(odd, "void"));
}

TEST(ImportRadiance, GreyIsNamedWhereASurfaceShowsIt) {
  const std::string polygon = " polygon p 0 0 9 0 0 0 1 0 0 0 1 0\n";
  const std::string pattern = "void brightdata dist 0 0 0\ndist alias other dist\n";
  const ImportedScene lamp = import_text("s.rad", pattern + "dist light lamp 0 0 3 1 1 1\nlamp" + polygon);
  EXPECT_FALSE(has_note(lamp, "grey")) << "only a light has the pattern";
  EXPECT_TRUE(has_note(lamp, "brightdata"));
  EXPECT_TRUE(
      has_note(import_text("s.rad", pattern + "dist" + polygon), "grey stands for the modifiers dist"));
  EXPECT_TRUE(has_note(import_text("s.rad", pattern + "void alias third other\nthird" + polygon),
                       "grey stands for the modifiers dist"));
}

TEST(ImportRadiance, WhatLightsLeaveOutIsNamed) {
  const auto read = [](const std::string& material) {
    return import_text("s.rad", "void " + material + "\nm polygon p 0 0 9 0 0 0 1 0 0 0 1 0");
  };
  EXPECT_TRUE(has_note(read("glow m 0 0 4 5 6 7 2"), "radii of glow"));
  EXPECT_TRUE(has_note(read("glow m 0 0 4 5 6 7 -1"), "radii of glow"));
  EXPECT_FALSE(has_note(read("glow m 0 0 4 5 6 7 0"), "radii of glow"));
  EXPECT_TRUE(has_note(read("plastic m 0 0 5 .5 .5 .5 .1 .05"), "gloss"));
  EXPECT_TRUE(has_note(read("metal m 0 0 5 .5 .5 .5 .9 .2"), "gloss"));
  EXPECT_FALSE(has_note(read("plastic m 0 0 5 .5 .5 .5 0 0"), "gloss"));
  EXPECT_FALSE(has_note(read("metal m 0 0 5 .5 .5 .5 .9 0"), "gloss")) << "a mirror";
  EXPECT_TRUE(
      has_note(read("plastic wall 0 0 5 .5 .5 .5 0 0\nvoid illum m 1 wall 0 3 5 6 7"), "how illum looks"));
  for (const char* emission : {"5 -1 7", "2e12 6 7"})
    EXPECT_TRUE(has_note(read(std::string("light m 0 0 3 ") + emission), "emission below 0 or above 1e12"));
  EXPECT_FALSE(has_note(read("light m 0 0 3 5 0 1e12"), "left out"));
}

TEST(ImportRadiance, ACylinderOfNegativeRadiusIsATube) {
  EXPECT_NEAR(rad_volume("red cylinder c 0 0 7 0 0 -1 0 0 1 -.5"), -2.0 / 3.0 * kPi * 0.5, 0.01);
  EXPECT_NEAR(rad_volume("red tube c 0 0 7 0 0 -1 0 0 1 -.5"), 2.0 / 3.0 * kPi * 0.5, 0.01);
  EXPECT_TRUE(has_note(import_text("s.rad", std::string(kRed) + "red cylinder c 0 0 7 0 0 -1 0 0 1 -.5"),
                       "negative radius"));
}

TEST(ImportRadiance, NumbersTooSmallAreZeroAndTooLargeAnErrorHoweverTheyAreWritten) {
  const std::string zeros(400, '0');
  const auto said = [&](const std::string& x) {
    return error_of([&] { import_text("s.rad", std::string(kRed) + "red sphere s 0 0 4 " + x + " 0 0 1"); });
  };
  for (const std::string& small : {"0." + zeros + "1", std::string("1e-400"), "-0." + zeros + "1e-5"})
    EXPECT_EQ(said(small), "") << small;
  for (const std::string& large : {"1" + zeros, std::string("1e400"), "1" + zeros + "e-1"})
    EXPECT_TRUE(is_one_line_with(said(large), "is not a real argument of at most")) << large;
}

TEST(ImportRadiance, TheViewComesFromTheFileBesideOrTheLastComment) {
  const TemporaryFolder folder;
  write(folder / "room.rad", kRadianceRoom);
  ImportedScene room = import_scene(folder / "room.rad");
  expect_near(room.scene.camera.eye, {2, -6, 1.6f}, 1e-6f);
  expect_near(room.scene.camera.up, {0, 0, 1}, 1e-6f);
  EXPECT_NEAR(room.scene.camera.fov_y, 35.0 * kPi / 180.0, 1e-6);
  EXPECT_TRUE(room.notes.empty());
  write(folder / "room.vf", "rvu -vtv -vp 1 1 1 -vd 0 1 0 -vu 0 0 1 -vh 60 -vv 50 -vo 0 -va 0\n");
  expect_near(import_scene(folder / "room.rad").scene.camera.eye, {1, 1, 1}, 1e-6f);
  EXPECT_FALSE(has_note(import_scene(folder / "room.rad"), "shifts of the view"));
  write(folder / "room.vf", "rvu -vtv -vp 1 1 1 -vd 0 1 0 -vu 0 0 1 -vh 60 -vv 50 -vs 0.2 -vl 0\n");
  EXPECT_TRUE(has_note(import_scene(folder / "room.rad"), "shifts of the view"));
  expect_near(mesh_of(room.scene, glm::vec3(0.6f)).positions[0], {0, 0, 0}, 1e-6f);
}

}  // namespace
}  // namespace icbench
