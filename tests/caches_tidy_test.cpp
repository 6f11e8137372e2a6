// Caches that are tidied: the same records and answers, and as much room.
#include <algorithm>
#include <numeric>
#include <optional>
#include <vector>

#include "cache_contract.h"
#include "caches/tidy.h"
#include "core/processing_units.h"

namespace icbench {
namespace {

class Tidying : public Contract {};
INSTANTIATE_TEST_SUITE_P(AllCaches, Tidying, ::testing::ValuesIn(registered_caches()), cache_name);

TEST_P(Tidying, ChangesNothingButTheOrder) {
  constexpr std::uint32_t kARound = 5'000;
  AnyCache cache(GetParam(), config(4 * kARound));
  if (!cache.tidy()) GTEST_SKIP() << "has no such thing";
  std::vector<AnyCache::Session> sessions;
  for (std::uint32_t t = 0; t < threads(); ++t) sessions.push_back(cache.open_session(t));
  std::vector<Record> records;
  std::uint32_t next_id = 0;
  Pcg32 rng(56);
  for (int round = 0; round < 3; ++round) {
    // In the end more than one thread takes up, and of all sizes. Sessions go on after a tidying as before.
    const auto new_records = random_records(kARound, 57 + static_cast<std::uint64_t>(round), next_id);
    next_id += kARound;
    for (Record r : new_records) {
      r.E = Irradiance(static_cast<float>(r.id));
      if (sessions[r.id % threads()].insert(r) == InsertResult::inserted) records.push_back(r);
    }
    std::vector<SurfacePoint> points;
    std::vector<std::optional<Irradiance>> before;
    cache.end_frame();
    for (int i = 0; i < 300; ++i) {
      points.push_back(random_surface_point(rng));
      before.push_back(sessions[0].query(points.back()));
    }
    cache.tidy();
    ASSERT_EQ(stored(cache).size(), keeps() ? records.size() : 0);
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (keeps()) {
        ASSERT_EQ(seen(sessions[0], points[i]), oracle(records, points[i], cache.config().a));
      }
      const auto after = sessions[threads() - 1].query(points[i]);
      ASSERT_EQ(after.has_value(), before[i].has_value());
      if (after) {
        EXPECT_NEAR(after->x, before[i]->x, 1e-4f * before[i]->x);
      }
    }
    cache.update_records([](Record& r) { return r.id % 7 == 0 ? UpdateResult::drop : UpdateResult::keep; });
    std::erase_if(records, [](const Record& r) { return r.id % 7 == 0; });
  }
  cache.tidy();
  cache.clear();
  cache.tidy();
  EXPECT_TRUE(stored(cache).empty());
}

// Guards against: sessions that keep memory which others have a promise of.
TEST_P(Tidying, LeavesRoomForAllThatIsPromised) {
  if (!keeps()) GTEST_SKIP() << "keeps nothing";
  constexpr std::uint32_t kCapacity = 9'000;
  AnyCache cache(GetParam(), config(kCapacity));
  if (!cache.tidy()) GTEST_SKIP() << "has no such thing";
  std::vector<AnyCache::Session> sessions;
  for (std::uint32_t t = 0; t < threads(); ++t) sessions.push_back(cache.open_session(t));
  Pcg32 rng(58);
  std::uint32_t accepted = 0;
  const auto insert = [&](std::uint32_t session) {
    const SurfacePoint x = random_surface_point(rng);
    // Tiny: a path of nodes for each.
    const auto result = sessions[session].insert(make_record(accepted, x.p, x.n, 1e-6f));
    accepted += result == InsertResult::inserted ? 1 : 0;
    return result;
  };
  while (accepted < kCapacity / 2) ASSERT_EQ(insert(accepted % threads()), InsertResult::inserted);
  cache.end_frame();
  cache.tidy();
  while (accepted < kCapacity) ASSERT_EQ(insert(threads() - 1), InsertResult::inserted) << accepted;
  cache.end_frame();
  cache.tidy();
  EXPECT_EQ(stored(cache).size(), kCapacity);
  EXPECT_NE(insert(0), InsertResult::inserted);
}

/// Counts what each workspace is given.
struct CountingStructure {
  std::vector<Record> records;
  void clear() {}
  void prefault(std::uint32_t&, std::uint32_t) noexcept {}
  bool insert(std::uint32_t& given, const Record&, NoCounters&) noexcept { return ++given != 0; }
  template <class F>
  void for_each(F&& f) const {
    for (const Record& r : records) f(r);
  }
};

TEST(Tidy, DealsAnyNumberOfRecordsToAllThreadsThereAre) {
  for (const std::uint32_t n : {0u, 1u, 12'288u, 20'001u, 40'003u, 200'003u}) {
    CountingStructure structure{random_records(n, 59)};
    std::vector<std::uint32_t> given(4, 0);
    lay_out_in_space(
        structure, OctreeAddressing({glm::vec3(0.0f), glm::vec3(1.0f)}), 4, [] {},
        [&](std::size_t i) -> std::uint32_t& { return given[i]; });
    const std::uint32_t threads = std::clamp(n / 4096, 1u, std::min(4u, processing_units()));
    EXPECT_EQ(std::accumulate(given.begin(), given.end(), 0u), n);
    for (std::uint32_t i = 0; i < given.size(); ++i)
      EXPECT_NEAR(given[i], i < threads ? static_cast<double>(n) / threads : 0.0, 1.0) << n << ' ' << i;
  }
}

}  // namespace
}  // namespace icbench
