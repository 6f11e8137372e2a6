// The contract that every cache in the registry keeps, checked against the brute-force oracle.
#include <sys/mman.h>

#include <array>
#include <barrier>
#include <fstream>
#include <limits>
#include <optional>
#include <string>
#include <thread>

#include "cache_contract.h"
#include "caches/registry.h"
#include "core/octree.h"

namespace icbench {
namespace {

INSTANTIATE_TEST_SUITE_P(AllCaches, Contract, ::testing::ValuesIn(registered_caches()), cache_name);

TEST_P(Contract, SeesExactlyTheValidRecords) {
  if (!keeps()) GTEST_SKIP() << "keeps nothing";
  AnyCache cache(GetParam(), config());
  auto session = cache.open_session(0);
  const auto records = random_records(3000, 1);
  for (const Record& r : records) ASSERT_EQ(session.insert(r), InsertResult::inserted);
  Pcg32 rng(2);
  std::size_t most = 0;
  for (int i = 0; i < 2000; ++i) {
    const SurfacePoint x = random_surface_point(rng);
    const auto expected = oracle(records, x, cache.config().a);
    ASSERT_EQ(seen(session, x), expected) << "query " << i;
    most = std::max(most, expected.size());
  }
  EXPECT_GT(most, 5u) << "the test's records hardly overlap";
}

/// The last coordinate in front of a plane of the grid, or the first behind it. All axes of the bounds are alike.
float beside(const OctreeAddressing& addressing, const Bounds& bounds, std::int32_t plane, bool is_behind) {
  const auto reaches = [&](float f) { return addressing.quantise(glm::vec3(f)).x >= plane; };
  const float share = static_cast<float>(plane) / static_cast<float>(1 << kMaxLevel);
  float f = bounds.lower.x + share * (bounds.upper.x - bounds.lower.x);
  while (reaches(f)) f = std::nextafter(f, bounds.lower.x);
  while (!reaches(std::nextafter(f, bounds.upper.x))) f = std::nextafter(f, bounds.upper.x);
  return is_behind ? std::nextafter(f, bounds.upper.x) : f;
}

// Guards against: cells, lanes and distances that leave out what is valid by a hair. The accuracy is the coarsest, the
// point lies at corners of cells, and the record as far from it as validity goes: sideways, or below its plane.
TEST_P(Contract, RecordsAreSeenToTheEdgeOfTheirValidityInEveryCell) {
  if (!keeps()) GTEST_SKIP() << "keeps nothing";
  constexpr std::uint32_t kRecords = kSanitized ? 300 : 3000;
  for (const float a : {0.05f, 0.4f, 1.0f}) {
    CacheConfig c = config(kRecords);
    c.a = c.a_max = a;
    c.bounds = {glm::vec3(-0.37f), glm::vec3(0.71f)};
    const OctreeAddressing addressing(c.bounds);
    AnyCache cache(GetParam(), c);
    auto session = cache.open_session(0);
    Pcg32 random(17);
    const auto direction = [&] {
      for (;;) {
        const glm::vec3 v(random.uniform() - 0.5f, random.uniform() - 0.5f, random.uniform() - 0.5f);
        if (glm::dot(v, v) > 0.01f && glm::dot(v, v) < 0.25f) return glm::normalize(v);
      }
    };
    std::vector<std::pair<SurfacePoint, std::uint32_t>> edges;
    for (std::uint32_t id = 0; id < kRecords; ++id) {
      const glm::vec3 n = random.below(2) == 0 ? glm::vec3(0, 0, 1) : direction();
      const int level = 1 + static_cast<int>(random.below(13));
      SurfacePoint x;
      for (int axis = 0; axis < 3; ++axis) {
        const std::uint32_t plane = 1 + random.below((1u << level) - 1);
        // Of the cells around, mostly the one that lies farthest behind the record.
        x.p[axis] = beside(addressing, c.bounds, static_cast<std::int32_t>(plane << (kMaxLevel - level)),
                           random.below(8) == 0 ? n[axis] > 0.0f : n[axis] <= 0.0f);
      }
      const float R = std::exp2(-static_cast<float>(level) - 4.0f * random.uniform()) / (2.0f * a);
      const bool is_below = random.below(2) == 0;
      // What distance leaves of the accuracy goes to the normals.
      const float far = is_below               ? 0.4f + 0.2f * random.uniform()
                        : random.below(2) == 0 ? 1.0f
                                               : random.uniform();
      const float angle = std::acos(1.0f - 0.9999f * a * a * (1.0f - far) * (1.0f - far));
      glm::vec3 aside = glm::normalize(glm::cross(n, direction()));
      if (n.z == 1.0f && random.below(2) == 0)
        aside = {0, random.below(2) == 0 ? -1 : 1, 0};  // to where its box ends
      x.n = glm::normalize(std::cos(angle) * n + std::sin(angle) * aside);
      const float up = random.below(2) == 0 ? 0.0f : 1.5f * random.uniform();
      const auto record = [&](float t) {
        const float height = is_below ? -1.5f * t : up,
                    distance = far * a * R * (is_below ? 0.9999f : 1.1f * t);
        return make_record(id, x.p - distance * (std::cos(height) * aside + std::sin(height) * n), n, R);
      };
      float valid = 0.0f, invalid = 1.0f;
      for (int i = 0; i < 40; ++i) {
        const float middle = 0.5f * (valid + invalid);
        (split_sphere_weight(x, record(middle), a) > 0.0f ? valid : invalid) = middle;
      }
      const Record r = record(valid);
      if (!(split_sphere_weight(x, r, a) > 0.0f) || !is_askable(x, c.bounds)) continue;
      if (session.insert(r) != InsertResult::inserted) continue;
      edges.emplace_back(x, id);
    }
    ASSERT_GT(edges.size(), kRecords / 2);
    for (int merged = 0; merged < 2; ++merged) {
      for (const auto& [x, id] : edges) {
        const auto ids = seen(session, x);
        ASSERT_TRUE(std::binary_search(ids.begin(), ids.end(), id)) << "record " << id << ", accuracy " << a;
      }
      cache.end_frame();
    }
  }
}

/// Of this process, the memory for which large pages were asked, as far as the system tells.
struct LargeMappings {
  std::size_t bytes = 0;
  bool are_whole = true;  ///< each from where a large page begins to where one ends
};
LargeMappings mappings_on_large_pages() {
  std::ifstream maps("/proc/self/smaps");
  LargeMappings found;
  std::size_t begin = 0, end = 0;
  for (std::string line; std::getline(maps, line);) {
    std::size_t from = 0, to = 0;
    if (std::sscanf(line.c_str(), "%zx-%zx ", &from, &to) == 2) {
      begin = from;
      end = to;
    }
    if (!line.starts_with("VmFlags:")) continue;
    if (line.find(" hg") == std::string::npos) continue;
    found.bytes += end - begin;
    found.are_whole &= begin % kLargePage == 0 && end % kLargePage == 0;
  }
  return found;
}

/// Whether what is asked for shows there. qemu-user takes no such advice.
bool do_mappings_show_advice() {
  const std::size_t before = mappings_on_large_pages().bytes;
  void* const memory =
      mmap(nullptr, 2 * kLargePage, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) return false;
  const bool shows =
      madvise(memory, 2 * kLargePage, MADV_HUGEPAGE) == 0 && mappings_on_large_pages().bytes > before;
  munmap(memory, 2 * kLargePage);
  return shows;
}

TEST_P(Contract, LargePagesAreAskedForAsToldAndChangeNoAnswer) {
  if (!keeps()) GTEST_SKIP() << "keeps nothing";
  const auto records = random_records(300, 1);
  const bool is_shown = do_mappings_show_advice();
  const LargeMappings before = mappings_on_large_pages();
  constexpr std::uint32_t kLarge = 1u << 16;
  struct Asked {
    LargePages pages;
    std::uint32_t capacity;
  };
  for (const auto& [pages, capacity] :
       {Asked{LargePages::never, kLarge + 1}, Asked{LargePages::when_large, kLarge},
        Asked{LargePages::when_large, kLarge + 1}, Asked{LargePages::always, 1000}}) {
    CacheConfig c = config(capacity);
    c.large_pages = pages;
    AnyCache cache(GetParam(), c);
    auto session = cache.open_session(0);
    for (const Record& r : records) ASSERT_EQ(session.insert(r), InsertResult::inserted);
    Pcg32 rng(2);
    for (int i = 0; i < 100; ++i) {
      const SurfacePoint x = random_surface_point(rng);
      ASSERT_EQ(seen(session, x), oracle(records, x, c.a)) << "query " << i;
    }
    const std::string_view structure = GetParam().traits.structure;
    if (!is_shown || (structure != "packed" && structure != "ward")) continue;
    const bool asks = pages == LargePages::always || (pages == LargePages::when_large && capacity > kLarge);
    const LargeMappings now = mappings_on_large_pages();
    EXPECT_EQ(now.bytes > before.bytes, asks) << static_cast<int>(pages) << ' ' << capacity;
    if (pages != LargePages::when_large || !asks) continue;
    // What the capacity fills, in whole pages, of one octree or of two.
    EXPECT_TRUE(now.are_whole || !before.are_whole);  // AddressSanitizer holds on to what was freed
    EXPECT_LE(now.bytes - before.bytes, std::size_t{2} * 150 * capacity);
  }
}

TEST_P(Contract, QueryInterpolatesWhatVisitShows) {
  AnyCache cache(GetParam(), config());
  auto session = cache.open_session(0);
  for (const Record& r : random_records(1000, 3)) session.insert(r);
  Pcg32 rng(4);
  for (int i = 0; i < 500; ++i) {
    const SurfacePoint x = random_surface_point(rng);
    glm::dvec3 sum(0.0);
    double weights = 0.0;
    session.visit(x, [&](const Record& r, float w) {
      sum += static_cast<double>(w) * glm::dvec3(r.E);
      weights += w;
    });
    const auto E = session.query(x);
    ASSERT_EQ(E.has_value(), weights > 0.0);
    if (E) {
      ASSERT_NEAR(E->x, sum.x / weights, 1e-4 * (1.0 + sum.x / weights));
    }
  }
}

TEST_P(Contract, BatchAnswersAsSingleQueries) {
  AnyCache cache(GetParam(), config());
  auto session = cache.open_session(0);
  for (const Record& r : random_records(1000, 5)) session.insert(r);
  Pcg32 rng(6);
  std::vector<SurfacePoint> points;
  for (int i = 0; i < 257; ++i) points.push_back(random_surface_point(rng));
  points.push_back({{2, 2, 2}, {0, 0, 1}});
  std::vector<std::optional<Irradiance>> out(points.size());
  session.query_batch(points, out);
  for (std::size_t i = 0; i < points.size(); ++i) ASSERT_EQ(out[i], session.query(points[i])) << i;
}

/// What one visit showed, in its order.
using Shown = std::vector<std::pair<std::uint32_t, float>>;

TEST_P(Contract, ABatchOfVisitsShowsWhatVisitsShowOneByOne) {
  AnyCache cache(GetParam(), config());
  auto session = cache.open_session(0);
  const auto records = random_records(3000, 9);
  for (std::size_t i = 0; i < 2000; ++i) session.insert(records[i]);
  cache.end_frame();  // where there are frames, some are in the shared structure
  cache.begin_frame();
  for (std::size_t i = 2000; i < records.size(); ++i) session.insert(records[i]);
  Pcg32 rng(12);
  const float kNaN = std::numeric_limits<float>::quiet_NaN();
  const SurfacePoint kRefused[] = {{{2, 2, 2}, {0, 0, 1}}, {{kNaN, 0, 0}, {0, 0, 1}}, {{0, 0, 0}, {0, 0, 0}}};
  for (const std::size_t size : {0, 1, 15, 16, 17, 100}) {
    // None that is refused, some among the others, and nothing else.
    for (const std::uint32_t percent : {0u, 30u, 100u}) {
      std::vector<SurfacePoint> points;
      for (std::size_t i = 0; i < size; ++i)
        points.push_back(rng.below(100) < percent ? kRefused[i % 3] : random_surface_point(rng));
      std::vector<Shown> single(size), batch(size);
      const Counts before = cache.counters();
      for (std::size_t i = 0; i < size; ++i)
        session.visit(points[i], [&](const Record& r, float w) { single[i].emplace_back(r.id, w); });
      const Counts between = cache.counters();
      session.visit_batch(points, [&](std::size_t i, const Record& r, float w) {
        ASSERT_TRUE(is_intact(r));
        batch.at(i).emplace_back(r.id, w);
      });
      const Counts after = cache.counters();
      ASSERT_EQ(batch, single) << size << " points, " << percent << " % refused";
      for (const auto count : {&Counts::queries, &Counts::invalid_queries, &Counts::records_valid})
        ASSERT_EQ(after.*count - between.*count, between.*count - before.*count) << size << " points";
    }
  }
}

TEST(DistributedRwLock, WhoTriesSeesEveryReaderAndTheWriter) {
  DistributedRwLock<StdSync> lock;
  std::array<DistributedRwLock<StdSync>::Reader, 3> readers;
  for (auto& reader : readers) lock.admit(reader);
  for (auto& reader : readers) {
    ASSERT_TRUE(reader.try_lock_shared());
    EXPECT_FALSE(lock.try_lock()) << "reader " << &reader - readers.data();
    for (auto& other : readers) {
      if (&other == &reader) continue;
      EXPECT_TRUE(other.try_lock_shared()) << "a try in vain keeps nothing";
      other.unlock_shared();
    }
    reader.unlock_shared();
    ASSERT_TRUE(lock.try_lock());
    for (auto& other : readers) EXPECT_FALSE(other.try_lock_shared());
    EXPECT_FALSE(lock.try_lock());
    lock.unlock();
  }
}

TEST(Batches, OfAPackedStructureUnderALockTakeItOnceForSixteen) {
  CacheConfig config;
  config.capacity = 1000;
  AnyCache cache(tested<PackedGlobalMutex<WithCounters>>(), config);
  auto session = cache.open_session(0);
  const std::vector<SurfacePoint> points(100, {{0.5f, 0.5f, 0.0f}, {0, 0, 1}});
  session.visit_batch(points, [](std::size_t, const Record&, float) {});
  EXPECT_EQ(cache.counters().lock_acquisitions, 7u);
}

TEST_P(Contract, BatchesSeeWhatReturnedBeforeWhileOthersInsert) {
  if (!keeps()) GTEST_SKIP() << "keeps nothing";
  constexpr std::size_t kBefore = 300, kEach = kSanitized ? 150 : 400;
  constexpr std::size_t kSizes[] = {1, 15, 16, 17, 100};
  AnyCache cache(GetParam(), config());
  const auto records = random_records(static_cast<std::uint32_t>(kBefore + kEach * threads()), 14);
  std::vector<AnyCache::Session> sessions;
  for (std::uint32_t t = 0; t < threads(); ++t) sessions.push_back(cache.open_session(t));
  for (std::size_t i = 0; i < kBefore; ++i) sessions[0].insert(records[i]);
  cache.end_frame();
  cache.begin_frame();
  {
    std::barrier start(static_cast<std::ptrdiff_t>(threads()));
    std::vector<std::jthread> team;
    for (std::uint32_t t = 0; t < threads(); ++t) {
      team.emplace_back([&, t] {
        const std::size_t first = kBefore + t * kEach;
        Pcg32 rng(hash_keys(15, t));
        start.arrive_and_wait();
        for (std::size_t i = 0; i < kEach; ++i) {
          ASSERT_EQ(sessions[t].insert(records[first + i]), InsertResult::inserted);
          if (i % 10 != 0) continue;
          // The first point of a batch is where this thread has just inserted.
          const Record& own = records[first + i];
          std::vector<SurfacePoint> points{{own.p, own.n}};
          while (points.size() < kSizes[i / 10 % std::size(kSizes)])
            points.push_back(random_surface_point(rng));
          std::vector<std::vector<std::uint32_t>> ids(points.size());
          sessions[t].visit_batch(points, [&](std::size_t k, const Record& r, float) {
            ASSERT_TRUE(is_intact(r));
            ids[k].push_back(r.id);
          });
          for (std::size_t k = 0; k < points.size(); ++k) {
            std::sort(ids[k].begin(), ids[k].end());
            ASSERT_EQ(std::adjacent_find(ids[k].begin(), ids[k].end()), ids[k].end()) << "shown twice";
            for (std::size_t r = 0; r < records.size(); ++r) {
              const bool is_due = r < kBefore || (r >= first && r <= first + i);
              if (!is_due || !(split_sphere_weight(points[k], records[r], cache.config().a) > 0.0f)) continue;
              ASSERT_TRUE(std::binary_search(ids[k].begin(), ids[k].end(), records[r].id));
            }
          }
        }
      });
    }
  }
  cache.end_frame();
  std::vector<SurfacePoint> points;
  Pcg32 rng(16);
  for (int i = 0; i < 100; ++i) points.push_back(random_surface_point(rng));
  std::vector<std::vector<std::uint32_t>> ids(points.size());
  sessions[0].visit_batch(points, [&](std::size_t i, const Record& r, float) { ids[i].push_back(r.id); });
  for (std::size_t i = 0; i < points.size(); ++i) {
    std::sort(ids[i].begin(), ids[i].end());
    EXPECT_EQ(ids[i], oracle(records, points[i], cache.config().a));
  }
}

TEST_P(Contract, ClearForgetsAndSessionsSurvive) {
  AnyCache cache(GetParam(), config());
  auto session = cache.open_session(0);
  for (std::uint32_t round = 0; round < 3; ++round) {
    const auto records = random_records(800, 10 + round, 1000 * round);
    for (const Record& r : records) session.insert(r);
    if (keeps()) {
      EXPECT_EQ(stored(cache).size(), 800u);
    }
    const SurfacePoint x{{0.5f, 0.5f, 0.0f}, {0, 0, 1}};
    if (keeps()) {
      EXPECT_EQ(seen(session, x), oracle(records, x, cache.config().a));
    }
    cache.clear();
    EXPECT_TRUE(stored(cache).empty());
    EXPECT_TRUE(seen(session, x).empty());
  }
}

TEST_P(Contract, FramesMakeEveryRecordVisibleToEverySession) {
  if (!keeps()) GTEST_SKIP() << "keeps nothing";
  AnyCache cache(GetParam(), config());
  std::vector<AnyCache::Session> sessions;
  for (std::uint32_t t = 0; t < threads(); ++t) sessions.push_back(cache.open_session(t));
  std::vector<Record> all;
  for (std::uint32_t frame = 0; frame < 3; ++frame) {
    cache.begin_frame();
    const auto records = random_records(400, 20 + frame, 1000 * frame);
    for (std::size_t i = 0; i < records.size(); ++i) sessions[i % sessions.size()].insert(records[i]);
    all.insert(all.end(), records.begin(), records.end());
    cache.end_frame();
    Pcg32 rng(30 + frame);
    for (int i = 0; i < 100; ++i) {
      const SurfacePoint x = random_surface_point(rng);
      const auto expected = oracle(all, x, cache.config().a);
      for (auto& session : sessions) ASSERT_EQ(seen(session, x), expected);
    }
  }
}

TEST_P(Contract, OwnInsertsAreSeenAtOnce) {
  if (!keeps()) GTEST_SKIP() << "keeps nothing";
  AnyCache cache(GetParam(), config());
  auto session = cache.open_session(0);
  for (const Record& r : random_records(500, 40)) {
    session.insert(r);
    const auto ids = seen(session, {r.p, r.n});
    ASSERT_TRUE(std::binary_search(ids.begin(), ids.end(), r.id));
  }
}

TEST_P(Contract, AcceptedRecordsSurviveAnyMixOfFramesUpdatesAndSessions) {
  if (!keeps()) GTEST_SKIP() << "keeps nothing";
  // Small pools, tiny radii (a path of nodes for each record) and pieces of memory left over in every session: what was
  // accepted must still fit wherever it is merged or moved to.
  constexpr std::uint32_t kCapacity = 512;
  for (std::uint64_t seed = 0; seed < (kSanitized ? 8 : 60); ++seed) {
    Pcg32 rng(hash_keys(seed, 90));
    AnyCache cache(GetParam(), config(kCapacity));
    std::vector<AnyCache::Session> sessions;
    for (std::uint32_t t = 0; t < threads(); ++t) sessions.push_back(cache.open_session(t));
    std::vector<std::uint32_t> expected;
    std::uint32_t next_id = 0;
    for (int step = 0; step < 12; ++step) {
      for (std::uint32_t i = rng.below(kCapacity); i > 0; --i) {
        const SurfacePoint x = random_surface_point(rng);
        const float R = std::exp2(-30.0f * rng.uniform());
        auto& session = sessions[rng.below(threads())];
        if (session.insert(make_record(next_id, x.p, x.n, R)) == InsertResult::inserted)
          expected.push_back(next_id);
        ++next_id;
      }
      if (rng.below(2) == 0) cache.end_frame();
      if (rng.below(3) == 0) {
        const std::uint32_t modulus = 2 + rng.below(4);
        cache.update_records(
            [modulus](Record& r) { return r.id % modulus == 0 ? UpdateResult::keep : UpdateResult::drop; });
        std::erase_if(expected, [modulus](std::uint32_t id) { return id % modulus != 0; });
      }
      ASSERT_EQ(stored(cache), expected) << "seed " << seed << ", step " << step;
    }
  }
}

TEST_P(Contract, RefusesSessionsItHasNoRoomFor) {
  AnyCache cache(GetParam(), config());
  EXPECT_THROW(cache.open_session(threads()), std::runtime_error);
  CacheConfig bad = this->config();
  bad.capacity = 0;
  EXPECT_THROW(AnyCache(GetParam(), bad), std::runtime_error);
}

TEST_P(Contract, ConcurrentInsertsAreAllThereAndIntact) {
  if (!keeps()) GTEST_SKIP() << "keeps nothing";
  // A queue's lock goes to a thread that does not run, as a rule, where there are more of them than cores.
  const bool is_queued = GetParam().traits.name.ends_with("queuing_mutex");
  const std::uint32_t each = is_queued ? 300 : kSanitized ? 800 : 1500;
  const std::uint32_t threads = Contract::threads();
  // Sanitizers slow this down tenfold; the histories of stress_history_test are the longer run for them.
  for (int round = 0; round < (kSanitized ? 1 : 3); ++round) {
    AnyCache cache(GetParam(), config(threads * each));
    std::barrier start(threads);
    std::vector<std::uint32_t> torn(threads, 0), missed(threads, 0);
    std::vector<std::vector<std::uint32_t>> accepted(threads);
    {
      std::vector<std::jthread> team;
      for (std::uint32_t t = 0; t < threads; ++t) {
        team.emplace_back([&, t] {
          auto session = cache.open_session(t);
          // Every thread inserts at the same places, so that children and chunks are raced for.
          auto records = random_records(each, 70 + static_cast<std::uint64_t>(round), t * each);
          Pcg32 rng(80 + t);
          start.arrive_and_wait();
          for (const Record& r : records) {
            const bool inserted = session.insert(r) == InsertResult::inserted;
            if (inserted) accepted[t].push_back(r.id);
            session.visit(random_surface_point(rng),
                          [&](const Record& s, float) { torn[t] += !is_intact(s); });
            bool own = false;
            session.visit({r.p, r.n}, [&](const Record& s, float) { own |= s.id == r.id; });
            missed[t] += inserted && !own;
          }
        });
      }
    }
    cache.end_frame();
    std::vector<std::uint32_t> expected;
    for (std::uint32_t t = 0; t < threads; ++t) {
      EXPECT_EQ(torn[t], 0u);
      EXPECT_EQ(missed[t], 0u);
      expected.insert(expected.end(), accepted[t].begin(), accepted[t].end());
    }
    std::sort(expected.begin(), expected.end());
    EXPECT_EQ(stored(cache), expected);
    // Tickets are drawn in batches, so up to a batch a session may be refused although nothing else is full.
    EXPECT_GE(expected.size(), threads * each - threads * 64);
    cache.for_each_record([&](const Record& r) { EXPECT_TRUE(is_intact(r)); });
  }
}

}  // namespace
}  // namespace icbench
