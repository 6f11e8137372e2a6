// Every estimator of irradiance against closed forms: the estimators alone, and their records through a cache.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <glm/geometric.hpp>
#include <iterator>
#include <numeric>
#include <span>
#include <string>
#include <vector>

#include "any_cache.h"
#include "core/interpolation.h"
#include "judged_estimates.h"
#include "scene/registry.h"
#include "trap_invalid.h"

namespace icbench {
namespace {

TEST(ClosedForms, DirectLightOfASquareIsLamberts) {
  const RayTracer rays(make_scene("lit_floor"));
  std::vector<Known> points;
  for (const glm::vec3 p : {glm::vec3(0.3f, 0, -0.2f), glm::vec3(1.5f, 0, 1)})
    points.push_back({facing(p, {0, 1, 0}), lambert(p, {0, 1, 0}, rectangle(-0.5, 0.5, 1, -0.5, 0.5), 10.0)});
  judge_direct("lit_floor", rays, points);
}

TEST(ClosedForms, DirectLightOfASphereIsThatOfItsCentre) {
  const Scene scene = make_scene("sphere_light");
  const RayTracer rays(scene);
  std::vector<Known> points;
  for (const glm::dvec3 p : {glm::dvec3(0.2, 0, 0), glm::dvec3(-0.8, 0, 1)}) {
    const glm::dvec3 d = glm::dvec3(0, 1, 0) - p;
    const double sphere = kPi * 10.0 * 0.4 * 0.4 / glm::dot(d, d) / glm::length(d);
    points.push_back({facing(p, {0, 1, 0}), lambert(p, {0, 1, 0}, scene.meshes[1], 10.0)});
    EXPECT_NEAR(points.back().E / sphere, 1.0, 0.003) << "the triangles are not that sphere";
  }
  judge_direct("sphere_light", rays, points);
}

TEST(ClosedForms, InABoxOfOneRadianceIrradianceIsPiTimesThat) {
  Scene s;
  s.name = "glowing_box";
  s.add_material({.emission = glm::vec3(3.0f)});
  s.meshes.push_back(box("box", {{-1, -2, -1}, {1, 1, 3}}, 0, true));
  const RayTracer rays(std::move(s));
  const Known points[] = {{facing({0.4f, -0.1f, 0.2f}, {1, 2, 3}), 3.0 * kPi}};
  judge_direct("glowing box", rays, points);
}

TEST(ClosedForms, IndirectLightOfAPlateIsLamberts) {
  const RayTracer rays(lit_plate());
  const Known points[] = {above_plate({0.1f, 0.7f, 0.2f}, {0, -1, 0}),  // parallel
                          above_plate({-1.0f, 0.5f, 0.3f}, {1, 0, 0}),  // at a right angle, over its edge
                          above_plate({0.5f, 0.6f, -0.5f}, {-1, -2, 0.5f})};
  const VplSettings vpls[] = {{512, kInfinity, 0}, {512, 1.0f, 16}};
  judge_indirect("lit plate", rays, points, vpls);
}

TEST(ClosedForms, InASphereIndirectLightIsEven) {
  const Scene scene = make_scene("integrating_sphere");
  double area = 0.0;
  for (const glm::uvec3& t : scene.meshes[0].triangles) {
    const auto& p = scene.meshes[0].positions;
    area += 0.5 * glm::length(glm::cross(glm::dvec3(p[t.y]) - glm::dvec3(p[t.x]),
                                         glm::dvec3(p[t.z]) - glm::dvec3(p[t.x])));
  }
  EXPECT_NEAR(area / (4.0 * kPi), 1.0, 0.003) << "the triangles are not that sphere";
  // Whatever the triangles do at single points, the mean over the area is exact: what is reflected arrives.
  const Known mean[] = {{{}, 4.0 * kPi * 2.0 / area}};  // rho Phi / ((1 - rho) A)
  const RayTracer rays(scene);
  Tracer tracer(rays);
  const auto at_random = [&](Pcg32& random) {
    for (;;) {
      const glm::vec3 d(random.uniform() - 0.5f, random.uniform() - 0.5f, random.uniform() - 0.5f);
      if (glm::dot(d, d) < 0.25f && glm::dot(d, d) > 0.0f)
        return tracer.intersect(Ray{glm::vec3(0.0f), kInfinity, d});
    }
  };
  judge("integrating_sphere, hemisphere gather", mean, kError, [&](std::uint64_t seed, std::span<double> E) {
    Pcg32 random(hash_keys(seed, 4));
    E[0] = by_gather(tracer, at_random(random), seed);
  });
  judge("integrating_sphere, path's indirect light", mean, kError,
        [&](std::uint64_t seed, std::span<double> E) {
          Pcg32 random(hash_keys(seed, 4));
          double sum = 0.0;
          for (int i = 0; i < 1000; ++i)
            sum += sample_irradiance(tracer, at_random(random), Light::indirect, random).y;
          E[0] = sum / 1000.0;
        });
  // Everything is seen under the same G, 1/4: clamped below that, a fifth of all light is compensation's.
  judge("integrating_sphere, VPLs clamped at 0.2", mean, kError,
        [&](std::uint64_t seed, std::span<double> E) {
          Pcg32 random(hash_keys(seed, 4));
          Known points[8];
          for (Known& point : points) point.at = at_random(random);
          double of[8];
          by_vpls(tracer, points, {4096, 0.2f, 16}, seed, of);
          E[0] = std::accumulate(std::begin(of), std::end(of), 0.0) / 8.0;
        });
}

// That path and cache keep it within a tenth of a per cent is in render_path_test.cpp and render_cached_test.cpp; VPLs
// in it are in render_vpl_test.cpp.
TEST(ClosedForms, IndirectLightInAFurnaceIsPiTimesItsAlbedo) {
  const RayTracer rays(make_scene("white_furnace"));
  const Known known[] = {{primary_hits(rays, 3, 3).hits[4], kPi * kRho}};
  judge_indirect("white_furnace", rays, known, {});
}

// Records are made and asked for as a renderer does, in the light of the plate. Beside each cache goes a twin whose
// records lie at the same places and hold the closed form, so that its error is interpolation's alone.
TEST(ClosedForms, RecordsAreUnbiasedAndInterpolationErrsWithinTheAccuracy) {
  constexpr int kSide = 20, kRuns = 40;
  const RayTracer rays(lit_plate());
  Tracer tracer(rays);
  const Bounds bounds{{-2, -1, -2}, {2, 1, 2}};
  std::vector<Known> points;
  for (int i = 0; i < kSide * kSide; ++i) {
    const int k = i * 87 % (kSide * kSide);  // all over the place, not row by row
    points.push_back(above_plate(
        {0.1f * static_cast<float>(k % kSide) - 0.95f, 0.6f, 0.1f * static_cast<float>(k / kSide) - 0.95f},
        {0, -1, 0}));
  }
  for (const AnyCache::Maker& maker : registered_caches()) {
    const std::string name(maker.traits.name);
    if (name != "wait_free" && name != "packed_wait_free") continue;
    double errors[2];
    for (const bool fine : {false, true}) {
      const float a = fine ? 0.1f : 0.4f;
      Judged records(1.0);
      Estimate interpolation, whole;
      double interpolation_squares = 0.0, noise_squares = 0.0, asked = 0.0;
      for (std::uint64_t seed = 0; seed < kRuns; ++seed) {
        const CacheConfig config{.bounds = bounds, .a_max = a, .a = a, .capacity = 1024};
        AnyCache cache(maker, config), twin(maker, config);
        AnyCache::Session session = cache.open_session(0), exact = twin.open_session(0);
        std::uint32_t id = 0;
        for (const Known& known : points) {
          const SurfacePoint x{known.at.p, known.at.n};
          if (session.query(x)) continue;
          const GatherResult g = gather(tracer, known.at, Strata::for_rays(256), hash_keys(seed, id));
          records.add(g.E.y / known.E);
          const float R = RadiusLimits{0.05f, 2.0f}.clamp(g.R);
          ASSERT_EQ(session.insert({x.p, x.n, R, g.E, id}), InsertResult::inserted);
          ASSERT_EQ(exact.insert({x.p, x.n, R, Irradiance(static_cast<float>(known.E)), id++}),
                    InsertResult::inserted);
        }
        for (const Known& known : points) {
          const SurfacePoint x{known.at.p, known.at.n};
          const double E = session.query(x).value().y / known.E, of_twin = exact.query(x).value().y / known.E;
          interpolation.add(of_twin - 1.0);
          whole.add(E - 1.0);
          interpolation_squares += (of_twin - 1.0) * (of_twin - 1.0);
          noise_squares += (E - of_twin) * (E - of_twin);
          ++asked;
        }
      }
      const std::string at = name + (fine ? ", a = 0.1" : ", a = 0.4");
      records.print(at + ", inserted records");
      errors[fine] = std::sqrt(interpolation_squares / asked);
      std::printf(
          "%-44s interpolation: bias %.3f %%, RMS %.3f %%; records' noise left: RMS %.3f %%; whole bias %.3f "
          "%%\n",
          at.c_str(), 100.0 * interpolation.mean(), 100.0 * errors[fine],
          100.0 * std::sqrt(noise_squares / asked), 100.0 * whole.mean());
      EXPECT_TRUE(records.agrees()) << at;
      EXPECT_LE(records.error(), 0.0025) << at;
      EXPECT_LT(errors[fine], a) << at << ": more than the accuracy allows";
      EXPECT_GT(errors[fine], 1e-5) << at << ": nothing was interpolated";
    }
    EXPECT_LT(errors[1], 0.5 * errors[0]) << name << ": a finer accuracy does not help";
  }
}

}  // namespace
}  // namespace icbench
