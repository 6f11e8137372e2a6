// Hard scenes by the pass that ships, with its threads and a cache: in waves, after an overture, over frames; and what
// such pictures are said to lack. Each with the failure it guards against.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include "cached_runs.h"
#include "caches/registry.h"
#include "hard_scenes.h"
#include "render/residual.h"
#include "trap_invalid.h"
#include "workload/cached_pass.h"

namespace icbench {
namespace {

constexpr int kSize = 10;  // pixels

struct Way {
  const char* name;
  bool deterministic, overture, leak_guard;
};
constexpr Way kWays[] = {{"after an overture", false, true, false},
                         {"in waves", true, false, false},
                         {"in waves, guarded against leaks", true, false, true},
                         {"in waves, after an overture", true, true, false}};
constexpr unsigned kWayCount = std::size(kWays);

// A pass of two threads through a packed octree.
class Rendering {
 public:
  Rendering(const RayTracer& rays, const RecordKind& kind, const Level& level, const Way& way)
      : crew_(rays, 2), key_{.seed = level.seed} {
    PassSetup setup{rays, crew_, kSize, kSize};
    setup.gather_rays = level.gather_rays;
    setup.vpls = level.vpls;
    setup.seed = level.seed;
    setup.a = level.a;
    setup.interpolation = level.level;
    setup.leak_guard = way.leak_guard;
    CachedPassSetup cached;
    cached.cache.bounds = rays.scene().bounds;
    cached.cache.a = cached.cache.a_max = search_reach(level.level, kind.by_vpls()) * level.a;
    cached.cache.max_sessions = crew_.size();
    cached.cache.capacity = capacity_for(4 * kSize * kSize, crew_.size());
    cached.deterministic = way.deterministic ? &rays : nullptr;
    cached.overture = way.overture;
    pass_ = std::make_unique<CachedPass<PackedWaitFree>>(cached, kind.make(setup), crew_);
  }

  // Indirect light in a frame to which the scene has gone.
  Image render(const PrimaryHits& primary, const SceneChange& change, const std::string& what) {
    Image out = blank(kSize, kSize);
    pass_->begin_frame(change);
    pass_->begin_sample(primary, key_);
    const auto tiles = make_tiles(kSize, kSize, 8, TileOrder::morton);
    crew_.for_each(tiles.size(), 1, [&](unsigned thread, Tracer& tracer, std::size_t i) {
      pass_->tile(thread, tracer, primary, key_, tiles[i], out);
    });
    pass_->end_sample(primary, out);
    expect_an_image(out, what);
    const CacheUse use = pass_->figures().use;
    EXPECT_EQ(use.rejected, 0u) << what;
    EXPECT_EQ(use.full, 0u) << what;
    ++key_.frame;
    return out;
  }

