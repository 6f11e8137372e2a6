// Neighbour clamping: a new record's radius is at most R_j + |p - p_j| for every record j that is found there, in a
// pass left to itself and in waves.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <glm/geometric.hpp>
#include <limits>
#include <memory>
#include <mutex>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "cached_runs.h"
#include "core/random.h"
#include "render/irradiance_cache.h"
#include "render/waves.h"
#include "render_support.h"
#include "temporal_scenes.h"

namespace icbench {
namespace {

constexpr float kA = 0.2f;
const Bounds kSpace{glm::vec3(-10.0f), glm::vec3(10.0f)};

Record record_at(const glm::vec3& p, float R, const glm::vec3& n = {0, 1, 0}) {
  return {p, n, R, Irradiance(1.0f), RecordDetails::kNone};
}

bool are_same_bytes(std::span<const Record> a, std::span<const Record> b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size_bytes()) == 0);
}

TEST(NeighbourClamping, AllowsTheNeighboursRadiusAndTheDistanceToIt) {
  const Record other = record_at({1, 2, 3}, 0.5f);
  EXPECT_FLOAT_EQ(allowed_by_neighbour(other, {1, 2, 3}), 0.5f);
  EXPECT_FLOAT_EQ(allowed_by_neighbour(other, {1 + 0.3f, 2, 3 - 0.4f}), 1.0f);
}

// Guards against: clamping by records that a query at the point would not find, and by the first of those that it does
// alone.
TEST(NeighbourClamping, HeedsTheClosestOfTheRecordsThatAreFoundAndNoOther) {
  const Record made = record_at({0, 0, 0}, 5.0f);
  const auto clamped = [&](std::vector<Record> records) {
    ListSession session{.bounds = kSpace, .a = 0.4f, .records = std::move(records)};
    const std::vector<Record> before = session.records;
    const float R = clamped_to_neighbours(session, made);
    EXPECT_TRUE(are_same_bytes(before, std::span(session.records).first(before.size())))
        << "published records stay as they are";
    return R;
  };
  EXPECT_EQ(clamped({}), 5.0f);
  EXPECT_FLOAT_EQ(clamped({record_at({0.39f, 0, 0}, 1.0f)}), 1.39f);
  EXPECT_EQ(clamped({record_at({0.41f, 0, 0}, 1.0f)}), 5.0f) << "too far to be found";
  EXPECT_EQ(clamped({record_at({0.1f, 0, 0}, 1.0f, {1, 0, 0})}), 5.0f) << "on another wall";
  EXPECT_EQ(clamped({record_at({0.1f, 0, 0}, 20.0f)}), 5.0f) << "its neighbour's allows more";
  const Record three[] = {record_at({0.2f, 0, 0}, 2.0f), record_at({0, 0, 0.1f}, 1.0f),
                          record_at({0, 0, 0.3f}, 3.0f)};
  EXPECT_FLOAT_EQ(clamped({three[0], three[1], three[2]}), 1.1f);
  EXPECT_FLOAT_EQ(clamped({three[1], three[2], three[0]}), 1.1f);
  EXPECT_FLOAT_EQ(clamped({three[2], three[0], three[1]}), 1.1f);
}

bool is_found(const Record& r, const Record& by) {
  return split_sphere_weight({by.p, by.n}, r, search_reach(Interpolation::neighbour_clamping) * kA) > 0.0f;
}

/// R that all of the records [0, end) allow.
float most_R(const std::vector<Record>& records, std::size_t end, const Record& of) {
  float R = std::numeric_limits<float>::infinity();
  for (std::size_t j = 0; j < end; ++j)
    if (is_found(records[j], of)) R = std::min(R, records[j].R + glm::distance(of.p, records[j].p));
  return R;
}

