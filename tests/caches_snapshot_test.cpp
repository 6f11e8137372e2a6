// What makes wait_free_snapshot more than wait_free, step by step: an operation is stopped before any of its steps, and
// meanwhile others run.
#include <functional>
#include <optional>
#include <utility>

#include "cache_contract.h"
#include "caches/registry.h"
#include "stress/hooked_atomic.h"
#include "stress/rebind.h"

namespace icbench {
namespace {

/// Runs something before a chosen step of the shipping code on this thread: what others do while an operation stands
/// still. Nothing here waits, so a nested call is an interleaving that threads could have.
class Interruption {
 public:
  /// Arms: `work` is run before step number `step`, counted from now.
  static void before(unsigned step, std::function<void()> work) {
    steps_left_ = step;
    work_ = std::move(work);
  }
  /// Whether it has not come to that; disarms.
  static bool was_missed() { return std::exchange(work_, nullptr) != nullptr; }

  static void step() {
    if (work_ == nullptr || steps_left_-- > 0) return;
    std::exchange(work_, nullptr)();
  }

 private:
  static inline thread_local unsigned steps_left_ = 0;
  static inline thread_local std::function<void()> work_;
};

struct InterruptibleSync : NoHooks {
  template <class T>
  using Atomic = stress::HookedAtomic<T, std::atomic<T>, Interruption>;
  static constexpr bool kConcurrent = true;
};

template <class T>
struct WithInterruptions {
  using type = T;
};
template <>
struct WithInterruptions<StdSync> {
  using type = InterruptibleSync;
};

using Stamped = stress::Rebound<WaitFreeSnapshot<>, WithInterruptions>;
using Flagged = stress::Rebound<WaitFree<>, WithInterruptions>;
using PackedStamped = stress::Rebound<PackedWaitFreeSnapshot<>, WithInterruptions>;
using PackedFlagged = stress::Rebound<PackedWaitFree<>, WithInterruptions>;
using CountedTree = stress::Rebound<WaitFree<WithCounters>, WithInterruptions>;
using CountedPacked = stress::Rebound<PackedWaitFree<WithCounters>, WithInterruptions>;

constexpr CacheConfig kConfig{.capacity = 1000, .max_sessions = 3};
const SurfacePoint kPlace{{0.3f, 0.4f, 0.0f}, {0, 0, 1}};

/// Valid at kPlace; stored in the root.
Record large(std::uint32_t id) { return make_record(id, kPlace.p, kPlace.n, 10.0f); }
/// Valid at kPlace; stored far below, in a list that a query comes to later.
Record small(std::uint32_t id) { return make_record(id, kPlace.p, kPlace.n, 0.01f); }

using Ids = std::vector<std::uint32_t>;

template <class Session>
bool sees(Session& session, std::uint32_t id) {
  const Ids ids = seen(session, kPlace);
  return std::binary_search(ids.begin(), ids.end(), id);
}

/// Stops an insert before each of its steps; two queries run there, one after the other. Returns before how many steps
/// the first missed the record and the second saw it.
template <class Cache>
unsigned inserts_helped() {
  unsigned helped = 0;
  for (unsigned step = 0;; ++step) {
    Cache cache(kConfig);
    auto writer = cache.open_session(0);
    auto one = cache.open_session(1);
    auto other = cache.open_session(2);
    for (std::uint32_t id = 0; id < 4; ++id) one.insert(small(id));
    bool first = false, second = false, third = false;
    Interruption::before(step, [&] {
      first = sees(one, 4);
      second = sees(other, 4);
      third = sees(one, 4);
      EXPECT_GE(seen(one, kPlace).size(), 4u) << "earlier records";
    });
    EXPECT_EQ(writer.insert(small(4)), InsertResult::inserted);
    if (Interruption::was_missed()) return helped;
    EXPECT_LE(first, second) << "step " << step;
    EXPECT_EQ(second, third) << "step " << step;
    EXPECT_EQ(seen(one, kPlace), (Ids{0, 1, 2, 3, 4})) << "step " << step;
    helped += !first && second;
  }
}

TEST(SnapshotInterleavings, AQueryStampsAPendingRecordForLaterOnes) {
  // Before the insert draws its tick, and before it stamps: the query helps, does not see the record, the next one
  // does.
  EXPECT_EQ(inserts_helped<Stamped>(), 2u);
  // Where one store publishes, nothing can happen to a record between two steps of its insert.
  EXPECT_EQ(inserts_helped<Flagged>(), 0u);
}

/// Stops an insert before each of its steps; what eight places then see of its record, one after the other, twice. All
/// of them are in cells of their own. Returns in how many places what was seen changed while the insert stood still.
template <class Cache>
unsigned copies_that_appear_late() {
  const SurfacePoint centre{glm::vec3(0.5f), {0, 0, 1}};
  unsigned late = 0;
  for (unsigned step = 0;; ++step) {
    Cache cache(kConfig);
    auto writer = cache.open_session(0);
    auto reader = cache.open_session(1);
    std::vector<bool> sights;
    const auto look = [&] {
      for (int i = 0; i < 16; ++i) {
        const glm::vec3 side(i & 1 ? 1.0f : -1.0f, i & 2 ? 1.0f : -1.0f, i & 4 ? 0.1f : -0.1f);
        bool is_seen = false;
        reader.visit({centre.p + 0.01f * side, centre.n}, [&](const Record&, float) { is_seen = true; });
        sights.push_back(is_seen);
      }
    };
    Interruption::before(step, look);
    EXPECT_EQ(writer.insert(make_record(0, centre.p, centre.n, 0.2f)), InsertResult::inserted);
    const bool was_missed = Interruption::was_missed();
    look();
    // Once seen in one place, it is seen in all.
    EXPECT_TRUE(std::is_sorted(sights.begin(), sights.end())) << "step " << step;
    EXPECT_TRUE(std::count(sights.end() - 16, sights.end(), true) == 16) << "step " << step;
    if (was_missed) return late;
    late += sights.front() != sights[15];
  }
}

TEST(PackedInterleavings, ARecordAppearsInAllItsCellsAtOnce) {
  EXPECT_EQ(copies_that_appear_late<PackedFlagged>(), 0u);
  // Before the insert draws its tick, and before it stamps: the first query stamps the record for all later ones.
  EXPECT_EQ(copies_that_appear_late<PackedStamped>(), 2u);
}

/// An insert that is interrupted before any of its steps by another's at the same place loses what that installs. Its
/// next one builds the same elsewhere: what was lost must be what that begins with. Returns how often something was.
template <class Cache>
unsigned losses_made_good() {
  const SurfacePoint elsewhere{{0.8f, 0.9f, 1.0f}, {0, 0, 1}};
  unsigned losses = 0;
  std::vector<std::uint64_t> needed;
  for (bool was_missed = false; !was_missed;) {
    Cache cache(kConfig);
    auto writer = cache.open_session(0), other = cache.open_session(1);
    Interruption::before(static_cast<unsigned>(needed.size()), [&] { other.insert(small(1)); });
    writer.insert(small(0));
    was_missed = Interruption::was_missed();
    const Counts before = cache.counters();
    writer.insert(make_record(2, elsewhere.p, elsewhere.n, small(2).R));
    needed.push_back(cache.counters().nodes_allocated - before.nodes_allocated + before.nodes_discarded);
    losses += before.nodes_discarded != 0;
  }
  EXPECT_EQ(std::count(needed.begin(), needed.end(), needed.back()), needed.size());
  return losses;
}

TEST(LostRaces, LeaveTheirUnitToTheSessionsNextInsert) {
  EXPECT_GT(losses_made_good<CountedTree>(), 5u);
  EXPECT_GT(losses_made_good<CountedPacked>(), 1u);
}

/// Stops a query before each of its steps, where a large and then a small record are inserted; what it saw of the two.
template <class Cache>
std::vector<Ids> sights_of_two_inserts() {
  std::vector<Ids> sights;
  for (unsigned step = 0;; ++step) {
    Cache cache(kConfig);
    auto reader = cache.open_session(0);
    auto writer = cache.open_session(1);
    writer.insert(large(0));
    writer.insert(small(1));
    Interruption::before(step, [&] {
      EXPECT_EQ(writer.insert(large(2)), InsertResult::inserted);
      EXPECT_EQ(writer.insert(small(3)), InsertResult::inserted);
    });
    Ids ids = seen(reader, kPlace);
    if (Interruption::was_missed()) return sights;
    EXPECT_EQ(seen(reader, kPlace), (Ids{0, 1, 2, 3})) << "step " << step;
    EXPECT_EQ(ids[0], 0u);
    EXPECT_EQ(ids[1], 1u);
    sights.emplace_back(ids.begin() + 2, ids.end());
  }
}

TEST(SnapshotInterleavings, AQueryStoppedAnywhereSeesTheMomentItBegan) {
  const std::vector<Ids> sights = sights_of_two_inserts<Stamped>();
  ASSERT_GT(sights.size(), 20u);
  EXPECT_EQ(sights[0], (Ids{2, 3})) << "before it read the clock";
  for (std::size_t step = 1; step < sights.size(); ++step) EXPECT_EQ(sights[step], Ids{}) << "step " << step;
}

TEST(SnapshotInterleavings, AQueryOfTheCacheWithoutStampsIsNoSnapshot) {
  const std::vector<Ids> sights = sights_of_two_inserts<Flagged>();
  EXPECT_NE(std::find(sights.begin(), sights.end(), Ids{3}), sights.end()) << "sees the later insert alone";
}

/// Of two records whose inserts overlap, the query that helps one must not show it with what it misses of the other.
TEST(SnapshotInterleavings, AnInsertThatReturnedIsSeenWithAPendingOneBesideIt) {
  for (unsigned step = 0;; ++step) {
    Stamped cache(kConfig);
    auto slow = cache.open_session(0);
    auto fast = cache.open_session(1);
    auto reader = cache.open_session(2);
    Ids first, second;
    Interruption::before(step, [&] {
      fast.insert(large(1));
      first = seen(reader, kPlace);
      second = seen(reader, kPlace);
    });
    slow.insert(small(0));
    if (Interruption::was_missed()) break;
    EXPECT_EQ(first.back(), 1u) << "step " << step;
    EXPECT_TRUE(std::includes(second.begin(), second.end(), first.begin(), first.end())) << "step " << step;
    const Ids last = seen(reader, kPlace);
    EXPECT_EQ(last, (Ids{0, 1})) << "step " << step;
  }
}

using Marks = Snapshot::In<StdSync>;

TEST(SnapshotMarks, APendingMarkIsStampedOnce) {
  Marks marks;
  Marks::Mark mark{};
  const auto before = marks.moment();
  EXPECT_FALSE(marks.shows(mark, before)) << "empty";
  mark.word.store(1, std::memory_order_relaxed);  // pending: what an insert leaves behind that stops forever
  EXPECT_FALSE(marks.shows(mark, before));
  const auto stamped = marks.moment();
  EXPECT_EQ(stamped, before + 1);
  EXPECT_TRUE(marks.shows(mark, stamped));
  EXPECT_FALSE(marks.shows(mark, before)) << "a query that began earlier comes by later";
  EXPECT_EQ(marks.moment(), stamped) << "no tick is drawn for a mark that has its stamp";
}

class SnapshotLists : public ::testing::Test {
 protected:
  using Lists = SlotPool<StdSync, StdSync, Snapshot>;