 private:
  ThreadCrew crew_;
  SampleKey key_;
  std::unique_ptr<IndirectPass> pass_;
};

class HardPasses : public ::testing::TestWithParam<RecordKind> {};
INSTANTIATE_TEST_SUITE_P(Kinds, HardPasses, ::testing::ValuesIn(record_kinds()), kind_name);

// Guards against: any NaN, infinity or negative value in the pictures of waves and overtures, pixels that get no
// answer, and light that gets lost or comes about; in each scene, besides, against what kHardScenes names.
TEST_P(HardPasses, WavesAndOverturesMakeImagesOfTheRightBrightness) {
  const bool by_vpls = GetParam().by_vpls();
  for (const HardScene& hard : kHardScenes) {
    const RayTracer rays(hard.make());
    const PrimaryHits primary = primary_hits(rays, kSize, kSize);
    Level level{.level = GetParam().level, .gather_rays = 256};
    const unsigned runs = by_vpls ? 1 : hard.runs, runs_each = (runs + 2) / 3;
    const double anew =
        hard.is_bright() ? mean_without_cache(rays, primary, level, by_vpls, hard.gathers()) : 0.0;
    double of_all = 0.0;
    for (const Way& way : kWays) {
      const std::string what =
          std::string(hard.name) + ", " + way.name + ", guards against: " + hard.guards_against;
      double made = 0.0;
      for (unsigned i = 0; i < runs_each; ++i, level.seed += by_vpls ? 0 : 1)
        made += mean_of(Rendering(rays, GetParam(), level, way).render(primary, {}, what)) / runs_each;
      of_all += made / kWayCount;
      if (!hard.is_bright()) {
        EXPECT_LE(made, hard.most) << what;
        continue;
      }
      ASSERT_GT(anew, 0.0) << what;
      // The error of fewer runs is larger.
      const double tolerance = by_vpls ? hard.tolerance_by_vpls
                                       : hard.tolerance * std::sqrt(static_cast<double>(runs) / runs_each);
      EXPECT_NEAR(made / anew, 1.0, tolerance) << what;
    }
    if (!hard.is_bright()) continue;
    std::printf("%s: %.4f\n", hard.name, of_all / anew);
    EXPECT_NEAR(of_all / anew, 1.0, by_vpls ? hard.tolerance_by_vpls : hard.tolerance) << hard.name;
  }
}

// A room with a block that comes down until it stands on the floor, sinks into it and is gone, while the lamp goes
// through all that floats can hold.
Scene press() {
  Scene s = closed_room(2.0f);
  add_lamp_at(s, {0.5f, 1.9f, 0.5f}, 1.0f, 1.0f);
  s.meshes.push_back(box("block", {{0.6f, 0, 0.6f}, {1.2f, 0.5f, 1.2f}}, 0));
  s.frames = 6;
  static constexpr float kHeights[] = {0.5f, 1e-6f, 0.0f, -0.25f, -0.6f, 0.5f};
  static constexpr float kRadiances[] = {1.0f, 1e18f, 1e-36f, 0.0f, 1e-20f, 1.0f};
  s.meshes.back().pose = [](float frame) {
    return Pose{glm::mat3(1.0f), {0, kHeights[static_cast<std::size_t>(frame)], 0}};
  };
  s.change_light = [](float frame, std::span<Material> materials, std::span<PointLight>) {
    materials[1].emission = glm::vec3(kRadiances[static_cast<std::size_t>(frame)]);
  };
  return s;
}

// Hemisphere gathers keep no record where anything moved.
class HardFrames : public ::testing::TestWithParam<RecordKind> {};
INSTANTIATE_TEST_SUITE_P(Kinds, HardFrames, ::testing::ValuesIn(record_kinds_by_vpls()), kind_name);

// Guards against: kept records that still have the light of another frame, radii that go to 0 with a gap that closes,
// and sums of what is no more there.
TEST_P(HardFrames, OfAPressAndOfLightOfEveryMagnitudeAreThoseOfEachFrameAlone) {
  for (const Way& way : kWays) {
    RayTracer rays(press());
    rays.go_to(0.0f);
    const Level level{.level = GetParam().level};
    Rendering rendering(rays, GetParam(), level, way);
    double first = 0.0;
    for (const std::uint32_t frame : {0u, 1u, 2u, 3u, 4u, 5u}) {
      const SceneChange change = rays.go_to(static_cast<float>(frame));
      const std::string what = std::string("frame ") + std::to_string(frame) + ", " + way.name;
      const PrimaryHits primary = primary_hits(rays, kSize, kSize);
      const double made = mean_of(rendering.render(primary, change, what));
      const double anew = mean_without_cache(rays, primary, level, true, 1);
      std::printf("%s: %g of %g\n", what.c_str(), made, anew);
      if (frame == 3) {
        EXPECT_EQ(made, 0.0) << what;
      } else {
        ASSERT_GT(anew, 0.0) << what;
        EXPECT_NEAR(made / anew, 1.0, 0.05) << what;
      }
      if (frame == 0) first = made;
      if (frame == 5) {
        EXPECT_NEAR(made / first, 1.0, 0.05) << "back at the start, " << way.name;
      }
    }
  }
}

// Guards against: squares of residuals that overflow or vanish, and with them the error that is stated; a layer that is
// no image where the picture and the paths differ by 40 orders of magnitude.
TEST(HardResiduals, AreFiniteAndMakePicturesRight) {
  for (const HardScene& hard : kHardScenes) {
    const RayTracer rays(hard.make());
    const PrimaryHits primary = primary_hits(rays, kSize, kSize);
    const Level level{.gather_rays = 64};
    const std::string what = std::string(hard.name) + ", guards against: " + hard.guards_against;
    const Image made = run_level(rays, primary, level).indirect;
    ResidualEstimator residual(kSize, kSize, 0.5f, 2, true);
    constexpr std::uint32_t kSamples = 16;
    for (std::uint32_t sample = 0; sample < kSamples; ++sample) {
      const auto tiles = make_tiles(kSize, kSize, 8, TileOrder::morton);
      ThreadCrew(rays, 2).for_each(tiles.size(), 1, [&](unsigned thread, Tracer& tracer, std::size_t i) {
        residual.tile(thread, tracer, Light::indirect, primary, {.seed = 3, .sample = sample}, tiles[i],
                      made);
      });
      residual.end_sample(made);
    }
    const ResidualFigures f = residual.figures();
    EXPECT_GT(f.samples, 0u) << what;
    for (const MeanWithError& m : {f.rgb[0], f.rgb[1], f.rgb[2], f.all, f.square}) {
      EXPECT_TRUE(std::isfinite(m.mean) && std::isfinite(m.error)) << what;
      EXPECT_GE(m.error, 0.0) << what;
    }
    for (const MeanWithError& m : f.blocks)
      EXPECT_TRUE(std::isfinite(m.mean) && std::isfinite(m.error)) << what;
    Image mended = made;
    residual.add_to(mended);
    double sum = 0.0;
    for (const glm::vec3& L : mended.pixels) {
      ASSERT_TRUE(is_finite(L)) << what;
      sum += static_cast<double>(L.y) / static_cast<double>(mended.pixels.size());
    }
    if (!hard.is_bright()) continue;
    // The layer brings what the figures say, and that is what the picture lacks.
    const double right = mean_of(made) + f.rgb[1].mean;
    EXPECT_NEAR(sum / right, 1.0, 1e-4) << what;
    EXPECT_GT(f.rgb[1].error, 0.0) << what;
    const double anew = mean_without_cache(rays, primary, {.gather_rays = 256}, false, hard.gathers());
    std::printf("%s: %.4f with the residual, standard error %.4f\n", hard.name, right / anew,
                f.rgb[1].error / anew);
    EXPECT_NEAR(right, anew, 4.0 * f.rgb[1].error + 0.02 * anew) << what;
  }
}

}  // namespace
}  // namespace icbench
