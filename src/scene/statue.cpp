#include "scene/statue.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <limits>

#include "scene/implicit_surface.h"
#include "scene/shapes.h"

namespace icbench {
namespace {

using glm::vec3;

// All coordinates below are in heads: the classical figure is eight of them high. +z is the front, +x the
// left of the onlooker's right hand.

float head(const vec3& p) {
  float d = ellipsoid(p, {-0.07f, 7.50f, 0.10f}, {0.35f, 0.48f, 0.41f});
  d = smooth_union(d, ellipsoid(p, {-0.09f, 7.23f, 0.24f}, {0.23f, 0.22f, 0.24f}), 0.15f);  // jaw
  d = smooth_union(d, tapered_capsule(p, {-0.10f, 7.55f, 0.49f}, {-0.105f, 7.38f, 0.56f}, 0.03f, 0.05f),
                   0.08f);
  d = smooth_union(d, ellipsoid(p, {-0.10f, 7.24f, 0.46f}, {0.09f, 0.035f, 0.05f}), 0.05f);  // lips
  d = smooth_union(d, ellipsoid(p, {-0.095f, 7.61f, 0.44f}, {0.22f, 0.05f, 0.07f}), 0.10f);  // brow
  const float wave = 0.018f * std::sin(38.0f * p.y + 9.0f * std::sin(5.0f * p.x)) * std::sin(14.0f * p.z);
  float hair = ellipsoid(p, {-0.05f, 7.66f, -0.03f}, {0.43f, 0.42f, 0.46f});
  hair = smooth_union(hair, ellipsoid(p, {-0.02f, 7.52f, -0.48f}, {0.20f, 0.20f, 0.20f}), 0.12f);
  return smooth_union(d, hair + wave, 0.05f);
}

float torso(const vec3& p) {
  float d = ellipsoid(p, {0.10f, 4.25f, -0.02f}, {0.78f, 0.70f, 0.54f});                     // pelvis
  d = smooth_union(d, ellipsoid(p, {0.04f, 5.05f, 0.03f}, {0.55f, 0.80f, 0.41f}), 0.35f);    // abdomen
  d = smooth_union(d, ellipsoid(p, {-0.03f, 5.92f, -0.02f}, {0.63f, 0.75f, 0.46f}), 0.30f);  // ribs
  d = smooth_union(d, tapered_capsule(p, {-0.70f, 6.38f, -0.05f}, {0.64f, 6.50f, -0.05f}, 0.23f, 0.23f),
                   0.35f);
  d = smooth_union(d, ellipsoid(p, {-0.30f, 5.98f, 0.36f}, {0.24f, 0.25f, 0.24f}), 0.12f);  // breasts
  d = smooth_union(d, ellipsoid(p, {0.24f, 6.03f, 0.36f}, {0.24f, 0.25f, 0.24f}), 0.12f);
  d = smooth_union(d, tapered_capsule(p, {-0.03f, 6.45f, -0.06f}, {-0.07f, 7.20f, 0.04f}, 0.25f, 0.21f),
                   0.22f);
  const float navel = ellipsoid(p, {0.05f, 4.93f, 0.46f}, {0.035f, 0.05f, 0.06f});
  d = std::max(d, -navel);
  // The arms end in broken stumps.
  const float right_arm = tapered_capsule(p, {-0.78f, 6.36f, -0.05f}, {-1.02f, 5.30f, 0.02f}, 0.22f, 0.17f);
  const float left_arm = tapered_capsule(p, {0.74f, 6.48f, -0.05f}, {1.00f, 5.95f, 0.12f}, 0.22f, 0.19f);
  d = smooth_union(d, std::max(right_arm, 5.36f - p.y + 0.2f * p.x + 0.2f), 0.10f);
  return smooth_union(d, std::max(left_arm, 6.02f - p.y), 0.10f);
}

float drapery(const vec3& p) {
  // Cloth over a straight leg that bears the weight and a bent one whose knee comes forward.
  float d = tapered_capsule(p, {0.34f, 3.95f, -0.02f}, {0.40f, 0.15f, -0.08f}, 0.46f, 0.42f);
  d = smooth_union(d, tapered_capsule(p, {-0.22f, 3.95f, 0.02f}, {-0.36f, 2.30f, 0.46f}, 0.46f, 0.31f),
                   0.35f);
  d = smooth_union(d, tapered_capsule(p, {-0.36f, 2.30f, 0.46f}, {-0.44f, 0.15f, 0.10f}, 0.30f, 0.40f),
                   0.35f);
  d = smooth_union(d, tapered_capsule(p, {0.02f, 3.60f, -0.12f}, {0.00f, 0.05f, -0.20f}, 0.62f, 0.66f),
                   0.40f);
  d = smooth_union(d, ellipsoid(p, {0.10f, 4.15f, -0.02f}, {0.86f, 0.70f, 0.60f}), 0.20f);
  const float smooth = d;
  // Folds run down and outward, deepen towards the hem, and are pulled flat over the bent knee.
  const float phi = std::atan2(p.z + 0.1f, p.x);
  const float taut = std::exp(-2.5f * glm::distance(p, vec3(-0.36f, 2.6f, 0.75f)));
  const float depth = 0.13f * std::clamp(1.15f - 0.24f * p.y, 0.25f, 1.0f) * (1.0f - taut);
  const float ridge = 0.6f * std::sin(11.0f * phi + 0.9f * p.y + 0.8f * std::sin(1.7f * p.y)) +
                      0.4f * std::sin(19.0f * phi - 1.1f * p.y + 1.0f);
  d -= depth * (ridge + 0.2f);
  // The rolled upper edge hugs the hips, lower on one side.
  const float above = p.y - (4.26f + 0.24f * p.x - 0.12f * p.z);
  const float twist = 0.030f * std::sin(13.0f * phi + 16.0f * above);
  const float roll = glm::length(glm::vec2(smooth + 0.01f, above)) - 0.12f - twist;
  d = std::max(d, above);
  d = smooth_union(d, roll, 0.06f);
  return std::max(d, 0.02f - p.y);
}

float plinth(const vec3& p) {
  const float side = glm::length(glm::vec2(p.x, p.z)) - 1.02f;
  return std::max({side, -p.y, p.y - 0.16f});
}

float figure(const vec3& p) {
  const vec3 q(p.x, p.y - 0.14f, p.z);
  // A part whose surface is further away than the fillets are wide does not count.
  float d = std::numeric_limits<float>::max();
  if (q.y > 3.0f) d = torso(q);
  if (q.y > 6.3f) d = smooth_union(d, head(q), 0.10f);
  if (q.y < 5.2f) d = smooth_union(d, drapery(q), 0.04f);
  if (q.y < 0.5f) d = smooth_union(d, plinth(p), 0.05f);
  return d;
}

Mesh sculpt() {
  constexpr float kHeads = 8.25f;
  const Bounds bounds{{-1.3f, -0.1f, -1.2f}, {1.3f, kHeads + 0.1f, 1.2f}};
  Mesh mesh = mesh_implicit("venus", figure, bounds, 0.04f, 0);
  place(mesh, 1.0f / kHeads, 0.0f, vec3(0.0f));
  return mesh;
}

}  // namespace

Mesh venus(std::uint32_t material) {
  static const Mesh sculpted = sculpt();
  Mesh mesh = sculpted;
  mesh.material = material;
  return mesh;
}

Mesh pedestal(float height, std::uint32_t material) {
  // (radius, height), both in shares of the height; repeated points are creases.
  static constexpr glm::vec2 kProfile[] = {
      {0.00f, 0.00f}, {0.66f, 0.00f}, {0.66f, 0.00f}, {0.66f, 0.14f}, {0.66f, 0.14f}, {0.62f, 0.17f},
      {0.55f, 0.20f}, {0.51f, 0.25f}, {0.50f, 0.30f}, {0.50f, 0.30f}, {0.48f, 0.50f}, {0.48f, 0.75f},
      {0.48f, 0.75f}, {0.50f, 0.80f}, {0.55f, 0.84f}, {0.60f, 0.86f}, {0.60f, 0.86f}, {0.60f, 1.00f},
      {0.60f, 1.00f}, {0.30f, 1.00f}, {0.00f, 1.00f}};
  Mesh mesh = revolve("pedestal", vec3(0.0f), kProfile, 96, material);
  place(mesh, height, 0.0f, vec3(0.0f));
  return mesh;
}

}  // namespace icbench
