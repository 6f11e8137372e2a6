// Updates between frames: what they change and drop, also where the function throws.
#include <malloc.h>
#include <sys/resource.h>
#include <unistd.h>

#include <atomic>
#include <fstream>
#include <limits>
#include <map>
#include <new>
#include <stdexcept>

#include "cache_contract.h"
#include "limited_child.h"

namespace icbench {
namespace {

class Updates : public Contract {};
INSTANTIATE_TEST_SUITE_P(AllCaches, Updates, ::testing::ValuesIn(registered_caches()), cache_name);

TEST_P(Updates, UpdateKeepsChangesAndDrops) {
  if (!keeps()) GTEST_SKIP() << "keeps nothing";
  AnyCache cache(GetParam(), config());
  auto session = cache.open_session(0);
  std::vector<Record> records = random_records(3000, 50);
  for (const Record& r : records) session.insert(r);
  // Some are merged already, some not: the update has to reach all copies.
  cache.end_frame();
  const auto late = random_records(500, 51, 5000);
  for (const Record& r : late) session.insert(r);
  records.insert(records.end(), late.begin(), late.end());

  cache.update_records([](Record& r) {
    if (r.id % 3 == 0) return UpdateResult::drop;
    if (r.id % 3 == 1) r.R *= 0.5f;
    return UpdateResult::keep;
  });
  std::vector<Record> expected;
  for (Record r : records) {
    if (r.id % 3 == 0) continue;
    if (r.id % 3 == 1) r.R *= 0.5f;
    expected.push_back(r);
  }
  Pcg32 rng(52);
  for (int i = 0; i < 500; ++i) {
    const SurfacePoint x = random_surface_point(rng);
    ASSERT_EQ(seen(session, x), oracle(expected, x, cache.config().a));
  }
  // What was dropped makes room, and the structure takes new records as before.
  for (const Record& r : random_records(1000, 53, 10000)) {
    ASSERT_EQ(session.insert(r), InsertResult::inserted);
    expected.push_back(r);
  }
  for (int i = 0; i < 500; ++i) {
    const SurfacePoint x = random_surface_point(rng);
    ASSERT_EQ(seen(session, x), oracle(expected, x, cache.config().a));
  }
}

TEST_P(Updates, AnUpdateThatDropsNothingReachesAllCopiesToo) {
  if (!keeps()) GTEST_SKIP() << "keeps nothing";
  AnyCache cache(GetParam(), config());
  auto session = cache.open_session(0);
  std::vector<Record> records = random_records(1000, 54);
  for (const Record& r : records) ASSERT_EQ(session.insert(r), InsertResult::inserted);
  cache.end_frame();
  const auto renew = [](Record& r) {
    r.E = Irradiance(static_cast<float>(r.id) + 1.0f);
    if (r.id % 2 == 0) r.R *= 0.5f;
    return UpdateResult::keep;
  };
  cache.update_records(renew);
  for (Record& r : records) renew(r);
  Pcg32 rng(55);
  std::size_t shown = 0;
  for (int i = 0; i < 500; ++i) {
    const SurfacePoint x = random_surface_point(rng);
    ASSERT_EQ(seen(session, x), oracle(records, x, cache.config().a));
    session.visit(x, [&](const Record& r, float) {
      ++shown;
      EXPECT_EQ(r.E, Irradiance(static_cast<float>(r.id) + 1.0f)) << "record " << r.id << " is the old one";
    });
  }
  EXPECT_GT(shown, 500u);
}

// Guards against: the last of the cells, whose copies stay when records go, to show the next ones in their places twice.
TEST_P(Updates, WhatTakesADroppedRecordsPlaceIsShownOnce) {
  if (!keeps()) GTEST_SKIP() << "keeps nothing";
  AnyCache cache(GetParam(), config());
  auto session = cache.open_session(0);
  for (std::uint32_t i = 0; i < 60; ++i) {
    // Each in cells of its own.
    const SurfacePoint x{{(static_cast<float>(i) + 0.3f) / 60.0f, 0.3f, 0.3f}, {0, 0, 1}};
    session.insert(make_record(i, x.p, x.n, 1e-3f));
    cache.end_frame();
    cache.update_records([&](Record& r) { return r.id == i ? UpdateResult::drop : UpdateResult::keep; });
    session.insert(make_record(100 + i, x.p, x.n, 1e-3f));
    ASSERT_EQ(seen(session, x), (std::vector<std::uint32_t>{100 + i}));
    cache.end_frame();
  }
}

TEST_P(Updates, AnUpdateThatThrowsLeavesEveryRecordThereOnceOrGone) {
  if (!keeps()) GTEST_SKIP() << "keeps nothing";
  AnyCache cache(GetParam(), config());
  auto session = cache.open_session(0);
  const SurfacePoint x{{0.5f, 0.5f, 0.5f}, {0, 0, 1}};
  constexpr std::uint32_t kRecords = 40;
  for (std::uint32_t i = 0; i < kRecords; ++i) session.insert(make_record(i, x.p, x.n, 0.2f));
  std::atomic<std::uint32_t> seen_by_f{0};
  EXPECT_THROW(cache.update_records([&](Record& r) {
    if (++seen_by_f > kRecords / 2) throw std::runtime_error("enough");
    r.R *= 0.5f;
    return r.id % 2 == 0 ? UpdateResult::drop : UpdateResult::keep;
  }),
               std::runtime_error);
  for (std::uint32_t i = 0; i < kRecords; ++i) session.insert(make_record(kRecords + i, x.p, x.n, 0.2f));
  const std::vector<std::uint32_t> all = stored(cache);
  EXPECT_EQ(std::adjacent_find(all.begin(), all.end()), all.end()) << "one is there twice";
  EXPECT_GE(all.size(), kRecords + kRecords / 2);
  EXPECT_EQ(seen(session, x), all);
  // Copies of a record say the same as it does.
  std::map<std::uint32_t, float> radii;
  cache.for_each_record([&](const Record& r) { radii[r.id] = r.R; });
  session.visit(x, [&](const Record& r, float) { EXPECT_EQ(r.R, radii[r.id]) << r.id; });
}

// Guards against: copies that an update did not get to, since there was no memory to go on.
TEST_P(Updates, AnUpdateWithoutMemoryLeavesCopiesThatSayTheSame) {
  if (!keeps()) GTEST_SKIP() << "keeps nothing";
  if (kSanitized) GTEST_SKIP() << "no limit on the address space";
  EXPECT_EQ(status_with_little_memory([this] {
              mallopt(M_MMAP_THRESHOLD, 1 << 16);  // what is freed goes back, so that the limit counts
              AnyCache cache(GetParam(), config(20'000));
              auto session = cache.open_session(0);
              for (const Record& r : random_records(20'000, 14)) session.insert(r);
              cache.end_frame();
              rlimit limit;
              getrlimit(RLIMIT_AS, &limit);
              std::size_t pages = 0;
              std::ifstream("/proc/self/statm") >> pages;
              limit.rlim_cur = pages * static_cast<std::size_t>(sysconf(_SC_PAGESIZE)) + (256u << 10);
              setrlimit(RLIMIT_AS, &limit);
              try {
                cache.update_records([](Record& r) {
                  r.E += 1.0f;
                  return UpdateResult::keep;
                });
              } catch (const std::bad_alloc&) {
              }
              limit.rlim_cur = limit.rlim_max;
              setrlimit(RLIMIT_AS, &limit);
              std::vector<Record> records;
              cache.for_each_record([&](const Record& r) { records.push_back(r); });
              int wrong = records.size() == 20'000 ? 0 : 1;
              for (std::size_t i = 0; i < records.size(); i += 100) {
                const Record& r = records[i];
                session.visit({r.p, r.n}, [&](const Record& shown, float) noexcept {
                  if (shown.id == r.id && shown.E != r.E) wrong = 2;
                });
              }
              return wrong;
            }),
            0);
}

TEST_P(Updates, AnUpdateThatThrowsGivesBackTheRoomOfWhatItDropped) {
  if (!keeps()) GTEST_SKIP() << "keeps nothing";
  constexpr std::uint32_t kCapacity = 400;
  AnyCache cache(GetParam(), config(kCapacity));
  auto session = cache.open_session(0);
  for (const Record& r : random_records(kCapacity, 71)) session.insert(r);
  std::atomic<std::uint32_t> seen_by_f{0};
  EXPECT_THROW(cache.update_records([&](Record&) {
    if (++seen_by_f == kCapacity) throw std::runtime_error("the last");
    return UpdateResult::drop;
  }),
               std::runtime_error);
  const auto left = static_cast<std::uint32_t>(stored(cache).size());
  for (std::uint32_t i = left; i < kCapacity; ++i)
    ASSERT_EQ(session.insert(make_record(kCapacity + i, {0.5f, 0.5f, 0.5f}, {0, 0, 1}, 0.2f)),
              InsertResult::inserted)
        << i << " after " << left;
}

// Guards against: room that shrinks with every update that throws, until records are refused or a merge fails.
TEST_P(Updates, UpdatesThatThrowNeverUseUpTheRoom) {
  if (!keeps()) GTEST_SKIP() << "keeps nothing";
  constexpr std::uint32_t kCapacity = 400;
  AnyCache cache(GetParam(), config(kCapacity));
  auto session = cache.open_session(0);
  std::uint32_t id = 0;
  for (int frame = 0; frame < 30; ++frame) {
    const auto left = static_cast<std::uint32_t>(stored(cache).size());
    Pcg32 random(hash_keys(74, static_cast<std::uint64_t>(frame)));
    for (std::uint32_t i = left; i < kCapacity; ++i) {
      const SurfacePoint x = random_surface_point(random);
      ASSERT_EQ(session.insert(make_record(id++, x.p, x.n, std::exp2(-12.0f * random.uniform()))),
                InsertResult::inserted)
          << "frame " << frame << ", " << i << " after " << left;
    }
    cache.end_frame();
    std::atomic<std::uint32_t> seen_by_f{0};
    EXPECT_THROW(cache.update_records([&](Record&) {
      if (++seen_by_f == kCapacity) throw std::runtime_error("the last");
      return UpdateResult::drop;
    }),
                 std::runtime_error);
  }
}

TEST_P(Updates, AnUpdateThatThrowsLeavesNothingUnfitToBeStored) {
  if (!keeps()) GTEST_SKIP() << "keeps nothing";
  AnyCache cache(GetParam(), config());
  auto session = cache.open_session(0);
  const SurfacePoint x{{0.5f, 0.5f, 0.5f}, {0, 0, 1}};
  for (std::uint32_t i = 0; i < 10; ++i) session.insert(make_record(i, x.p, x.n, 0.2f));
  std::atomic<int> calls{0};
  EXPECT_THROW(cache.update_records([&](Record& r) {
    r.E.x = std::numeric_limits<float>::quiet_NaN();
    if (++calls == 10) throw std::runtime_error("the last");
    return UpdateResult::keep;
  }),
               std::runtime_error);
  EXPECT_EQ(stored(cache).size(), 1u) << "that at which it threw, as it was";
  cache.for_each_record([&](const Record& r) { EXPECT_TRUE(is_storable(r, cache.config().bounds)) << r.id; });
  EXPECT_EQ(seen(session, x), stored(cache));
}

TEST_P(Updates, WhatAnUpdateLeavesUnfitToBeStoredGoes) {
  if (!keeps()) GTEST_SKIP() << "keeps nothing";
  AnyCache cache(GetParam(), config());
  auto session = cache.open_session(0);
  const SurfacePoint x{{0.5f, 0.5f, 0.5f}, {0, 0, 1}};
  for (std::uint32_t i = 0; i < 8; ++i) session.insert(make_record(i, x.p, x.n, 0.2f));
  cache.update_records([](Record& r) {
    if (r.id == 1) r.R = 0.0f;
    if (r.id == 2) r.R = std::numeric_limits<float>::quiet_NaN();
    if (r.id == 3) r.E.y = -1.0f;
    if (r.id == 4) r.E.z = std::numeric_limits<float>::infinity();
    if (r.id == 5) r.E.x = std::numeric_limits<float>::quiet_NaN();
    return UpdateResult::keep;
  });
  EXPECT_EQ(stored(cache), (std::vector<std::uint32_t>{0, 6, 7}));
  EXPECT_EQ(seen(session, x), stored(cache));
}

}  // namespace
}  // namespace icbench
