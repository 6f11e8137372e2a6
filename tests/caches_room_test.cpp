// Room in a cache, and what it takes of memory.
#include <sys/resource.h>
#include <unistd.h>

#include <fstream>
#include <functional>
#include <string_view>
#include <vector>

#include "cache_contract.h"

namespace icbench {
namespace {

class Room : public Contract {};
INSTANTIATE_TEST_SUITE_P(AllCaches, Room, ::testing::ValuesIn(registered_caches()), cache_name);

TEST_P(Room, FullPoolIsAResultAndKeepsEarlierRecords) {
  if (!keeps()) GTEST_SKIP() << "keeps nothing";
  constexpr std::uint32_t kCapacity = 1000;
  AnyCache cache(GetParam(), config(kCapacity));
  auto session = cache.open_session(0);
  const auto records = random_records(kCapacity + 200, 7);
  for (std::uint32_t i = 0; i < records.size(); ++i) {
    ASSERT_EQ(session.insert(records[i]), i < kCapacity ? InsertResult::inserted : InsertResult::full) << i;
  }
  EXPECT_EQ(cache.counters().full, 200u);
  const std::vector<Record> accepted(records.begin(), records.begin() + kCapacity);
  Pcg32 rng(8);
  for (int i = 0; i < 300; ++i) {
    const SurfacePoint x = random_surface_point(rng);
    ASSERT_EQ(seen(session, x), oracle(accepted, x, cache.config().a));
  }
  cache.clear();
  EXPECT_EQ(session.insert(records[0]), InsertResult::inserted) << "clear makes room";
}

TEST_P(Room, MemoryTakenBeforehandIsMissingToNobody) {
  if (!keeps()) GTEST_SKIP() << "keeps nothing";
  constexpr std::uint32_t kCapacity = 3000;
  AnyCache cache(GetParam(), config(kCapacity));
  std::vector<AnyCache::Session> sessions;
  for (std::uint32_t t = 0; t < threads(); ++t) sessions.push_back(cache.open_session(t));
  Pcg32 rng(12);
  std::uint32_t next_id = 0;
  for (int round = 0; round < 2; ++round) {
    // Far more than all sessions can use, again and again while one of them inserts.
    for (std::uint32_t i = 0; i < kCapacity; ++i) {
      if (i % 100 == 0) {
        for (auto& session : sessions) session.prefault(kCapacity / threads() << i / 100 % 3);
      }
      const SurfacePoint x = random_surface_point(rng);
      ASSERT_EQ(sessions.back().insert(make_record(next_id++, x.p, x.n, 1e-6f)), InsertResult::inserted) << i;
    }
    cache.end_frame();
    ASSERT_EQ(stored(cache).size(), kCapacity);
    cache.clear();
  }
}

// Guards against: tickets that sessions keep, or that are dealt out again, past a quiescent point.
TEST_P(Room, NoMoreRecordsThanTheCapacityWhateverHappenedBefore) {
  if (!keeps()) GTEST_SKIP() << "keeps nothing";
  constexpr std::uint32_t kCapacity = 1000;
  const std::function<void(AnyCache&)> kHappened[] = {
      [](AnyCache& cache) { cache.clear(); }, [](AnyCache& cache) { cache.tidy(); },
      [](AnyCache& cache) { cache.update_records([](Record&) { return UpdateResult::keep; }); },
      [](AnyCache& cache) {
        cache.end_frame();
        cache.update_records(
            [](Record& r) { return r.id % 2 == 0 ? UpdateResult::drop : UpdateResult::keep; });
      }};
  const auto records = random_records(2 * kCapacity, 16);
  for (const auto& happened : kHappened) {
    AnyCache cache(GetParam(), config(kCapacity));
    std::vector<AnyCache::Session> sessions;
    for (std::uint32_t t = 0; t < threads(); ++t) sessions.push_back(cache.open_session(t));
    constexpr std::uint32_t kBefore = 300;
    for (std::uint32_t i = 0; i < kBefore; ++i) sessions[i % threads()].insert(records[i]);
    happened(cache);
    for (std::uint32_t i = kBefore; i < records.size(); ++i) sessions[i % threads()].insert(records[i]);
    cache.end_frame();
    EXPECT_EQ(stored(cache).size(), kCapacity) << "of the last " << &happened - kHappened;
  }
}

// Pages that the calling thread was given so far.
long pages_given() {
  rusage usage{};
  getrusage(RUSAGE_THREAD, &usage);
  return usage.ru_minflt;
}

/// Bytes of memory that the process has.
std::size_t resident() {
  std::ifstream file("/proc/self/statm");
  std::size_t pages = 0, of_these = 0;
  file >> pages >> of_these;
  return of_these * static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
}

TEST_P(Room, NoMoreIsTouchedBeforehandThanTheCapacityNeeds) {
  constexpr std::uint32_t kCapacity = 50'000;
  AnyCache cache(GetParam(), config(kCapacity));
  const std::size_t before = resident();
  for (std::uint32_t t = 0; t < threads(); ++t) {
    auto session = cache.open_session(t);
    for (const std::uint32_t n : {kCapacity, 1u << 31, UINT32_MAX}) session.prefault(n);
  }
  // Of local copies each may be as large as all.
  const std::size_t copies = GetParam().traits.mechanism == "local_write" ? 1 + threads() : 1;
  if (kSanitized) return;  // which take memory of their own
  EXPECT_LT(resident(), before + copies * (kCapacity * 400u + (2u << 20)));
}

// Guards against: memory that a session was to touch beforehand, and that is fetched page by page as records come.
TEST_P(Room, InsertsFindMemoryTouchedBeforehand) {
  if (!keeps() || GetParam().traits.name == "tbb_hash_grid") GTEST_SKIP() << "touches nothing beforehand";
  constexpr std::uint32_t kRecords = 20'000;
  const auto records = random_records(kRecords, 13);
  const auto pages_of_inserts = [&](bool prefault) {
    AnyCache cache(GetParam(), config(2 * kRecords));
    auto session = cache.open_session(0);
    if (prefault) session.prefault(kRecords);
    const long before = pages_given();
    for (const Record& r : records) EXPECT_EQ(session.insert(r), InsertResult::inserted);
    return pages_given() - before;
  };
  const long untouched = pages_of_inserts(false), touched = pages_of_inserts(true);
  if (kSanitized || untouched < 100) GTEST_SKIP() << untouched << " pages: too few, or a sanitizer's as well";
  EXPECT_LT(touched, untouched / 4);
}

TEST_P(Room, DroppedRecordsMakeRoomForeverInALongAnimation) {
  if (!keeps()) GTEST_SKIP() << "keeps nothing";
  constexpr std::uint32_t kCapacity = 400;
  AnyCache cache(GetParam(), config(kCapacity));
  auto session = cache.open_session(0);
  const auto records = random_records(kCapacity, 60);
  for (int frame = 0; frame < 50; ++frame) {
    for (const Record& r : records) ASSERT_EQ(session.insert(r), InsertResult::inserted) << "frame " << frame;
    cache.end_frame();
    cache.update_records([](Record&) { return UpdateResult::drop; });
    ASSERT_TRUE(stored(cache).empty());
  }
}

TEST_P(Room, DroppedRecordsMakeRoomBetweenMergesToo) {
  if (!keeps()) GTEST_SKIP() << "keeps nothing";
  constexpr std::uint32_t kCapacity = 400;
  AnyCache cache(GetParam(), config(kCapacity));
  auto session = cache.open_session(0);
  for (int round = 0; round < 20; ++round) {
    for (const Record& r : random_records(kCapacity, 65 + static_cast<std::uint64_t>(round))) {
      ASSERT_EQ(session.insert(r), InsertResult::inserted) << "round " << round;
    }
    cache.update_records([](Record&) { return UpdateResult::drop; });
  }
}

// Guards against: what lives took to need no more, where each next record beside it does. Piles in the packed octree are
// as high as cells of three levels take them, what comes and goes beside them takes nearly all that is to spare of
// further lanes, and then every pile gets one record more, which needs some in eight cells.
TEST_P(Room, RecordsThatTakeMoreThanThoseBesideThemFitAsWell) {
  if (!keeps()) GTEST_SKIP() << "keeps nothing";
  constexpr std::uint32_t kPiles = 40, kHeight = 48, kOthers = 49, kFrames = 968;
  AnyCache cache(
      GetParam(),
      {.bounds = {{0, 0, 0}, {1, 1, 1}}, .capacity = kPiles * kHeight + kOthers, .max_sessions = 1});
  auto session = cache.open_session(0);
  std::uint32_t next_id = 0;
  // At corners of cells that no other pile reaches.
  const auto insert = [&](std::uint32_t pile) {
    const glm::uvec3 corner(pile % 31, pile / 31 % 31, pile / (31 * 31));
    const glm::vec3 p = glm::vec3(2u * corner + 1u) / 64.0f;
    return session.insert(make_record(next_id++, p, {0, 0, 1}, 0.005f));
  };
  for (std::uint32_t i = 0; i < kPiles * kHeight; ++i) ASSERT_EQ(insert(i / kHeight), InsertResult::inserted);
  const std::uint32_t lasting = next_id;
  for (std::uint32_t frame = 0; frame < kFrames; ++frame) {
    for (std::uint32_t i = 0; i < kOthers; ++i)
      ASSERT_EQ(insert(kPiles + frame), InsertResult::inserted) << "frame " << frame;
    cache.update_records([&](Record& r) { return r.id < lasting ? UpdateResult::keep : UpdateResult::drop; });
  }
  for (std::uint32_t pile = 0; pile < kPiles; ++pile)
    ASSERT_EQ(insert(pile), InsertResult::inserted) << "pile " << pile;
  cache.end_frame();
  EXPECT_EQ(stored(cache).size(), kPiles * (kHeight + 1));
}

// Guards against: a large page for each pool of each session, of which nothing was used.
TEST(MemoryBytes, EmptyCopiesOfManySessionsStayWithoutMemory) {
  if (kSanitized) GTEST_SKIP() << "sanitizers take memory of their own";
  for (const AnyCache::Maker& info : registered_caches()) {
    if (info.traits.mechanism != "local_write") continue;
    constexpr std::uint32_t kSessions = 32;
    AnyCache cache(info, {.bounds = {{0, 0, 0}, {1, 1, 1}}, .capacity = 100'000, .max_sessions = kSessions});
    std::vector<AnyCache::Session> sessions;
    for (std::uint32_t i = 0; i < kSessions; ++i) sessions.push_back(cache.open_session(i));
    const std::size_t before = resident();
    cache.end_frame();
    EXPECT_LT(resident(), before + (16u << 20)) << info.traits.name;
  }
}

TEST(MemoryBytes, IncludeWhatAStructureTakesEmpty) {
  constexpr std::string_view kPacked = "packed_";
  CacheConfig config{.capacity = 1u << 20, .max_sessions = 1};
  std::size_t without_lock = 0;
  for (const AnyCache::Maker& maker : registered_caches()) {
    if (maker.traits.name == "packed_wait_free") without_lock = AnyCache(maker, config).memory_bytes();
  }
  ASSERT_GT(without_lock, 100'000u);
  for (const AnyCache::Maker& maker : registered_caches()) {
    if (!maker.traits.name.starts_with(kPacked)) continue;
    AnyCache cache(maker, config);
    cache.open_session(0);
    EXPECT_GT(cache.memory_bytes(), without_lock * 9 / 10) << maker.traits.name;
  }
}

}  // namespace
}  // namespace icbench
