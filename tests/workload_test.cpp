// Synthetic plans, streams and trials, and the validation that every trial must pass.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <map>
#include <memory>
#include <numeric>
#include <set>

#include "made_points.h"
#include "workload/synthetic_plan.h"
#include "workload/trial.h"
#include "workload/validation.h"

namespace icbench {
namespace {

std::vector<std::uint32_t> queries_of(std::span<const std::uint32_t> operations) {
  std::vector<std::uint32_t> out;
  std::copy_if(operations.begin(), operations.end(), std::back_inserter(out),
               [](std::uint32_t operation) { return (operation & Streams::kInsert) == 0; });
  return out;
}

TEST(Streams, EveryInsertIsMadeOnceWhateverTheThreads) {
  for (const char* workload : {"insert_only:records=700", "mix_99_1:records=50:operations=700",
                               "mix_90_10:records=50:operations=701", "mix_50_50:records=50:operations=3"}) {
    const SyntheticPlan plan = made_plan(workload);
    const std::uint32_t n = plan.spec().kind == WorkloadKind::insert_only ? 700 : plan.spec().operations;
    ASSERT_EQ(plan.records().size(), plan.prefilled() + plan.spec().inserts());
    for (const unsigned threads : {1u, 2u, 3u, 64u, 1000u, 8192u}) {
      const Streams streams = plan.streams(threads, 5);
      ASSERT_EQ(streams.begin.size(), threads + 1);
      EXPECT_EQ(streams.begin.front(), 0u);
      EXPECT_EQ(streams.begin.back(), n);
      EXPECT_TRUE(std::is_sorted(streams.begin.begin(), streams.begin.end()));
      ASSERT_EQ(streams.operations.size(), n);
      std::vector<std::uint32_t> inserted;
      for (unsigned t = 0; t < threads; ++t) {
        // Shares differ by one operation at most.
        EXPECT_LE(streams.of(t).size(), n / threads + 1);
        for (const std::uint32_t operation : streams.of(t)) {
          if (operation & Streams::kInsert) {
            inserted.push_back(operation & Streams::kIndex);
          } else {
            EXPECT_LT(operation, plan.points().size());
          }
        }
      }
      std::vector<std::uint32_t> expected(plan.spec().inserts());
      std::iota(expected.begin(), expected.end(), plan.prefilled());
      EXPECT_EQ(inserted, expected) << workload << ", " << threads << " threads";
    }
  }
}

TEST(Streams, InsertsAreSpreadOverAllThreads) {
  const Streams streams = made_plan("mix_90_10:records=50:operations=8000").streams(8, 1);
  for (unsigned t = 0; t < 8; ++t) {
    EXPECT_NEAR(static_cast<double>(streams.of(t).size() - queries_of(streams.of(t)).size()), 100.0, 1.0);
  }
}

TEST(Streams, OperationsDependOnTheSeedAndNotOnTheThreads) {
  for (const char* order : {"uniform", "hot_spot"}) {
    const SyntheticPlan plan = made_plan(fmt::format("miss_driven:operations=1000:order={}", order));
    EXPECT_EQ(plan.streams(1, 3).operations, plan.streams(7, 3).operations);
    EXPECT_NE(plan.streams(1, 3).operations, plan.streams(1, 4).operations);
  }
  const SyntheticPlan coherent = made_plan("miss_driven:operations=1000:order=coherent");
  EXPECT_EQ(coherent.streams(7, 3).operations, coherent.streams(7, 3).operations);
}

TEST(Streams, UniformOrderReachesAllPoints) {
  const SyntheticPlan plan = made_plan("miss_driven:operations=20000");
  const std::vector<std::uint32_t> asked = queries_of(plan.streams(1, 1).operations);
  const double mean = std::accumulate(asked.begin(), asked.end(), 0.0) / static_cast<double>(asked.size());
  const double middle = static_cast<double>(plan.points().size()) / 2.0;
  EXPECT_NEAR(mean / middle, 1.0, 0.03);  // standard error 0.004
  // As many different ones as independent draws would give, n (1 - 1/e).
  EXPECT_NEAR(static_cast<double>(std::set(asked.begin(), asked.end()).size()), 0.632 * kMadePoints, 400.0);
}

TEST(Streams, NineInTenQueriesFallIntoTheHotSpot) {
  const SyntheticPlan plan = made_plan("miss_driven:operations=40000:order=hot_spot");
  std::map<std::uint32_t, std::uint32_t> asked;
  for (const std::uint32_t point : plan.streams(4, 1).operations) ++asked[point];
  // A point of the spot is asked for 180 times on average, any other 0.2 times.
  std::uint32_t hot_queries = 0, hot_points = 0;
  glm::vec3 centre(0.0f);
  for (const auto& [point, times] : asked) {
    if (times < 20) continue;
    hot_queries += times;
    ++hot_points;
    centre += plan.points()[point].p;
  }
  EXPECT_EQ(hot_points, kMadePoints / 100);
  EXPECT_NEAR(hot_queries / 40000.0, 0.901, 0.01);
  // They lie together: few points are nearer to their centre than the farthest of them.
  centre /= static_cast<float>(hot_points);
  const auto distance = [&](std::uint32_t i) { return glm::length(plan.points()[i].p - centre); };
  float farthest = 0.0f;
  for (const auto& [point, times] : asked) {
    if (times >= 20) farthest = std::max(farthest, distance(point));
  }
  std::uint32_t inside = 0;
  for (std::uint32_t i = 0; i < plan.points().size(); ++i) inside += distance(i) <= farthest;
  EXPECT_LT(inside, 2 * hot_points);
}

TEST(Streams, CoherentOrderGoesTileByTile) {
  const SyntheticPlan plan = made_plan("miss_driven:operations=15000:order=coherent");
  for (const unsigned threads : {1u, 3u, 8u}) {
    const Streams streams = plan.streams(threads, 1);
    std::set<std::uint32_t> all;
    for (unsigned t = 0; t < threads; ++t) {
      std::size_t place = 0;
      for (const std::uint32_t point : streams.of(t)) {
        // Tiles t, t + threads, ..., each from its first point on.
        EXPECT_EQ(point, (t + place / kMadeTile * threads) * kMadeTile + place % kMadeTile);
        ++place;
        all.insert(point);
      }
    }
    EXPECT_EQ(all.size(), 15000u) << "no tile is given to two threads before all were given out";
  }
}

TEST(Streams, CoherentOrderStartsAgainAfterTheLastTile) {
  const SyntheticPlan plan = made_plan("miss_driven:operations=45000:order=coherent");
  std::vector<unsigned> asked(kMadePoints);
  for (const std::uint32_t point : plan.streams(1, 1).operations) ++asked[point];
  EXPECT_EQ(*std::min_element(asked.begin(), asked.end()), 2u);
  EXPECT_EQ(*std::max_element(asked.begin(), asked.end()), 3u);
  EXPECT_EQ(asked.front(), 3u);
}

TEST(Plan, SixRecordsAreValidAtAPointOnAverage) {
  for (const char* workload :
       {"read_only:records=300", "read_only:records=5000:a=0.1", "insert_only:records=2000",
        "mix_50_50:records=1000:operations=2000:order=coherent"}) {
    const SyntheticPlan plan = made_plan(workload);
    Pcg32 random(1);
    constexpr int kProbes = 2000;
    std::uint64_t valid = 0;
    for (int i = 0; i < kProbes; ++i) {
      const SurfacePoint& x = plan.points()[random.below(static_cast<std::uint32_t>(plan.points().size()))];
      for (const Record& r : plan.records()) valid += split_sphere_weight(x, r, plan.spec().a) > 0.0f;
    }
    EXPECT_NEAR(static_cast<double>(valid) / kProbes, 6.0, 0.6) << workload;
  }
}

TEST(Plan, ExpectedHitsAreThoseOfAllRecords) {
  const SyntheticPlan plan = made_plan("read_only:records=100:operations=3000");
  const Streams streams = plan.streams(2, 1);
  std::uint64_t hits = 0;
  for (const std::uint32_t point : streams.operations) {
    hits += std::any_of(plan.records().begin(), plan.records().end(), [&](const Record& r) {
      return split_sphere_weight(plan.points()[point], r, plan.spec().a) > 0.0f;
    });
  }
  EXPECT_EQ(plan.expected_answers(streams).hits, hits);
  EXPECT_GT(hits, 0u);
  EXPECT_LT(hits, 3000u) << "the test needs misses too";
}

constexpr struct Nobody {
} nobody;  // a session that counts no waiting

TEST(LatencySampling, OneInSoManyIsTimed) {
  for (const auto& [every, expected] : {std::pair{1u, 100000.0}, {16u, 6250.0}, {1000u, 100.0}, {0u, 0.0}}) {
    LatencySampler sampler(every, 9);
    Histogram histogram;
    int runs = 0;
    for (int i = 0; i < 100000; ++i) EXPECT_EQ(sampler.run(histogram, nobody, [&] { return ++runs; }), i + 1);
    // Distances are uniform, so the count's standard deviation is 0.58 of its root.
    EXPECT_NEAR(static_cast<double>(histogram.count()), expected, every < 2 ? 0.0 : 4 * std::sqrt(expected));
  }
}

TEST(LatencySampling, FollowsNoRhythm) {
  LatencySampler sampler(4, 9);
  std::set<int> distances;
  for (int i = 0, last = -1; i < 1000; ++i) {
    Histogram histogram;
    sampler.run(histogram, nobody, [] { return 0; });
    if (histogram.count() == 0) continue;
    if (last >= 0) distances.insert(i - last);
    last = i;
  }
  EXPECT_EQ(distances, (std::set{1, 2, 3, 4, 5, 6, 7}));
}

// A cache that holds what a test puts there, and a query that shows what a test wants.
struct FakeCache {
  CacheConfig settings;
  std::vector<Record> stored;

