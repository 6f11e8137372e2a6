// Synthetic trials on every cache, and on broken caches that a trial must find out.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <map>
#include <memory>

#include "broken_caches.h"
#include "made_points.h"
#include "temporary_folder.h"
#include "workload/dispatch.h"
#include "workload/synthetic_trial.h"

namespace icbench {
namespace {

constexpr std::uint64_t kSeed = 3;

/// Runs trials with teams that are made once.
class Bench {
 public:
  template <class Run>
  TrialOutcome operator()(Run&& run, const SyntheticPlan& plan, unsigned threads) {
    auto& team = teams_[threads];
    if (!team) team = std::make_unique<ThreadTeam>(topology_, Placement::none, threads);
    return run(plan, TrialSetup{*team, work_, kSeed, 1});
  }

 private:
  Topology topology_ = Topology::of_this_process();
  Work work_{WorkCalibration{}};
  std::map<unsigned, std::unique_ptr<ThreadTeam>> teams_;
};

class Trials : public ::testing::TestWithParam<const char*> {};

TEST_P(Trials, AreValidOnEveryCacheAndNumberOfThreads) {
  const SyntheticPlan plan = made_plan(GetParam());
  const WorkloadSpec& spec = plan.spec();
  Bench bench;
  for (const CacheEntry& cache : all_caches()) {
    for (const unsigned threads : {1u, 2u, 8u}) {
      if (!can_run(cache, spec, threads)) continue;
      SCOPED_TRACE(::testing::Message() << cache.traits.name << ", " << threads << " threads");
      const TrialOutcome out = bench(cache.synthetic, plan, threads);
      ASSERT_EQ(out.error, "");
      EXPECT_GT(out.wall_ns, 0.0);
      EXPECT_LE(out.counts.hits, out.counts.queries);
      EXPECT_EQ(out.query_ticks.count(), out.counts.queries) << "every operation was to be timed";
      EXPECT_EQ(out.query_ticks.count() + out.insert_ticks.count(), out.operations);
      const std::uint64_t operations =
          spec.kind == WorkloadKind::insert_only ? spec.records : spec.operations;
      if (spec.kind != WorkloadKind::miss_driven) {
        EXPECT_EQ(out.operations, operations);
      }
      if (cache.traits.consistency == Consistency::none) {
        EXPECT_EQ(out.records, 0u);
        continue;
      }
      EXPECT_EQ(out.records, plan.prefilled() + out.counts.inserted);
      EXPECT_GT(out.bytes, out.records * sizeof(Record));
      EXPECT_EQ(out.counts.full + out.counts.rejected + out.counts.invalid_queries, 0u);
      if (spec.kind == WorkloadKind::miss_driven) {
        EXPECT_EQ(out.counts.queries, operations);
        EXPECT_EQ(out.counts.inserted, out.counts.queries - out.counts.hits);
        if (threads == 1) {
          EXPECT_EQ(out.records, plan.records_of_one_thread(1, kSeed)) << "redundant records";
        }
      } else {
        EXPECT_EQ(out.counts.inserted, spec.inserts());
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Kinds, Trials,
                         ::testing::Values("read_only:records=500:operations=1500",
                                           "insert_only:records=1500", "mix_99_1:records=500:operations=1500",
                                           "mix_90_10:records=500:operations=1500:order=hot_spot",
                                           "mix_50_50:records=500:operations=1500",
                                           "read_only:records=500:layout=tidied:operations=1500",
                                           "mix_50_50:records=500:layout=tidied:operations=1500",
                                           "miss_driven:cost=0:operations=1500",
                                           "miss_driven:cost=1:operations=1500:order=hot_spot",
                                           "miss_driven:cost=0:operations=1500:order=coherent",
                                           "mix_50_50:records=3:operations=4"),
                         [](const auto& kind) { return fmt::format("Kind{}", kind.index); });

// Guards against: redundancy that is told of threads because they have other tiles than one alone would have.
TEST(Redundancy, InCoherentOrderIsOverWhatTheSameTilesNeed) {
  Bench bench;
  constexpr unsigned kThreads = 8;
  const SyntheticPlan plan = made_plan("miss_driven:cost=0:operations=1500:order=coherent");
  ASSERT_EQ(plan.streams_of_one_thread(kThreads), kThreads);
  const auto needed = static_cast<double>(plan.records_of_one_thread(kThreads, kSeed));
  const TrialOutcome out = bench(find_cache("global_mutex").synthetic, plan, kThreads);
  EXPECT_NEAR(static_cast<double>(out.records), needed, 0.1 * needed);
  EXPECT_EQ(made_plan("miss_driven:cost=0:operations=1500").streams_of_one_thread(kThreads), 1u);
}

TEST(BrokenCaches, WrongRecordsAreFoundOut) {
  const SyntheticPlan inserts = made_plan("insert_only:records=200");
  const SyntheticPlan misses = made_plan("miss_driven:cost=0:operations=1000");
  Bench bench;
  EXPECT_EQ(bench(run_synthetic_trial<WaitFree>, inserts, 2).error, "");
  EXPECT_EQ(bench(run_synthetic_trial<Losing>, inserts, 2).error, "200 records accepted but 199 stored");
  EXPECT_EQ(bench(run_synthetic_trial<Tearing>, inserts, 2).error.find("torn record"), 0u);
  EXPECT_EQ(bench(run_synthetic_trial<Inventing>, inserts, 2).error, "invented record 1000000");
  EXPECT_EQ(bench(run_synthetic_trial<Small>, inserts, 1).error, "136 inserts refused");
  EXPECT_EQ(bench(run_synthetic_trial<WaitFree>, misses, 2).error, "");
  EXPECT_EQ(bench(run_synthetic_trial<Tearing>, misses, 2).error.find("torn record"), 0u);
}

TEST(BrokenCaches, WrongAnswersAreFoundOut) {
  Bench bench;
  const auto says = [](const TrialOutcome& out, const char* part) {
    return is_one_line_with(out.error, part);
  };
  for (const char* workload :
       {"read_only:records=200:operations=300", "mix_90_10:records=200:operations=300"}) {
    const SyntheticPlan plan = made_plan(workload);
    EXPECT_EQ(bench(run_synthetic_trial<WaitFree>, plan, 2).error, "");
    EXPECT_TRUE(says(bench(run_synthetic_trial<Blind>, plan, 2), "0 queries hit where"));
    EXPECT_TRUE(says(bench(run_synthetic_trial<Brightening>, plan, 2), "answers reach from"));
  }
  const SyntheticPlan reads = made_plan("read_only:records=200:operations=300");
  EXPECT_TRUE(says(bench(run_synthetic_trial<Darkening>, reads, 2), "the answers' sum is"));
}

TEST(BrokenCaches, AreTidiedWhereTheWorkloadSaysSo) {
  Bench bench;
  const SyntheticPlan plain = made_plan("read_only:records=200:operations=300");
  EXPECT_EQ(bench(run_synthetic_trial<Sweeping>, plain, 2).error, "");
  const SyntheticPlan tidied = made_plan("read_only:records=200:layout=tidied:operations=300");
  EXPECT_EQ(bench(run_synthetic_trial<WaitFree>, tidied, 2).error, "");
  EXPECT_EQ(bench(run_synthetic_trial<Sweeping>, tidied, 2).error, "200 records accepted but 0 stored");
}

TEST(Dispatch, FindsEveryCacheByName) {
  for (const CacheEntry& cache : all_caches()) EXPECT_EQ(&find_cache(cache.traits.name), &cache);
  EXPECT_THROW(find_cache("waitfree"), std::runtime_error);
}

}  // namespace
}  // namespace icbench
