// The ray tracer: hits, their normals, packets against single rays, and that rays neither hit their own
// surface nor leak.
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <memory>
#include <vector>

#include "core/random.h"
#include "render/camera.h"
#include "render/ray_tracer.h"
#include "render/sampling.h"
#include "render_support.h"
#include "scene/registry.h"
#include "scene/shapes.h"

namespace icbench {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

glm::vec3 any_direction(Pcg32& random) {
  const float z = 2.0f * random.uniform() - 1.0f, phi = 6.2831853f * random.uniform();
  const float r = std::sqrt(1.0f - z * z);
  return {r * std::cos(phi), r * std::sin(phi), z};
}

Scene with_mesh(Mesh mesh) {
  Scene s;
  s.name = "test";
  s.add_material({.albedo = glm::vec3(0.5f), .emission = glm::vec3(1.0f)});
  s.meshes.push_back(std::move(mesh));
  return s;
}

TEST(RenderTracer, AHitHasItsPlaceDistanceAndNormalOnTheRaysSide) {
  const RayTracer rays(with_mesh(quad("q", {-1, -1, 2}, {2, 0, 0}, {0, 2, 0}, 0)));
  Tracer tracer(rays);
  const Hit front = tracer.intersect(Ray{{0.25f, 0.5f, 5.0f}, kInfinity, {0, 0, -1}});
  EXPECT_FLOAT_EQ(front.t, 3.0f);
  EXPECT_LT(glm::distance(front.p, glm::vec3(0.25f, 0.5f, 2.0f)), 1e-6f);
  EXPECT_EQ(front.ng, glm::vec3(0, 0, 1));
  EXPECT_TRUE(front.front);
  EXPECT_EQ(rays.emitted(front), glm::vec3(1.0f));
  const Hit back = tracer.intersect(Ray{{0.25f, 0.5f, 0.0f}, kInfinity, {0, 0, 2}});
  EXPECT_FLOAT_EQ(back.t, 1.0f) << "in units of |d|";
  EXPECT_EQ(back.ng, glm::vec3(0, 0, -1));
  EXPECT_FALSE(back.front);
  EXPECT_EQ(rays.emitted(back), glm::vec3(0.0f));
  const Hit miss = tracer.intersect(Ray{{3, 3, 5}, kInfinity, {0, 0, -1}});
  EXPECT_TRUE(miss.missed());
  EXPECT_EQ(rays.emitted(miss), glm::vec3(0.0f));
  EXPECT_EQ(tracer.counts.closest, 3u);
}

TEST(RenderTracer, ShadingNormalsAreUnitAndOnTheGeometricSide) {
  const RayTracer rays(make_scene("cornell_box"));
  Tracer tracer(rays);
  const CameraView view(rays.scene().camera, 97, 97);
  for (int y = 0; y < 97; ++y)
    for (int x = 0; x < 97; ++x) {
      const Ray ray = view.ray(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f);
      const Hit hit = tracer.intersect(ray);
      if (hit.missed()) continue;
      ASSERT_NEAR(glm::length(hit.n), 1.0f, 1e-5f);
      ASSERT_NEAR(glm::length(hit.ng), 1.0f, 1e-5f);
      ASSERT_GE(glm::dot(hit.n, hit.ng), 0.0f);
      ASSERT_LE(glm::dot(hit.ng, ray.d), 0.0f);
      ASSERT_TRUE(rays.scene().bounds.contains(hit.p));
      ASSERT_LT(glm::distance(hit.p, ray.o + hit.t * ray.d), rays.epsilon());
    }
}

TEST(RenderTracer, ManyRaysAtOnceAreTheSameAsOneByOne) {
  const RayTracer rays(make_scene("cornell_box"));
  Pcg32 random(7);
  for (const std::size_t count : {1u, 2u, 4u, 5u, 16u, 17u, 37u, 64u}) {
    std::vector<Ray> batch;
    for (std::size_t i = 0; i < count; ++i)
      batch.push_back({{1.0f + 3.0f * random.uniform(), 2.5f, 1.0f + 3.0f * random.uniform()},
                       2.5f,
                       any_direction(random)});
    std::vector<Hit> hits(count);
    const auto dark = std::make_unique<bool[]>(count);
    Tracer tracer(rays);
    tracer.intersect(batch, hits);
    tracer.occluded(batch, {dark.get(), count});
    EXPECT_EQ(tracer.counts.total(), 2 * count);
    for (std::size_t i = 0; i < count; ++i) {
      const Hit alone = tracer.intersect(batch[i]);
      ASSERT_EQ(hits[i].material, alone.material);
      ASSERT_EQ(dark[i], !alone.missed());
      ASSERT_EQ(tracer.occluded(batch[i]), dark[i]);
      if (alone.missed()) continue;
      ASSERT_LT(glm::distance(hits[i].p, alone.p), rays.epsilon());
    }
  }
}

TEST(RenderTracer, ARayThatLeavesAConvexSolidDoesNotMeetItAgain) {
  // Far from the origin, where a coordinate's rounding is largest against the solid's size.
  for (const glm::vec3 centre : {glm::vec3(0.0f), glm::vec3(200.0f, -100.0f, 50.0f)}) {
    const RayTracer rays(with_mesh(icosphere("ball", centre, 1.0f, 4, 0)));
    Tracer tracer(rays);
    Pcg32 random(11);
    for (int i = 0; i < 20'000; ++i) {
      const glm::vec3 inward = any_direction(random);
      const Hit hit = tracer.intersect(Ray{centre - 3.0f * inward, kInfinity, inward});
      ASSERT_FALSE(hit.missed());
      const float u = random.uniform(), v = random.uniform();
      const glm::vec3 d = cosine_direction(Basis(hit.ng), u, v);
      ASSERT_FALSE(tracer.occluded(Ray{rays.leave(hit.p, hit.ng), kInfinity, d}));
    }
  }
}

// Triangles of all sizes and slants anywhere in a scene of 100 m, and rays that start a half and a quarter as far off
// them as they need to: kEpsilonShare leaves room.
TEST(RenderTracer, ARayThatLeavesATriangleDoesNotMeetItAgain) {
  constexpr float kReach = 100.0f;
  Pcg32 random(3);
  const auto within = [&](float size) { return size * (2.0f * random.uniform() - 1.0f); };
  int left = 0;
  for (int k = 0; k < 300; ++k) {
    const float size = k % 2 == 0 ? kReach : 10.0f * random.uniform();
    const glm::vec3 centre(within(kReach - size), within(kReach - size), within(kReach - size));
    Mesh mesh = quad("corner", glm::vec3(kReach), {-1, 0, 0}, {0, -1, 0}, 0);
    for (int v = 0; v < 3; ++v)
      mesh.positions.push_back(centre + glm::vec3(within(size), within(size), within(size)));
    mesh.triangles.push_back({4, 5, 6});
    const RayTracer rays(with_mesh(mesh));
    if (rays.scene().dropped_triangles > 0) continue;
    Tracer tracer(rays);
    for (int i = 0; i < 50; ++i) {
      const float u = random.uniform(), v = (1.0f - u) * random.uniform();
      const glm::vec3 target = mesh.positions[4] + u * (mesh.positions[5] - mesh.positions[4]) +
                               v * (mesh.positions[6] - mesh.positions[4]);
      const glm::vec3 from(within(kReach), within(kReach), within(kReach));
      const Hit hit = tracer.intersect(Ray{from, kInfinity, target - from});
      if (hit.missed()) continue;
      ++left;
      const float a = random.uniform(), b = random.uniform();
      for (const float share : {1.0f, 0.5f, 0.25f}) {
        const Ray away{hit.p + share * rays.epsilon() * hit.ng, kInfinity,
                       cosine_direction(Basis(hit.ng), a, b)};
        const Hit next = tracer.intersect(away);
        ASSERT_TRUE(next.missed() || glm::distance(next.p, glm::vec3(kReach)) < 2.0f) << share;
      }
    }
  }
  EXPECT_GT(left, 10'000);
}

TEST(RenderTracer, NothingLeaksFromAClosedRoom) {
  const RayTracer rays(make_scene("white_furnace"));
  Tracer tracer(rays);
  Pcg32 random(13);
  Hit at = tracer.intersect(Ray{rays.scene().camera.eye, kInfinity, any_direction(random)});
  for (int i = 0; i < 200'000; ++i) {
    ASSERT_FALSE(at.missed()) << "bounce " << i;
    const float u = random.uniform(), v = random.uniform();
    at = tracer.intersect(Ray{rays.leave(at.p, at.ng), kInfinity, cosine_direction(Basis(at.ng), u, v)});
  }
}

TEST(RenderTracer, TheMiddleOfTheImageLooksAtTheTarget) {
  const Camera camera{.eye = {1, 2, 3}, .target = {4, -5, 6}, .up = {0, 1, 0}, .fov_y = 0.8f};
  const CameraView view(camera, 200, 100);
  const Ray middle = view.ray(100.0f, 50.0f);
  EXPECT_LT(glm::distance(middle.d, glm::normalize(camera.target - camera.eye)), 1e-6f);
  const float cosine = glm::dot(view.ray(100.0f, 0.0f).d, view.ray(100.0f, 100.0f).d);
  EXPECT_NEAR(std::acos(cosine), camera.fov_y, 1e-5f);
  EXPECT_GT(view.ray(100.0f, 0.0f).d.y, middle.d.y) << "the first row is the top";
}

TEST(RenderTracer, CosineDirectionsAreUnitAndHaveTheCosinesMoments) {
  Pcg32 random(17);
  for (const glm::vec3 n :
       {glm::vec3(0, 0, 1), glm::vec3(0, 0, -1), glm::normalize(glm::vec3(1, -2, -0.5f))}) {
    const Basis basis(n);
    EXPECT_LT(glm::distance(glm::cross(basis.s, basis.t), n), 1e-5f);
    double cosine = 0.0, squared = 0.0;
    constexpr int kDraws = 100'000;
    for (int i = 0; i < kDraws; ++i) {
      const float u = random.uniform(), v = random.uniform();
      const glm::vec3 d = cosine_direction(basis, u, v);
      ASSERT_NEAR(glm::length(d), 1.0f, 1e-5f);
      cosine += glm::dot(d, n);
      squared += glm::dot(d, n) * glm::dot(d, n);
    }
    EXPECT_NEAR(cosine / kDraws, 2.0 / 3.0, 4.0 * std::sqrt(1.0 / 18.0 / kDraws));
    EXPECT_NEAR(squared / kDraws, 0.5, 4.0 * std::sqrt(1.0 / 12.0 / kDraws));
  }
}

}  // namespace
}  // namespace icbench
