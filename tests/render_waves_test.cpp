// Sums of what a cache finds, which must not depend on the order in which it finds it; and which hits ask it again.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <map>
#include <mutex>
#include <optional>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "cached_runs.h"
#include "core/random.h"
#include "render/place_hash.h"
#include "render/waves.h"
#include "render_support.h"
#include "temporal_scenes.h"

namespace icbench {
namespace {

// Records as they are, of no level that extrapolates.
class PlainSource final : public RecordSource {
 public:
  RecordsThen begin_frame(const SceneChange&, Crew&) override { return RecordsThen::go; }
  Record evaluate(unsigned, Tracer&, const Visible&, const SampleKey&) noexcept override { return {}; }
};

// Guards against: sums in the order of the cache. Such pictures are alike all the same where irradiance is: doubles
// hold sums of floats exactly unless these are 2^29 times as large as one another. Here the mean of four lies half way
// between two floats, but for what the small ones add, and each alone is lost beside the large one.
TEST(Answers, AreSummedInAnOrderThatTheCacheHasNoPartIn) {
  PlainSource source;
  Answers answers(source);
  const SurfacePoint x{glm::vec3(0.5f), {0, 1, 0}};
  constexpr std::array kE{0x1p60f, 0x1p36f, 0x1p7f, 0x1p7f};
  for (const bool at_one_place : {false, true}) {
    std::array order{0, 1, 2, 3};
    std::optional<float> first;
    int differ = 0;
    do {
      MeanIrradiance as_found;
      answers.ask_at({&x, 1});
      for (const int k : order) {
        const auto i = static_cast<std::size_t>(k);
        const glm::vec3 p = at_one_place ? x.p : glm::vec3(0.5f, 0.5f, 0.1f * static_cast<float>(k));
        answers[0]({p, x.n, 1.0f, Irradiance(kE[i]), RecordDetails::kNone}, 1.0f);
        as_found.add(Irradiance(kE[i]), 1.0f);
      }
      const Reply reply = answers.settle(0);
      ASSERT_TRUE(reply.E.has_value());
      if (!first) first = reply.E->x;
      EXPECT_EQ(reply.E->x, *first);
      differ += as_found.result()->x != *first;
    } while (std::next_permutation(order.begin(), order.end()));
    EXPECT_GT(differ, 0) << "there was nothing to guard against";
    EXPECT_LT(differ, 24);
  }
  answers.ask_at({&x, 1});
  EXPECT_FALSE(answers.settle(0).E.has_value()) << "what was settled is forgotten";
}

constexpr float kA = 0.2f;
const Bounds kCube{glm::vec3(-2.0f), glm::vec3(2.0f)};

// Records with ellipses, of which it is told which are needed.
class NeededSource final : public RecordSource {
 public:
  NeededSource()
      : shapes_{RecordShaper(Interpolation::occlusion_hessian, kA, kCube, {0.05f, 8.0f}, 10),
                RecordDetails(2, 1)} {}

  RecordsThen begin_frame(const SceneChange&, Crew&) override { return RecordsThen::stay; }
  Record evaluate(unsigned, Tracer&, const Visible&, const SampleKey&) noexcept override { return {}; }
  RecordShapes* shapes() noexcept override { return &shapes_; }
  UseToTell tells() const noexcept override { return UseToTell::needed; }
  void used(const Record& r) noexcept override { told.push_back(r.id); }

  Record record_at(const glm::vec3& p, float reach) {
    const std::uint32_t id = shapes_.details.draft(0);
    shapes_.details.keep(0);
    shapes_.details[id] = {.gradients = {},
                           .major = {1, 0, 0},
                           .inverse_major = 1.0f / reach,
                           .inverse_minor = 1.0f / reach,
                           .marks = {}};
    return {p, {0, 0, 1}, 10.0f, Irradiance(1.0f), id};
  }

  std::vector<std::uint32_t> told;

 private:
  RecordShapes shapes_;
};

// Guards against: naming a record that only counts beside the one that covers the point, which then seems superfluous.
TEST(Answers, NeedOneOfTheRecordsThatCoverThePoint) {
  const SurfacePoint x{glm::vec3(0.0f), {0, 0, 1}};
  int first = 0;  // by its place, which decides among those that cover the point
  constexpr int kPlaces = 16;
  for (int k = 0; k < kPlaces; ++k) {
    const float angle = 0.4f * static_cast<float>(k), c = 0.2f * std::cos(angle), d = 0.2f * std::sin(angle);
    NeededSource source;
    const Record near = source.record_at({0, 0.05f, 0}, 0.1f), far = source.record_at({c, d, 0}, 0.1f);
    first += hash_of(far.p) < hash_of(near.p);
    const auto told = [&](const std::vector<Record>& found) {
      ListSession session{
          .bounds = kCube, .a = search_reach(Interpolation::occlusion_hessian) * kA, .records = found};
      Answers answers(source);
      answers.ask_at({&x, 1});
      session.visit(x, answers[0]);
      answers.settle(0);
      const std::vector<std::uint32_t> in_waves = std::exchange(source.told, {});
      query_telling(session, source, source.tells(), x, Extrapolator(*source.shapes(), x));
      EXPECT_EQ(in_waves, source.told);
      return std::exchange(source.told, {});
    };
    ASSERT_GT(Extrapolator(*source.shapes(), x).of(far, 1e3f).w, 0.0f) << "it does not even count";
    EXPECT_EQ(told({far, near}), std::vector{near.id});
    EXPECT_EQ(told({near, far}), std::vector{near.id});
    EXPECT_TRUE(told({far}).empty());
  }
  EXPECT_GT(first, 0);
  EXPECT_LT(first, kPlaces);
}

// A cache with room for so many records, which notes who asks twice, and how often for nothing: no record that counts
// there came between.
class NotingCache final : public WaveCache {
 public:
  NotingCache(const RecordShapes& shapes, std::size_t capacity)
      : shapes_(shapes),
        list_{
            .bounds = kCube, .a = search_reach(Interpolation::occlusion_hessian) * kA, .capacity = capacity} {
  }

