// Scenes that are hard on every estimator, each with the failure it guards against.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <glm/geometric.hpp>
#include <string>
#include <vector>

#include "judged_estimates.h"
#include "scene/registry.h"

namespace icbench {
namespace {

// Guards against: densities that overflow, and offsets that step over the lamp.
TEST(HardScenes, ALampTooSmallToHaveAnAreaShinesAsAPoint) {
  constexpr double kSide = 1e-4, kL = 1e8;
  Scene s;
  s.name = "speck";
  add_lamp(s, static_cast<float>(kSide), 1.0f, static_cast<float>(kL));
  const auto grey = s.add_material({.albedo = glm::vec3(0.5f)});
  s.meshes.push_back(quad("floor", {-4, 0, -4}, {0, 0, 8}, {8, 0, 0}, grey));
  const RayTracer rays(std::move(s));
  std::vector<Known> points;
  for (const glm::dvec3 p : {glm::dvec3(0.0), glm::dvec3(1, 0, -2)}) {
    const double d2 = glm::dot(p, p) + 1.0;
    points.push_back({facing(p, {0, 1, 0}), kL * kSide * kSide / (d2 * d2)});
  }
  judge_direct("speck of light", rays, points);
}

// Guards against: shadow rays that miss a narrow gap or slip past its edges.
TEST(HardScenes, ALampBehindASlitShinesAsFarAsItIsSeen) {
  constexpr float kHalf = 0.05f;  // of the slit's width
  Scene s;
  s.name = "slit";
  add_lamp(s, 1.0f, 2.0f, 10.0f);
  const auto black = s.add_material({});
  s.meshes.push_back(quad("left", {-4, 1, -4}, {0, 0, 8}, {4.0f - kHalf, 0, 0}, black));
  s.meshes.push_back(quad("right", {kHalf, 1, -4}, {0, 0, 8}, {4.0f - kHalf, 0, 0}, black));
  const RayTracer rays(std::move(s));
  // From x at height 0 the gap at height 1 shows what lies between 2 (-+kHalf) - x at height 2.
  const glm::dvec3 p(0.35, 0, 0.3);
  const double low = std::max(-0.5, -2.0 * kHalf - p.x), high = std::min(0.5, 2.0 * kHalf - p.x);
  const Known point[] = {
      {facing(p, {0, 1, 0}), lambert(p, {0, 1, 0}, rectangle(low, high, 2, -0.5, 0.5), 10.0)}};
  judge_direct("slit", rays, point);
}

// Guards against: hits whose normal or offset depends on how flat they are looked at.
TEST(HardScenes, GrazingViewsSeeTheSameLight) {
  const RayTracer rays(make_scene("lit_floor"));
  Tracer tracer(rays);
  for (const float slope : {1e-2f, 1e-4f}) {
    const Known ratio[] = {{{}, 1.0}};
    judge("views at a slope of " + std::to_string(slope), ratio, kError,
          [&](std::uint64_t seed, std::span<double> out) {
            Pcg32 random(hash_keys(seed, 9));
            const float turn = 6.2831853f * random.uniform();
            const glm::vec3 target(0.6f * random.uniform(), 0.0f, 0.6f * random.uniform());
            const glm::vec3 d(std::cos(turn), -slope, std::sin(turn));
            const Hit x = tracer.intersect(Ray{target - d, kInfinity, d});
            ASSERT_FALSE(x.missed());
            ASSERT_GT(x.ng.y, 0.99f);
            const double E = lambert(x.p, {0, 1, 0}, rectangle(-0.5, 0.5, 1, -0.5, 0.5), 10.0);
            out[0] = by_path(tracer, x, Light::direct, seed, 1000) / E;
          });
  }
}

// Guards against: light counted twice, and holes where triangles have no normal.
TEST(HardScenes, DoubledNeedleAndCollapsedTrianglesReflectAsThePlateTheyCover) {
  Scene s = lit_plate();
  Mesh& plate = s.meshes[0];
  const Mesh whole = plate;
  // A fan of 100 needles round one corner, over the other two edges.
  plate.positions = {{-1, 0, -1}};
  plate.triangles.clear();
  for (int i = 0; i <= 100; ++i) {
    const float t = static_cast<float>(i % 50) / 25.0f - 1.0f;
    plate.positions.push_back(i == 100 ? glm::vec3(1, 0, -1)
                              : i < 50 ? glm::vec3(t, 0, 1)
                                       : glm::vec3(1, 0, -t));
  }
  for (std::uint32_t i = 1; i <= 100; ++i) {
    plate.triangles.push_back({0, i, i + 1});
    plate.triangles.push_back({0, i, i + 1});  // twice
    plate.triangles.push_back({i, i + 1, 0});  // and once more
    plate.triangles.push_back({0, i, i});      // a line
    plate.triangles.push_back({i, i, i});      // a point
  }
  s.meshes.push_back(whole);
  const RayTracer rays(std::move(s));
  EXPECT_EQ(rays.scene().dropped_triangles, 200u);
  const Known points[] = {above_plate({0.1f, 0.7f, 0.2f}, {0, -1, 0})};
  const VplSettings vpls[] = {{512, 1.0f, 16}};
  judge_indirect("fan of needles", rays, points, vpls);
}

// Guards against: lengths that do not scale with the scene.
TEST(HardScenes, AScaledSceneGivesTheSamePicture) {
  const auto room = [](float scale) {
    Scene s;
    s.name = "room";
    const auto wall = s.add_material({.albedo = {0.7f, 0.5f, 0.3f}});
    s.meshes.push_back(box("walls", {{-10, 0, -10}, {10, 20, 10}}, wall, true));
    s.meshes.push_back(icosphere("ball", {3, 6, -2}, 4.0f, 2, wall));
    add_lamp(s, 6.0f, 19.0f, 10.0f);
    s.camera = {.eye = {1, 12, 9}, .target = {0, 7, -3}, .up = {0, 1, 0}, .fov_y = 1.0f};
    for (Mesh& mesh : s.meshes)
      for (glm::vec3& p : mesh.positions) p *= scale;
    s.camera.eye *= scale;
    s.camera.target *= scale;
    return s;
  };
  constexpr int kSize = 24;
  for (const char* name : {"path", "instant_gi"}) {
    const RayTracer one_rays(room(1.0f));
    const Image one = picture(one_rays, find_integrator(name), kSize, 4, {.seed = 3});
    for (const float scale : {1e-4f, 1e4f}) {
      const RayTracer rays(room(scale));
      const Image other = picture(rays, find_integrator(name), kSize, 4, {.seed = 3});
      int alike = 0;
      double mean_one = 0.0, mean_other = 0.0;
      for (std::size_t i = 0; i < one.pixels.size(); ++i) {
        const float difference = glm::distance(one.pixels[i], other.pixels[i]);
        alike += difference <= 1e-3f * glm::length(one.pixels[i]);
        mean_one += one.pixels[i].y;
        mean_other += other.pixels[i].y;
      }
      std::printf("%s, scaled by %g: %d of %d pixels alike, means differ by %.2g\n", name,
                  static_cast<double>(scale), alike, kSize * kSize, mean_other / mean_one - 1.0);
      EXPECT_GE(alike, 0.97 * kSize * kSize)
          << name << ' ' << scale;  // a ray in a hundred may take another side
      EXPECT_NEAR(mean_other / mean_one, 1.0, 0.003) << name << ' ' << scale;
    }
  }
}

// Guards against: offsets that carry rays through a wall, and VPLs or compensation that shine through it.
TEST(HardScenes, NoLightPassesAThinWall) {
  for (const float thickness : {0.0f, 4e-5f}) {
    Scene s;
    s.name = "two_rooms";
    const auto wall = s.add_material({.albedo = glm::vec3(0.7f)});
    s.meshes.push_back(box("walls", {{-1, 0, -1}, {1, 1, 1}}, wall, true));
    const float x = 0.5f * thickness;
    if (thickness > 0.0f)
      s.meshes.push_back(box("partition", {{-x, -0.1f, -1.1f}, {x, 1.1f, 1.1f}}, wall));
    else
      s.meshes.push_back(quad("partition", {0, -0.1f, -1.1f}, {0, 0, 2.2f}, {0, 1.2f, 0}, wall));
    const auto glow = s.add_material({.emission = glm::vec3(1e6f)});
    s.meshes.push_back(quad("lamp", {-0.8f, 0.99f, -0.5f}, {0.6f, 0, 0}, {0, 0, 1}, glow));
    const RayTracer rays(std::move(s));
    Tracer tracer(rays);
    VplSet set(rays, {256, 1});
    trace_all(set, tracer);
    ASSERT_GT(set.count(), 100u);
    Pcg32 random(5);
    const float clamp = 0.01f * vpl_clamp(rays.scene().bounds);
    const auto light_at = [&](const Hit& at, std::uint64_t key) {
      double E = gather(tracer, at, Strata::for_rays(64), key).E.y +
                 gather_vpls(tracer, at, set.vpls(), clamp).y +
                 compensate(tracer, at, set.vpls(), clamp, 16, key).E.y;
      for (int k = 0; k < 8; ++k) E += sample_irradiance(tracer, at, Light::all, random).y;
      return E;
    };
    for (std::uint64_t i = 0; i < 300; ++i) {
      // Every third ray goes to where the partition meets the floor.
      const glm::vec3 from(0.5f, 0.5f, 0.0f);
      const float u = random.uniform(), v = random.uniform(), w = random.uniform();
      glm::vec3 d(2.0f * u - 1.0f, 2.0f * v - 1.0f, 2.0f * w - 1.0f);
      if (i % 3 == 0) d = glm::vec3(x + 3e-5f, 0, 2.0f * v - 1.0f) - from;
      const Hit dark = tracer.intersect(Ray{from, kInfinity, d});
      ASSERT_FALSE(dark.missed());
      ASSERT_EQ(light_at(dark, i), 0.0)
          << dark.p.x << ' ' << dark.p.y << ' ' << dark.p.z << ", " << thickness;
      const Hit lit = tracer.intersect(Ray{from * glm::vec3(-1, 1, 1), kInfinity, d * glm::vec3(-1, 1, 1)});
      ASSERT_GT(light_at(lit, i), 0.0);
    }
  }
}

// Guards against: sums, densities or alias tables that lose a lamp of 1e-20 beside one of 1e20.
TEST(HardScenes, RoomsOfRadiance1em20And1e20KeepTheirLight) {
  Scene s;
  s.name = "dim_and_bright";
  std::vector<Known> points;
  for (const float L : {1e-20f, 1e20f}) {
    const float x = L < 1.0f ? -2.0f : 2.0f;
    const auto wall = s.add_material({.albedo = glm::vec3(0.5f), .emission = glm::vec3(0.5f * L)});
    s.meshes.push_back(box("room", {{x - 1, 0, -1}, {x + 1, 2, 1}}, wall, true));
    points.push_back({facing({x + 0.2f, 0, 0.1f}, {0, 1, 0}), 0.5 * kPi * static_cast<double>(L)});
  }
  const RayTracer rays(std::move(s));
  judge_indirect("1e-20 and 1e20", rays, points, {});
  Tracer tracer(rays);
  double E[2];
  by_vpls(tracer, points, {64, vpl_clamp(rays.scene().bounds), 4}, 1, E);
  for (const double e : E) EXPECT_TRUE(std::isfinite(e) && e >= 0.0);
}

// Guards against: float sums that stagnate.
TEST(HardScenes, SumsOverAHundredThousandVplsAreThoseOfDoubles) {
  constexpr std::size_t kVpls = 100'000;
  const Hit at = facing({0, 0, 0}, {0, 1, 0});
  for (const bool equal : {true, false}) {
    VplArrays vpls(kVpls);
    std::vector<std::uint64_t> bits(vpls.words());
    Pcg32 random(7);
    glm::dvec3 E(0.0);
    for (std::size_t i = 0; i < kVpls; ++i) {
      const float u = random.uniform(), v = random.uniform();
      const float size = equal ? 1.0f : std::exp(20.0f * random.uniform() - 10.0f);
      const glm::vec3 d = equal ? glm::vec3(0, 1, 0) : cosine_direction(Basis(at.n), 0.9f * u, v);
      const Vpl vpl{(1.0f + v) * d, -d, size * glm::vec3(1.0f, 0.1f, 0.003f)};
      vpls.set(i, vpl);
      bits[i / 64] |= std::uint64_t{1} << i % 64;
      const glm::dvec3 to(vpl.p);
      const double d2 = glm::dot(to, to);
      E += std::min(to.y * -glm::dot(to, glm::dvec3(vpl.n)) / (d2 * d2), 0.5) / kPi * glm::dvec3(vpl.flux);
    }
    const Irradiance sum = irradiance_from(bits, at, vpls, 0.5f);
    for (int c = 0; c < 3; ++c) {
      std::printf("100,000 VPLs, %s: float over double less 1: %.2g\n", equal ? "equal" : "unequal",
                  sum[c] / E[c] - 1.0);
      EXPECT_NEAR(sum[c] / E[c], 1.0, 1e-4);  // 6,250 a lane, each rounded by 6e-8 at most
    }
  }
}

}  // namespace
}  // namespace icbench