  const CacheConfig& config() const { return settings; }
  template <class F>
  void for_each_record(F&& f) const {
    for (const Record& r : stored) f(r);
  }
};

struct FakeSession {
  std::function<void(const SurfacePoint&, std::vector<std::uint32_t>&)> tamper = [](auto&, auto&) {};
  const FakeCache* cache;

  template <class F>
  void visit(const SurfacePoint& x, F&& f) {
    std::vector<std::uint32_t> shown;
    for (const Record& r : cache->stored) {
      if (split_sphere_weight(x, r, cache->settings.a) > 0.0f) shown.push_back(r.id);
    }
    tamper(x, shown);
    for (const std::uint32_t id : shown) {
      f(*std::find_if(cache->stored.begin(), cache->stored.end(),
                      [&](const Record& r) { return r.id == id; }),
        1.0f);
    }
  }
};

class Validation : public ::testing::Test {
 protected:
  Validation() {
    cache.settings.a = cache.settings.a_max = 0.5f;
    for (std::uint32_t i = 0; i < 20; ++i) {
      const float x = static_cast<float>(i) / 20.0f;
      given.push_back({{x, 0.0f, 0.5f}, {0, 1, 0}, 0.2f, glm::vec3(x), i});
      points.push_back({{x, 0.0f, 0.55f}, {0, 1, 0}});
    }
    cache.stored = given;
    std::reverse(cache.stored.begin(), cache.stored.end());
    session.cache = &cache;
  }

