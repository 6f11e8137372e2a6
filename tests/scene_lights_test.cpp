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

// A light far away sends its paths to the scene, with the flux that goes there; one whose cone ends within the scene
// keeps its own directions.
TEST(SceneEmission, FarPointLightsAimAtTheScene) {
  const glm::vec3 down(0, -1, 0);
  struct Far {
    PointLight light;
    bool is_aimed;
  };
  for (const float distance : {3.0f, 100.0f, 1e4f, 1e7f}) {
    const glm::vec3 p(0, distance, 0);
    for (const auto& [light, is_aimed] :
         {Far{{.p = p, .intensity = glm::vec3(2)}, true}, Far{{p, glm::vec3(2), down, 0.5f, 0.2f}, true},
          Far{{p, glm::vec3(2), -down, 0.5f, 0.2f}, false}}) {
      Scene s;
      s.meshes.push_back(quad("floor", {-1, 0, -1}, {2, 0, 0}, {0, 0, 2}, s.add_material({})));
      s.point_lights.push_back(light);
      prepare(s);
      Pcg32 random(5);
      double flux = 0.0;
      constexpr int kDraws = 20'000;
      for (int i = 0; i < kDraws; ++i) {
        const EmittedRay ray = draw(s.lights, random);
        ASSERT_NEAR(glm::length(ray.d), 1.0f, 1e-5f);
        const glm::vec3 at = ray.p - ray.p.y / std::min(ray.d.y, -1e-9f) * ray.d;
        const bool hits = ray.d.y < 0.0f && std::abs(at.x) <= 1.0f && std::abs(at.z) <= 1.0f;
        if (hits) flux += ray.power.x / kDraws;
        if (is_aimed) {
          ASSERT_LE(glm::length(glm::vec2(at.x, at.z)), 2.0f) << distance;
        }
      }
      if (!is_aimed) {
        EXPECT_EQ(flux, 0.0);
        continue;
      }
      // The solid angle of a square seen from above its centre.
      const double d = distance, angle = 4.0 * std::asin(1.0 / (1.0 + d * d));
      EXPECT_NEAR(flux / (2.0 * angle), 1.0, 0.02) << distance;
    }
  }
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