  void ask(unsigned, std::span<const SurfacePoint> points, Answers& answers,
           std::span<Reply> replies) noexcept override {
    const std::lock_guard lock(mutex_);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const SurfacePoint& x = points[i];
      answers.ask_at({&x, 1});
      list_.visit(x, answers[0]);
      replies[i] = answers.settle(0);
      const auto count = static_cast<std::size_t>(
          std::ranges::count_if(list_.records, [&](const Record& r) { return counts_at(shapes_, r, x); }));
      const auto [before, is_first] = counted_.try_emplace({x.p.x, x.p.y, x.p.z}, count);
      if (!is_first && before->second > 0) {
        ++again;
        for_nothing += before->second == count;
      }
      before->second = count;
    }
  }
  InsertResult insert(unsigned, const Record& r) noexcept override {
    const std::lock_guard lock(mutex_);
    if (list_.records.size() + made_.size() >= list_.capacity) return InsertResult::full;
    made_.push_back(r);
    return InsertResult::inserted;
  }
  void publish() override {
    list_.records.insert(list_.records.end(), made_.begin(), made_.end());
    made_.clear();
  }
  float accuracy() const noexcept override { return list_.a; }

  const std::vector<Record>& records() const { return list_.records; }
  std::size_t made() {
    const std::lock_guard lock(mutex_);
    return list_.records.size() + made_.size();
  }

  std::size_t again = 0, for_nothing = 0;

 private:
  std::mutex mutex_;
  const RecordShapes& shapes_;
  ListSession list_;
  std::vector<Record> made_;                                        // since they were published
  std::map<std::tuple<float, float, float>, std::size_t> counted_;  // records, by the point that asked
};

// Guards against: hits that keep what they had before records of the same round came, and hits that ask again because
// of a record which the cache had no room for.
TEST(Waves, HitsAskAgainWhereRecordsOfTheirTileCameLaterAndNowhereElse) {
  const RayTracer rays(animated_room({}));
  ThreadCrew crew(rays, 2);
  constexpr int kSize = kFrameTile;  // one tile: all records are of it
  const PrimaryHits primary = primary_hits(rays, kSize, kSize);
  std::size_t made = 0;
  for (const bool has_room : {true, false}) {
    UnevenSource source(Interpolation::occlusion_hessian, kA, kCube);
    NotingCache cache(*source.shapes(), has_room ? kSize * kSize : 2 * made / 3);
    Image out = blank(kSize, kSize);
    Waves waves(rays, source, crew);
    waves.render(cache, primary, {}, false, out);
    if (has_room) made = cache.records().size();
    EXPECT_EQ(waves.use().full > 0, !has_room);
    EXPECT_GT(cache.again, 10u);
    EXPECT_EQ(cache.for_nothing, 0u) << "of " << cache.again;

    std::size_t made_there = 0;
    Answers answers(source);
    for (std::uint32_t pixel = 0; pixel < out.pixels.size(); ++pixel) {
      const Visible x = primary.at(pixel, 0);
      if (!reflects(rays, x.hit)) continue;
      const SurfacePoint at{x.hit.p, x.hit.n};
      Reply reply{};
      cache.ask(0, {&at, 1}, answers, {&reply, 1});
      const auto shows = [&](const Irradiance& E) {
        const glm::vec3 L = reflected_radiance(rays, x.hit, E);
        return glm::distance(out.pixels[pixel], L) <= 1e-5f * glm::length(L);
      };
      Tracer tracer(rays);
      const bool own = shows(source.evaluate(0, tracer, x, {}).E);
      made_there += own;
      EXPECT_TRUE(own || (reply.E && shows(*reply.E))) << "pixel " << pixel;
    }
    EXPECT_LT(2 * made_there, out.pixels.size()) << "most hits have a record of their own";
  }
}

// Guards against: work that is told of before it is done or long after, more than once, or never.
TEST(Waves, TellOfTheirWorkAsRecordsAreMade) {
  const RayTracer rays(animated_room({}));
  ThreadCrew crew(rays, 2);
  constexpr int kSize = 6 * kFrameTile;
  const PrimaryHits primary = primary_hits(rays, kSize, kSize);
  for (const Interpolation level : {Interpolation::split_sphere, Interpolation::occlusion_hessian}) {
    for (const bool overture : {false, true}) {
      UnevenSource source(level, kA, kCube);
      NotingCache cache(*source.shapes(), kSize * kSize);
      Image out = blank(kSize, kSize);
      std::mutex mutex;
      double told = 0.0;
      std::vector<double> at;  // what was told when so many records were there
      Waves waves(rays, source, crew, [&](double share) {
        const std::lock_guard lock(mutex);
        told += share;
        at.resize(cache.made() + 1, told);
      });
      for (std::uint32_t sample = 0; sample < 2; ++sample) {
        waves.render(cache, primary, {.sample = sample}, overture, out);
        EXPECT_NEAR(told, sample + 1.0, 1e-9) << name_of(level) << overture;
        if (sample > 0) continue;
        ASSERT_GT(at.size(), 20u);
        EXPECT_LT(at[at.size() / 4], 0.5) << name_of(level) << overture;
        EXPECT_GT(at[at.size() * 3 / 4], 0.25) << name_of(level) << overture;
      }
    }
  }
}

}  // namespace
}  // namespace icbench