  std::string verdict() {
    return validate_records(cache, session, given.size(), points, [&](std::uint32_t id) -> const Record* {
      return id < given.size() ? &given[id] : nullptr;
    });
  }

  FakeCache cache;
  FakeSession session;
  std::vector<Record> given;
  std::vector<SurfacePoint> points;
};

TEST_F(Validation, WholeCachePasses) { EXPECT_EQ(verdict(), ""); }

TEST_F(Validation, LostRecord) {
  cache.stored.pop_back();
  EXPECT_EQ(verdict(), "20 records accepted but 19 stored");
}

TEST_F(Validation, DuplicatedRecord) {
  cache.stored.push_back(given[7]);
  EXPECT_EQ(verdict(), "duplicated record 7");
}

TEST_F(Validation, DuplicateInPlaceOfAnother) {
  cache.stored[3] = cache.stored[4];
  EXPECT_EQ(verdict(), "duplicated record 15");
}

TEST_F(Validation, TornRecord) {
  cache.stored[5].E.z += 1.0f;
  EXPECT_EQ(verdict(), "torn record 14");
}

TEST_F(Validation, InventedRecord) {
  cache.stored[5].id = 20;
  EXPECT_EQ(verdict(), "invented record 20");
}

TEST_F(Validation, QueryThatMisses) {
  session.tamper = [](const SurfacePoint& x, auto& shown) {
    if (x.p.x > 0.42f && x.p.x < 0.48f) shown.pop_back();
  };
  EXPECT_NE(verdict().find("a query sees"), std::string::npos);
}

TEST_F(Validation, QueryThatShowsARecordTwice) {
  session.tamper = [](auto&, auto& shown) { shown.push_back(shown.back()); };
  EXPECT_NE(verdict().find("a query sees"), std::string::npos);
}

TEST_F(Validation, QueryThatShowsAnotherRecord) {
  session.tamper = [](const SurfacePoint& x, auto& shown) { shown.back() = x.p.x < 0.5f ? 19 : 0; };
  EXPECT_NE(verdict().find("a query sees"), std::string::npos);
}

}  // namespace
}  // namespace icbench
