// Point lights against closed forms: I cos / d^2, the fall-off of a spot, and what happens on the light itself.
// Statistical comparisons are in standard errors measured from the samples; seeds are fixed.
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include "render/path.h"
#include "render_support.h"
#include "scene/registry.h"
#include "scene/shapes.h"
#include "trap_invalid.h"

namespace icbench {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

// A floor and one point light.
Scene lit_by(const PointLight& light) {
  Scene s;
  const auto floor = s.add_material({.albedo = glm::vec3(0.5f)});
  s.meshes.push_back(quad("floor", {-4, 0, -4}, {0, 0, 8}, {8, 0, 0}, floor));
  s.point_lights.push_back(light);
  return s;
}

TEST(RenderPointLight, IrradianceOfAFloorIsIntensityTimesCosineOverDistanceSquared) {
  const RayTracer rays(lit_by({.p = {0, 2, 0}, .intensity = {3, 2, 1}}));
  Tracer tracer(rays);
  Pcg32 random(1);
  for (const float x : {0.0f, 0.5f, 1.0f, 3.5f}) {
    const Hit at = down(tracer, {x, 1, 0.3f});
    const double d2 = x * x + 4.0 + 0.09, E = 2.0 / std::sqrt(d2) / d2;
    const Irradiance direct = sample_irradiance(tracer, at, Light::direct, random);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(direct[c], (3 - c) * E, 1e-5 * E) << "without variance";
    EXPECT_EQ(sample_irradiance(tracer, at, Light::indirect, random), glm::vec3(0.0f));
  }
  // From below nothing arrives.
  const Hit below = tracer.intersect(Ray{{0, -1, 0}, kInfinity, {0, 1, 0}});
  EXPECT_EQ(sample_irradiance(tracer, below, Light::direct, random), glm::vec3(0.0f));
}

TEST(RenderPointLight, SeveralLightsAddUpAndSurfacesCastShadows) {
  Scene s = make_scene("lit_floor");
  s.point_lights.push_back({.p = {2, 1, 0}, .intensity = glm::vec3(5)});
  s.point_lights.push_back(
      {.p = {-2, 3, 0}, .intensity = glm::vec3(40)});  // the lamp shades the origin from it
  const RayTracer rays(std::move(s)), lamp_only(make_scene("lit_floor"));
  Tracer tracer(rays), alone(lamp_only);
  for (const glm::vec3 p : {glm::vec3(1, 0.5f, 0), glm::vec3(3, 0.5f, 1)}) {
    const Hit at = down(tracer, p);
    Estimate all, lamp;
    Pcg32 random(3);
    for (int i = 0; i < 200'000; ++i) {
      all.add(sample_irradiance(tracer, at, Light::direct, random).x);
      lamp.add(sample_irradiance(alone, at, Light::direct, random).x);
    }
    double points = 0.0;
    for (const PointLight& light : rays.scene().point_lights) {
      const glm::dvec3 d = light.p - at.p;
      // Where the segment to the light passes the lamp's plane.
      const glm::dvec3 q = glm::dvec3(at.p) + d / d.y;
      const bool dark = d.y > 1.0 && std::abs(q.x) < 0.5 && std::abs(q.z) < 0.5;
      if (!dark) points += light.intensity.x * d.y / std::pow(glm::dot(d, d), 1.5);
    }
    EXPECT_NEAR(all.mean(), lamp.mean() + points, 4.0 * std::hypot(all.error(), lamp.error()));
    EXPECT_LT(all.error(), 0.01 * all.mean());
  }
}

TEST(RenderPointLight, ASpotFallsOffSmoothlyAndIsDarkOutside) {
  const RayTracer rays(lit_by({{0, 1, 0}, glm::vec3(1), {0, -1, 0}, 0.9f, 0.7f}));
  Tracer tracer(rays);
  Pcg32 random(5);
  for (const float cosine : {0.99f, 0.91f, 0.85f, 0.8f, 0.72f, 0.69f, 0.5f}) {
    const float x = std::sqrt(1.0f / (cosine * cosine) - 1.0f);
    const float t = std::clamp((cosine - 0.7f) / 0.2f, 0.0f, 1.0f);
    const double E = t * t * (3.0 - 2.0 * t) * std::pow(cosine, 3);
    const Hit at = down(tracer, {0.6f * x, 0.5f, 0.8f * x});
    EXPECT_NEAR(sample_irradiance(tracer, at, Light::direct, random).x, E, 2e-5) << cosine;
  }
}

TEST(RenderPointLight, ALightInASurfaceIsBoundedAndNotHidden) {
  // At the floor's very points, and a hair above them.
  for (const float height : {0.0f, 1e-30f, 1e-12f, 1e-6f, 1e-4f}) {
    const RayTracer rays(lit_by({.p = {0.25f, height, 0.5f}, .intensity = glm::vec3(1)}));
    Tracer tracer(rays);
    Pcg32 random(7);
    for (const float x : {0.25f, 0.250001f, 0.26f, 1.0f}) {
      const Irradiance E = sample_irradiance(tracer, down(tracer, {x, 1, 0.5f}), Light::all, random);
      const float epsilon = rays.epsilon();
      EXPECT_TRUE(is_finite(E) && E.x >= 0.0f && E.x <= 1.001f / (epsilon * epsilon)) << height << " " << x;
      if (height > 0.0f && x == 0.25f) {
        EXPECT_GT(E.x, 0.0f) << height;
      }
    }
  }
  Scene s = lit_by({.p = {0, 2, 0}, .intensity = glm::vec3(4)});
  s.meshes.push_back(quad("ceiling", {-1, 2, -1}, {2, 0, 0}, {0, 0, 2}, 0));
  const RayTracer rays(std::move(s));
  Tracer tracer(rays);
  Pcg32 random(9);
  EXPECT_NEAR(sample_irradiance(tracer, down(tracer, {0, 1, 0}), Light::direct, random).x, 1.0f, 1e-4f);
  const RayTracer far(lit_by({.p = {0, 1e15f, 0}, .intensity = glm::vec3(3e38f)}));
  Tracer far_tracer(far);
  EXPECT_TRUE(is_finite(sample_irradiance(far_tracer, down(far_tracer, {0, 1, 0}), Light::direct, random)));
}

}  // namespace
}  // namespace icbench
