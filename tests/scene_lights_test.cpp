// Point and spot lights, and the starts of light paths.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <numbers>
#include <vector>

#include "core/random.h"
#include "scene/scene.h"
#include "scene/shapes.h"

namespace icbench {
namespace {

constexpr double kPi = std::numbers::pi;
const glm::vec3 kAxis = glm::normalize(glm::vec3(1, -2, 0.5f));

// A lamp of 2 m^2, a point light and two spot lights, one with a sharp edge, in different colours, over a floor so wide
// that none of them is far off.
Scene four_lights() {
  Scene s;
  const auto lamp = s.add_material({.emission = {3, 1, 0}});
  s.meshes.push_back(quad("lamp", {0, 5, 0}, {2, 0, 0}, {0, 0, 1}, lamp));
  s.meshes.push_back(quad("floor", {-60, -9, -60}, {120, 0, 0}, {0, 0, 120}, s.add_material({})));
  s.point_lights.push_back({.p = {9, 0, 0}, .intensity = {1, 1, 1}});
  s.point_lights.push_back({{9, 1, 0}, {0, 5, 5}, kAxis, 0.9f, 0.5f});
  s.point_lights.push_back({{9, 2, 0}, {20, 0, 0}, kAxis, 0.8f, 0.8f});
  prepare(s);
  return s;
}

// Their fluxes: pi A L, 4 pi I, and I over a cap, half of it where intensity steps down smoothly in the cosine.
const std::vector<glm::dvec3> kFlux = {kPi * 2.0 * glm::dvec3(3, 1, 0), 4.0 * kPi* glm::dvec3(1, 1, 1),
                                       2.0 * kPi*(0.1 + 0.5 * 0.4) * glm::dvec3(0, 5, 5),
                                       2.0 * kPi * 0.2 * glm::dvec3(20, 0, 0)};

std::size_t light_of(const EmittedRay& ray) {
  return ray.on_surface ? 0 : 1 + static_cast<std::size_t>(ray.p.y + 0.5f);
}

EmittedRay draw(const LightTable& lights, Pcg32& random) {
  const float u = random.uniform(), u1 = random.uniform(), u2 = random.uniform();
  const float v1 = random.uniform(), v2 = random.uniform();
  return lights.emit(u, u1, u2, v1, v2);
}

TEST(SceneEmission, TheMeanPowerIsTheFluxOfTheLightsEachItsShare) {
  const Scene s = four_lights();
  constexpr int kDraws = 200'000;
  Pcg32 random(1);
  std::vector<glm::dvec3> sums(4, glm::dvec3(0.0)), squares = sums;
  for (int i = 0; i < kDraws; ++i) {
    const EmittedRay ray = draw(s.lights, random);
    sums[light_of(ray)] += ray.power;
    squares[light_of(ray)] += glm::dvec3(ray.power) * glm::dvec3(ray.power);
  }
  for (int l = 0; l < 4; ++l)
    for (int c = 0; c < 3; ++c) {
      const double mean = sums[l][c] / kDraws;
      const double error = std::sqrt((squares[l][c] / kDraws - mean * mean) / kDraws);
      EXPECT_NEAR(mean, kFlux[l][c], 4.0 * error) << "light " << l;
      EXPECT_LE(error, 0.01 * kFlux[l][c]);
    }
}

TEST(SceneEmission, RaysStartOnTheirLightAndHaveItsDistribution) {
  const Scene s = four_lights();
  Pcg32 random(2);
  double lamp_cosine = 0.0, steps = 0.0;
  glm::dvec3 everywhere(0.0);
  int drawn[4] = {}, inner = 0;
  for (int i = 0; i < 200'000; ++i) {
    const EmittedRay ray = draw(s.lights, random);
    const std::size_t l = light_of(ray);
    ++drawn[l];
    ASSERT_NEAR(glm::length(ray.d), 1.0f, 1e-5f);
    const float cosine = glm::dot(ray.d, kAxis);
    if (l == 0) {
      ASSERT_TRUE(s.bounds.contains(ray.p));
      ASSERT_EQ(ray.n, glm::vec3(0, -1, 0));
      ASSERT_GE(glm::dot(ray.d, ray.n), 0.0f);
      lamp_cosine += glm::dot(ray.d, ray.n);
    } else if (l == 1) {
      everywhere += ray.d;
    } else if (l == 2) {
      ASSERT_GE(cosine, 0.5f - 1e-5f);
      inner += cosine >= 0.9f;
      if (cosine < 0.9f) steps += (cosine - 0.5) / 0.4;
    } else {
      ASSERT_GE(cosine, 0.8f - 1e-5f);
    }
  }
  EXPECT_NEAR(lamp_cosine / drawn[0], 2.0 / 3.0, 4.0 * std::sqrt(1.0 / 18.0 / drawn[0]));
  for (int c = 0; c < 3; ++c)
    EXPECT_NEAR(everywhere[c] / drawn[1], 0.0, 4.0 * std::sqrt(1.0 / 3.0 / drawn[1]));
  EXPECT_NEAR(inner, drawn[2] / 3.0, 4.0 * std::sqrt(drawn[2] * 2.0 / 9.0)) << "0.1 of 0.1 + 0.4 / 2";
  // Where density grows as the smooth step t^2 (3 - 2t), the mean of t is (3/4 - 2/5) / (1/2).
  const int outer = drawn[2] - inner;
  EXPECT_NEAR(steps / outer, 0.7, 4.0 * std::sqrt(0.05 / outer));
}

TEST(SceneEmission, PowerDiffersFromRayToRayByColourOnly) {
  const Scene s = four_lights();
  Pcg32 random(3);
  for (int i = 0; i < 1000; ++i) {
    const glm::vec3 power = draw(s.lights, random).power, first = draw(s.lights, random).power;
    ASSERT_NEAR(power.x + power.y + power.z, first.x + first.y + first.z, 1e-3f);
  }
  const float last = 1.0f - 0x1p-24f;
  for (const float u : {0.0f, 0.3f, 0.6f, 0.9f, last})
    for (const float v : {0.0f, last}) {
      const EmittedRay ray = s.lights.emit(u, v, v, v, v);
      EXPECT_NEAR(glm::length(ray.d), 1.0f, 1e-5f);
    }
}

// A light far away sends its paths to the scene, with the flux that goes there; one that does not shine evenly on it
// keeps its own directions.
TEST(SceneEmission, FarPointLightsAimAtTheScene) {
  const glm::vec3 up = glm::normalize(glm::vec3(0.3f, 1.0f, 0.2f)), aside(1, 0, 0);
  struct Far {
    float distance;
    PointLight light;
    bool is_aimed;
  };
  const glm::vec3 near = 3.0f * up;
  std::vector<Far> cases = {// Its cone ends within the scene, and it shines everywhere but not evenly.
                            {3.0f, {near, glm::vec3(2), -up, 0.98f, 0.5f}, false},
                            {3.0f, {near, glm::vec3(2), aside, 1.0f, -1.0f}, false}};
  for (const float distance : {3.0f, 100.0f, 1e4f, 1e6f}) {
    cases.push_back({distance, {.p = distance * up, .intensity = glm::vec3(2)}, true});
    cases.push_back({distance, {distance * up, glm::vec3(2), -up, 0.5f, 0.2f}, true});
  }
  for (const auto& [distance, light, is_aimed] : cases) {
    Scene s;
    s.meshes.push_back(quad("floor", {-1, 0, -1}, {2, 0, 0}, {0, 0, 2}, s.add_material({})));
    s.point_lights.push_back(light);
    prepare(s);
    // What arrives, by a sum over the floor.
    constexpr int kSide = 200;
    double expected = 0.0;
    for (int i = 0; i < kSide * kSide; ++i) {
      const auto at = [](int k) { return (2.0f * static_cast<float>(k) + 1.0f) / kSide - 1.0f; };
      const glm::vec3 d = glm::vec3(at(i % kSide), 0.0f, at(i / kSide)) - light.p;
      const double length = glm::length(d);
      const float falloff = spot_falloff(light, glm::dot(glm::normalize(d), light.axis));
      expected += 2.0 * falloff * (-d.y / (length * length * length)) * 4.0 / (kSide * kSide);
    }
    Pcg32 random(5);
    double flux = 0.0;
    constexpr int kDraws = 100'000;
    for (int i = 0; i < kDraws; ++i) {
      const EmittedRay ray = draw(s.lights, random);
      ASSERT_NEAR(glm::length(ray.d), 1.0f, 1e-5f);
      const glm::dvec3 p(ray.p), d(ray.d), at = p - p.y / std::min(d.y, -1e-12) * d;
      if (d.y < 0.0 && std::abs(at.x) <= 1.0 && std::abs(at.z) <= 1.0) flux += ray.power.x / kDraws;
      if (is_aimed) {
        ASSERT_LE(glm::length(glm::cross(d, p)), 1.43 + 0x1p-20 * distance) << "it passes the scene";
      }
    }
    EXPECT_NEAR(flux / expected, 1.0, is_aimed ? 0.03 : 0.1) << distance;
  }
}

// Guards against: a sun far away that takes nearly all paths from a lamp that lights the scene as much.
TEST(SceneEmission, LightsAreDrawnByWhatTheySendToTheScene) {
  constexpr float kDistance = 1000.0f;
  Scene s;
  s.meshes.push_back(quad("floor", {-1, 0, -1}, {2, 0, 0}, {0, 0, 2}, s.add_material({})));
  s.point_lights.push_back({.p = {0, 0.5f, 0}, .intensity = glm::vec3(1)});
  s.point_lights.push_back({.p = {0, kDistance, 0}, .intensity = glm::vec3(kDistance * kDistance)});
  prepare(s);
  Pcg32 random(3);
  int near = 0;
  constexpr int kDraws = 20'000;
  for (int i = 0; i < kDraws; ++i) near += draw(s.lights, random).p.y < 1.0f;
  // The far one sends its intensity over a disc of radius sqrt(2), nearly: 2 pi W; the near one 4 pi W.
  EXPECT_NEAR(near, kDraws * 2.0 / 3.0, 4.0 * std::sqrt(kDraws * 2.0 / 9.0) + 0.002 * kDraws);
}

// Guards against: a choice by so few random bits that lights of which one has many triangles get a wrong share.
TEST(SceneLightTable, ManyTrianglesGetTheirShareAndNoMore) {
  for (const std::uint32_t log_triangles : {4u, 16u, 20u}) {
    // Half of the triangles, on the left, have a hundredth of the power.
    Scene s;
    const auto dim = s.add_material({.emission = glm::vec3(1)}),
               bright = s.add_material({.emission = glm::vec3(99)});
    const std::uint32_t half = 1u << (log_triangles - 1);
    for (const bool is_left : {true, false}) {
      Mesh mesh{is_left ? "dim" : "bright", {}, {}, {}, is_left ? dim : bright};
      for (std::uint32_t i = 0; i <= half; ++i)
        mesh.positions.push_back({(is_left ? -1.0f : 1.0f) + 0.5f * static_cast<float>(i % 2), 0.0f,
                                  static_cast<float>(i) / static_cast<float>(half)});
      mesh.positions.push_back(
          {(is_left ? -1.0f : 1.0f) + 0.5f * static_cast<float>((half + 1) % 2), 0.0f, 1.0f});
      for (std::uint32_t i = 0; i < half; ++i) mesh.triangles.emplace_back(i, i + 1, i + 2);
      s.meshes.push_back(std::move(mesh));
    }
    s.lights = LightTable(s, 0.0f);
    Pcg32 random(11);
    constexpr int kDraws = 400'000;
    int left = 0;
    for (int i = 0; i < kDraws; ++i) {
      const float u = random.uniform(), u1 = random.uniform(), u2 = random.uniform();
      left += s.lights.sample(u, u1, u2).p.x < 0.0f;
    }
    const double share = 0.01;
    EXPECT_NEAR(left, share * kDraws, 4.0 * std::sqrt(share * kDraws)) << log_triangles;
  }
}

TEST(SceneSpot, IntensityFallsSmoothlyFromTheInnerConeToTheOuter) {
  PointLight spot{.intensity = glm::vec3(1), .cos_inner = 0.9f, .cos_outer = 0.7f};
  EXPECT_EQ(spot_falloff(spot, 1.0f), 1.0f);
  EXPECT_EQ(spot_falloff(spot, 0.9f), 1.0f);
  EXPECT_NEAR(spot_falloff(spot, 0.8f), 0.5f, 1e-5f);
  EXPECT_EQ(spot_falloff(spot, 0.7f), 0.0f);
  EXPECT_EQ(spot_falloff(spot, -1.0f), 0.0f);
  EXPECT_NEAR(spot_falloff(spot, 0.8999f), 1.0f, 1e-5f) << "flat where it begins";
  EXPECT_NEAR(spot_falloff(spot, 0.7001f), 0.0f, 1e-5f) << "and where it ends";
  for (float c = 0.69f; c < 0.91f; c += 0.001f)
    ASSERT_LE(spot_falloff(spot, c), spot_falloff(spot, c + 0.001f));
  EXPECT_EQ(spot_falloff(spot, std::nanf("")), 0.0f);
  spot.cos_inner = spot.cos_outer = 0.8f;
  EXPECT_EQ(spot_falloff(spot, 0.8f), 1.0f);
  EXPECT_EQ(spot_falloff(spot, 0.79f), 0.0f);
  spot.cos_inner = spot.cos_outer = -1.0f;
  EXPECT_EQ(spot_falloff(spot, -1.0000001f), 1.0f) << "shines everywhere, whatever is rounded";
}

TEST(SceneLightTable, TrianglesWithoutAreaAreNotDrawn) {
  Scene s;
  s.meshes.push_back(
      quad("lamp", {0, 0, 0}, {1, 0, 0}, {0, 0, 1}, s.add_material({.emission = glm::vec3(1)})));
  s.meshes[0].triangles.emplace_back(0, 1, 1);
  EXPECT_EQ(LightTable(s, 0.0f).size(), 2u);
}

TEST(SceneLightTable, LightsThatGiveNothingAreNotDrawn) {
  Scene s;
  s.add_material({.albedo = glm::vec3(0.5f)});
  s.meshes.push_back(quad("floor", {0, 0, 0}, {1, 0, 0}, {0, 0, 1}, 0));
  s.point_lights.push_back({.p = {0, 1, 0}});
  s.point_lights.push_back({{0, 1, 0}, glm::vec3(1), {0, -1, 0}, 1.0f, 1.0f});
  prepare(s);
  EXPECT_TRUE(s.lights.empty()) << "no intensity, and a cone without extent";
  s.point_lights.push_back({.p = {0.5f, 0.2f, 0.5f}, .intensity = glm::vec3(1e-20f)});
  prepare(s);
  EXPECT_EQ(s.lights.size(), 1u);
  EXPECT_EQ(s.lights.sample(0.5f, 0.5f, 0.5f).p, glm::vec3(0.5f, 0.2f, 0.5f));
  EXPECT_FLOAT_EQ(s.lights.emit(0.5f, 0, 0, 0.5f, 0.5f).power.x, static_cast<float>(4e-20 * kPi));
}

}  // namespace
}  // namespace icbench
