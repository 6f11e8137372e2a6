// The check of progress: steps are counted as they are taken, stopped fibers block exactly those who wait for them,
// every cache of the registry holds what it declares, and every control is seen through.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <stdexcept>

#include "caches/registry.h"
#include "core/random.h"
#include "stress/progress/check.h"
#include "stress/progress/controls.h"

namespace icbench::stress {
namespace {

TEST(StepSync, CountsEveryAtomicOperationOfAFiber) {
  Stage stage(1);
  StepAtomic<std::uint32_t> word(1);
  std::uint32_t seen = 0;
  stage.start(0, [&] {
    word.store(2, std::memory_order_relaxed);
    word.fetch_add(3, std::memory_order_relaxed);
    std::uint32_t expected = 0;
    word.compare_exchange_strong(expected, 9, std::memory_order_relaxed, std::memory_order_relaxed);
    word.exchange(7, std::memory_order_relaxed);
    seen = word.load(std::memory_order_relaxed);
  });
  stage.run(0, Stage::kAll);
  EXPECT_TRUE(stage.is_done(0));
  EXPECT_EQ(stage.steps(0), 5u);
  EXPECT_EQ(seen, 7u);
}

TEST(StepSync, IsAnOrdinaryAtomicOffStageAndValidWhenAllZero) {
  alignas(StepAtomic<std::uint32_t>) std::byte zeros[sizeof(std::uint32_t)] = {};
  auto& word = *std::launder(reinterpret_cast<StepAtomic<std::uint32_t>*>(zeros));
  EXPECT_EQ(word.load(std::memory_order_relaxed), 0u);
  EXPECT_EQ(word.fetch_add(5, std::memory_order_relaxed), 0u);
  std::uint32_t expected = 5;
  EXPECT_TRUE(
      word.compare_exchange_strong(expected, 6, std::memory_order_relaxed, std::memory_order_relaxed));
  EXPECT_EQ(word.load(std::memory_order_relaxed), 6u);
}

TEST(Stage, StopsAFiberBetweenAnyTwoOfItsSteps) {
  for (std::uint64_t k = 0; k <= 3; ++k) {
    Stage stage(1);
    StepAtomic<std::uint32_t> word(0);
    stage.start(0, [&] {
      for (int i = 0; i < 3; ++i) word.fetch_add(1, std::memory_order_relaxed);
    });
    stage.run(0, k);
    EXPECT_EQ(word.load(std::memory_order_relaxed), k);
    EXPECT_EQ(stage.steps(0), k);
  }
}

TEST(Stage, WhoWaitsCanRunOnceSomebodyElseHasWritten) {
  Stage stage(2);
  SpinLock<StepSync> lock;
  stage.start(0, [&] {
    lock.lock();
    lock.unlock();
  });
  stage.start(1, [&] { lock.lock(); });
  stage.run(0, 2);  // it holds the lock
  stage.run(1, Stage::kAll);
  EXPECT_FALSE(stage.can_run(1));
  EXPECT_FALSE(stage.is_done(1));
  stage.run(0, Stage::kAll);
  ASSERT_TRUE(stage.can_run(1));
  stage.run(1, Stage::kAll);
  EXPECT_TRUE(stage.is_done(1));
}

TEST(Stage, HalfWrittenMemoryIsRubbish) {
  Stage stage(1);
  std::uint32_t memory = 1;
  stage.start(0, [&] {
    StepSync::writes(&memory, sizeof memory);
    memory = 2;
  });
  stage.run(0, 1);
  EXPECT_EQ(memory, 0xeeeeeeeeu);
  stage.run(0, Stage::kAll);
  EXPECT_EQ(memory, 2u);
}

/// Runs fiber 0's body to its `points`th point and then 1 and 2; whether these came to their ends.
template <class Body>
std::array<bool, 2> others_end(std::uint64_t points, const std::array<Body, 3>& bodies) {
  Stage stage(3);
  for (unsigned f = 0; f < 3; ++f) stage.start(f, bodies[f]);
  stage.run(0, points);
  for (bool ran = true; ran;) {
    ran = false;
    for (unsigned f = 1; f < 3; ++f) {
      if (!stage.can_run(f)) continue;
      stage.run(f, Stage::kAll);
      ran = true;
    }
  }
  return {stage.is_done(1), stage.is_done(2)};
}

using Bodies = std::array<std::function<void()>, 3>;
constexpr std::array<bool, 2> kBothEnd = {true, true}, kNoneEnds = {false, false};

template <class Lock>
std::function<void()> exclusive(Lock& lock) {
  return [&lock] {
    lock.lock();
    lock.unlock();
  };
}
template <class Lock>
std::function<void()> shared(Lock& lock) {
  return [&lock] {
    lock.lock_shared();
    lock.unlock_shared();
  };
}

TEST(ModelledLocks, AHolderThatStopsBlocksAllOthers) {
  SpinLock<StepSync> spin;
  EXPECT_EQ(others_end(2, Bodies{exclusive(spin), exclusive(spin), exclusive(spin)}), kNoneEnds);
  StepQueueLock queue;
  EXPECT_EQ(others_end(2, Bodies{exclusive(queue), exclusive(queue), exclusive(queue)}), kNoneEnds);
  StepRwLock<false> readers;
  EXPECT_EQ(others_end(2, Bodies{exclusive(readers), exclusive(readers), shared(readers)}), kNoneEnds);
  StepRwLock<true> writers;
  EXPECT_EQ(others_end(2, Bodies{exclusive(writers), exclusive(writers), shared(writers)}), kNoneEnds);
}

TEST(ModelledLocks, OnlyInAQueueDoesOneThatStoppedBeforeHoldingBlockOthers) {
  SpinLock<StepSync> spin;
  EXPECT_EQ(others_end(1, Bodies{exclusive(spin), exclusive(spin), exclusive(spin)}), kBothEnd);
  StepQueueLock queue;
  EXPECT_EQ(others_end(1, Bodies{exclusive(queue), exclusive(queue), exclusive(queue)}), kNoneEnds);
}

TEST(ModelledLocks, AReaderThatStopsBlocksWriters) {
  StepRwLock<false> readers;
  EXPECT_EQ(others_end(2, Bodies{shared(readers), exclusive(readers), shared(readers)}),
            (std::array{false, true}));
  StepRwLock<true> writers;
  EXPECT_EQ(others_end(2, Bodies{shared(writers), shared(writers), shared(writers)}), kBothEnd);
  // The writer that waits for the reader keeps the next reader out.
  StepRwLock<true> again;
  EXPECT_EQ(others_end(2, Bodies{shared(again), exclusive(again), shared(again)}), kNoneEnds);
}

/// Three fibers add to a plain number under the lock, switching at random.
template <class Lock>
int count_under(Lock& lock, std::uint64_t seed) {
  Stage stage(3);
  StepAtomic<int> number(0);
  for (unsigned f = 0; f < 3; ++f) {
    stage.start(f, [&] {
      for (int i = 0; i < 4; ++i) {
        lock.lock();
        const int n = number.load(std::memory_order_relaxed);
        number.store(n + 1, std::memory_order_relaxed);
        lock.unlock();
      }
    });
  }
  Pcg32 random(seed);
  while (stage.can_run(0) || stage.can_run(1) || stage.can_run(2)) {
    const unsigned f = random.below(3);
    if (stage.can_run(f)) stage.run(f, 1 + random.below(3));
  }
  return number.load(std::memory_order_relaxed);
}

TEST(ModelledLocks, ExcludeEachOther) {
  for (std::uint64_t seed = 0; seed < 500; ++seed) {
    SpinLock<StepSync> spin;
    EXPECT_EQ(count_under(spin, seed), 12);
    StepQueueLock queue;
    EXPECT_EQ(count_under(queue, seed), 12);
    StepRwLock<false> readers;
    EXPECT_EQ(count_under(readers, seed), 12);
    StepRwLock<true> writers;
    EXPECT_EQ(count_under(writers, seed), 12);
  }
}

TEST(StepBounds, TheWordsSayWhatTheNumbersSay) {
  using Flag = WardTree<StdSync>;
  using Stamp = WardTree<StdSync, NoNodeLock, Snapshot>;
  for (int level = 0; level <= kMaxLevel; ++level) {
    EXPECT_EQ(Flag::insert_steps(level), 6u * static_cast<unsigned>(level) + 75u);
    EXPECT_EQ(Stamp::insert_steps(level), 6u * static_cast<unsigned>(level) + 77u);
  }
  EXPECT_EQ(Flag::kInsertBound, "6 level + 75");
  EXPECT_EQ(Stamp::kInsertBound, "6 level + 77");
  // Four slots are one chunk, one link; 252 are six; one more takes a directory and its first entry.
  EXPECT_EQ(Flag::list_steps(0), 9u);
  EXPECT_EQ(Flag::list_steps(4), 9u + 1u + 4u);
  EXPECT_EQ(Stamp::list_steps(4), 9u + 1u + 4u * 4u);
  EXPECT_EQ(Flag::list_steps(252), 9u + 6u + 252u);
  EXPECT_EQ(Flag::list_steps(253), 9u + 8u + 253u);
  // All of height 1: its 256 entries; then one slot under height 2: the link, an entry, and an entry of that.
  EXPECT_EQ(Flag::list_steps(252 + 65536), 9u + 6u + 1u + 256u + 252u + 65536u);
  EXPECT_EQ(Flag::list_steps(253 + 65536), 9u + 6u + 1u + 256u + 3u + 253u + 65536u);
}

/// Cells that a query visits at most: on each level the product of three numbers of one axis each, and by Hoelder's
/// inequality the sum of such products is largest where the axes agree.
TEST(StepBounds, NoQueryVisitsMoreNodesThanDocumented) {
  std::uint32_t most = 0;
  for (std::int32_t u = 0; u < 1 << kMaxLevel; ++u) {
    const WardNeighbourhood neighbourhood({u, u, u});
    std::uint32_t nodes = 1;
    std::int32_t first = 0, last = 0;  // cells of one level along an axis
    for (int level = 0; level < kMaxLevel; ++level) {
      std::int32_t first_child = 2 * last + 1, last_child = 2 * first;
      for (std::int32_t c = first; c <= last; ++c) {
        // Of the children of a cell on the diagonal, numbers 0 and 7 lie on it.
        const unsigned children = neighbourhood.children(level, c, c, c);
        if ((children & 0x01u) != 0) first_child = std::min(first_child, 2 * c);
        if ((children & 0x80u) != 0) first_child = std::min(first_child, 2 * c + 1);
        if ((children & 0x01u) != 0) last_child = std::max(last_child, 2 * c);
        if ((children & 0x80u) != 0) last_child = std::max(last_child, 2 * c + 1);
      }
      first = first_child;
      last = last_child;
      const auto cells = static_cast<std::uint32_t>(last - first + 1);
      nodes += cells * cells * cells;
    }
    most = std::max(most, nodes);
  }
  EXPECT_EQ(most, WardTree<StdSync>::kMostLists);
}

ProgressSubject subject_of(std::string_view cache) {
  const auto subjects = all_progress_subjects();
  return *std::find_if(subjects.begin(), subjects.end(),
                       [&](const ProgressSubject& s) { return s.traits.name == cache; });
}

class ProgressOfCache : public ::testing::TestWithParam<std::string> {};

TEST_P(ProgressOfCache, IsWhatItDeclares) {
  const ProgressSubject subject = subject_of(GetParam());
  for (const ProgressResult& r : check_progress(subject, {})) {
    EXPECT_TRUE(r.holds) << r.operation << ": " << r.note << '\n' << r.witness;
    EXPECT_EQ(r.bound.empty(), r.declared != ProgressGuarantee::wait_free);
    EXPECT_GT(r.operations, 0u);
    // The caches of one thread have no others to hinder; of the rest, exactly the blocking ones must be seen blocking,
    // but for those that wait where nobody can look.
    if (r.stop_positions == 0) continue;
    EXPECT_EQ(r.blocking_positions > 0,
              r.declared == ProgressGuarantee::blocking && !subject.traits.waits_in_library)
        << r.operation;
    ASSERT_EQ(r.steps_by_interference.size(), kInterference.size());
    if (r.declared == ProgressGuarantee::wait_free && r.operation == "insert") {
      for (const InterferenceSteps& s : r.steps_by_interference)
        EXPECT_LE(s.steps, r.bound_steps) << s.inserts;
      // A retry that ends after some time keeps within a bound for the worst case, but not the series from rising.
      EXPECT_LE(2 * r.steps_by_interference.back().steps, 3 * r.steps_by_interference.front().steps);
    }
  }
}

std::vector<std::string> cache_names() {
  std::vector<std::string> names;
  for (const ProgressSubject& subject : all_progress_subjects()) names.emplace_back(subject.traits.name);
  return names;
}
INSTANTIATE_TEST_SUITE_P(Registry, ProgressOfCache, ::testing::ValuesIn(cache_names()),
                         [](const auto& tested) { return tested.param; });

class ProgressControls : public ::testing::TestWithParam<std::string> {};

TEST_P(ProgressControls, IsSeenThrough) {
  const auto controls = all_progress_controls();
  const auto control =
      std::find_if(controls.begin(), controls.end(), [](const auto& c) { return c.name == GetParam(); });
  const ProgressControlOutcome outcome = run_progress_control(*control, {});
  EXPECT_TRUE(outcome.seen) << outcome.of(control->operation).note;
}

std::vector<std::string> control_names() {
  std::vector<std::string> names;
  for (const ProgressControl& control : all_progress_controls()) names.emplace_back(control.name);
  return names;
}
INSTANTIATE_TEST_SUITE_P(All, ProgressControls, ::testing::ValuesIn(control_names()),
                         [](const auto& tested) { return tested.param; });

TEST(ProgressCheck, SaysTheSameAgain) {
  const ProgressSubject subject = subject_of("global_spin");
  const auto first = check_progress(subject, {.seed = 7}), again = check_progress(subject, {.seed = 7});
  for (std::size_t i = 0; i < first.size(); ++i) {
    EXPECT_EQ(first[i].most_steps, again[i].most_steps);
    EXPECT_EQ(first[i].operations, again[i].operations);
    EXPECT_EQ(first[i].blocking_positions, again[i].blocking_positions);
  }
}

}  // namespace
}  // namespace icbench::stress
