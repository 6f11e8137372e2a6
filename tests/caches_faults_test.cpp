// The pool is used up at every possible allocation: an insert says so, and nothing else is to be noticed.
#include <barrier>
#include <optional>
#include <thread>

#include "cache_contract.h"
#include "caches/registry.h"
#include "stress/rebind.h"

namespace icbench {
namespace {

/// Which of a thread's allocations are refused; none until it says so.
///
/// A cursor asks for a piece first and, if it gets none, for what it needs (core/arena.h). Where single allocations are
/// counted, all pieces are refused, so that every node and every segment is an allocation of its own.
class Refusals {
 public:
  /// Refuses `count` allocations from number `first` on, counted from now.
  static void refuse(std::uint64_t first, std::uint64_t count) noexcept {
    mode_ = Mode::window;
    first_ = first;
    count_ = count;
    requests_ = 0;
  }
  /// Refuses every second request by chance: an allocation in four.
  static void refuse_at_random(std::uint64_t seed) noexcept {
    mode_ = Mode::chance;
    random_ = Pcg32(seed);
  }
  static void stop() noexcept { mode_ = Mode::off; }

  /// Allocations tried since `refuse`.
  static std::uint64_t allocations() noexcept { return requests_ / 2; }

  static bool may_allocate() noexcept {
    if (mode_ == Mode::off) return true;
    if (mode_ == Mode::chance) return random_.below(2) == 0;
    const std::uint64_t request = requests_++;
    const std::uint64_t allocation = request / 2;
    return request % 2 == 1 && (allocation < first_ || allocation - first_ >= count_);
  }

 private:
  enum class Mode { off, window, chance };
  static constinit inline thread_local Mode mode_ = Mode::off;
  static constinit inline thread_local std::uint64_t first_ = 0;
  static constinit inline thread_local std::uint64_t count_ = 0;
  static constinit inline thread_local std::uint64_t requests_ = 0;
  static constinit inline thread_local Pcg32 random_{0};
};

template <class Base>
struct FaultySync : Base {
  static bool may_allocate() noexcept { return Refusals::may_allocate(); }
};

template <class T>
struct WithFaults {
  using type = T;
};
template <>
struct WithFaults<StdSync> {
  using type = FaultySync<StdSync>;
};
template <>
struct WithFaults<PlainSync> {
  using type = FaultySync<PlainSync>;
};

template <template <class> class Cache>
using Faulty = stress::Rebound<Cache<WithCounters>, WithFaults>;
template <template <class> class Cache>
AnyCache::Maker faulty() {
  return tested<Faulty<Cache>>();
}

const SurfacePoint kCrowded{{0.25f, 0.5f, 0.0f}, {0, 0, 1}};

/// Most at one place, so that their list gets segments of every kind up to blocks of its directory; the others far
/// apart and at all depths, each on a path of its own. Both take turns.
std::vector<Record> records_of_all_allocations() {
  constexpr std::uint32_t kRecords = 800;
  std::vector<Record> records;
  Pcg32 rng(100);
  for (std::uint32_t i = 0; i < kRecords; ++i) {
    if (i % 100 == 50) {
      const SurfacePoint x = random_surface_point(rng);
      records.push_back(make_record(i, x.p, x.n, std::exp2(-2.5f * static_cast<float>(i) / 100.0f)));
    } else {
      records.push_back(make_record(i, kCrowded.p, kCrowded.n, 0.1f));
    }
  }
  return records;
}

std::vector<std::uint32_t> ids_of(const std::vector<Record>& records) {
  std::vector<std::uint32_t> ids;
  for (const Record& r : records) ids.push_back(r.id);
  std::sort(ids.begin(), ids.end());
  return ids;
}

class Faults : public Contract {
 protected:
  /// Every allocation in release builds, some of them where that would take minutes.
  static constexpr std::uint64_t kStride = kSanitized ? 7 : 1;

  /// More than are inserted, and so many that the packed octree's grid has bricks to allocate.
  static constexpr std::uint32_t kCapacity = 4000;

