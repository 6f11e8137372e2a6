// Caustics: where particles tell them, and that records do not put them out.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <glm/geometric.hpp>
#include <limits>
#include <utility>

#include "cached_runs.h"
#include "render/caustics.h"
#include "render/gather.h"
#include "render/specular.h"
#include "scene/room.h"
#include "scene/shapes.h"
#include "specular_scenes.h"

namespace icbench {
namespace {

constexpr float kAlbedo = 0.25f;     // of the mirror
constexpr float kRadiance = 100.0f;  // of the lamp
constexpr float kSide = 0.1f;        // of the lamp, metres
const glm::vec3 kUp(0, 1, 0);

// A lamp that shines up at a mirror two metres above the floor, which sees its image three metres above itself: at a
// distance r from the point below it, irradiance is kBelow / (1 + r^2 / 9)^2.
constexpr float kBelow = kAlbedo * kRadiance * kSide * kSide / 9.0f;

Scene lamp_under_mirror(Surface above) {
  Scene s;
  const auto white = s.add_material({.albedo = glm::vec3(0.5f)});
  const auto lamp = s.add_material({.emission = glm::vec3(kRadiance)});
  const auto mirror = s.add_material({.albedo = glm::vec3(kAlbedo), .surface = above});
  s.meshes.push_back(quad("floor", {-9, 0, -9}, {0, 0, 18}, {18, 0, 0}, white));
  s.meshes.push_back(quad("mirror", {-9, 2, -9}, {18, 0, 0}, {0, 0, 18}, mirror));
  s.meshes.push_back(quad("lamp", {-kSide / 2, 1, -kSide / 2}, {0, 0, kSide}, {kSide, 0, 0}, lamp));
  s.camera = {.eye = {0, 0.5f, 4}, .target = {0, 0, 0}, .up = kUp, .fov_y = 1.0f};
  return s;
}

// A room whose lamp is behind a pane that reaches from wall to wall.
Scene lamp_behind_glass() {
  Scene s;
  const auto white = s.add_material({.albedo = glm::vec3(0.7f)});
  const auto lamp = s.add_material({.emission = glm::vec3(20.0f)});
  const auto glass = s.add_material(kGlass);
  add_room(s, {{-1, 0, -1}, {1, 2, 1}}, {white, white, white, white, white, white});
  s.meshes.push_back(quad("lamp", {-0.4f, 1.97f, -0.4f}, {0.8f, 0, 0}, {0, 0, 0.8f}, lamp));
  s.meshes.push_back(box("pane", {{-1.1f, 1.85f, -1.1f}, {1.1f, 1.9f, 1.1f}}, glass));
  s.camera = {.eye = {0.1f, 0.75f, 0.95f}, .target = {0, 0.5f, -0.3f}, .up = kUp, .fov_y = 1.2f};
  return s;
}

Caustics caustics_of(const RayTracer& rays, unsigned threads = 1) {
  ThreadCrew crew(rays, threads);
  Caustics out;
  out.find(rays, crew, 1);
  return out;
}

TEST(Caustics, EndWhereTheImageOfALampInAMirrorIsAsFaintAsAsked) {
  const Scene scene = lamp_under_mirror(Surface::mirror);
  const RayTracer rays(scene);
  const Caustics caustics = caustics_of(rays);
  EXPECT_GT(caustics.count(), Caustics::kParticles / 2);
  const glm::vec3 p(6, 0, 0);
  for (const float share : {0.5f, 0.25f, 0.1f}) {
    const float edge = 6.0f - caustics.distance_to_brighter(p, kUp, share * kBelow);
    const float there = 1.0f / ((1.0f + edge * edge / 9.0f) * (1.0f + edge * edge / 9.0f));
    std::printf("above %.2f of the most: to %.2f m, where there is %.3f\n", share, edge, there);
    // Eight particles tell an irradiance to 38 %; of many places some are taken for brighter than they are.
    EXPECT_LT(there, 1.1f * share);
    EXPECT_GT(there, 0.3f * share);
  }
  EXPECT_EQ(caustics.distance_to_brighter(p, kUp, 6.0f * kBelow), std::numeric_limits<float>::infinity());
  EXPECT_EQ(caustics.distance_to_brighter(p, -kUp, 0.1f * kBelow), std::numeric_limits<float>::infinity());
}

// Guards against: scenes that pay for what they do not have; direct light taken for a caustic.
TEST(Caustics, AreOfSpecularSurfacesAlone) {
  const Scene diffuse = lamp_under_mirror(Surface::diffuse);
  const RayTracer rays(diffuse);
  ThreadCrew crew(rays, 1);
  Caustics caustics;
  caustics.find(rays, crew, 1);
  EXPECT_EQ(caustics.count(), 0u);
  EXPECT_EQ(crew.rays().total(), 0u);

  Scene away = lamp_under_mirror(Surface::mirror);  // the lamp shines at the floor
  std::swap(away.meshes[2].triangles[0][0], away.meshes[2].triangles[0][1]);
  std::swap(away.meshes[2].triangles[1][0], away.meshes[2].triangles[1][1]);
  EXPECT_EQ(caustics_of(RayTracer(away)).count(), 0u);
}

TEST(Caustics, AreTheSameForAnyNumberOfThreads) {
  const Scene scene = lamp_under_mirror(Surface::mirror);
  const RayTracer rays(scene);
  const Caustics one = caustics_of(rays, 1), three = caustics_of(rays, 3);
  ASSERT_EQ(one.count(), three.count());
  for (float share = 0.1f; share < 1.0f; share += 0.01f)
    ASSERT_EQ(one.distance_to_brighter({6, 0, 0}, kUp, share * kBelow),
              three.distance_to_brighter({6, 0, 0}, kUp, share * kBelow));
}

Scene lens_over_floor() {
  Scene s;
  const auto white = s.add_material({.albedo = glm::vec3(0.5f)});
  const auto glass = s.add_material({.albedo = glm::vec3(1.0f), .surface = Surface::dielectric, .ior = 1.5f});
  const auto lamp = s.add_material({.emission = glm::vec3(40.0f)});
  s.meshes.push_back(box("room", {{-2, 0, -2}, {2, 3, 2}}, white, true));
  s.meshes.push_back(icosphere("lens", {0.2f, 0.9f, 0}, 0.4f, 4, glass));
  s.meshes.push_back(quad("lamp", {0.0f, 2.9f, -0.2f}, {0.4f, 0, 0}, {0, 0, 0.4f}, lamp));
  s.camera = {.eye = {0.0f, 0.8f, 1.9f}, .target = {0.2f, 0, 0}, .up = kUp, .fov_y = 0.7f};
  return s;
}

// Guards against: light that is lost or counted twice as it is set apart.
TEST(Caustics, LightSetApartIsInTheIrradianceAndInNoCell) {
  for (const Scene& scene : {lamp_under_mirror(Surface::mirror), lamp_under_mirror(Surface::diffuse)}) {
    const RayTracer rays(scene);
    Tracer tracer(rays);
    const Hit at = down(tracer, {0.5f, 0.5f, 0.3f});
    Hemisphere seen, rest;
    const Strata strata = Strata::for_rays(4096);
    const GatherResult whole = gather(tracer, at, strata, 3, seen);
    const GatherResult parted = gather(tracer, at, strata, 3, rest, FocusedLight::apart);
    ASSERT_EQ(whole.E, parted.E);
    EXPECT_EQ(seen.apart, glm::vec3(0.0f));
    const auto sum_of = [&](const Hemisphere& h) {
      double sum = 0.0;
      for (const HemisphereSample& s : h.samples) sum += s.L.y;
      return kPi * sum / strata.count();
    };
    EXPECT_NEAR(sum_of(seen), whole.E.y, 1e-5 * whole.E.y);
    EXPECT_NEAR(sum_of(rest) + rest.apart.y, whole.E.y, 1e-5 * whole.E.y);
    if (scene.has_specular()) {
      EXPECT_GT(rest.apart.y, 0.1f * whole.E.y);
    } else {
      EXPECT_EQ(rest.apart, glm::vec3(0.0f));
    }
  }
}

// Guards against: light that walls reflect of a caustic taken for light that lamps send straight to where a record is,
// so that nothing of it was left in what a record's reach is decided by. (Behind a pane of glass all light was.)
TEST(Caustics, LightSetApartIsThatOfLampsSeenInMirrorsAndBehindGlassAlone) {
  const RayTracer rays(lamp_behind_glass());
  const PrimaryHits primary = primary_hits(rays, 24, 18);
  Tracer tracer(rays);
  const Strata strata = Strata::for_rays(256);
  Estimate difference, straight, all;
  Hemisphere seen;
  for (std::size_t i = 0; i < primary.hits.size(); ++i) {
    const Hit& at = primary.hits[i];
    if (!reflects(rays, at)) continue;
    const double E = gather(tracer, at, strata, hash_keys(i, 5), seen, FocusedLight::apart).E.y;
    double met = 0.0;
    for (std::uint32_t k = 0; k < strata.count(); ++k) {
      Pcg32 random(hash_keys(i, k, 8));
      const float u = random.uniform(), v = random.uniform();
      Ray ray{rays.leave(at.p, at.ng), std::numeric_limits<float>::infinity(),
              cosine_direction(Basis(at.n), u, v)};
      glm::vec3 weight(1.0f);
      std::uint32_t bounces = 0;
      if (!(glm::dot(ray.d, at.ng) > 0.0f)) continue;
      const Hit hit = intersect_beyond_specular(tracer, ray, random, weight, bounces);
      if (hit.missed() || bounces == 0 || !hit.front) continue;
      met += kPi * (weight * rays.material(hit).emission).y / strata.count();
    }
    difference.add(seen.apart.y - met);
    straight.add(met);
    all.add(E);
  }
  std::printf("apart %.3f of all, straight %.3f, +- %.3f\n",
              (straight.mean() + difference.mean()) / all.mean(), straight.mean() / all.mean(),
              difference.error() / all.mean());
  EXPECT_GT(straight.mean(), 0.1 * all.mean());
  EXPECT_LT(difference.error(), 0.1 * straight.mean()) << "too few samples to say so";
  EXPECT_NEAR(difference.mean(), 0.0, 4.0 * difference.error());
}

// Guards against: pictures that are too dark, because records whose rays found much count less far than those whose
// rays, by chance, found nothing. (Cornell specular lost 5 % of its light so, with 256 rays a record.)
TEST(Caustics, WhatRaysFoundByChanceDoesNotDecideHowFarARecordCounts) {
  const RayTracer rays(lens_over_floor());
  const PrimaryHits primary = primary_hits(rays, 8, 8);
  ThreadCrew crew(rays, 1);
  PassSetup setup{rays, crew, 8, 8};
  setup.gather_rays = 256;
  setup.a = 0.3f;
  setup.interpolation = Interpolation::occlusion_hessian;
  const auto source = make_irradiance_cache(setup);
  source->begin_frame({}, crew);
  Tracer tracer(rays);
  const Visible x = primary.at(8 * 6 + 1, 0);
  constexpr int kRecords = 400;
  Estimate E, R, ER, EE, RR;
  for (std::uint64_t seed = 0; seed < kRecords; ++seed) {
    const Record r = source->evaluate(0, tracer, x, {.seed = seed});
    const double e = r.E.y, reach = r.R;
    E.add(e), R.add(reach), ER.add(e * reach), EE.add(e * e), RR.add(reach * reach);
  }
  const double correlation = (ER.mean() - E.mean() * R.mean()) /
                             std::sqrt((EE.mean() - E.mean() * E.mean()) * (RR.mean() - R.mean() * R.mean()));
  std::printf("correlation of irradiance and radius %.3f, irradiance %.3f +- %.3f\n", correlation, E.mean(),
              E.error() * std::sqrt(kRecords));
  EXPECT_GT(correlation, -0.3);
}

// Guards against: a record in the dark beside a caustic, whose rays see nothing of it, that counts across it.
TEST(Caustics, AreNotPutOutByRecordsBesideThem) {
  const RayTracer rays(lens_over_floor());
  const PrimaryHits primary = primary_hits(rays, 40, 40);
  const Level level{.level = Interpolation::occlusion_hessian, .gather_rays = 1024, .a = 0.5f};
  const LevelRun cached = run_level(rays, primary, level);
  const Image truth = without_cache(rays, primary, level, false);
  double mean = 0.0, bright = 0.0, kept = 0.0;
  for (const glm::vec3& L : truth.pixels) mean += L.y / static_cast<double>(truth.pixels.size());
  std::size_t in_caustic = 0;
  for (std::size_t i = 0; i < truth.pixels.size(); ++i) {
    if (truth.pixels[i].y < 3.0 * mean) continue;
    ++in_caustic;
    bright += truth.pixels[i].y;
    kept += cached.indirect.pixels[i].y;
  }
  std::printf("%zu pixels of caustic, %zu records, light there %.3f of a gather's in every pixel\n",
              in_caustic, cached.records.size(), kept / bright);
  ASSERT_GT(in_caustic, 10u);
  EXPECT_LT(cached.records.size(), truth.pixels.size() / 4);
  EXPECT_NEAR(kept / bright, 1.0, 0.1);
}

}  // namespace
}  // namespace icbench
