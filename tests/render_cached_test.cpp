// The cached integrator, on the simplest cache there is.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "cached_runs.h"
#include "core/interpolation.h"
#include "render/gather.h"
#include "render/irradiance_cache.h"
#include "render/path.h"
#include "render_support.h"
#include "scene/registry.h"
#include "scene/shapes.h"
#include "trap_invalid.h"

namespace icbench {

namespace {

struct CachedRun {
  Image indirect;
  CacheUse use;
  RayCounts rays;
};

// How the records of these tests are made.
struct Gathers {
  Strata strata;
  RadiusLimits limits;
  SampleKey key{};
};

CachedRun run_cached(const RayTracer& rays, const PrimaryHits& primary, ListSession& session,
                     const Gathers& g) {
  CachedRun run{blank(primary.width, primary.height), {}, {}};
  Tracer tracer(rays);
  HemisphereSource source(g.strata, g.limits, RecordNames(rays.scene(), primary.width, primary.height));
  for (const Tile& tile : make_tiles(primary.width, primary.height, 8, TileOrder::morton))
    irradiance_cache_tile(session, source, 0, tracer, primary, g.key, tile, run.indirect, run.use);
  run.rays = tracer.counts;
  return run;
}

TEST(RenderCached, TheFurnaceIsWhiteInEveryPixel) {
  const RayTracer rays(make_scene("white_furnace"));
  constexpr int kSize = 32;
  const PrimaryHits primary = primary_hits(rays, kSize, kSize);
  const Gathers params{.strata = Strata::for_rays(4096),
                       .limits = RadiusLimits::for_scene(rays.scene().bounds, 0.01f, 0.2f),
                       .key = {.seed = 4}};
  ListSession session{.bounds = rays.scene().bounds};
  const CachedRun run = run_cached(rays, primary, session, params);
  EXPECT_GT(run.use.hits, run.use.queries / 2) << "hardly anything was interpolated";
  EXPECT_EQ(run.use.rejected, 0u);

  // An interpolated irradiance is a mean of records, so its error is at most theirs.
  Estimate record;
  Tracer tracer(rays);
  for (std::uint64_t k = 0; k < 50; ++k) record.add(gather(tracer, primary.hits[77], params.strata, k).E.x);
  const double deviation = record.error() * std::sqrt(50.0) * kRho / kPi;
  Estimate all;
  for (const glm::vec3& L : run.indirect.pixels) {
    EXPECT_NEAR(L.x, kRho * kRho, 5.0 * deviation);
    all.add(L.x + (1.0 - kRho) + (1.0 - kRho) * kRho);  // emitted and direct radiance, in closed form
  }
  EXPECT_NEAR(all.mean(), 1.0, 0.001);
}

TEST(RenderCached, CountsAddUpAndIdsAreUnique) {
  const RayTracer rays(make_scene("cornell_box"));
  const PrimaryHits primary = primary_hits(rays, 32, 32);
  const Gathers params{.strata = Strata::for_rays(16),
                       .limits = RadiusLimits::for_scene(rays.scene().bounds, 0.002f, 0.1f)};
  ListSession session{.bounds = rays.scene().bounds};
  const CachedRun run = run_cached(rays, primary, session, params);
  std::uint64_t asked = 0;
  for (const Hit& hit : primary.hits) asked += reflects(rays, hit);
  EXPECT_EQ(run.use.queries, asked);
  EXPECT_EQ(run.use.queries, run.use.hits + run.use.inserts);
  EXPECT_EQ(run.use.inserts, session.records.size());
  EXPECT_GE(run.rays.total(), 16 * run.use.inserts / 2);
  std::vector<bool> seen(primary.hits.size());
  for (const Record& r : session.records) {
    ASSERT_LT(r.id, seen.size());
    ASSERT_FALSE(seen[r.id]);
    seen[r.id] = true;
    ASSERT_TRUE(r.R >= params.limits.min && r.R <= params.limits.max);
  }
}

TEST(RenderCached, WhatIsSeenInGlassIsCachedLikewise) {
  Scene s = make_scene("white_furnace");
  const auto glass = s.add_material({.albedo = glm::vec3(1.0f), .surface = Surface::dielectric});
  s.meshes[1].material = s.meshes[2].material = glass;
  const RayTracer rays(std::move(s));
  constexpr int kSize = 32;
  const PrimaryHits primary = primary_hits(rays, kSize, kSize);
  Image direct = blank(kSize, kSize);
  for_tiles(rays, kSize, kSize, TileOrder::scanline, 2,
            [&](Tracer& t, const Tile& tile) { direct_tile(t, primary, 16, {.seed = 2}, tile, direct); });
  ListSession session{.bounds = rays.scene().bounds};
  const CachedRun run = run_cached(rays, primary, session,
                                   {.strata = Strata::for_rays(1024),
                                    .limits = RadiusLimits::for_scene(rays.scene().bounds, 0.01f, 0.1f)});
  std::uint64_t asked = 0;
  for_each_visible({0, 0, kSize, kSize}, primary, [&](const Visible& x) { asked += reflects(rays, x.hit); });
  EXPECT_GT(asked, primary.hits.size());
  EXPECT_EQ(run.use.queries, asked);
  EXPECT_EQ(run.use.queries, run.use.hits + run.use.inserts);
  std::vector<bool> seen(primary.layers() * primary.hits.size());
  for (const Record& r : session.records) {
    ASSERT_LT(r.id, seen.size());
    ASSERT_FALSE(seen[r.id]) << "two hits of a pixel share an id";
    seen[r.id] = true;
  }
  Estimate all;
  for (std::size_t i = 0; i < direct.pixels.size(); ++i)
    all.add(direct.pixels[i].x + run.indirect.pixels[i].x);
  EXPECT_NEAR(all.mean(), 1.0, 0.01);
}

TEST(RenderCached, AFullCacheStillYieldsThePicture) {
  const RayTracer rays(make_scene("cornell_box"));
  const PrimaryHits primary = primary_hits(rays, 16, 16);
  const Gathers params{.strata = Strata::for_rays(16),
                       .limits = RadiusLimits::for_scene(rays.scene().bounds, 0.002f, 0.1f)};
  ListSession session{.bounds = rays.scene().bounds, .capacity = 3};
  const CachedRun run = run_cached(rays, primary, session, params);
  EXPECT_EQ(run.use.inserts, 3u);
  EXPECT_GT(run.use.full, 0u);
  EXPECT_EQ(run.use.queries, run.use.hits + run.use.inserts + run.use.full);
  for (const glm::vec3& L : run.indirect.pixels) ASSERT_TRUE(is_finite(L) && L.x >= 0.0f);
}

TEST(RenderCached, ItsMeanComesNearTheReferenceAtTheSameHits) {
  const RayTracer rays(make_scene("cornell_box"));
  const PrimaryHits primary = primary_hits(rays, 40, 40);
  Image reference = blank(40, 40);
  for_tiles(rays, 40, 40, TileOrder::scanline, 2, [&](Tracer& t, const Tile& tile) {
    path_indirect_tile(t, primary, 128, {.seed = 6}, tile, reference);
  });
  ListSession session{.bounds = rays.scene().bounds, .a = 0.15f};
  const CachedRun run = run_cached(rays, primary, session,
                                   {.strata = Strata::for_rays(256),
                                    .limits = RadiusLimits::for_scene(rays.scene().bounds, 0.002f, 0.1f)});
  glm::dvec3 cached(0.0), exact(0.0);
  for (std::size_t i = 0; i < reference.pixels.size(); ++i) {
    cached += run.indirect.pixels[i];
    exact += reference.pixels[i];
  }
  for (int c = 0; c < 3; ++c)
    EXPECT_NEAR(cached[c] / exact[c], 1.0, 0.03);  // interpolation is biased, by little
}

// Guards against: pictures that differ from run to run because what errors are judged by does.
TEST(RenderCached, TheMeanIrradianceOfAPictureIsKnownWithinATenthWhoeverTraces) {
  for (const char* scene : {"cornell_box", "conference", "cornell_specular", "sibenik"}) {
    const RayTracer rays(make_scene(scene));
    constexpr int kWidth = 40, kHeight = 30;
    ThreadCrew alone(rays, 1), four(rays, 4);
    Estimate seeds;
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
      const float mean = mean_irradiance(rays, alone, kWidth, kHeight, seed);
      if (seed < 3) {
        EXPECT_EQ(mean, mean_irradiance(rays, four, kWidth, kHeight, seed));
      }
      seeds.add(mean);
    }
    // Of the same by many rays from every pixel.
    PrimaryHits primary(rays.scene(), kWidth, kHeight);
    Tracer tracer(rays);
    primary_tile(tracer, CameraView(rays.scene().camera, kWidth, kHeight), Lens::centre, {},
                 {0, 0, kWidth, kHeight}, primary);
    double light = 0.0, weight = 0.0;
    for_each_visible({0, 0, kWidth, kHeight}, primary, [&](const Visible& x) {
      if (!reflects(rays, x.hit)) return;
      const double w = luminance(x.weight);
      light += w * luminance(gather(tracer, x.hit, Strata::for_rays(64), x.pixel).E);
      weight += w;
    });
    const double spread = seeds.error() * std::sqrt(20.0);
    std::printf("%s: %.3f by probes, each within %.1f %%; by all pixels %.3f\n", scene, seeds.mean(),
                100.0 * spread / seeds.mean(), light / weight);
    EXPECT_NEAR(seeds.mean() / (light / weight), 1.0, 0.15);
    EXPECT_LT(spread / seeds.mean(), 0.1);
  }
}

TEST(RenderCached, NothingIsExpectedOfAPictureThatReflectsNothing) {
  Scene scene = make_scene("cornell_box");
  scene.camera = {
      .eye = {0, 1e3f, 0}, .target = {0, 2e3f, 0}, .up = {1, 0, 0}, .fov_y = 1.0f};  // of the void
  const RayTracer rays(std::move(scene));
  ThreadCrew crew(rays, 2);
  EXPECT_EQ(mean_irradiance(rays, crew, 8, 8, 1), 0.0f);
}

// For records made by hand in a cube of 2 m.
RecordShapes shapes_in_a_cube(Interpolation level, float a, std::uint32_t records) {
  const Bounds bounds{glm::vec3(-1.0f), glm::vec3(1.0f)};
  return {RecordShaper(level, a, bounds, RadiusLimits::for_scene(bounds, 0.01f, 0.2f), 10),
          RecordDetails(records, 1)};
}

// Where neighbours are looked for, a cache answers farther out than records are valid.
TEST(RenderExtrapolation, ARecordWithoutDetailsCountsNoFartherThanItsAccuracy) {
  for (const Interpolation level : {Interpolation::neighbour_clamping, Interpolation::occlusion_hessian}) {
    constexpr float kA = 0.2f;
    const RecordShapes shapes = shapes_in_a_cube(level, kA, 1);
    const Record r{glm::vec3(0.0f), {0, 0, 1}, 1.0f, glm::vec3(3.0f), RecordDetails::kNone};
    for (const float distance : {0.0f, 0.19f, 0.21f, 0.39f}) {
      Extrapolator sum(shapes, {{distance, 0, 0}, r.n});
      sum(r, 1.0f / std::max(distance, kMinError));
      ASSERT_EQ(sum.result().has_value(), distance < kA) << distance;
      if (sum.result()) {
        EXPECT_FLOAT_EQ(sum.result()->x, 3.0f);  // 3 w / w
      }
    }
  }
}

// Guards against: slats, books or mouldings that face the same way a little before or behind one another sharing their
// light.
TEST(RenderExtrapolation, APointOffTheSurfaceOfARecordIsFarAway) {
  for (const Interpolation level : {Interpolation::geometric_hessian, Interpolation::occlusion_hessian}) {
    constexpr float kA = 0.5f;
    RecordShapes shapes = shapes_in_a_cube(level, kA, 1);
    const std::uint32_t id = shapes.details.draft(0);
    shapes.details[id] = {
        .gradients = {}, .major = {1, 0, 0}, .inverse_major = 1.0f, .inverse_minor = 1.0f, .marks = {}};
    const Record r{glm::vec3(0.0f), {0, 0, 1}, 1.0f / kA, glm::vec3(3.0f), id};
    const auto error_at = [&](const glm::vec3& p, const glm::vec3& n) {
      return Extrapolator(shapes, {p, n}).error_of(r);
    };
    EXPECT_NEAR(error_at({0.3f, 0.4f, 0}, r.n), 0.5f, 1e-6f);
    for (const float side : {-1.0f, 1.0f}) {
      EXPECT_NEAR(error_at({0.3f, 0, 0.4f * side}, r.n), 0.5f + 2.0f * 0.4f, 1e-6f);
      // On a sphere or in a bowl that the record touches, no more than the distance and the turn count.
      constexpr float kTurn = 0.2f, kRadius = 2.0f;
      const glm::vec3 n(std::sin(kTurn), 0, std::cos(kTurn));
      const float chord = 2.0f * kRadius * std::sin(0.5f * kTurn);
      const float turn = std::sqrt(1.0f - std::cos(kTurn)) / (kA * search_reach(level));
      EXPECT_NEAR(error_at(side * kRadius * (n - r.n), n), chord + turn, 1e-4f);
    }
  }
}

// Guards against: pictures of one-sided extrapolation, where only the record that was made first counts; and against
// records that count so far away that no new ones are made.
TEST(RenderExtrapolation, RecordsOverlapButWhatNoneCoversIsAMiss) {
  constexpr float kA = 0.5f;
  const float reach = search_reach(Interpolation::occlusion_hessian) * kA;
  RecordShapes shapes = shapes_in_a_cube(Interpolation::occlusion_hessian, kA, 2);
  const auto record_at = [&](float x, float E) {
    const std::uint32_t id = shapes.details.draft(0);
    shapes.details.keep(0);
    shapes.details[id] = {
        .gradients = {}, .major = {1, 0, 0}, .inverse_major = 10.0f, .inverse_minor = 10.0f, .marks = {}};
    return Record{{x, 0, 0}, {0, 0, 1}, kOverlap * 0.1f / reach, glm::vec3(E), id};
  };
  const Record left = record_at(0.0f, 1.0f), right = record_at(0.25f, 2.0f);
  const auto mean_at = [&](float x) {
    const SurfacePoint at{{x, 0, 0}, left.n};
    Extrapolator sum(shapes, at);
    for (const Record& r : {left, right})
      if (const float w = split_sphere_weight(at, r, reach); w > 0.0f) sum(r, w);
    return sum.result();
  };
  const auto weight = [](float e) { return (1.0f - e / kOverlap) / (e * e * e * e + 0.5f); };
  ASSERT_TRUE(mean_at(0.05f).has_value());
  EXPECT_NEAR(mean_at(0.05f)->x, (weight(0.5f) + 2.0f * weight(2.0f)) / (weight(0.5f) + weight(2.0f)), 1e-5f);
  EXPECT_FALSE(mean_at(0.125f).has_value()) << "a distance of 1.25 ellipses from either";
  EXPECT_NEAR(mean_at(-0.03f)->x, 1.0f + weight(2.8f) / (weight(0.3f) + weight(2.8f)), 1e-5f);
  EXPECT_FLOAT_EQ(mean_at(-0.09f)->x, 1.0f) << "3.4 ellipses from the one on the right";
}

// Guards against: light that jumps on curved surfaces, where the search ends before a record's weight is 0.
TEST(RenderExtrapolation, WeightsFallToNothingOnCurvedSurfacesToo) {
  for (const Interpolation level : {Interpolation::geometric_hessian, Interpolation::occlusion_hessian})
    for (const float radius : {1.0f, 0.1f, 0.05f, 0.02f}) {  // of a cylinder; the ellipse's is 0.05
      constexpr float kA = 0.2f, kStep = 1e-3f;
      RecordShapes shapes = shapes_in_a_cube(level, kA, 1);
      const std::uint32_t id = shapes.details.draft(0);
      shapes.details[id] = {
          .gradients = {}, .major = {1, 0, 0}, .inverse_major = 20.0f, .inverse_minor = 20.0f, .marks = {}};
      const float reach = search_reach(level) * kA;
      const Record r{{0, 0, radius}, {0, 0, 1}, kOverlap * 0.05f / reach, glm::vec3(1.0f), id};
      float before = 0.0f, most = 0.0f;
      for (float angle = 0.0f; angle < 1.5f; angle += kStep) {
        const glm::vec3 n(std::sin(angle), 0.0f, std::cos(angle));
        const SurfacePoint x{radius * n, n};
        const float found = split_sphere_weight(x, r, reach);
        const float w = found > 0.0f ? std::max(Extrapolator(shapes, x).of(r, found).w, 0.0f) : 0.0f;
        if (angle > 0.0f) {
          EXPECT_LT(std::fabs(w - before), 0.1f) << name_of(level) << ", radius " << radius;
        }
        most = std::max(most, w);
        before = w;
      }
      EXPECT_GT(most, 1.0f);
      EXPECT_EQ(before, 0.0f);
    }
}

// Guards against: slats lit by what their neighbours' records could only guess at, and points given by one steep
// gradient that is noise.
TEST(RenderExtrapolation, WithOcclusionChangesAreJudgedByTheMeanOfThePicture) {
  constexpr float kA = 0.5f;
  RecordShapes shapes = shapes_in_a_cube(Interpolation::occlusion_hessian, kA, 1);
  RecordDetail& detail = shapes.details[shapes.details.draft(0)];
  detail = {.gradients = {}, .major = {1, 0, 0}, .inverse_major = 1.0f, .inverse_minor = 1.0f, .marks = {}};
  const auto given_at = [&](float E, const SurfacePoint& x) {
    return Extrapolator(shapes, x).of({glm::vec3(0.0f), {0, 0, 1}, 1.0f / kA, glm::vec3(E), 0}, 1.0f);
  };
  const auto slope = [&](float by_place, float by_normal) {
    detail.gradients.translational.fill({by_place, 0, 0});
    detail.gradients.rotational.fill({0, by_normal, 0});
  };
  const SurfacePoint beside{{0.5f, 0, 0}, {0, 0, 1}};
  shapes.shaper.expect(4.0f);
  slope(2.0f, 0.0f);
  EXPECT_FLOAT_EQ(given_at(3.0f, beside).E.x, 3.5f) << "1 is halved where the mean is four times as much";
  EXPECT_FLOAT_EQ(given_at(3.0f, {{-0.5f, 0, 0}, {0, 0, 1}}).E.x, 2.5f);
  slope(0.002f, 0.0f);
  EXPECT_NEAR(given_at(3.0f, beside).E.x, 3.001f, 2e-6f) << "what is small counts in full";
  slope(1e20f, 0.0f);
  EXPECT_FLOAT_EQ(given_at(3.0f, beside).E.x, 4.0f) << "and never more than a quarter of the mean";

  const auto covers = [&](float E, const SurfacePoint& x) { return given_at(E, x).covers; };
  const float most = 1.1f * kA * 4.0f;  // of a change that is foreseen
  slope(1.98f * most, 0.0f);
  EXPECT_TRUE(covers(3.0f, beside));
  slope(-1.98f * most, 0.0f);
  EXPECT_TRUE(covers(3.0f, beside));
  slope(2.02f * most, 0.0f);
  EXPECT_FALSE(covers(3.0f, beside));
  EXPECT_TRUE(covers(4.5f, beside)) << "a brighter record is judged by itself";
  EXPECT_GT(given_at(3.0f, beside).w, 0.0f) << "it counts where others cover";
  const float sine = 0.2f;
  const SurfacePoint turned{beside.p, {sine, 0, std::sqrt(1.0f - sine * sine)}};
  slope(-most, 0.51f * most / sine);
  EXPECT_FALSE(covers(3.0f, turned)) << "the two are added whatever their signs";
  slope(-most, 0.49f * most / sine);
  EXPECT_TRUE(covers(3.0f, turned));
  EXPECT_NEAR(given_at(3.0f, turned).E.x, 3.0f - 0.5f * most / (1.0f + 0.5f * most) + 0.49f * most, 1e-4f);

  shapes.shaper.expect(0.0f);  // unknown
  slope(2.0f, 0.0f);
  EXPECT_FLOAT_EQ(given_at(4.0f, beside).E.x, 4.5f) << "the record's own";
  slope(0.0f, 0.0f);
  EXPECT_TRUE(covers(0.0f, beside)) << "in the dark nothing changes";
}

// Guards against: a bunny covered with records whose gradients already know what its turning normals do.
TEST(RenderExtrapolation, NormalsTurnFartherWhereVirtualLightsGaveTheRecord) {
  constexpr float kA = 0.1f;
  const Bounds bounds{glm::vec3(-1.0f), glm::vec3(1.0f)};
  const float asked = search_reach(Interpolation::gradients, true) * kA;
  RecordShapes shapes{RecordShaper(Interpolation::gradients, asked, bounds,
                                   RadiusLimits::for_scene(bounds, 0.001f, 0.5f), 10),
                      RecordDetails(1, 1)};
  const std::uint32_t id = shapes.details.draft(0);
  const glm::vec3 E(1.0f);
  const float R = shapes.shaper.shape_of_vpls(1.0f, E, {}, shapes.details[id]);
  const Record r{glm::vec3(0.0f), {0, 0, 1}, R, E, id};
  const auto is_valid = [&](float distance, float turn) {  // |d| / R, and the root of 1 minus the cosine
    const float cosine = 1.0f - turn * turn;
    const SurfacePoint x{{0, distance, 0}, {std::sqrt(1.0f - cosine * cosine), 0, cosine}};
    const float weight = split_sphere_weight(x, r, asked);
    return weight > 0.0f && Extrapolator(shapes, x).of(r, weight).w > 0.0f;
  };
  EXPECT_TRUE(is_valid(0.99f * kA, 0.0f));
  EXPECT_FALSE(is_valid(1.01f * kA, 0.0f)) << "places count as they do without";
  EXPECT_TRUE(is_valid(0.0f, 2.99f * kA));
  EXPECT_FALSE(is_valid(0.0f, 3.01f * kA));
  EXPECT_TRUE(is_valid(0.49f * kA, 1.5f * kA));
  EXPECT_FALSE(is_valid(0.51f * kA, 1.5f * kA));
}

// Guards against: records that count three times as far as others because there was no room for their gradients.
TEST(RenderExtrapolation, RecordsOfVirtualLightsReachNoFartherWhereThereIsNoRoomForTheirDetails) {
  const RayTracer rays(make_scene("cornell_box"));
  ThreadCrew crew(rays, 1);
  const PrimaryHits primary = primary_hits(rays, 4, 4);
  const Visible x = primary.at(5, 0);
  ASSERT_TRUE(reflects(rays, x.hit));
  for (const RecordKind& kind : record_kinds_by_vpls()) {
    if (!extrapolates(kind.level)) continue;
    PassSetup setup{rays, crew, 4, 4};
    setup.vpls = 16;
    setup.interpolation = kind.level;
    const auto source = kind.make(setup);
    source->begin_frame({}, crew);
    Tracer tracer(rays);
    std::uint32_t made = 0;
    const Record first = source->evaluate(0, tracer, x, {});
    for (Record r = first; r.id != RecordDetails::kNone; ++made) {
      ASSERT_EQ(r.R, first.R) << kind.name;
      ASSERT_LT(made, 1u << 16) << "there is always room";
      source->settle(0, r, InsertResult::inserted);
      r = source->evaluate(0, tracer, x, {});
    }
    EXPECT_GT(made, 16u);
    EXPECT_EQ(source->evaluate(0, tracer, x, {}).R, first.R) << kind.name;
  }
}

// At each level of interpolation, through the simplest cache of all.
class RenderInterpolation : public ::testing::TestWithParam<InterpolationEntry> {
 protected:
  static LevelRun run(const RayTracer& rays, const PrimaryHits& primary, std::uint32_t gather_rays, float a,
                      bool leak_guard = false) {
    return run_level(
        rays, primary,
        {.level = GetParam().level, .gather_rays = gather_rays, .a = a, .leak_guard = leak_guard});
  }
};

TEST_P(RenderInterpolation, TheFurnaceStaysWhite) {
  const RayTracer rays(make_scene("white_furnace"));
  const PrimaryHits primary = primary_hits(rays, 24, 24);
  for (const bool guard : {false, true}) {
    const LevelRun made = run(rays, primary, 1024, 0.3f, guard);
    EXPECT_GT(made.use.hits, made.use.queries / 4) << "hardly anything was interpolated";
    Estimate all, records;
    for (const glm::vec3& L : made.indirect.pixels) all.add(L.x / (kRho * kRho));
    for (const Record& r : made.records) records.add(r.E.x * kRho / kPi / (kRho * kRho));
    EXPECT_NEAR(all.mean(), 1.0, 4.0 * records.error()) << guard;
    EXPECT_LT(records.error(), 0.01) << "too few records to tell";
  }
}

TEST_P(RenderInterpolation, ThePictureIsThatOfAGatherInEveryPixel) {
  const RayTracer rays(make_scene("cornell_box"));
  const PrimaryHits primary = primary_hits(rays, 24, 24);
  const LevelRun made[] = {run(rays, primary, 1024, 0.2f), run(rays, primary, 1024, 0.2f, true)};
  const Strata strata = Strata::for_rays(1024);
  Tracer tracer(rays);
  double sum[2] = {}, exact = 0.0, square[2] = {};
  for (std::size_t i = 0; i < primary.hits.size(); ++i) {
    glm::vec3 anew(0.0f);
    if (reflects(rays, primary.hits[i]))
      anew = reflected_radiance(rays, primary.hits[i], gather(tracer, primary.hits[i], strata, i).E);
    exact += anew.y;
    for (const bool guard : {false, true}) {
      const glm::vec3& L = made[guard].indirect.pixels[i];
      ASSERT_TRUE(L.x >= 0.0f && L.y >= 0.0f && L.z >= 0.0f && std::isfinite(L.x + L.y + L.z));
      sum[guard] += L.y;
      square[guard] += (L.y - anew.y) * (L.y - anew.y);
    }
  }
  const auto pixels = static_cast<double>(primary.hits.size());
  for (const bool guard : {false, true}) {
    EXPECT_NEAR(sum[guard] / exact, 1.0, 0.015) << guard;
    EXPECT_LT(std::sqrt(square[guard] / pixels), 0.15 * exact / pixels) << guard;
  }
}

TEST_P(RenderInterpolation, LightOfAnyBrightnessGivesThePicture) {
  const RayTracer plain(make_scene("cornell_box"));
  const PrimaryHits primary = primary_hits(plain, 12, 12);
  const LevelRun made = run(plain, primary, 64, 0.3f);
  for (const int exponent : {-66, 66}) {  // a power of two: nothing is rounded otherwise
    Scene scene = make_scene("cornell_box");
    const float factor = std::ldexp(1.0f, exponent);
    for (Material& m : scene.materials) m.emission *= factor;
    const RayTracer rays(std::move(scene));
    const LevelRun other = run(rays, primary, 64, 0.3f);
    ASSERT_EQ(other.records.size(), made.records.size());
    for (std::size_t i = 0; i < made.indirect.pixels.size(); ++i)
      ASSERT_FLOAT_EQ(other.indirect.pixels[i].y / factor, made.indirect.pixels[i].y) << exponent;
  }
}

INSTANTIATE_TEST_SUITE_P(Levels, RenderInterpolation, ::testing::ValuesIn(kInterpolations), level_name);

}  // namespace
}  // namespace icbench
