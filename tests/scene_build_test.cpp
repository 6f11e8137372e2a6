// Scenes: what prepare() refuses, drops and derives; the built-in scenes; light sampling.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "core/random.h"
#include "scene/registry.h"
#include "scene/shapes.h"
#include "scene/statue.h"
#include "scene_solid.h"

namespace icbench {
namespace {

Scene one_quad() {
  Scene s;
  s.name = "one_quad";
  s.add_material({.albedo = glm::vec3(0.5f)});
  s.meshes.push_back(quad("q", {}, {1, 0, 0}, {0, 1, 0}, 0));
  return s;
}

// The one line that prepare() gives for a spoiled scene; empty if it accepts it.
std::string complaint(const std::function<void(Scene&)>& spoil) {
  Scene s = one_quad();
  spoil(s);
  try {
    prepare(s);
  } catch (const std::runtime_error& e) {
    return e.what();
  }
  return "";
}

TEST(ScenePrepare, AcceptsAUsableScene) {
  EXPECT_EQ(complaint([](Scene&) {}), "");
}

TEST(ScenePrepare, NamesWhatIsWrongInOneLine) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN(),
                  kInf = std::numeric_limits<float>::infinity();
  const std::pair<std::function<void(Scene&)>, const char*> cases[] = {
      {[](Scene& s) { s.meshes.clear(); }, "no surface"},
      {[](Scene& s) { s.meshes[0].triangles.clear(); }, "no surface"},
      {[&](Scene& s) { s.meshes[0].positions[2].y = kNan; }, "vertex 2 of mesh 'q' is not finite"},
      {[&](Scene& s) { s.meshes[0].positions[1].x = kInf; }, "vertex 1 of mesh 'q' is not finite"},
      {[](Scene& s) { s.meshes[0].triangles[1].z = 4; }, "triangle 1 of mesh 'q' uses vertex 4 of 4"},
      {[](Scene& s) { s.meshes[0].material = 7; }, "material 7 of 1"},
      {[](Scene& s) {
         s.meshes[0].normals.resize(3, {0, 0, 1});
       },
       "3 normals for 4 vertices"},
      {[&](Scene& s) {
         s.meshes[0].normals.resize(4, {0, kNan, 1});
       },
       "normal 0 of mesh 'q'"},
      {[](Scene& s) { s.materials[0].albedo.y = 1.01f; }, "albedo 1.01"},
      {[&](Scene& s) { s.materials[0].albedo.z = kNan; }, "albedo"},
      {[](Scene& s) { s.materials[0].emission.x = -1.0f; }, "emits -1"},
      {[&](Scene& s) { s.materials[0].emission.x = kInf; }, "emits inf"},
      {[](Scene& s) { s.camera.target = s.camera.eye; }, "coincide"},
      {[](Scene& s) { s.camera.up = s.camera.target - s.camera.eye; }, "parallel"},
      {[](Scene& s) { s.camera.fov_y = 4.0f; }, "angle"},
      {[&](Scene& s) { s.camera.eye.x = kNan; }, "not finite"},
      {[](Scene& s) { s.camera.eye.x = -2e15f; }, "the camera has a coordinate of -2e+15 m"},
      {[](Scene& s) { s.camera.target.z = 2e18f; }, "the camera has a coordinate of 2e+18 m"},
      {[](Scene& s) {
         s.point_lights.push_back({.p = {0, 2e15f, 0}});
       },
       "point light 0 has a coordinate of 2e+15 m"},
      {[](Scene& s) {
         s.frames = 3;
         s.camera_path = [](float frame) {
           Camera camera;
           camera.eye.x = frame == 2.0f ? 1e30f : camera.eye.x;
           return camera;
         };
       },
       "the camera has a coordinate of 1e+30 m"},
      {[](Scene& s) {
         s.frames = 3;
         s.point_lights.emplace_back();
         s.change_light = [](float frame, std::span<Material>, std::span<PointLight> lights) {
           lights[0].p.x = frame == 2.0f ? 1e30f : 0.0f;
         };
       },
       "point light 0 has a coordinate of 1e+30 m"},
      {[](Scene& s) { s.frames = 0; }, "has no frame"},
      {[](Scene& s) {
         s.materials[0].emission.x = 1.0f;
         s.materials[0].surface = Surface::mirror;
       },
       "material 0 is specular and emits"},
      {[](Scene& s) {
         s.materials[0].surface = Surface::dielectric;
         s.materials[0].ior = 1.0f;
       },
       "index of refraction 1;"},
      {[](Scene& s) {
         s.materials[0].surface = Surface::dielectric;
         s.materials[0].ior = 10.5f;
       },
       "index of refraction 10.5;"},
      {[](Scene& s) {
         s.textures.push_back({"t", 1, 1, {1, 2, 3}});
         s.materials[0].texture = 1;
       },
       "material 0 names texture 1 of 1"},
      {[](Scene& s) {
         s.textures.push_back({"t", 1, 1, {1, 2, 3, 4}});
       },
       "texture 't' has 4 bytes for 1 x 1"},
      {[](Scene& s) { s.meshes[0].uvs.resize(3); }, "3 texture coordinates for 4 vertices"},
      {[](Scene& s) {
         s.point_lights.push_back({.axis = {0, 0, 2}});
       },
       "the axis of point light 0"},
      {[](Scene& s) {
         s.point_lights.push_back({.intensity = {0, -1, 0}});
       },
       "point light 0 has intensity -1"},
      {[](Scene& s) { s.point_lights.push_back({.cos_inner = 0.5f, .cos_outer = 0.6f}); },
       "point light 0 needs -1 <= cos_outer"},
      {[](Scene& s) {
         s.meshes[0].pose = [](float) { return Pose{}; };
         s.meshes[0].deform = [](float, std::span<glm::vec3>, std::span<glm::vec3>) {};
       },
       "moves rigidly and deforms"},
      {[](Scene& s) {
         s.meshes[0].pose = [](float) { return Pose{{{-1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {}}; };
       },
       "flattens or mirrors"},
      {[](Scene& s) { place(s.meshes[0], 1e-20f, 0.0f, {}); }, "scale it"},
      {[](Scene& s) { place(s.meshes[0], 1e20f, 0.0f, {}); }, "scale it"},
      {[](Scene& s) { s.meshes[0].positions.assign(4, glm::vec3(1.0f)); }, "only degenerate triangles"},
  };
  for (const auto& [spoil, expected] : cases) {
    const std::string said = complaint(spoil);
    EXPECT_NE(said.find(expected), std::string::npos)
        << "expected '" << expected << "', got '" << said << "'";
    EXPECT_EQ(said.find('\n'), std::string::npos);
  }
}

// A mesh that stands still, one that moves, and an instance of that one, which a test spoils.
TEST(ScenePrepare, InstancesAreOfAMovingMeshWithAShapeAndHaveNone) {
  const auto still = [](float) { return Pose{}; };
  const auto of_instance = [&](const std::function<void(Scene&, Mesh&)>& spoil) {
    return complaint([&](Scene& s) {
      s.meshes.push_back(quad("owner", {}, {1, 0, 0}, {0, 1, 0}, 0));
      s.meshes[1].pose = still;
      Mesh instance{"instance", {}, {}, {}, 0, {}, still, {}, 1};
      spoil(s, instance);
      s.meshes.push_back(std::move(instance));
    });
  };
  EXPECT_EQ(of_instance([](Scene&, Mesh&) {}), "");
  const std::pair<std::function<void(Scene&, Mesh&)>, const char*> cases[] = {
      {[](Scene&, Mesh& m) { m.instance_of = 7; }, "an instance of mesh 7, which has no shape"},
      {[](Scene&, Mesh& m) { m.instance_of = 2; }, "an instance of mesh 2, which has no shape"},
      {[](Scene&, Mesh& m) { m.instance_of = 0; }, "need a pose each"},
      {[](Scene&, Mesh& m) { m.pose = {}; }, "need a pose each"},
      {[](Scene&, Mesh& m) { m.triangles.emplace_back(0, 1, 2); }, "is an instance and has vertices"},
      {[](Scene&, Mesh& m) { m.positions.emplace_back(); }, "is an instance and has vertices"},
  };
  for (const auto& [spoil, expected] : cases) {
    const std::string said = of_instance(spoil);
    EXPECT_NE(said.find(expected), std::string::npos)
        << "expected '" << expected << "', got '" << said << "'";
  }
}

// Where an instance shows a shape larger, its small triangles have a surface.
TEST(ScenePrepare, TrianglesAreAsLargeAsTheLargestInstanceShowsThem) {
  const auto dropped = [](float scale) {
    Scene s = one_quad();
    Mesh owner = quad("owner", {}, {1e-7f, 0, 0}, {0, 1e-7f, 0}, 0);
    owner.pose = [](float) { return Pose{}; };
    const auto larger = [scale](float) { return Pose{glm::mat3(scale), {}}; };
    s.meshes.push_back(std::move(owner));
    s.meshes.push_back({"instance", {}, {}, {}, 0, {}, larger, {}, 1});
    prepare(s);
    return s.dropped_triangles;
  };
  EXPECT_EQ(dropped(1.0f), 2u);
  EXPECT_EQ(dropped(1e6f), 0u);
}

TEST(ScenePrepare, BrightnessIsThatOfAllPointLights) {
  const auto lit = [](int lights) {
    return complaint([&](Scene& s) {
      for (int i = 0; i < lights; ++i)
        s.point_lights.push_back({.p = {0.5f, 0.5f, 1.0f}, .intensity = glm::vec3(0.6e30f)});
    });
  };
  EXPECT_EQ(lit(1), "");
  EXPECT_NE(lit(2).find("too bright so close to the scene"), std::string::npos);
}

TEST(ScenePrepare, TheSceneIsThatOfFrameZero) {
  Scene s = one_quad();
  s.frames = 3;
  s.point_lights.push_back({.p = {0, 0, 1}, .intensity = glm::vec3(7)});
  s.change_light = [](float frame, std::span<Material> materials, std::span<PointLight> lights) {
    materials[0].albedo = glm::vec3(0.25f * frame);
    lights[0].intensity = glm::vec3(1 + frame);
  };
  s.meshes[0].deform = [](float frame, std::span<glm::vec3> positions, std::span<glm::vec3>) {
    positions[2] = {2, 2, frame};
  };
  prepare(s);
  EXPECT_EQ(s.materials[0].albedo, glm::vec3(0));
  EXPECT_EQ(s.point_lights[0].intensity, glm::vec3(1));
  EXPECT_EQ(s.meshes[0].positions[2], glm::vec3(2, 2, 0));
  EXPECT_NEAR(s.bounds.upper.z, 2.0f, 1e-3f) << "of all frames";
}

TEST(Scene, MirrorsAndGlassThatAreShownAreSpecular) {
  Scene s = one_quad();
  s.add_material({.surface = Surface::mirror});
  EXPECT_FALSE(s.has_specular()) << "no mesh has that material";
  for (const Surface surface : {Surface::mirror, Surface::dielectric}) {
    s.materials[0].surface = surface;
    EXPECT_TRUE(s.has_specular());
  }
}

TEST(ScenePrepare, DropsAndCountsDegenerateTriangles) {
  Scene s = one_quad();
  Mesh& mesh = s.meshes[0];
  mesh.positions.insert(mesh.positions.end(), {{0.5f, 0.5f, 0.0f}, {0.3f, 0.3f, 0.0f}, {0.0f, 1e-9f, 0.0f}});
  mesh.triangles.emplace_back(0, 0, 1);  // a point twice
  mesh.triangles.emplace_back(0, 4, 5);  // three points in line
  mesh.triangles.emplace_back(0, 1, 6);  // a sliver
  // Far away they do not make what is here small.
  mesh.positions.insert(mesh.positions.end(), {{9e5f, 0.0f, 0.0f}, {9e5f, 9e5f, 0.0f}, {9e5f, 4e5f, 0.0f}});
  mesh.triangles.emplace_back(7, 7, 8);
  mesh.triangles.emplace_back(7, 8, 9);
  prepare(s);
  EXPECT_EQ(s.dropped_triangles, 5u);
  EXPECT_EQ(s.meshes[0].triangles.size(), 2u);
  EXPECT_LT(s.bounds.upper.x, 1.001f);
  const Bounds bounds = s.bounds;
  prepare(s);
  EXPECT_EQ(s.dropped_triangles, 5u) << "prepare is not idempotent";
  EXPECT_EQ(s.bounds.lower, bounds.lower);
  EXPECT_EQ(s.bounds.upper, bounds.upper);
}

TEST(ScenePrepare, OfWhatMovesAPointCountsForNothingEither) {
  Scene s = one_quad();
  s.meshes[0].positions.emplace_back(9e5f, 0.0f, 0.0f);
  s.meshes[0].triangles.emplace_back(4, 4, 4);
  s.meshes[0].pose = [](float) { return Pose{}; };
  prepare(s);
  EXPECT_EQ(s.dropped_triangles, 1u);
  EXPECT_LT(s.bounds.upper.x, 1.001f);
}

TEST(ScenePrepare, BoundsHoldAllSurfacesButNotUnusedVertices) {
  Scene s = one_quad();
  s.meshes[0].positions.emplace_back(50.0f, 50.0f, 50.0f);
  prepare(s);
  for (int i = 0; i < 4; ++i) EXPECT_TRUE(s.bounds.contains(s.meshes[0].positions[i]));
  EXPECT_LT(s.bounds.upper.x, 1.001f);
}

TEST(SceneRegistry, EveryEntryPreparesWithoutALoss) {
  for (const SceneEntry& entry : kScenes) {
    Scene s = make_scene(entry.name);
    prepare(s);
    EXPECT_EQ(s.name, entry.name);
    EXPECT_EQ(s.dropped_triangles, 0u) << entry.name;
    EXPECT_FALSE(s.lights.empty()) << entry.name;
  }
}

TEST(SceneRegistry, AnUnknownNameIsAnsweredWithTheKnownOnes) {
  try {
    make_scene("cornel_box");
    FAIL() << "accepted";
  } catch (const std::runtime_error& e) {
    EXPECT_NE(std::string(e.what()).find("cornell_box"), std::string::npos);
  }
}

TEST(SceneShapes, SolidsAreClosedAndFaceOutward) {
  const Bounds unit{glm::vec3(-0.5f), glm::vec3(0.5f)};
  EXPECT_TRUE(is_closed(box("b", unit, 0)));
  EXPECT_NEAR(volume(box("b", unit, 0)), 1.0, 1e-6);
  EXPECT_NEAR(volume(box("b", unit, 0, true)), -1.0, 1e-6);
  const Mesh ball = icosphere("s", {3, 4, 5}, 2.0f, 4, 0);
  EXPECT_EQ(ball.triangles.size(), 20u * 256u);
  EXPECT_TRUE(is_closed(ball));
  EXPECT_NEAR(volume(ball), 32.0 / 3.0 * 3.14159265, 0.1);
}

TEST(SceneShapes, TheStatueIsClosedStandsOnTheGroundAndHasSmoothOutwardNormals) {
  const Mesh statue = venus(0);
  EXPECT_TRUE(is_closed(statue));
  EXPECT_GT(volume(statue), 0.0);
  const Bounds b = bounds_of(statue);
  EXPECT_NEAR(b.lower.y, 0.0f, 0.01f);
  EXPECT_NEAR(b.upper.y, 1.0f, 0.02f);
  std::size_t astray = 0;
  for (const glm::uvec3& t : statue.triangles) {
    const glm::vec3 ng = glm::cross(statue.positions[t.y] - statue.positions[t.x],
                                    statue.positions[t.z] - statue.positions[t.x]);
    astray += glm::dot(ng, statue.normals[t.x] + statue.normals[t.y] + statue.normals[t.z]) <= 0.0f;
  }
  EXPECT_LT(astray, statue.triangles.size() / 1000);
}

// Three emitting quads of different area and emission, one of them mirrored.
Scene three_lamps() {
  Scene s;
  s.name = "three_lamps";
  const float emissions[] = {1.0f, 5.0f, 0.25f};
  const float sides[] = {1.0f, 0.5f, 3.0f};
  for (int i = 0; i < 3; ++i) {
    const auto material = s.add_material({.emission = glm::vec3(emissions[i])});
    s.meshes.push_back(
        quad("lamp", {0, static_cast<float>(i), 0}, {sides[i], 0, 0}, {0, 0, sides[i]}, material));
  }
  prepare(s);
  return s;
}

TEST(SceneLights, DensityIntegratesToOne) {
  const Scene s = three_lamps();
  const double total = 1.0 * s.lights.pdf_area(glm::vec3(1.0f)) + 0.25 * s.lights.pdf_area(glm::vec3(5.0f)) +
                       9.0 * s.lights.pdf_area(glm::vec3(0.25f));
  EXPECT_NEAR(total, 1.0, 1e-6);
}

TEST(SceneLights, LampsAreDrawnInProportionToTheirPower) {
  const Scene s = three_lamps();
  const double power[] = {1.0, 1.25, 2.25};
  constexpr int kDraws = 100'000;
  int drawn[3] = {};
  Pcg32 random(1);
  for (int i = 0; i < kDraws; ++i) {
    const float u = random.uniform(), v = random.uniform(), w = random.uniform();
    const LightPoint point = s.lights.sample(u, v, w);
    ++drawn[static_cast<int>(point.p.y + 0.5f)];
    ASSERT_FLOAT_EQ(point.pdf_area, s.lights.pdf_area(point.emission));
  }
  for (int i = 0; i < 3; ++i) {
    const double share = power[i] / 4.5;
    EXPECT_NEAR(drawn[i], kDraws * share, 4.0 * std::sqrt(kDraws * share * (1.0 - share))) << "lamp " << i;
  }
}

TEST(SceneLights, PointsAreUniformOnALampAndLieOnIt) {
  const Scene s = three_lamps();
  Pcg32 random(2);
  int quarters[4] = {}, seen = 0;
  while (seen < 20'000) {
    const float u = random.uniform(), v = random.uniform(), w = random.uniform();
    const LightPoint point = s.lights.sample(u, v, w);
    if (point.p.y > 0.5f) continue;
    ASSERT_TRUE(s.bounds.contains(point.p));
    ++quarters[(point.p.x > 0.5f) + 2 * (point.p.z > 0.5f)];
    ++seen;
  }
  for (const int n : quarters) EXPECT_NEAR(n, seen / 4, 4.0 * std::sqrt(seen * 0.25 * 0.75));
}

TEST(SceneLights, TheLastRandomNumberStillDrawsALamp) {
  const Scene s = three_lamps();
  const float last = 1.0f - 0x1p-24f;
  EXPECT_TRUE(s.bounds.contains(s.lights.sample(last, last, last).p));
  EXPECT_TRUE(s.bounds.contains(s.lights.sample(0.0f, 0.0f, 0.0f).p));
}

}  // namespace
}  // namespace icbench
