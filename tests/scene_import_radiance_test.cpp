// Radiance's files: what becomes of surfaces, materials, modifiers and views.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <stdexcept>
#include <string>
#include <utility>

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

TEST(ImportRadiance, ASphereOfNegativeRadiusIsABubble) {
  EXPECT_NEAR(rad_volume("red sphere s 0 0 4 1 2 3 -.5"), -4.0 / 3.0 * kPi * 0.125, 0.005);
  EXPECT_NEAR(rad_volume("red bubble s 0 0 4 1 2 3 -.5"), 4.0 / 3.0 * kPi * 0.125, 0.005);
}

// They stray by a five-hundredth of the radius, whatever that is.
TEST(ImportRadiance, CurvedSurfacesHaveFacetsOfTheirRadius) {
  for (const double radius : {0.02, 1.0, 30.0}) {
    const std::string r = std::to_string(radius);
    const Mesh mesh =
        import_text("s.rad", kRed + ("red cylinder c 0 0 7 0 0 0 0 0 " + r + " " + r)).scene.meshes[0];
    double nearest = 1.0;
    for (const glm::uvec3& t : mesh.triangles)
      for (const auto& [a, b] : {std::pair{t.x, t.y}, {t.y, t.z}, {t.z, t.x}}) {
        const glm::dvec3 middle = 0.5 * (glm::dvec3(mesh.positions[a]) + glm::dvec3(mesh.positions[b]));
        nearest = std::min(nearest, std::hypot(middle.x, middle.y) / radius);
      }
    EXPECT_GT(nearest, 1.0 - 2.01e-3) << radius;
    EXPECT_LT(nearest, 1.0 - 1e-3) << radius;
  }
}

TEST(ImportRadiance, TheNormalsOfConesSlant) {
  for (const bool is_cup : {false, true}) {
    const std::string type = is_cup ? "cup" : "cone";
    const Mesh mesh =
        import_text("s.rad", kRed + ("red " + type + " c 0 0 8 0 0 1 0 0 5 4 1")).scene.meshes[0];
    ASSERT_EQ(mesh.normals.size(), mesh.positions.size());
    for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
      const glm::vec3 p = mesh.positions[v], out = glm::normalize(glm::vec3(p.x, p.y, 0));
      // 3 in for 4 up.
      expect_near(mesh.normals[v], (is_cup ? -1.0f : 1.0f) * (0.8f * out + glm::vec3(0, 0, 0.6f)), 1e-5f);
    }
  }
}

TEST(ImportRadiance, OfOneMaterialWhatIsFlatStaysFlat) {
  const std::string surfaces =
      "red sphere s 0 0 4 0 0 0 1\nred ring r 0 0 8 0 0 2 0 0 1 0 1\nred polygon p 0 0 9 0 0 3 1 0 3 0 1 3\n";
  const Scene scene = import_text("s.rad", kRed + surfaces).scene;
  ASSERT_EQ(scene.meshes.size(), 2u);
  for (const Mesh& mesh : scene.meshes)
    EXPECT_EQ(mesh.normals.size(), mesh.positions[0].z < 1.5f ? mesh.positions.size() : 0u);
}

TEST(ImportRadiance, WordsMayBeQuotedAndNumbersSigned) {
  const Scene scene = import_text("s.rad",
                                  "void plastic 'a red' 0 0 5 +.5 0 0 0 0\n"
                                  "\"a red\" polygon \"p q\" 0 0 9 0 0 0 +1 0 0 0 +1e0 0\n")
                          .scene;
  EXPECT_EQ(scene.materials[scene.meshes.at(0).material].albedo, kRedAlbedo);
  EXPECT_NEAR(area(scene.meshes[0]).z, 0.5, 1e-6);
  EXPECT_TRUE(is_one_line_with(error_of([] { import_text("s.rad", "void plastic 'a\nb' 0 0 x"); }),
                               "line 2: 'x' is not the number of real arguments"));
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
  EXPECT_FLOAT_EQ(glass.ior, 1.52f);
  EXPECT_FLOAT_EQ(read("glass m 0 0 4 .81 .81 .81 1.7").ior, 1.7f);
  EXPECT_EQ(read("dielectric m 0 0 5 1 1 1 1.33 2"),
            (Material{.albedo = glm::vec3(1), .surface = Surface::dielectric, .ior = 1.33f}));
  EXPECT_EQ(read("metal m 0 0 5 .2 .4 .6 .4 0").surface, Surface::diffuse);
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
  write(folder / "told.rad", std::string(kRadianceRoom) + "# view from the door\n");
  expect_near(import_scene(folder / "told.rad").scene.camera.eye, {2, -6, 1.6f}, 1e-6f);
  write(folder / "room.vf", "rvu -vtv -vp 1 1 1 -vd 0 1 0 -vu 0 0 1 -vh 60 -vv 50 -vo 0 -va 0\n");
  expect_near(import_scene(folder / "room.rad").scene.camera.eye, {1, 1, 1}, 1e-6f);
  EXPECT_FALSE(has_note(import_scene(folder / "room.rad"), "shifts of the view"));
  write(folder / "room.vf", "rvu -vtv -vp 1 1 1 -vd 0 1 0 -vu 0 0 1 -vh 60 -vv 50 -vs 0.2 -vl 0\n");
  EXPECT_TRUE(has_note(import_scene(folder / "room.rad"), "shifts of the view"));
  expect_near(mesh_of(room.scene, glm::vec3(0.6f)).positions[0], {0, 0, 0}, 1e-6f);
  write(folder / "room.vf", "rvu -vtl -vp 1 1 1 -vd 0 1 0 -vu 0 0 1 -vh 6 -vv 5\n");
  const ImportedScene parallel = import_scene(folder / "room.rad");
  EXPECT_TRUE(has_note(parallel, "a view that is not perspective"));
  EXPECT_TRUE(has_note(parallel, "no camera"));
}

}  // namespace
}  // namespace icbench
