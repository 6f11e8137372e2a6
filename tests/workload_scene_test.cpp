// Workloads on real scenes: plans on the scenes' surfaces, and ray-traced trials on every cache.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <memory>
#include <numbers>

#include "broken_caches.h"
#include "scene/registry.h"
#include "workload/dispatch.h"
#include "workload/ray_traced_plan.h"
#include "workload/ray_traced_trial.h"
#include "workload/repeatability.h"
#include "workload/synthetic_plan.h"
#include "workload/validation.h"

namespace icbench {
namespace {

const RayTracer& scene(const std::string& name) {
  static std::map<std::string, std::unique_ptr<RayTracer>> scenes;
  auto& slot = scenes[name];
  if (!slot) slot = std::make_unique<RayTracer>(make_scene(name));
  return *slot;
}

TEST(ScenePlan, SeedFixesPointsAndRecords) {
  const auto plan = [](std::uint64_t seed) {
    return SyntheticPlan(parse_workload("mix_50_50:records=100:operations=100"), scene("white_furnace"),
                         seed);
  };
  const SyntheticPlan a = plan(4), b = plan(4), c = plan(5);
  ASSERT_EQ(a.records().size(), 150u);
  for (std::size_t i = 0; i < a.records().size(); ++i) {
    EXPECT_TRUE(same_bits(a.records()[i], b.records()[i]));
    EXPECT_FALSE(same_bits(a.records()[i], c.records()[i]));
    EXPECT_EQ(a.records()[i].id, i);
  }
  for (std::size_t i = 0; i < a.points().size(); ++i) {
    ASSERT_EQ(a.points()[i].p, b.points()[i].p);
    ASSERT_EQ(a.points()[i].n, b.points()[i].n);
  }
}

// Small and large, still and moving, flat and finely curved; all of them would take a minute.
constexpr const char* kSomeScenes[] = {"cornell_box", "wobble", "sibenik", "white_furnace", "lit_floor"};

TEST(ScenePlan, CachesAcceptAllPointsAndRecords) {
  for (const std::string name : kSomeScenes) {
    const SyntheticPlan plan(parse_workload("insert_only:records=500"), scene(name), 1);
    const Bounds bounds = plan.config(1).bounds;
    for (const SurfacePoint& x : plan.points()) ASSERT_TRUE(is_askable(x, bounds)) << name;
    for (const Record& r : plan.records()) ASSERT_TRUE(is_storable(r, bounds)) << name;
  }
}

TEST(ScenePlan, SixRecordsAreValidAtAPointOnAverage) {
  for (const std::string name : kSomeScenes) {
    const SyntheticPlan plan(parse_workload("read_only:records=3000"), scene(name), 1);
    Pcg32 random(1);
    constexpr int kProbes = 2000;
    std::uint64_t valid = 0;
    for (int i = 0; i < kProbes; ++i) {
      const SurfacePoint& x = plan.points()[random.below(static_cast<std::uint32_t>(plan.points().size()))];
      for (const Record& r : plan.records()) valid += split_sphere_weight(x, r, plan.spec().a) > 0.0f;
    }
    EXPECT_NEAR(static_cast<double>(valid) / kProbes, 6.0, 0.6) << name;
  }
}

TEST(ScenePlan, CoherentPointsOfATileLieTogether) {
  const SyntheticPlan plan(parse_workload("miss_driven:operations=20000:order=coherent"),
                           scene("white_furnace"), 1);
  const auto mean_step = [&](const SyntheticPlan& p) {
    const Streams streams = p.streams(1, 1);
    double sum = 0.0;
    for (std::size_t i = 1; i < streams.operations.size(); ++i) {
      sum += glm::length(p.points()[streams.operations[i]].p - p.points()[streams.operations[i - 1]].p);
    }
    return sum / static_cast<double>(streams.operations.size());
  };
  const SyntheticPlan scattered(parse_workload("miss_driven:operations=20000"), scene("white_furnace"), 1);
  EXPECT_LT(mean_step(plan), 0.05 * mean_step(scattered));
}

class RayTraced : public ::testing::Test {
 protected:
  RayTraced()
      : primary(centre_hits(scene("cornell_box"), 40, 24)),
        reference(make_reference(scene("cornell_box"), primary, 4, 1)),
        plan(parse_workload("cornell_box:rays=4:size=40x24"), scene("cornell_box"), primary, reference, 1) {}

