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
