// Mirrors and glass for tests: materials, and a gallery of them.
#pragma once

#include <glm/geometric.hpp>

#include "scene/scene.h"
#include "scene/shapes.h"

namespace icbench {

inline constexpr Material kGlass{.albedo = glm::vec3(1.0f), .surface = Surface::dielectric, .ior = 1.5f};
inline constexpr Material kMirror{.albedo = glm::vec3(1.0f), .surface = Surface::mirror};

// A room with an area lamp, a point light and a spot light, a mirror ball, a tinted glass ball and a diffuse one.
inline Scene gallery() {
  Scene s;
  const auto white = s.add_material({.albedo = {0.7f, 0.7f, 0.6f}});
  const auto lamp = s.add_material({.emission = {8.0f, 7.0f, 6.0f}});
  const auto glass = s.add_material({.albedo = {0.9f, 1.0f, 0.9f}, .surface = Surface::dielectric});
  const auto mirror = s.add_material({.albedo = {0.9f, 0.8f, 0.7f}, .surface = Surface::mirror});
  s.meshes.push_back(box("room", {{-1, 0, -1}, {1, 2, 1}}, white, true));
  s.meshes.push_back(quad("lamp", {-0.3f, 1.98f, -0.3f}, {0.6f, 0.0f, 0.0f}, {0.0f, 0.0f, 0.6f}, lamp));
  s.meshes.push_back(icosphere("glass", {-0.4f, 0.6f, 0.0f}, 0.3f, 2, glass));
  s.meshes.push_back(icosphere("mirror", {0.4f, 0.5f, -0.3f}, 0.35f, 2, mirror));
  s.meshes.push_back(icosphere("plaster", {0.1f, 0.3f, 0.4f}, 0.2f, 2, white));
  s.point_lights.push_back({.p = {0.8f, 1.5f, 0.7f}, .intensity = {0.3f, 0.2f, 0.1f}});
  s.point_lights.push_back(
      {{-0.7f, 1.6f, 0.6f}, {1, 1, 2}, glm::normalize(glm::vec3(1, -2, -1)), 0.95f, 0.8f});
  s.camera = {.eye = {0.1f, 1.1f, 0.95f}, .target = {0.0f, 0.7f, -0.3f}, .up = {0, 1, 0}, .fov_y = 1.3f};
  return s;
}

}  // namespace icbench