  TrialOutcome run(TrialOutcome (*trial)(const RayTracedPlan&, const TrialSetup&), unsigned threads) {
    auto& team = teams[threads];
    if (!team) team = std::make_unique<ThreadTeam>(topology, Placement::none, threads);
    return trial(plan, TrialSetup{*team, work, kSeed, 1});
  }

  static constexpr std::uint64_t kSeed = 3;
  Topology topology = Topology::of_this_process();
  Work work{WorkCalibration{}};
  std::map<unsigned, std::unique_ptr<ThreadTeam>> teams;
  PrimaryHits primary;
  Reference reference;
  RayTracedPlan plan;
};

TEST_F(RayTraced, TrialsAreValidOnEveryCacheAndNumberOfThreads) {
  for (const CacheEntry& cache : all_caches()) {
    for (const unsigned threads : {1u, 2u, 8u}) {
      if (cache.traits.single_thread && threads > 1) continue;
      SCOPED_TRACE(::testing::Message() << cache.traits.name << ", " << threads << " threads");
      const TrialOutcome out = run(cache.ray_traced, threads);
      ASSERT_EQ(out.error, "");
      EXPECT_EQ(out.query_ticks.count(), out.counts.queries) << "every operation was to be timed";
      EXPECT_GT(out.rays.total(), 0u);
      EXPECT_TRUE(std::isfinite(out.relmse));
      if (cache.traits.consistency == Consistency::none) continue;
      EXPECT_EQ(out.counts.inserted, out.counts.queries - out.counts.hits);
      EXPECT_EQ(out.records, out.counts.inserted);
      EXPECT_GT(out.counts.hits, 0u);
      EXPECT_NEAR(out.mean_ratio, 1.0, 0.2);
    }
  }
}

TEST_F(RayTraced, OneThreadGivesTheSamePictureWithEveryCache) {
  const TrialOutcome expected = run(find_cache("sequential").ray_traced, 1);
  EXPECT_EQ(expected.records, plan.records_of_one_thread(kSeed));
  for (const char* name : {"global_mutex", "node_lock", "local_write", "wait_free"}) {
    const TrialOutcome out = run(find_cache(name).ray_traced, 1);
    EXPECT_EQ(out.counts.hits, expected.counts.hits) << name;
    EXPECT_EQ(out.records, expected.records) << name;
    // The same records in another order of summation.
    EXPECT_NEAR(out.relmse / expected.relmse, 1.0, 1e-5) << name;
  }
}

TEST_F(RayTraced, BrokenCachesAreFoundOut) {
  EXPECT_EQ(run(run_ray_traced_trial<WaitFree>, 2).error, "");
  EXPECT_NE(run(run_ray_traced_trial<Losing>, 2).error.find("accepted but"), std::string::npos);
  EXPECT_EQ(run(run_ray_traced_trial<Tearing>, 2).error.find("torn record"), 0u);
  EXPECT_EQ(run(run_ray_traced_trial<Inventing>, 2).error, "invented record 1000000");
}

TEST_F(RayTraced, PathTracingNeedsNoCacheAndNoOrder) {
  const TrialOutcome one = run(run_uncached_trial, 1), many = run(run_uncached_trial, 8);
  EXPECT_EQ(one.relmse, many.relmse);
  EXPECT_EQ(one.rays.total(), many.rays.total());
  EXPECT_EQ(one.operations, 40u * 24u * plan.spec().spp);
  EXPECT_EQ(one.counts.queries, 0u);
}

TEST_F(RayTraced, HashCellsShareWhatPathsBringAndNeedNoOrder) {
  const TrialOutcome alone = run(run_uncached_trial, 1);
  plan = RayTracedPlan(parse_workload("cornell_box:integrator=hash_cells:size=40x24"), scene("cornell_box"),
                       primary, reference, 1);
  const TrialOutcome one = run(run_uncached_trial, 1), many = run(run_uncached_trial, 8);
  EXPECT_EQ(one.relmse, many.relmse);
  EXPECT_EQ(one.rays.total(), many.rays.total());
  EXPECT_EQ(one.rays.total(), alone.rays.total());
  EXPECT_EQ(one.operations, 40u * 24u * plan.spec().spp);
  EXPECT_GT(one.merge_ns, 0.0);
  EXPECT_NE(one.relmse, alone.relmse);
  EXPECT_NEAR(one.mean_ratio, alone.mean_ratio, 0.01);  // shares light, makes and loses none
}

TEST_F(RayTraced, IrradianceIsRadianceOverWhatASurfaceReflects) {
  const Image E = irradiance_of(scene("cornell_box"), primary, reference.indirect);
  std::size_t lit = 0;
  for (std::size_t i = 0; i < E.pixels.size(); ++i) {
    const Hit& hit = primary.hits[i];
    if (!reflects(scene("cornell_box"), hit)) {
      EXPECT_EQ(E.pixels[i], glm::vec3(0.0f)) << i;
      continue;
    }
    ++lit;
    const glm::vec3 again = scene("cornell_box").albedo(hit) * E.pixels[i] * std::numbers::inv_pi_v<float>;
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(again[c], reference.indirect.pixels[i][c], 1e-6f * reference.indirect.pixels[i][c]) << i;
  }
  EXPECT_GT(lit, E.pixels.size() / 2);
  EXPECT_GT(reference.rmse_irradiance, std::numbers::pi * reference.rmse);
}

// What is seen in a mirror or through glass is left out, be its weight 1.
TEST_F(RayTraced, IrradianceIsToldOfWhatIsSeenDirectly) {
  Scene s = make_scene("cornell_specular");
  for (Material& m : s.materials)
    if (m.is_specular()) m.albedo = glm::vec3(1.0f);
  const RayTracer rays(std::move(s));
  const PrimaryHits seen = centre_hits(rays, 40, 24);
  const Reference made = make_reference(rays, seen, 4, 1);
  const Image E = irradiance_of(rays, seen, made.indirect);
  const CameraView view(rays.scene().camera, 40, 24);
  Tracer tracer(rays);
  std::size_t specular = 0, lit = 0;
  for (std::uint32_t i = 0; i < E.pixels.size(); ++i) {
    const Hit first =
        primary_hit(tracer, view, Lens::centre, {}, static_cast<int>(i % 40), static_cast<int>(i / 40), i);
    if (first.missed() || !rays.material(first).is_specular()) {
      lit += E.pixels[i] != glm::vec3(0.0f);
      continue;
    }
    ++specular;
    EXPECT_EQ(E.pixels[i], glm::vec3(0.0f)) << i;
  }
  EXPECT_GT(specular, 20u);
  EXPECT_GT(lit, 400u);
}

TEST_F(RayTraced, ReferenceErrorFallsWithItsSamples) {
  const Reference better = make_reference(scene("cornell_box"), primary, 64, 1);
  EXPECT_EQ(better.spp, 64u);
  EXPECT_GT(reference.relmse, 4.0 * better.relmse);
}

// Each picture that is begun in this process is brighter than the last: a schedule without end, known beforehand.
unsigned g_pictures = 0;
class DriftingPass final : public IndirectPass {
 public:
  void begin_frame(const SceneChange&) override { L_ = 1.0f + static_cast<float>(g_pictures++); }
  void tile(unsigned, Tracer&, const PrimaryHits& primary, const SampleKey&, const Tile& tile,
            Image& out) noexcept override {
    for_each_pixel(tile, primary.width, [&](std::uint32_t pixel) { out.pixels[pixel] = glm::vec3(L_); });
  }
  // Seven records more in each.
  PassFigures figures() const override {
    PassFigures out;
    out.use.queries = 10 * static_cast<std::uint64_t>(L_);
    out.use.hits = 3 * static_cast<std::uint64_t>(L_);
    return out;
  }

