// glTF files: what becomes of nodes, meshes, lights, cameras and animations.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "core/random.h"
#include "import_support.h"
#include "render/ray_tracer.h"
#include "scene/registry.h"
#include "scene_files.h"
#include "temporary_folder.h"

namespace icbench {
namespace {

using nlohmann::json;

constexpr double kPi = std::numbers::pi;

TEST(ImportGltf, TextAndBinaryGiveTheSameScene) {
  const ImportedScene a = import_gltf(spinning_cube()), b = import_text("scene.glb", spinning_cube().glb());
  ASSERT_EQ(a.scene.meshes.size(), b.scene.meshes.size());
  EXPECT_EQ(a.notes, b.notes);
  EXPECT_EQ(a.scene.materials, b.scene.materials);
  EXPECT_EQ(a.scene.point_lights, b.scene.point_lights);
  EXPECT_EQ(a.scene.camera, b.scene.camera);
  for (std::size_t i = 0; i < a.scene.meshes.size(); ++i) {
    EXPECT_EQ(a.scene.meshes[i].positions, b.scene.meshes[i].positions);
    EXPECT_EQ(a.scene.meshes[i].triangles, b.scene.meshes[i].triangles);
  }
}

TEST(ImportGltf, WhatFollowsABinaryFileIsNoneOfIt) {
  EXPECT_EQ(import_text("scene.glb", spinning_cube().glb() + "\n").scene.meshes.size(),
            import_gltf(spinning_cube()).scene.meshes.size());
}

TEST(ImportGltf, AnAnimatedFileRendersFrameByFrame) {
  ImportedScene imported = import_gltf(spinning_cube());
  EXPECT_EQ(imported.scene.frames, 48u);
  const tbb::global_control serial(tbb::global_control::max_allowed_parallelism, 1);
  RayTracer rays(std::move(imported.scene));
  Tracer tracer(rays);
  const float inf = std::numeric_limits<float>::infinity();
  for (const float frame : {0.0f, 6.0f, 12.0f, 30.0f, 47.0f}) {
    rays.go_to(frame);
    // The cube's side that a ray down the z axis meets: at 0.5 / cos of the angle from the nearest face.
    const double turned = std::fmod(frame / 24.0 * 0.5 * kPi + 0.25 * kPi, 0.5 * kPi) - 0.25 * kPi;
    const Hit spinner = tracer.intersect({{0, 0.6f, 1.9f}, inf, {0, 0, -1}});
    EXPECT_NEAR(spinner.p.z, 0.5 / std::cos(turned), 1e-5) << "frame " << frame;
    expect_near(rays.albedo(spinner), {0.8f, 0.4f, 0.1f}, 1e-6f);
    // The small one circles at 1.2 m, the other way round; seen from above. Half a turn a second.
    const double angle = -kPi * frame / 24.0;
    const float x = static_cast<float>(1.2 * std::cos(angle)), z = static_cast<float>(-1.2 * std::sin(angle));
    const Hit circling = tracer.intersect({{x, 1.4f, z}, inf, {0, -1, 0}});
    EXPECT_NEAR(circling.p.y, 0.5f, 1e-5f) << "frame " << frame;
  }
}

TEST(ImportGltf, InstancesOfAMovingMeshShareItsShape) {
  const Scene scene = import_gltf(spinning_cube()).scene;
  int owners = 0, instances = 0;
  for (const Mesh& mesh : scene.meshes) {
    if (!mesh.pose) continue;
    ++(mesh.instance_of == kOwnShape ? owners : instances);
  }
  EXPECT_EQ(owners, 1);
  EXPECT_EQ(instances, 1);
}

TEST(ImportGltf, NodesStandWhereTheirAncestorsPutThem) {
  GltfFile f;
  const auto cube = f.cube(f.material(json::object()));
  const auto leaf =
      GltfFile::append(f.doc["nodes"], {{"mesh", cube}, {"translation", {1, 0, 0}}, {"scale", {2, 2, 2}}});
  const auto turned = GltfFile::append(
      f.doc["nodes"],
      {{"children", {leaf}}, {"rotation", {0, 0, std::sqrt(0.5), std::sqrt(0.5)}}});  // x to y
  f.node({{"children", {turned}}, {"matrix", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1}}});
  Scene scene = import_gltf(f).scene;
  prepare(scene);
  const glm::vec3 centre = 0.5f * (scene.bounds.lower + scene.bounds.upper);
  expect_near(centre, {0, 1, 5}, 1e-5f);
  EXPECT_NEAR(volume(scene.meshes[0]), 8.0, 1e-4);
}

TEST(ImportGltf, MirroredNodesKeepTheirFrontsOutside) {
  for (const bool moving : {false, true}) {
    GltfFile f = grey_cube();
    f.doc["nodes"][0]["scale"] = {-1, 2, 1};
    f.doc["nodes"][0]["translation"] = {3, 0, 0};
    if (moving) f.animate(0, "translation", f.scalars({0, 1}), f.vec3s({3, 0, 0, 4, 0, 0}));
    Scene scene = import_gltf(f).scene;
    prepare(scene);
    const Mesh& mesh = scene.meshes[0];
    EXPECT_EQ(static_cast<bool>(mesh.pose), moving);
    EXPECT_NEAR(volume(mesh, mesh.pose ? mesh.pose(0.0f) : Pose{}), 2.0, 1e-5);
  }
}

TEST(ImportGltf, KeysAreInterpolatedAsTheySay) {
  const auto at = [](const char* way, std::vector<float> values, float frame) {
    GltfFile f = grey_cube();
    f.animate(0, "translation", f.scalars({0, 1}), f.vec3s(values), way);
    return import_gltf(f).scene.meshes[0].pose(frame).shift.x;
  };
  EXPECT_NEAR(at("LINEAR", {0, 0, 0, 4, 0, 0}, 6.0f), 1.0f, 1e-6f);
  EXPECT_NEAR(at("STEP", {0, 0, 0, 4, 0, 0}, 23.0f), 0.0f, 1e-6f);
  EXPECT_NEAR(at("STEP", {0, 0, 0, 4, 0, 0}, 24.0f), 4.0f, 1e-6f);
  // From 0 to 4 with slopes of 2 and -3 a second: at a quarter, 0.15625 * 4 + 0.140625 * 2 + 0.046875 * 3.
  EXPECT_NEAR(at("CUBICSPLINE", {0, 0, 0, 0, 0, 0, 2, 0, 0, -3, 0, 0, 4, 0, 0, 0, 0, 0}, 6.0f), 1.046875f,
              1e-5f);
}

// Of keys at the times of frames, rounded to floats, each step comes with its frame.
TEST(ImportGltf, StepsComeWithTheirFrames) {
  GltfFile f = grey_cube();
  std::vector<float> times, values;
  for (int k = 0; k < 2400; ++k) {
    times.push_back(static_cast<float>(k / 24.0));
    values.insert(values.end(), {static_cast<float>(k), 0, 0});
  }
  f.animate(0, "translation", f.scalars(times), f.vec3s(values), "STEP");
  const Scene scene = import_gltf(f).scene;
  for (int k = 0; k < 2400; ++k)
    EXPECT_FLOAT_EQ(scene.meshes[0].pose(static_cast<float>(k)).shift.x, static_cast<float>(k));
}

// What is small for a moment is not degenerate.
TEST(ImportGltf, AMeshThatGrowsKeepsItsTriangles) {
  for (const bool grows : {true, false}) {
    GltfFile f;
    std::vector<float> positions;
    std::vector<std::uint16_t> triangles;
    constexpr int kSide = 200;
    for (int y = 0; y <= kSide; ++y)
      for (int x = 0; x <= kSide; ++x)
        positions.insert(positions.end(), {static_cast<float>(x) / kSide, static_cast<float>(y) / kSide, 0});
    for (int y = 0; y < kSide; ++y)
      for (int x = 0; x < kSide; ++x) {
        const auto v = static_cast<std::uint16_t>(y * (kSide + 1) + x);
        const auto up = static_cast<std::uint16_t>(v + kSide + 1);
        triangles.insert(triangles.end(), {v, static_cast<std::uint16_t>(v + 1), up});
      }
    const auto grey = f.material(json::object());
    const auto node = f.node({{"mesh", f.mesh(f.vec3s(positions), f.indices(triangles), grey)}});
    f.node({{"mesh", f.square(grey)}, {"scale", {20, 20, 20}}});
    f.animate(node, "scale", f.scalars({0, 1}),
              f.vec3s(grows ? std::vector<float>{0, 0, 0, 1, 1, 1} : std::vector<float>{1, 1, 1, 0, 0, 0}));
    ImportedScene imported = import_gltf(f);
    prepare(imported.scene);
    EXPECT_EQ(imported.scene.dropped_triangles, 0u) << grows;
  }
}

TEST(ImportGltf, ACameraFarAwayLooksWhereItIsToldTo) {
  GltfFile f = grey_cube();
  f.doc["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 0.002}, {"znear", 0.1}}}}};
  const double half = 0.5 * std::atan2(3.0, 4.0);  // turned about y toward the cube
  f.node({{"camera", 0},
          {"translation", {30'000, 0, 40'000}},
          {"rotation", {0, std::sin(half), 0, std::cos(half)}}});
  const Camera c = import_gltf(f).scene.camera;
  EXPECT_LE(
      glm::distance(glm::normalize(glm::dvec3(c.target) - glm::dvec3(c.eye)), glm::dvec3(-0.6, 0, -0.8)),
      1e-6);
}

TEST(ImportGltf, AChannelThatDoesNotChangeIsNoMotion) {
  GltfFile f = grey_cube();
  f.animate(0, "translation", f.scalars({0, 1}), f.vec3s({3, 0, 0, 3, 0, 0}));
  const Scene scene = import_gltf(f).scene;
  EXPECT_FALSE(scene.moves());
  EXPECT_EQ(scene.frames, 1u);
  EXPECT_NEAR(scene.meshes[0].positions[0].x, 2.5f, 1e-6f);
}

TEST(ImportGltf, AScaleThroughZeroIsKeptFromIt) {
  GltfFile f = grey_cube();
  f.animate(0, "scale", f.scalars({0, 1}), f.vec3s({1, 1, 1, 0, 0, 0}));
  ImportedScene imported = import_gltf(f);
  EXPECT_TRUE(has_note(imported, "scale that passes through zero"));
  EXPECT_NO_THROW(prepare(imported.scene));
}

// A spinning parent below which a cube has one more node, which a test flattens.
GltfFile flattened_cube(const json& flattening, const json& leaf) {
  GltfFile f = grey_cube();
  json bottom = leaf;
  bottom["mesh"] = 0;
  json middle = flattening;
  middle["children"] = {GltfFile::append(f.doc["nodes"], bottom)};
  const auto flat = GltfFile::append(f.doc["nodes"], middle);
  const auto parent = f.node({{"children", {flat}}});
  const float h = std::sqrt(0.5f);
  f.animate(parent, "rotation", f.scalars({0, 1}), f.vec4s({0, 0, 0, 1, h, 0, 0, h}));
  return f;
}

TEST(ImportGltf, AMovingMeshOfScaleZeroIsLeftOut) {
  const json turned = {{"rotation", {0.1, 0.2, 0.3, std::sqrt(0.86)}}};
  for (const json& flat :
       {json{{"scale", {0, 0, 0}}}, json{{"scale", {1, 0, 1}}}, json{{"scale", {1e-20, 1e-20, 1e-20}}},
        json{{"matrix", {1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}}}}) {
    ImportedScene imported = import_gltf(flattened_cube(flat, turned));
    EXPECT_EQ(error_of([&] { prepare(imported.scene); }), "") << flat;
    EXPECT_EQ(imported.scene.meshes.size(), 1u) << flat;
    EXPECT_TRUE(has_note(imported, "moving meshes of scale 0")) << flat;
  }
  ImportedScene shown = import_gltf(flattened_cube({{"scale", {1e-3, 1, 1}}}, turned));
  EXPECT_EQ(shown.scene.meshes.size(), 2u) << "what is thin alone is left out";
  EXPECT_NO_THROW(prepare(shown.scene));
}

TEST(ImportGltf, FramesAreCapped) {
  GltfFile f = grey_cube();
  f.animate(0, "translation", f.scalars({0, 1e9f}), f.vec3s({0, 0, 0, 1, 0, 0}));
  const ImportedScene imported = import_gltf(f);
  EXPECT_EQ(imported.scene.frames, kMaxFrames);
  EXPECT_TRUE(has_note(imported, "cut to 10000 frames"));
}

GltfFile cube_and_light(const json& light, const json& node) {
  GltfFile f = grey_cube();
  f.doc["extensions"]["KHR_lights_punctual"]["lights"] = json::array({light});
  json lit = node;
  lit["extensions"] = {{"KHR_lights_punctual", {{"light", 0}}}};
  f.node(lit);
  return f;
}

TEST(ImportGltf, PointAndSpotLightsShineFromTheirNodes) {
  const Scene point =
      import_gltf(cube_and_light({{"type", "point"}, {"color", {1, 0.5, 0}}, {"intensity", 8}},
                                 {{"translation", {1, 2, 3}}}))
          .scene;
  ASSERT_EQ(point.point_lights.size(), 1u);
  EXPECT_EQ(point.point_lights[0], (PointLight{.p = {1, 2, 3}, .intensity = {8, 4, 0}, .axis = {0, 0, -1}}));
  const Scene spot =
      import_gltf(
          cube_and_light({{"type", "spot"}, {"spot", {{"innerConeAngle", 0.25}, {"outerConeAngle", 0.5}}}},
                         {{"rotation", {-std::sqrt(0.5), 0, 0, std::sqrt(0.5)}}}))
          .scene;
  expect_near(spot.point_lights[0].axis, {0, -1, 0}, 1e-6f);
  EXPECT_NEAR(spot.point_lights[0].cos_inner, std::cos(0.25), 1e-6);
  EXPECT_NEAR(spot.point_lights[0].cos_outer, std::cos(0.5), 1e-6);
  const auto cone = [](const json& angles) {
    const Scene s = import_gltf(cube_and_light({{"type", "spot"}, {"spot", angles}}, json::object())).scene;
    return glm::vec2(s.point_lights[0].cos_inner, s.point_lights[0].cos_outer);
  };
  EXPECT_LT(glm::distance(cone(json::object()), {1.0f, std::sqrt(0.5f)}), 1e-6f)
      << "what a file may leave out";
  EXPECT_LT(glm::distance(cone({{"innerConeAngle", 1}, {"outerConeAngle", 0.5}}), glm::vec2(std::cos(0.5f))),
            1e-6f);
}

TEST(ImportGltf, ADirectionalLightGivesItsIrradianceAtTheCentre) {
  const ImportedScene imported =
      import_gltf(cube_and_light({{"type", "directional"}, {"intensity", 3}}, json::object()));
  const PointLight& sun = imported.scene.point_lights[0];
  EXPECT_GT(sun.p.z, 40.0f);
  EXPECT_NEAR(sun.intensity.x / glm::dot(sun.p, sun.p), 3.0f, 1e-4f);
  // It shines on all of the cube, evenly, and hardly past its sphere, or nearly all light paths would miss it.
  Scene scene = imported.scene;
  prepare(scene);
  const Bounds& box = scene.bounds;
  for (int corner = 0; corner < 8; ++corner) {
    const glm::vec3 p((corner & 1) != 0 ? box.upper.x : box.lower.x,
                      (corner & 2) != 0 ? box.upper.y : box.lower.y,
                      (corner & 4) != 0 ? box.upper.z : box.lower.z);
    EXPECT_EQ(spot_falloff(sun, glm::dot(glm::normalize(p - sun.p), sun.axis)), 1.0f);
  }
  Pcg32 random(1);
  int met = 0;
  float nearest = 1.0f;
  for (int i = 0; i < 10'000; ++i) {
    const EmittedRay ray = scene.lights.emit(random.uniform(), random.uniform(), random.uniform(),
                                             random.uniform(), random.uniform());
    const glm::vec3 centre = 0.5f * (box.lower + box.upper);
    const float beside = glm::length(glm::cross(ray.d, centre - ray.p));
    met += beside < 0.5f * glm::length(box.upper - box.lower) ? 1 : 0;
    nearest = std::min(nearest, beside);
  }
  EXPECT_GT(met, 9'900);
  EXPECT_LT(nearest, 0.02f) << "directions lie on rings";
  EXPECT_TRUE(has_note(imported, "directional"));
}

TEST(ImportGltf, LightsAndCamerasMoveWithTheirNodes) {
  GltfFile f = cube_and_light({{"type", "point"}}, json::object());
  f.doc["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 0.5}, {"znear", 0.1}}}}};
  f.node({{"camera", 0}});
  const auto times = f.scalars({0, 1});
  f.animate(1, "translation", times, f.vec3s({0, 0, 2, 0, 0, 4}));
  f.animate(2, "translation", times, f.vec3s({0, 0, 5, 0, 0, 9}));
  Scene scene = import_gltf(f).scene;
  ASSERT_TRUE(scene.change_light && scene.camera_path);
  scene.change_light(12.0f, scene.materials, scene.point_lights);
  expect_near(scene.point_lights[0].p, {0, 0, 3}, 1e-6f);
  const Camera camera = scene.camera_path(12.0f);
  expect_near(camera.eye, {0, 0, 7}, 1e-6f);
  expect_near(glm::normalize(camera.target - camera.eye), {0, 0, -1}, 1e-6f);
  EXPECT_FLOAT_EQ(camera.fov_y, 0.5f);
}

TEST(ImportGltf, OfTwoCamerasTheFirstIsUsed) {
  GltfFile f = grey_cube();
  for (const double yfov : {0.5, 0.25})
    f.doc["cameras"].push_back({{"type", "perspective"}, {"perspective", {{"yfov", yfov}, {"znear", 0.1}}}});
  for (const int camera : {1, 0}) f.node({{"camera", camera}, {"translation", {0, 0, 4 + camera}}});
  const ImportedScene imported = import_gltf(f);
  EXPECT_TRUE(has_note(imported, "has 2 cameras; the first is used"));
  EXPECT_FLOAT_EQ(imported.scene.camera.fov_y, 0.25f);
  expect_near(imported.scene.camera.eye, {0, 0, 5}, 1e-6f);
}

TEST(ImportGltf, WithoutCameraAndLightTheWholeSceneIsSeenAndLit) {
  ImportedScene imported = import_gltf(grey_cube());
  EXPECT_TRUE(has_note(imported, "no camera"));
  EXPECT_TRUE(has_note(imported, "no light"));
  const Camera& c = imported.scene.camera;
  const glm::vec3 forward = glm::normalize(c.target - c.eye);
  for (int i = 0; i < 8; ++i) {
    const glm::vec3 p(i & 1 ? 0.5f : -0.5f, i & 2 ? 0.5f : -0.5f, i & 4 ? 0.5f : -0.5f);
    EXPECT_GE(glm::dot(glm::normalize(p - c.eye), forward), std::cos(0.5f * c.fov_y)) << "corner " << i;
  }
  const PointLight& light = imported.scene.point_lights.at(0);
  EXPECT_NEAR(light.intensity.x / glm::dot(light.p, light.p), kPi, 1e-4);
  EXPECT_NO_THROW(prepare(imported.scene));
}

TEST(ImportGltf, ASceneFarFromItsOriginKeepsItsShape) {
  GltfFile f = grey_cube();
  f.doc["nodes"][0]["translation"] = {6.4e6, 0, 1e7};
  f.doc["nodes"][0]["scale"] = {0.01, 0.01, 0.01};
  ImportedScene imported = import_gltf(f);
  EXPECT_TRUE(has_note(imported, "far from its origin"));
  EXPECT_NEAR(volume(imported.scene.meshes[0]), 1e-6, 1e-10);
  EXPECT_NO_THROW(prepare(imported.scene));
}

TEST(ImportGltf, WhatIsNotSeenDoesNotKeepAFarSceneWhereItIs) {
  GltfFile far = grey_cube();
  far.doc["nodes"][0]["translation"] = {1e5, 0, 0};
  const glm::vec3 first = import_gltf(far).scene.meshes[0].positions[0];
  GltfFile hidden = far;
  hidden.node({{"mesh", 0}, {"scale", {0, 0, 0}}});
  GltfFile unused = far;
  const auto grey = unused.material(json::object());
  unused.node({{"mesh", unused.mesh(unused.vec3s({0, 0, 0, 1e5f, 0, 0, 1e5f, 0.5f, 0, 1e5f, 0.5f, 0.5f}),
                                    unused.indices({1, 2, 3}), grey)}});
  GltfFile flat = far;
  flat.node({{"mesh", flat.mesh(flat.vec3s({0, 0, 0, 1e5f, 0, 0, 5e4f, 0, 0}), flat.indices({0, 1, 2}), 0)}});
  for (const GltfFile& f : {hidden, unused, flat}) {
    const ImportedScene imported = import_gltf(f);
    EXPECT_TRUE(has_note(imported, "far from its origin"));
    EXPECT_EQ(imported.scene.meshes[0].positions[0], first);
  }
  GltfFile nothing;
  nothing.node({{"mesh", nothing.cube(nothing.material(json::object()))}, {"scale", {0, 0, 0}}});
  EXPECT_NE(error_of([&] { import_gltf(nothing); }).find("no triangle with a surface"), std::string::npos);
}

TEST(ImportGltf, MovingMeshesMayBeOfAnyUnits) {
  std::vector<Mesh> meshes;
  for (const float unit : {1.0f, 0x1p-40f, 0x1p40f}) {
    GltfFile f;
    const auto mesh = f.cube(f.material(json::object()));
    std::vector<float> corners;
    for (int c = 0; c < 8; ++c)
      for (int axis = 0; axis < 3; ++axis) corners.push_back((c >> axis & 1 ? 0.5f : -0.5f) * unit);
    f.doc["meshes"][mesh]["primitives"][0]["attributes"]["POSITION"] = f.vec3s(corners);
    const auto node = f.node({{"mesh", mesh}, {"scale", {-1 / unit, 1 / unit, 1 / unit}}});
    f.animate(node, "translation", f.scalars({0, 1}), f.vec3s({0, 0, 0, 1, 0, 0}));
    ImportedScene imported = import_gltf(f);
    prepare(imported.scene);
    meshes.push_back(imported.scene.meshes.at(0));
    const Mesh& m = meshes.back();
    EXPECT_NEAR(volume(m, m.pose(3.0f)), 1.0, 1e-6) << unit;
    for (const glm::vec3& p : m.positions) {
      EXPECT_GE(glm::length(p), 0.5f) << unit;
      EXPECT_LE(glm::length(p), 2.0f) << unit;
    }
    for (std::size_t v = 0; v < m.positions.size(); ++v)
      expect_near(m.pose(3.0f)(m.positions[v]), meshes[0].pose(3.0f)(meshes[0].positions[v]), 1e-6f);
  }
}

TEST(ImportGltf, StripsFansListsAndSparseAccessorsAreRead) {
  const auto area_of = [](const std::function<void(GltfFile&, json & primitive)>& change) {
    GltfFile f;
    f.node({{"mesh", f.square(f.material(json::object()))}});
    json primitive = f.doc["meshes"][0]["primitives"][0];
    change(f, primitive);
    f.doc["meshes"][0]["primitives"][0] = primitive;
    return area(import_gltf(f).scene.meshes[0]).z;
  };
  EXPECT_NEAR(area_of([](GltfFile&, json&) {}), 1.0, 1e-6);
  EXPECT_NEAR(area_of([](GltfFile& f, json& p) {
                p["mode"] = 5;
                p["indices"] = f.indices({0, 1, 3, 2});
              }),
              1.0, 1e-6);
  EXPECT_NEAR(area_of([](GltfFile& f, json& p) {
                p["mode"] = 6;
                p["indices"] = f.indices({0, 1, 2, 3});
              }),
              1.0, 1e-6);
  EXPECT_NEAR(area_of([](GltfFile&, json& p) { p.erase("indices"); }), 0.5, 1e-6);
  EXPECT_NEAR(area_of([](GltfFile& f, json& p) {  // two corners of nothing but zeros are moved
                const auto where = f.view(std::string("\0\1", 2));
                const float moved[] = {-3, 0, 0, 0, -2, 0};
                const auto what = f.view({reinterpret_cast<const char*>(moved), sizeof moved});
                p["attributes"]["POSITION"] = GltfFile::append(
                    f.doc["accessors"], {{"componentType", 5126},
                                         {"count", 3},
                                         {"type", "VEC3"},
                                         {"sparse",
                                          {{"count", 2},
                                           {"indices", {{"bufferView", where}, {"componentType", 5121}}},
                                           {"values", {{"bufferView", what}}}}}});
                p["indices"] = f.indices({0, 1, 2});
              }),
              3.0, 1e-6);
}

TEST(ImportGltf, WhatIsLeftOutIsNamedOnce) {
  GltfFile f = spinning_cube();
  f.doc["nodes"][0]["skin"] = 0;
  for (json& material : f.doc["materials"]) material["normalTexture"] = {{"index", 0}};
  const ImportedScene imported = import_gltf(f);
  EXPECT_TRUE(has_note(imported, "skinning"));
  EXPECT_TRUE(has_note(imported, "normal maps (4 times)"));
  EXPECT_EQ(std::count_if(imported.notes.begin(), imported.notes.end(),
                          [](const std::string& n) { return n.starts_with("left out:"); }),
            1);
}

TEST(ImportGltf, WhatIsApproximatedIsNamed) {
  GltfFile f = spinning_cube();
  f.doc["materials"][0]["pbrMetallicRoughness"]["metallicFactor"] = 1.0;
  f.doc["materials"][0]["pbrMetallicRoughness"]["roughnessFactor"] = 0.4;
  f.doc["materials"][1]["alphaMode"] = "BLEND";
  f.doc["materials"][1]["pbrMetallicRoughness"]["baseColorFactor"] = {1.0, 1.0, 1.0, 0.3};
  f.doc["scenes"] = json::array({f.doc["scenes"][0], f.doc["scenes"][0]});
  f.doc["textures"] = json::array({json::object()});
  const ImportedScene imported = import_gltf(f);
  EXPECT_TRUE(has_note(imported, "gloss of rough metals"));
  EXPECT_TRUE(has_note(imported, "textures without a picture"));
  EXPECT_TRUE(has_note(imported, "alpha below 0.5 count as glass"));
  EXPECT_TRUE(has_note(imported, "scenes beside the one that is shown"));
  const ImportedScene plain = import_gltf(spinning_cube());
  for (const char* note : {"gloss", "as glass", "scenes beside", "without a picture"})
    EXPECT_FALSE(has_note(plain, note)) << note;
}

TEST(ImportGltf, ATextureWithoutCoordinatesIsNamed) {
  GltfFile f = spinning_cube();
  for (json& mesh : f.doc["meshes"]) mesh["primitives"][0]["attributes"].erase("TEXCOORD_0");
  EXPECT_TRUE(has_note(import_gltf(f), "without texture coordinates"));
  EXPECT_FALSE(has_note(import_gltf(spinning_cube()), "without texture coordinates"));
}

TEST(ImportRegistry, MakeSceneTakesFilesAndKeepsItsErrors) {
  const TemporaryFolder folder;
  write(folder / "cube.gltf", grey_cube().text());
  std::vector<std::string> notes;
  EXPECT_EQ(make_scene((folder / "cube.gltf").string(), &notes).meshes.size(), 1u);
  EXPECT_FALSE(notes.empty());
  EXPECT_TRUE(is_one_line_with(error_of([] { make_scene("cornel_box"); }), "cornell_box"));
  EXPECT_TRUE(
      is_one_line_with(error_of([&] { make_scene((folder / "absent.gltf").string()); }), "absent.gltf"));
  EXPECT_TRUE(
      is_one_line_with(error_of([&] { make_scene((folder / "scene.txt").string()); }), "convert the scene"));
}

}  // namespace
}  // namespace icbench
