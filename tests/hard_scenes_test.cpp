// Scenes that are hard on every estimator, each with the failure it guards against.
#include "hard_scenes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <glm/geometric.hpp>
#include <string>
#include <vector>

#include "cached_runs.h"
#include "scene/registry.h"
#include "trap_invalid.h"

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

// Guards against: shadow rays that miss a narrow gap or slip past its edges, be it one of a millimetre in a hall of 100
// m.
TEST(HardScenes, ALampBehindASlitShinesAsFarAsItIsSeen) {
  struct Slit {
    const char* name;
    float half;  // of its width
    float lamp;  // side
    float hall;  // side
  };
  for (const Slit& slit :
       {Slit{"slit", 0.05f, 1.0f, 8.0f}, Slit{"slit of a millimetre", 5e-4f, 3e-3f, 100.0f}}) {
    Scene s;
    s.name = "slit";
    add_lamp(s, slit.lamp, 2.0f, 10.0f / (slit.lamp * slit.lamp));
    const auto black = s.add_material({});
    const float far = 0.5f * slit.hall;
    s.meshes.push_back(quad("floor", {-far, -1, -far}, {0, 0, slit.hall}, {slit.hall, 0, 0}, black));
    s.meshes.push_back(quad("left", {-slit.half, 1, -4}, {0, 0, 8}, {-4, 0, 0}, black));
    s.meshes.push_back(quad("right", {slit.half, 1, -4}, {0, 0, 8}, {4, 0, 0}, black));
    const RayTracer rays(std::move(s));
    // From x at height 0 the gap at height 1 shows what lies between 2 (-+half) - x at height 2.
    const double side = static_cast<double>(slit.lamp), gap = 2.0 * static_cast<double>(slit.half);
    const float x = 0.35f * slit.lamp;
    const glm::dvec3 p(x, 0, 0.3);
    const double low = std::max(-0.5 * side, -gap - p.x), high = std::min(0.5 * side, gap - p.x);
    const Known point[] = {
        {facing(p, {0, 1, 0}),
         lambert(p, {0, 1, 0}, rectangle(low, high, 2, -0.5 * side, 0.5 * side), 10.0 / (side * side))}};
    judge_direct(slit.name, rays, point);
  }
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
  constexpr int kSize = 24;
  for (const char* name : {"path", "instant_gi"}) {
    const RayTracer rays(scaled_room(1.0f));
    const Image one = picture(rays, find_integrator(name), kSize, 4, {.seed = 3});
    for (const float scale : {1e-4f, 1e4f}) {
      const RayTracer scaled(scaled_room(scale));
      expect_alike(one, picture(scaled, find_integrator(name), kSize, 4, {.seed = 3}),
                   std::string(name) + ", scaled by " + std::to_string(scale));
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

// Guards against: float sums that stagnate, of irradiance and of its gradients.
TEST(HardScenes, SumsOverAHundredThousandVplsAreThoseOfDoubles) {
  constexpr std::size_t kVpls = 100'000;
  constexpr double kClamp = 0.5;
  const Hit at = facing({0, 0, 0}, {0, 1, 0});
  const glm::dvec3 n(at.n);
  for (const bool equal : {true, false}) {
    VplArrays vpls(kVpls);
    std::vector<std::uint64_t> bits(vpls.words());
    Pcg32 random(7);
    glm::dvec3 E(0.0);
    // By channel: of translational and rotational gradients, and of the magnitudes of all that is added up for them.
    glm::dvec3 moved[3]{}, turned[3]{}, moves[3]{}, turns[3]{};
    std::size_t sloping = 0;
    for (std::size_t i = 0; i < kVpls; ++i) {
      const float u = random.uniform(), v = random.uniform();
      const float size = equal ? 1.0f : std::exp(20.0f * random.uniform() - 10.0f);
      const glm::vec3 d =
          equal ? glm::normalize(glm::vec3(0.3f, 1, -0.2f)) : cosine_direction(Basis(at.n), 0.9f * u, v);
      const Vpl vpl{(1.0f + v) * d, -d, size * glm::vec3(1.0f, 0.1f, 0.003f)};
      vpls.set(i, vpl);
      bits[i / 64] |= std::uint64_t{1} << i % 64;
      const glm::dvec3 to(vpl.p), flux(vpl.flux), from(vpl.n);
      const double d2 = glm::dot(to, to), there = -glm::dot(to, from), G = to.y * there / (d2 * d2);
      E += std::min(G, kClamp) / kPi * flux;
      ASSERT_GT(std::abs(G / kClamp - 1.0), 1e-7) << "rounding decides whether the clamp bounds it";
      if (G < kClamp) {
        ++sloping;
        const glm::dvec3 parts[] = {to.y / (d2 * d2) * from, 4.0 * G / d2 * to, -there / (d2 * d2) * n};
        const glm::dvec3 turn = there / (d2 * d2) * to;
        for (int c = 0; c < 3; ++c) {
          for (const glm::dvec3& part : parts) {
            moved[c] += flux[c] / kPi * part;
            moves[c] += flux[c] / kPi * glm::abs(part);
          }
          turned[c] += flux[c] / kPi * glm::cross(n, turn);
          turns[c] += flux[c] / kPi * glm::abs(glm::cross(n, turn));
        }
      }
    }
    EXPECT_GT(sloping, kVpls / 4);
    IrradianceGradients gradients;
    const Irradiance sum = irradiance_from(bits, at, vpls, static_cast<float>(kClamp));
    ASSERT_EQ(irradiance_from(bits, at, vpls, static_cast<float>(kClamp), gradients), sum);
    for (int c = 0; c < 3; ++c) {
      std::printf("100,000 VPLs, %s: float over double less 1: %.2g\n", equal ? "equal" : "unequal",
                  sum[c] / E[c] - 1.0);
      // Sums of n numbers that are not negative err by at most n u of themselves, u = 2^-24 (Higham 2002, 4.2): here
      // 6,250 in each of 16 lanes, four more for these, and some ten roundings a term. Roundings cancel for the most
      // part.
      constexpr double kBound = (kVpls / 16 + 4 + 10) / 16'777'216.0;
      static_assert(kBound < 4e-4);
      EXPECT_NEAR(sum[c] / E[c], 1.0, kBound);
      // Numbers of both signs err by that of the sum of their magnitudes: four at once, so 1,563 in each lane, two
      // more for these four, 16 lanes, and some 20 roundings a term.
      constexpr double kBoundOfSlopes = (kVpls / 64 + 1 + 2 + 16 + 20) / 16'777'216.0;
      static_assert(kBoundOfSlopes < 1e-4);
      moved[c] -= glm::dot(moved[c], n) * n;
      const auto channel = static_cast<std::size_t>(c);
      double worst = 0.0;
      for (int axis = 0; axis < 3; ++axis) {
        const double of_moved = std::abs(gradients.translational[channel][axis] - moved[c][axis]);
        const double of_turned = std::abs(gradients.rotational[channel][axis] - turned[c][axis]);
        EXPECT_LE(of_moved, kBoundOfSlopes * moves[c][axis]) << "axis " << axis;
        EXPECT_LE(of_turned, kBoundOfSlopes * turns[c][axis]) << "axis " << axis;
        if (axis != 1) worst = std::max({worst, of_moved / moves[c][axis], of_turned / turns[c][axis]});
      }
      std::printf("and of its gradients: error at most %.2g of the magnitudes\n", worst);
    }
  }
}

// Guards against: any NaN, infinity or negative value in any integrator's picture, and light that gets lost or comes
// about; in each scene, besides, against what kHardScenes names.
TEST(HardScenes, EveryIntegratorMakesAnImageOfThem) {
  constexpr int kSize = 10;
  for (const HardScene& hard : kHardScenes) {
    const RayTracer rays(hard.make());
    const Image truth = picture(rays, find_integrator("path"), kSize, 128, {.seed = 7});
    const std::uint32_t spp = hard.is_noisy() ? 128 : 32;
    for (const IntegratorEntry& integrator : kIntegrators) {
      if (integrator.needs_cache()) continue;
      const std::string what = std::string(hard.name) + ", " + std::string(integrator.name) +
                               ", guards against: " + hard.guards_against;
      const Image made = picture(rays, integrator, kSize, spp, {.seed = 2}, TileOrder::scanline, 2);
      // Four standard deviations: of one set of few virtual lights, whatever the samples; of paths.
      const double tolerance =
          integrator.uses_vpls ? (hard.is_noisy() ? 0.5 : 0.25) : (hard.is_noisy() ? 0.1 : 0.05);
      expect_an_image(made, what);
      if (!hard.is_bright()) {
        EXPECT_LE(mean_of(made), hard.most) << what;
        continue;
      }
      ASSERT_GT(mean_of(truth), 0.0) << what;
      const double ratio = mean_of(made) / mean_of(truth);
      std::printf("%s, %s: %.3f\n", hard.name, std::string(integrator.name).c_str(), ratio);
      if (integrator.name == "whitted") {  // light that comes straight from a lamp is a half, more or less
        EXPECT_GT(ratio, hard.is_noisy() ? 0.05 : 0.2) << what;
        EXPECT_LT(ratio, 0.8) << what;
      } else {
        EXPECT_NEAR(ratio, 1.0, tolerance) << what;
      }
    }
  }
}

// Guards against: a trap that is off, in the thread of a test or in those that it starts, or stays off after a library
// was called; nobody would see the traps of all other tests find nothing.
TEST(HardScenesDeathTest, AnInvalidOperationEndsTheProgram) {
  if (!kCanTrapInvalid) GTEST_SKIP() << "this build cannot trap";
  const auto divide = [] {
    const volatile float zero = 0.0f;
    const volatile float nan = zero / zero;
    static_cast<void>(nan);
  };
  const auto compare = [] {
    const volatile float nan = std::numeric_limits<float>::quiet_NaN();
    const volatile bool less = nan < 1.0f;
    static_cast<void>(less);
  };
  const RayTracer rays(lit_plate());
  {
    const LibraryCall call;
    divide();
  }
  EXPECT_DEATH(divide(), "");
  EXPECT_DEATH(compare(), "");
  EXPECT_DEATH(ThreadCrew(rays, 2).run([&](unsigned, Tracer&) { divide(); }), "");
  Tracer tracer(rays);
  EXPECT_FALSE(tracer.intersect(Ray{{0, 1, 0}, kInfinity, {0, -1, 0}}).missed());
  EXPECT_DEATH(divide(), "");
}

}  // namespace
}  // namespace icbench