  /// The cache holds exactly `expected`, and every query agrees.
  static void expect_exactly(const AnyCache& cache, AnyCache::Session& session,
                             const std::vector<Record>& expected) {
    ASSERT_EQ(stored(cache), ids_of(expected));
    ASSERT_EQ(seen(session, kCrowded), oracle(expected, kCrowded, cache.config().a));
    std::vector<SurfacePoint> elsewhere;
    for (const Record& r : expected) {
      if (r.p != kCrowded.p) elsewhere.push_back({r.p, r.n});
    }
    constexpr std::size_t kMostPlaces = 40;
    for (std::size_t i = 0; i < elsewhere.size(); i += 1 + elsewhere.size() / kMostPlaces) {
      ASSERT_EQ(seen(session, elsewhere[i]), oracle(expected, elsewhere[i], cache.config().a));
    }
    cache.for_each_record([](const Record& r) { EXPECT_TRUE(is_intact(r)); });
  }

  void TearDown() override { Refusals::stop(); }
};
INSTANTIATE_TEST_SUITE_P(FaultyCaches, Faults,
                         ::testing::Values(faulty<Sequential>(), faulty<NodeLockCache>(),
                                           faulty<LocalWriteCache>(), faulty<WaitFree>(),
                                           faulty<WaitFreeSnapshot>(), faulty<PackedWaitFree>(),
                                           faulty<PackedWaitFreeSnapshot>(), faulty<PackedNodeLock>(),
                                           faulty<PackedLocalWrite>()),
                         cache_name);

TEST_P(Faults, OneRefusedAllocationIsOneRefusedInsert) {
  const auto records = records_of_all_allocations();
  for (std::uint64_t k = 0;; k += kStride) {
    SCOPED_TRACE("allocation " + std::to_string(k));
    AnyCache cache(GetParam(), config(kCapacity));
    auto session = cache.open_session(0);
    std::vector<Record> accepted;
    std::optional<Record> refused;
    Refusals::refuse(k, 1);
    for (const Record& r : records) {
      const InsertResult result = session.insert(r);
      if (result == InsertResult::inserted) {
        accepted.push_back(r);
        continue;
      }
      ASSERT_EQ(result, InsertResult::full);
      ASSERT_FALSE(refused.has_value()) << "a second record";
      refused = r;
      ASSERT_NO_FATAL_FAILURE(expect_exactly(cache, session, accepted));
    }
    const std::uint64_t allocations = Refusals::allocations();
    Refusals::stop();
    ASSERT_EQ(refused.has_value(), k < allocations);
    ASSERT_EQ(cache.counters().full, refused.has_value() ? 1u : 0u);
    if (refused) {
      ASSERT_EQ(session.insert(*refused), InsertResult::inserted) << "a later insert works";
      accepted.push_back(*refused);
    }
    ASSERT_NO_FATAL_FAILURE(expect_exactly(cache, session, accepted));
    if (k >= allocations) {
      // Six chunks, a directory and three blocks, and the nodes above them: all were tried.
      EXPECT_GT(allocations, 50u);
      break;
    }
  }
}

TEST_P(Faults, NothingIsLostWhenAllLaterAllocationsAreRefused) {
  const auto records = records_of_all_allocations();
  for (std::uint64_t k = 0;; k += kStride) {
    SCOPED_TRACE("from allocation " + std::to_string(k));
    AnyCache cache(GetParam(), config(kCapacity));
    auto session = cache.open_session(0);
    std::vector<Record> accepted, refused;
    Refusals::refuse(k, UINT64_MAX);
    for (const Record& r : records) {
      const InsertResult result = session.insert(r);
      ASSERT_NE(result, InsertResult::rejected);
      (result == InsertResult::inserted ? accepted : refused).push_back(r);
    }
    const std::uint64_t allocations = Refusals::allocations();
    Refusals::stop();
    ASSERT_EQ(refused.empty(), k >= allocations);
    ASSERT_NO_FATAL_FAILURE(expect_exactly(cache, session, accepted));

    // Memory is back: the lists go on behind the slots that nobody got.
    for (const Record& r : refused) ASSERT_EQ(session.insert(r), InsertResult::inserted);
    accepted.insert(accepted.end(), refused.begin(), refused.end());
    ASSERT_NO_FATAL_FAILURE(expect_exactly(cache, session, accepted));

    cache.end_frame();
    cache.update_records([](Record& r) { return r.id % 2 == 0 ? UpdateResult::drop : UpdateResult::keep; });
    std::erase_if(accepted, [](const Record& r) { return r.id % 2 == 0; });
    ASSERT_NO_FATAL_FAILURE(expect_exactly(cache, session, accepted));

    cache.clear();
    for (const Record& r : records) ASSERT_EQ(session.insert(r), InsertResult::inserted);
    ASSERT_NO_FATAL_FAILURE(expect_exactly(cache, session, records));
    if (k >= allocations) break;
  }
}

// Guards against: tickets and places that inserts in vain keep, until a cache with room refuses all.
TEST_P(Faults, RefusedInsertsCostNoRoom) {
  constexpr std::uint32_t kRoom = 1000, kTurns = 40, kInVain = 80;
  CacheConfig c = config(kRoom);
  c.max_sessions = 1;
  AnyCache cache(GetParam(), c);
  auto session = cache.open_session(0);
  Pcg32 rng(130);
  std::uint32_t accepted = 0;
  const auto insert = [&] {
    const SurfacePoint x = random_surface_point(rng);
    // Tiny: a path of nodes for each.
    const auto result = session.insert(make_record(accepted, x.p, x.n, 1e-6f));
    accepted += result == InsertResult::inserted;
    return result;
  };
  for (std::uint32_t turn = 0; turn < kTurns; ++turn) {
    Refusals::stop();
    ASSERT_EQ(insert(), InsertResult::inserted);  // what a session takes of memory comes in pieces
    Refusals::refuse(0, UINT64_MAX);
    for (std::uint32_t i = 0; i < kInVain; ++i) insert();
  }
  Refusals::stop();
  ASSERT_LT(accepted, kRoom) << "hardly an insert was in vain";
  while (accepted < kRoom) ASSERT_EQ(insert(), InsertResult::inserted) << accepted;
}

TEST_P(Faults, ThreadsThatRaceWithoutMemoryLoseNothing) {
  constexpr std::uint32_t kEach = 600;
  const std::uint32_t threads = Contract::threads();
  for (std::uint64_t round = 0; round < 3; ++round) {
    AnyCache cache(GetParam(), config(2 * threads * kEach));
    std::barrier start(threads);
    std::vector<std::uint32_t> wrong(threads, 0);
    std::vector<std::vector<Record>> accepted(threads), refused(threads);
    {
      std::vector<std::jthread> team;
      for (std::uint32_t t = 0; t < threads; ++t) {
        team.emplace_back([&, t] {
          auto session = cache.open_session(t);
          // The same places for all threads, so that they race for the same children and segments.
          const auto records = random_records(kEach, 110 + round, t * kEach);
          Refusals::refuse_at_random(hash_keys(120, round, t));
          start.arrive_and_wait();
          for (const Record& r : records) {
            const bool inserted = session.insert(r) == InsertResult::inserted;
            (inserted ? accepted : refused)[t].push_back(r);
            bool is_seen = false;
            session.visit({r.p, r.n}, [&](const Record& s, float) {
              is_seen |= s.id == r.id;
              wrong[t] += !is_intact(s);
            });
            wrong[t] += is_seen != inserted;
          }
        });
      }
    }
    cache.end_frame();
    std::vector<Record> all, rest;
    for (std::uint32_t t = 0; t < threads; ++t) {
      EXPECT_EQ(wrong[t], 0u);
      all.insert(all.end(), accepted[t].begin(), accepted[t].end());
      rest.insert(rest.end(), refused[t].begin(), refused[t].end());
    }
    EXPECT_FALSE(rest.empty()) << "no allocation failed";
    auto session = cache.open_session(0);
    ASSERT_NO_FATAL_FAILURE(expect_exactly(cache, session, all));
    for (const Record& r : rest) ASSERT_EQ(session.insert(r), InsertResult::inserted);
    all.insert(all.end(), rest.begin(), rest.end());
    ASSERT_NO_FATAL_FAILURE(expect_exactly(cache, session, all));
  }
}

/// Tickets reserve the room for the merge, so this cannot happen but by a fault in the program.
TEST(FaultsDeathTest, AMergeStopsTheProgramRatherThanLoseARecord) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  Faulty<LocalWriteCache> cache({.capacity = 100});
  auto session = cache.open_session(0);
  ASSERT_EQ(session.insert(make_record(1, kCrowded.p, kCrowded.n, 0.1f)), InsertResult::inserted);
  EXPECT_EXIT(
      {
        Refusals::refuse(0, UINT64_MAX);
        cache.end_frame();
      },
      ::testing::KilledBySignal(SIGABRT), "");
}

}  // namespace
}  // namespace icbench
