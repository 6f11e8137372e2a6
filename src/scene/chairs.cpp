// Chairs.
#include <array>
#include <numbers>

#include "scene/furniture.h"
#include "scene/shapes.h"

namespace icbench {
namespace {

using glm::vec3;

// An upholstered panel in the plane of x and y, hollowed towards +z by `hollow` / m and leant back by `lean`.
Mesh back_rest(const Bounds& b, float radius, float hollow, float lean) {
  return bent(rounded_box(b, radius, 2, {6, 3, 1}), [&](const vec3& p) {
    const float rise = p.y - b.lower.y;
    return vec3(p.x, p.y, p.z + hollow * p.x * p.x - lean * rise);
  });
}

// A seat, dished where one sits and rounded down at its front edge.
Mesh seat(const Bounds& b, float radius) {
  const float half = 0.5f * (b.upper.x - b.lower.x);
  return bent(rounded_box(b, radius, 2, {4, 1, 4}), [&](const vec3& p) {
    const float x = p.x / half, front = std::max(0.0f, (p.z - b.upper.z + 0.14f) / 0.14f);
    return vec3(p.x, p.y + 0.014f * (x * x - 1.0f) - 0.022f * front * front, p.z);
  });
}

}  // namespace

Parts conference_chair(const ChairMaterials& m) {
  constexpr float kHalf = 0.27f, kTube = 0.011f;
  Parts chair;
  for (const float x : {-kHalf, kHalf}) {
    const Path side{{x, kGap, 0.23f}, {x, 0.63f, 0.23f}, {x, 0.63f, -0.215f}, {x, kGap + 0.0008f, -0.26f}};
    chair.add(m.frame, tube(fillet(side, 0.06f, 3), kTube));
    chair.add(m.arms, rounded_box({{x - 0.026f, 0.632f, -0.18f}, {x + 0.026f, 0.664f, 0.20f}}, 0.012f, 1));
  }
  for (const float z : {-0.13f, 0.15f})
    chair.add(m.frame, tube({{-kHalf, 0.405f, z}, {kHalf, 0.405f, z}}, kTube));
  chair.add(m.frame, tube({{-kHalf, 0.40f, -0.231f}, {kHalf, 0.40f, -0.231f}}, kTube));
  for (const float x : {-0.16f, 0.16f}) {
    const Path post{{x, 0.40f, -0.231f}, {x, 0.56f, -0.245f}, {x, 0.80f, -0.295f}};
    chair.add(m.frame, tube(fillet(post, 0.10f, 2), kTube));
  }
  chair.add(m.fabric, seat({{-0.245f, 0.415f, -0.21f}, {0.245f, 0.495f, 0.25f}}, 0.032f));
  chair.add(m.fabric, back_rest({{-0.235f, 0.54f, -0.262f}, {0.235f, 0.95f, -0.205f}}, 0.026f, 0.55f, 0.20f));
  return chair;
}

Parts swivel_chair(const ChairMaterials& m) {
  constexpr float kCastor = 0.03f;
  Parts chair;
  for (int i = 0; i < 5; ++i) {
    const float angle = 2.0f * std::numbers::pi_v<float> * (static_cast<float>(i) + 0.5f) / 5.0f;
    Parts arm;
    arm.add(m.frame,
            bent(rounded_box({{-0.028f, 0.075f, 0.0f}, {0.028f, 0.115f, 0.32f}}, 0.013f, 1, {1, 1, 6}),
                 [](const vec3& p) {
                   return vec3(p.x * (1.2f - 1.3f * p.z), p.y + 0.10f * (0.32f - p.z) * 0.9f, p.z);
                 }));
    arm.add(m.frame, tube({{0, 0.045f, 0.295f}, {0, 0.09f, 0.295f}}, 0.009f));
    for (const float x : {-0.016f, 0.016f}) {
      const Polygon wheel = circle({0.0f, 0.0f}, kCastor, 16);
      Mesh disc = slab(wheel, std::array{SlabLevel{0.006f, -0.010f}, SlabLevel{0.0f, -0.005f},
                                         SlabLevel{0.0f, 0.005f}, SlabLevel{0.006f, 0.010f}});
      arm.add(m.frame, moved(std::move(disc), {rotation({0, 0, 1}, 0.5f * std::numbers::pi_v<float>),
                                               {x, kCastor + kGap, 0.295f}}));
    }
    chair.add(arm, turned(angle, vec3(0.0f)));
  }
  static constexpr glm::vec2 kColumn[] = {
      {0.0f, 0.07f},    {0.045f, 0.07f},  {0.045f, 0.07f}, {0.045f, 0.16f}, {0.040f, 0.17f},
      {0.030f, 0.175f}, {0.030f, 0.175f}, {0.030f, 0.30f}, {0.030f, 0.30f}, {0.018f, 0.30f},
      {0.018f, 0.30f},  {0.018f, 0.42f},  {0.018f, 0.42f}, {0.0f, 0.42f}};
  chair.add(m.frame, revolve("column", vec3(0.0f), kColumn, 24, m.frame));
  chair.add(m.frame, rounded_box({{-0.13f, 0.405f, -0.15f}, {0.13f, 0.445f, 0.13f}}, 0.015f, 1));
  chair.add(m.fabric, seat({{-0.26f, 0.44f, -0.24f}, {0.26f, 0.535f, 0.26f}}, 0.038f));
  const Path spine{{0, 0.43f, -0.10f}, {0, 0.43f, -0.31f}, {0, 0.60f, -0.325f}, {0, 0.85f, -0.345f}};
  chair.add(m.frame,
            sweep(fillet(spine, 0.06f, 4), rectangle({-0.035f, -0.008f}, {0.035f, 0.008f}), {0, 1, 0}));
  chair.add(m.fabric, back_rest({{-0.235f, 0.62f, -0.315f}, {0.235f, 1.08f, -0.25f}}, 0.03f, 0.55f, 0.10f));
  for (const float side : {-1.0f, 1.0f}) {
    const Path arm{
        {side * 0.12f, 0.425f, -0.02f}, {side * 0.31f, 0.425f, -0.02f}, {side * 0.31f, 0.70f, -0.02f}};
    chair.add(m.frame,
              sweep(fillet(arm, 0.05f, 4), rectangle({-0.025f, -0.007f}, {0.025f, 0.007f}), {0, 1, 0}));
    chair.add(m.arms,
              rounded_box({{side * 0.31f - 0.04f, 0.69f, -0.17f}, {side * 0.31f + 0.04f, 0.725f, 0.13f}},
                          0.015f, 2));
  }
  return chair;
}

}  // namespace icbench