/// Of uneven records in the order that they were made: each is what its source made it or what those before allow.
void expect_clamped(const std::vector<Record>& records) {
  std::size_t smaller = 0;
  for (std::size_t i = 0; i < records.size(); ++i) {
    ASSERT_FLOAT_EQ(records[i].R, std::min(records[i].E.x, most_R(records, i, records[i]))) << i;
    smaller += records[i].R < records[i].E.x;
  }
  EXPECT_GT(smaller, records.size() / 20) << "hardly anything was clamped";
  EXPECT_LT(smaller, records.size());
}

/// A list of records for waves, which remembers how many there were when each was made.
class ListOfWaves final : public WaveCache {
 public:
  ListOfWaves(const Bounds& bounds, float a) : list_{.bounds = bounds, .a = a} {}

  void ask(unsigned, std::span<const SurfacePoint> points, Answers& answers,
           std::span<Reply> replies) noexcept override {
    for (std::size_t i = 0; i < points.size(); ++i) {
      answers.ask_at(points.subspan(i, 1));
      list_.visit(points[i], answers[0]);
      replies[i] = answers.settle(0);
    }
  }
  InsertResult insert(unsigned, const Record& r) noexcept override {
    const std::lock_guard lock(mutex_);
    made_.push_back(r);
    published_before_.push_back(list_.records.size());
    return InsertResult::inserted;
  }
  void publish() override {
    list_.records.insert(list_.records.end(),
                         made_.begin() + static_cast<std::ptrdiff_t>(list_.records.size()), made_.end());
  }
  float accuracy() const noexcept override { return list_.a; }

  const std::vector<Record>& made() const { return made_; }  ///< in the order that they came
  const std::vector<Record>& published() const { return list_.records; }
  std::size_t published_before(std::size_t i) const { return published_before_[i]; }

 private:
  std::mutex mutex_;
  ListSession list_;
  std::vector<Record> made_;
  std::vector<std::size_t> published_before_;
};

std::unique_ptr<ListOfWaves> by_waves(const RayTracer& rays, RecordSource& source, int width, int height,
                                      unsigned threads) {
  ThreadCrew crew(rays, threads);
  source.begin_frame({}, crew);
  auto cache =
      std::make_unique<ListOfWaves>(rays.scene().bounds, search_reach(source.shapes()->shaper.level()) * kA);
  Image out = make_image(width, height);
  Waves waves(rays, source, crew);
  waves.render(*cache, primary_hits(rays, width, height), {}, false, out);
  EXPECT_TRUE(are_same_bytes(std::span(cache->made()).first(cache->published().size()), cache->published()))
      << "published records stay as they were inserted";
  return cache;
}

std::vector<Record> by_tiles(const RayTracer& rays, RecordSource& source, int width, int height) {
  ListSession session{.bounds = rays.scene().bounds, .a = search_reach(source.shapes()->shaper.level()) * kA};
  const PrimaryHits primary = primary_hits(rays, width, height);
  Image out = make_image(width, height);
  Tracer tracer(rays);
  CacheUse use;
  for (const Tile& tile : make_tiles(width, height, 8, TileOrder::morton))
    irradiance_cache_tile(session, source, 0, tracer, primary, {}, tile, out, use);
  return session.records;
}

TEST(NeighbourClamping, ClampsEachNewRecordOfATileByThoseBefore) {
  const RayTracer rays(animated_room({}));
  UnevenSource source(Interpolation::neighbour_clamping, kA, kSpace);
  expect_clamped(by_tiles(rays, source, 40, 30));
}

// Ellipses, too, are looked for farther out than they are valid.
TEST(NeighbourClamping, IsNotDoneAtOtherLevels) {
  const RayTracer rays(animated_room({}));
  for (const Interpolation level : {Interpolation::gradients, Interpolation::occlusion_hessian}) {
    UnevenSource source(level, kA, kSpace);
    for (const Record& r : by_tiles(rays, source, 40, 30)) ASSERT_EQ(r.R, r.E.x);
    const auto cache = by_waves(rays, source, 40, 30, 1);
    for (const Record& r : cache->made()) ASSERT_EQ(r.R, r.E.x);
  }
}

