// Keys of what light and pictures depend on: all of that changes them, and nothing else.
#include <gtest/gtest.h>

#include <cstdint>
#include <functional>
#include <glm/matrix.hpp>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "scene/scene.h"
#include "scene/shapes.h"

namespace icbench {
namespace {

Scene one_quad() {
  Scene s;
  s.add_material({.albedo = glm::vec3(0.5f)});
  s.meshes.push_back(quad("q", {}, {1, 0, 0}, {0, 1, 0}, 0));
  return s;
}

TEST(SceneKeys, KnowWhereThingsStandAtAFrameAndHowTheCameraLooks) {
  const auto scene = [](float reach, float camera) {
    Scene s = one_quad();
    s.frames = 4;
    s.meshes[0].pose = [=](float frame) {
      return Pose{glm::mat3(1.0f), glm::vec3(reach * frame, 0.0f, 0.0f)};
    };
    s.camera_path = [=, still = s.camera](float frame) {
      Camera c = still;
      c.fov_y += camera * frame;
      return c;
    };
    return s;
  };
  const Scene a = scene(0.1f, 0.0f), other_motion = scene(0.2f, 0.0f), other_view = scene(0.1f, 0.1f);
  EXPECT_EQ(light_key(a, 0), light_key(other_motion, 0));
  EXPECT_NE(light_key(a, 1), light_key(other_motion, 1));
  EXPECT_EQ(light_key(a, 1), light_key(other_view, 1));
  EXPECT_NE(picture_key(a, 1), picture_key(other_view, 1));
  EXPECT_EQ(picture_key(a, 0), picture_key(other_view, 0));
  Scene renamed = a;
  renamed.name = "another";
  EXPECT_EQ(picture_key(a, 2), picture_key(renamed, 2));
}

// A glass quad and two moving ones, one of them an instance, textured and lit by a spot light.
Scene one_of_everything() {
  Scene s = one_quad();
  s.frames = 4;
  s.textures.push_back({"t", 2, 1, {1, 2, 3, 4, 5, 6}});
  s.add_material({.albedo = glm::vec3(1), .texture = 0});
  s.materials[0].surface = Surface::dielectric;
  s.meshes.push_back(quad("owner", {}, {1, 0, 0}, {0, 1, 0}, 1));
  s.meshes[1].uvs.resize(4);
  s.meshes[1].pose = [](float) { return Pose{}; };
  s.meshes.push_back({"instance", {}, {}, {}, 1, {}, s.meshes[1].pose, {}, 1});
  s.point_lights.push_back({{0, 0, 1}, glm::vec3(1), {0, 0, -1}, 0.9f, 0.5f});
  return s;
}

TEST(SceneKeys, EverythingThatLightDependsOnChangesThem) {
  const std::vector<std::function<void(Scene&)>> changes = {
      [](Scene& s) { s.materials[0].albedo.z = 0.25f; },
      [](Scene& s) { s.materials[1].emission.y = 1.0f; },
      [](Scene& s) { s.materials[0].surface = Surface::mirror; },
      [](Scene& s) { s.materials[0].ior = 1.25f; },
      [](Scene& s) { s.materials[1].texture = kNoTexture; },
      [](Scene& s) { s.add_material({}); },
      [](Scene& s) { s.meshes[0].positions[3].x += 0.5f; },
      [](Scene& s) {
        s.meshes[0].normals.assign(4, {0, 0, 1});
      },
      [](Scene& s) { std::swap(s.meshes[0].triangles[0].x, s.meshes[0].triangles[0].y); },
      [](Scene& s) { s.meshes[0].material = 1; },
      [](Scene& s) { s.meshes[1].uvs[2].y = 0.5f; },
      [](Scene& s) { s.meshes[0].pose = [](float) { return Pose{}; }; },
      [](Scene& s) { s.meshes[2].instance_of = 0; },
      [](Scene& s) { s.meshes[2].pose = [](float) {
                       return Pose{glm::mat3(2.0f), {}};
                     }; },
      [](Scene& s) {
        s.meshes[0].deform = [](float frame, std::span<glm::vec3> p, std::span<glm::vec3>) {
          p[0].z = frame;
        };
      },
      [](Scene& s) { s.point_lights[0].p.y = 0.5f; },
      [](Scene& s) { s.point_lights[0].intensity.x = 2.0f; },
      [](Scene& s) {
        s.point_lights[0].axis = {0, 1, 0};
      },
      [](Scene& s) { s.point_lights[0].cos_inner = 0.8f; },
      [](Scene& s) { s.point_lights[0].cos_outer = 0.4f; },
      [](Scene& s) {
        s.change_light = [](float frame, std::span<Material> materials, std::span<PointLight>) {
          materials[1].albedo.x = 1.0f - 0.125f * frame;
        };
      },
      [](Scene& s) {
        s.change_light = [](float frame, std::span<Material>, std::span<PointLight> lights) {
          lights[0].p.x = frame;
        };
      },
      [](Scene& s) { s.textures[0].texels[5] = 7; },
      [](Scene& s) { std::swap(s.textures[0].width, s.textures[0].height); },
  };
  std::set<std::uint64_t> seen = {light_key(one_of_everything(), 1)};
  for (std::size_t i = 0; i < changes.size(); ++i) {
    Scene s = one_of_everything();
    changes[i](s);
    EXPECT_TRUE(seen.insert(light_key(s, 1)).second) << "change " << i << " is not noticed";
  }
  EXPECT_TRUE(seen.insert(light_key(one_of_everything(), 2)).second) << "the frame";
}

TEST(SceneKeys, EverythingOfTheCameraChangesThePictureAlone) {
  const std::vector<std::function<void(Camera&)>> changes = {
      [](Camera& c) { c.eye.x += 1.0f; }, [](Camera& c) { c.target.y += 1.0f; },
      [](Camera& c) { c.up.x += 0.5f; }, [](Camera& c) { c.fov_y += 0.1f; }};
  const Scene first = one_of_everything();
  std::set<std::uint64_t> seen = {picture_key(first, 1)};
  for (const auto& change : changes) {
    Scene s = one_of_everything();
    change(s.camera);
    EXPECT_TRUE(seen.insert(picture_key(s, 1)).second);
    EXPECT_EQ(light_key(s, 1), light_key(first, 1));
  }
}

}  // namespace
}  // namespace icbench
