// A small animated room in which everything that can change does, each kind in a scene of its own.
#pragma once

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "scene/scene.h"
#include "scene/shapes.h"

namespace icbench {

struct Animations {
  bool rigid = false, deforming = false, light = false, material = false, camera = false;
};

/// A room of diffuse walls with a lamp below the ceiling, a still block and a still ball.
inline Scene animated_room(const Animations& a, std::uint32_t frames = 16) {
  Scene s;
  s.name = "animated_room";
  s.frames = frames;
  const float turn = 2.0f * std::numbers::pi_v<float> / static_cast<float>(frames);
  const auto white = s.add_material({.albedo = glm::vec3(0.7f)});
  const auto red = s.add_material({.albedo = {0.7f, 0.2f, 0.1f}});
  const auto lamp = s.add_material({.emission = glm::vec3(20.0f)});
  s.meshes.push_back(box("room", {{-1.0f, 0.0f, -1.0f}, {1.0f, 2.0f, 1.0f}}, white, true));
  s.meshes.push_back(quad("lamp", {-0.3f, 1.99f, -0.3f}, {0.6f, 0, 0}, {0, 0, 0.6f}, lamp));
  s.meshes.push_back(box("block", {{-0.7f, 0.0f, -0.6f}, {-0.3f, 0.7f, -0.2f}}, red));
  s.meshes.push_back(icosphere("ball", {0.5f, 0.3f, -0.4f}, 0.25f, 2, white));
  if (a.rigid) {
    Mesh moving = box("moving", {{-0.15f, -0.15f, -0.15f}, {0.15f, 0.15f, 0.15f}}, red);
    moving.pose = [turn](float frame) {
      const float c = std::cos(turn * frame), d = std::sin(turn * frame);
      return Pose{{{c, 0, -d}, {0, 1, 0}, {d, 0, c}}, {0.5f * c, 0.5f + 0.2f * d, 0.5f * d}};
    };
    s.meshes.push_back(moving);
  }
  if (a.deforming) {
    Mesh flag = icosphere("flag", {0.0f, 1.2f, 0.0f}, 0.2f, 2, white);
    flag.deform = [turn, rest = flag.positions](float frame, std::span<glm::vec3> positions,
                                                std::span<glm::vec3>) {
      for (std::size_t i = 0; i < rest.size(); ++i)
        positions[i] = rest[i] + glm::vec3(0.1f * std::sin(turn * frame + 5.0f * rest[i].y), 0, 0);
    };
    s.meshes.push_back(flag);
  }
  if (a.light || a.material) {
    s.change_light = [a, turn, red, lamp](float frame, std::span<Material> materials, std::span<PointLight>) {
      if (a.light) materials[lamp].emission = glm::vec3(20.0f + 10.0f * std::sin(turn * frame));
      if (a.material) materials[red].albedo.y = 0.3f + 0.2f * std::sin(turn * frame);
    };
  }
  s.camera = {.eye = {0.0f, 1.0f, 0.95f}, .target = {0.0f, 0.7f, -0.3f}, .up = {0, 1, 0}, .fov_y = 1.1f};
  if (a.camera) {
    s.camera_path = [turn, rest = s.camera](float frame) {
      Camera c = rest;
      c.eye.x = 0.5f * std::sin(turn * frame);
      c.target.x = 0.9f * std::cos(turn * frame);
      return c;
    };
  }
  return s;
}

struct NamedScene {
  std::string name;
  Scene scene;
};

inline std::vector<NamedScene> animated_rooms() {
  return {
      {"rigid", animated_room({.rigid = true})},   {"deforming", animated_room({.deforming = true})},
      {"light", animated_room({.light = true})},   {"material", animated_room({.material = true})},
      {"camera", animated_room({.camera = true})}, {"all", animated_room({true, true, true, true, true})}};
}

}  // namespace icbench