// A picture of one block, so that one thread makes all records in turn.
TEST(NeighbourClamping, ClampsEachNewRecordOfAWaveByThoseBeforeAndByThoseOfItsBlock) {
  const RayTracer rays(animated_room({}));
  UnevenSource source(Interpolation::neighbour_clamping, kA, kSpace);
  const auto cache = by_waves(rays, source, 8, 8, 1);
  expect_clamped(cache->made());
  std::size_t by_own = 0;
  for (std::size_t i = 0; i < cache->made().size(); ++i)
    by_own += cache->made()[i].R < most_R(cache->made(), cache->published_before(i), cache->made()[i]);
  EXPECT_GT(by_own, 0u) << "no record of the same round mattered";
}

// Blocks of a round do not see each other: what counts is published, whatever the number of threads.
TEST(NeighbourClamping, OfWavesHoldsForAllThatIsPublishedAndDependsOnNoThread) {
  const RayTracer rays(animated_room({}));
  const auto sorted = [](std::vector<Record> records) {
    std::sort(records.begin(), records.end(), [](const Record& a, const Record& b) {
      return std::tie(a.p.x, a.p.y, a.p.z, a.R) < std::tie(b.p.x, b.p.y, b.p.z, b.R);
    });
    return records;
  };
  std::vector<Record> by_one;
  for (const unsigned threads : {1u, 3u}) {
    UnevenSource source(Interpolation::neighbour_clamping, kA, kSpace);
    const auto cache = by_waves(rays, source, 40, 30, threads);
    std::size_t bound = 0;
    for (std::size_t i = 0; i < cache->made().size(); ++i) {
      const Record& r = cache->made()[i];
      const float most = most_R(cache->made(), cache->published_before(i), r);
      ASSERT_LE(r.R, 1.000001f * std::min(r.E.x, most)) << i;
      bound += most < r.E.x;
    }
    EXPECT_GT(bound, cache->made().size() / 20) << "hardly anything was clamped";
    if (threads == 1) by_one = sorted(cache->made());
    const std::vector<Record> made = sorted(cache->made());
    EXPECT_TRUE(are_same_bytes(made, by_one));
  }
}

// Guards against: records of a renderer that reach the cache by a way on which nothing is clamped.
TEST(NeighbourClamping, HoldsForTheRecordsOfHemisphereGathers) {
  const RayTracer rays(animated_room({}));
  constexpr int kWidth = 32, kHeight = 24;
  const auto largest_excess = [&](Interpolation level, bool in_waves) {
    ThreadCrew crew(rays, 1);
    PassSetup setup{rays, crew, kWidth, kHeight};
    setup.gather_rays = 64;
    setup.a = kA;
    setup.interpolation = level;
    const auto source = make_irradiance_cache(setup);
    source->begin_frame({}, crew);
    float most = 0.0f;  // of R over what is allowed
    const auto look_at = [&](const std::vector<Record>& records, std::size_t i, std::size_t before) {
      most = std::max(most, records[i].R / most_R(records, before, records[i]));
    };
    if (in_waves) {
      const auto cache = by_waves(rays, *source, kWidth, kHeight, 1);
      for (std::size_t i = 0; i < cache->made().size(); ++i)
        look_at(cache->made(), i, cache->published_before(i));
    } else {
      const auto records = by_tiles(rays, *source, kWidth, kHeight);
      for (std::size_t i = 0; i < records.size(); ++i) look_at(records, i, i);
    }
    return most;
  };
  for (const bool in_waves : {false, true}) {
    EXPECT_LE(largest_excess(Interpolation::neighbour_clamping, in_waves), 1.000001f);
    EXPECT_GT(largest_excess(Interpolation::gradients, in_waves), 1.1f) << "there is nothing to clamp";
  }
}

}  // namespace
}  // namespace icbench