 private:
  float L_ = 0.0f;
};

struct RepeatabilityTest : ::testing::Test {
  Topology topology = Topology::of_this_process();
  ThreadTeam team{topology, Placement::none, 1};
  RayTracer rays{make_scene("white_furnace")};
  CacheEntry drifting = [] {
    CacheEntry entry = find_cache("wait_free");
    entry.traits.name = "drifting";
    entry.pass = [](const CachedPassSetup&, std::unique_ptr<RecordSource>,
                    Crew&) -> std::unique_ptr<IndirectPass> { return std::make_unique<DriftingPass>(); };
    return entry;
  }();

  RepeatabilityStudy study() {
    const FrameRequest frame{rays, team, find_integrator("irradiance_cache"), drifting, 8, 8};
    return RepeatabilityStudy({frame, "white_furnace", 0, Placement::none, 2, 2}, topology, [](double) {});
  }
  std::vector<RepeatabilityPoint> points(const CacheEntry& cache, std::vector<unsigned> threads) {
    const CacheEntry* const caches[] = {&cache};
    return repeatability_points(caches, std::move(threads));
  }
};

TEST_F(RepeatabilityTest, PicturesThatDependOnWhatRanBeforeAreFoundOut) {
  const auto found = points(drifting, {3, 1});
  ASSERT_EQ(found.size(), 2u);
  g_pictures = 0;
  RepeatabilityStudy work = study();
  const auto field = [](const Entry& e, const char* name) { return e.counters.at(name).get<double>(); };
  const Entry a = work.run(found[0], 0), b = work.run(found[1], 0), c = work.run(found[0], 1),
              d = work.run(found[1], 1);
  EXPECT_EQ(d.name, "repeatability/white_furnace/irradiance_cache/drifting/threads:3");
  EXPECT_EQ(field(a, "rms_to_single"), 0.0);
  EXPECT_EQ(field(b, "rms_to_single"), 1.0);
  EXPECT_EQ(field(c, "rms_to_single"), 2.0);
  EXPECT_EQ(field(d, "rms_to_single"), 3.0);
  EXPECT_EQ(field(c, "rms_to_last_run"), 2.0);
  EXPECT_EQ(field(d, "rms_to_last_run"), 2.0);
  EXPECT_EQ(field(b, "rms_to_fewer_threads"), 1.0);
  EXPECT_EQ(field(d, "rms_to_fewer_threads"), 1.0);
  EXPECT_EQ(field(d, "rms_to_fewer_threads_share_of_mean"), 1.0 / 4.0);
  EXPECT_DOUBLE_EQ(field(d, "rms_to_single_share_of_error"), 3.0 / field(d, "error"));
  EXPECT_NEAR(field(d, "error"), 4.0 - 0.25, 0.05);  // the truth is 0.25
  // What the reference itself is off by is taken away.
  EXPECT_GT(field(d, "reference_rmse"), 0.0);
  EXPECT_DOUBLE_EQ(std::pow(field(d, "error"), 2),
                   std::pow(field(d, "rmse"), 2) - std::pow(field(d, "reference_rmse"), 2));
  EXPECT_EQ(d.counters.at("records_made"), 4 * 7);
  EXPECT_EQ(d.counters.at("redundant_records"), 3 * 7) << "more than the picture of one thread";
  EXPECT_EQ(a.counters.at("redundant_records"), 0);
  EXPECT_FALSE(a.counters.contains("rms_to_last_run") || a.counters.contains("rms_to_fewer_threads"));
  EXPECT_EQ(g_pictures, 4u) << "some were rendered for nothing";
}

TEST_F(RepeatabilityTest, WhatAnEarlierProcessMeasuredIsRenderedAgain) {
  const auto found = points(drifting, {1, 3});
  g_pictures = 0;
  RepeatabilityStudy work = study();
  const Entry d = work.run(found[1], 1);
  for (const char* name : {"rms_to_single", "rms_to_last_run", "rms_to_fewer_threads"})
    EXPECT_GT(d.counters.at(name).get<double>(), 0.0) << name;
  EXPECT_EQ(g_pictures, 4u);
}

TEST_F(RepeatabilityTest, CachesForOneThreadAreMeasuredWithOne) {
  const auto found = points(find_cache("sequential"), {2, 4});
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].threads, 1u);
  EXPECT_EQ(found[0].fewer, 0u);
  const auto shared = points(find_cache("wait_free"), {8, 2, 4});
  ASSERT_EQ(shared.size(), 3u);
  EXPECT_EQ(shared[0].threads, 2u);
  EXPECT_EQ(shared[0].fewer, 0u);
  EXPECT_EQ(shared[2].threads, 8u);
  EXPECT_EQ(shared[2].fewer, 4u);
}

}  // namespace
}  // namespace icbench
