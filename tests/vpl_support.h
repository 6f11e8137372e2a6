// What the tests of virtual point lights share: a room in motion, sets traced in it, and comparisons bit by bit.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <vector>

#include "render/primary.h"
#include "render/ray_tracer.h"
#include "render/vpl.h"
#include "render_support.h"
#include "scene/registry.h"
#include "scene/shapes.h"

namespace icbench {

// Built once.
inline const RayTracer& cornell_box_rays() {
  static const RayTracer rays(make_scene("cornell_box"));
  return rays;
}

inline VplSet traced_set(const RayTracer& rays, std::uint32_t wanted, std::uint64_t seed) {
  VplSet set(rays, {wanted, seed});
  Tracer tracer(rays);
  trace_all(set, tracer);
  return set;
}

inline bool same_bits(const VplArrays& a, const VplArrays& b) {
  return a.slots() == b.slots() && std::memcmp(a.of(VplArrays::kPx), b.of(VplArrays::kPx),
                                               VplArrays::kComponents * a.slots() * sizeof(float)) == 0;
}

inline bool same_bits(const glm::vec3& a, const glm::vec3& b) { return std::memcmp(&a, &b, sizeof a) == 0; }

inline std::vector<Hit> reflecting_hits(const RayTracer& rays, int size) {
  std::vector<Hit> hits;
  for (const Hit& hit : primary_hits(rays, size, size).hits)
    if (reflects(rays, hit)) hits.push_back(hit);
  return hits;
}

// A room with a lamp, a mirror, a block that slides, one that turns beside it, and walls that become white.
inline Scene room() {
  Scene s;
  s.name = "room";
  const auto wall = s.add_material({.albedo = glm::vec3(0.3f, 0.5f, 0.4f)});
  const auto lamp = s.add_material({.emission = glm::vec3(9.0f, 8.0f, 6.0f)});
  const auto glass = s.add_material({.albedo = glm::vec3(0.9f), .surface = Surface::mirror});
  s.meshes.push_back(box("walls", {{-1, 0, -1}, {1, 2, 1}}, wall, true));
  s.meshes.push_back(quad("lamp", {-0.3f, 1.99f, -0.3f}, {0.6f, 0, 0}, {0, 0, 0.6f}, lamp));
  s.meshes.push_back(quad("mirror", {-0.99f, 0.3f, -0.8f}, {0, 1.4f, 0}, {0, 0, 1.6f}, glass));
  s.meshes.push_back(box("slider", {{-0.2f, 0.0f, -0.2f}, {0.2f, 0.7f, 0.2f}}, wall));
  s.meshes.back().pose = [](float frame) {
    return Pose{glm::mat3(1.0f), {0.04f * frame - 0.5f, 0.1f, 0.3f}};
  };
  s.meshes.push_back(icosphere("turner", {0.0f, 0.0f, 0.0f}, 0.25f, 2, wall));
  s.meshes.back().pose = [](float frame) {
    const float c = std::cos(0.1f * frame + 0.3f), n = std::sin(0.1f * frame + 0.3f);
    return Pose{{{c, 0, -n}, {0, 1.2f, 0}, {n, 0, c}}, {0.5f, 1.0f, -0.4f}};
  };
  s.frames = 20;
  s.change_light = [](float frame, std::span<Material> materials, std::span<PointLight>) {
    materials[0].albedo = frame == 19.0f ? glm::vec3(0.95f) : glm::vec3(0.3f, 0.5f, 0.4f);
  };
  s.camera = {.eye = {0.0f, 1.0f, 0.95f}, .target = {-0.2f, 0.8f, 0.0f}, .up = {0, 1, 0}, .fov_y = 1.2f};
  return s;
}

}  // namespace icbench