  void append(std::uint32_t id) {
    NoCounters counters;
    ASSERT_TRUE(lists_.append(workspace_, list_, small(id), counters));
  }
  Ids seen_at(std::uint64_t moment) {
    Ids ids;
    lists_.visit(list_, moment, [&](const Record& r) { ids.push_back(r.id); });
    return ids;
  }

  Lists lists_{10'000};
  Lists::Workspace workspace_;
  Lists::List list_{};
};

TEST_F(SnapshotLists, EveryEarlierMomentCanBeSeenAgain) {
  for (std::uint32_t id = 0; id < 20; ++id) {
    EXPECT_EQ(lists_.moment(), id);
    append(id);
  }
  for (std::uint32_t n = 0; n <= 20; ++n) EXPECT_EQ(seen_at(n).size(), n);
}

TEST_F(SnapshotLists, UpdatedRecordsKeepTheirStamps) {
  for (std::uint32_t id = 0; id < 6; ++id) append(id);
  lists_.update(list_, [](Record& r) { return r.id % 3 == 0 ? UpdateResult::drop : UpdateResult::keep; });
  EXPECT_EQ(lists_.moment(), 6u);
  EXPECT_EQ(seen_at(1), Ids{});
  EXPECT_EQ(seen_at(2), Ids{1});
  EXPECT_EQ(seen_at(4), (Ids{1, 2}));
  EXPECT_EQ(seen_at(6), (Ids{1, 2, 4, 5}));
  append(6);
  EXPECT_EQ(seen_at(6), (Ids{1, 2, 4, 5}));
  EXPECT_EQ(seen_at(7), (Ids{1, 2, 4, 5, 6}));
}

TEST_F(SnapshotLists, ResettingStartsTheClockAgain) {
  for (std::uint32_t id = 0; id < 6; ++id) append(id);
  lists_.reset();
  workspace_ = {};
  list_.count.store(0, std::memory_order_relaxed);
  list_.head.store(0, std::memory_order_relaxed);
  EXPECT_EQ(lists_.moment(), 0u);
  append(7);
  EXPECT_EQ(seen_at(0), Ids{});
  EXPECT_EQ(seen_at(1), Ids{7});
}

}  // namespace
}  // namespace icbench
