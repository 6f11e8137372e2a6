// Short runs of every registered cache, as it ships and with delays, judged by what it promises; and the
// parts that record histories.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <cstring>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>
#include <type_traits>

#include "caches/registry.h"
#include "limited_child.h"
#include "sanitized.h"
#include "stress/campaign.h"
#include "stress/checker.h"
#include "stress/clock.h"
#include "stress/round.h"
#include "stress/subject.h"

namespace icbench::stress {
namespace {

constexpr std::uint32_t kThreads = 4;

static_assert(std::is_same_v<Delayed<WaitFree<>>, Direct<WardTree<DelaySync>, NoCounters>>);
static_assert(std::is_same_v<Delayed<GlobalSpinCache<>>,
                             Locked<WardTree<DelayPlainSync>, GlobalSpin<DelaySync>, NoCounters>>);

ClockSource some_clock(std::uint32_t i) {
  CampaignOptions options;
  options.use_tsc = tsc_is_usable();
  // The counter would hide missing synchronisation from ThreadSanitizer.
  options.use_counter = !kThreadSanitizer || !options.use_tsc;
  return clock_of_round(options, i);
}

/// Operations on each cache, in all: ICBENCH_STRESS_OPERATIONS, or a short run.
std::uint64_t operations_per_cache() {
  const char* wanted = std::getenv("ICBENCH_STRESS_OPERATIONS");
  return wanted == nullptr ? 32'000 : std::strtoull(wanted, nullptr, 10);
}

class StressCaches : public ::testing::TestWithParam<std::size_t> {
 protected:
  const Subject& subject() const { return all_subjects()[GetParam()]; }

  /// Judges one round by what the cache promises.
  void expect_promises(RoundPlan plan) const {
    if (subject().traits.single_thread) plan.threads = 1;
    const RoundRecord round = plan.delay_every > 0 ? subject().run_delayed(plan) : subject().run(plan);
    const Judgement judgement = judge(round.history);
    EXPECT_GT(judgement.operations, 0u);
    if (plan.shape->capacity_percent > 100 && subject().traits.consistency != Consistency::none) {
      for (const Operation& o : round.history.operations) ASSERT_FALSE(o.is_refused()) << plan.shape->name;
    }
    for (std::size_t i = 0; i < kCheckNames.size(); ++i) {
      if (!promises(subject().traits.consistency, static_cast<Check>(i))) continue;
      EXPECT_EQ(judgement.findings[i].violations, 0u)
          << kCheckNames[i] << ", " << plan.shape->name << ", " << plan.threads << " threads\n"
          << judgement.findings[i].witness;
    }
  }

  void expect_promises_in_all_shapes(std::uint32_t delay_every) const {
    constexpr std::uint64_t kRoundOperations = 50'000;
    // This is one of two tests.
    const std::uint64_t operations = operations_per_cache() / 2 / all_shapes().size();
    for (std::uint64_t done = 0; done < operations; done += kRoundOperations) {
      std::uint32_t turn = 0;
      for (const Shape& shape : all_shapes()) {
        RoundPlan plan;
        plan.shape = &shape;
        plan.threads = kThreads;
        plan.operations = static_cast<std::uint32_t>(std::min(kRoundOperations, operations - done));
        plan.seed = hash_keys(done, turn);
        plan.clock = some_clock(turn++);
        plan.delay_every = delay_every;
        ASSERT_NO_FATAL_FAILURE(expect_promises(plan));
      }
    }
  }
};

TEST_P(StressCaches, KeepTheirPromises) { expect_promises_in_all_shapes(0); }
TEST_P(StressCaches, KeepTheirPromisesUnderDelays) { expect_promises_in_all_shapes(32); }

/// Threads lose the processor in the middle of everything; each does little, and all of it is accounted for.
TEST_P(StressCaches, KeepTheirPromisesWithManyMoreThreadsThanCores) {
  static constexpr float kSizes[] = {0.9f, 0.1f, 0.02f};
  const Shape kCrowd{"crowd", 3, kSizes, 1'000, 50, 2, 200};
  constexpr std::uint32_t kMostThreads = 1024;
  const std::uint32_t cores = std::max(1u, std::thread::hardware_concurrency());
  for (const std::uint32_t times : {4u, 32u}) {
    RoundPlan plan;
    plan.shape = &kCrowd;
    plan.threads = std::min(times * cores, kMostThreads);
    plan.operations = (kThreadSanitizer ? 1 : 5) * kCrowd.epoch_operations;
    plan.seed = times;
    plan.clock = some_clock(times / 4);
    plan.delay_every = 32;
    ASSERT_NO_FATAL_FAILURE(expect_promises(plan));
    plan.delay_every = 0;
    ASSERT_NO_FATAL_FAILURE(expect_promises(plan));
  }
}

INSTANTIATE_TEST_SUITE_P(Registry, StressCaches, ::testing::Range(std::size_t{0}, all_subjects().size()),
                         [](const auto& at) { return std::string(all_subjects()[at.param].traits.name); });

/// A hang would be a failure: the threads that there are wait for those that are missing.
// Also where a place sees more records than logs have room for as a rule.
TEST(StressRound, EveryPlaceIsAskedAtRest) {
  constexpr float kRadii[] = {2.0f};
  Shape shape = all_shapes().front();
  shape.radii = kRadii;
  shape.places = 5;
  shape.epoch_operations = 4000;
  shape.insert_percent = 90;
  RoundPlan plan;
  plan.shape = &shape;
  plan.threads = 2;
  plan.operations = 3 * shape.epoch_operations;
  const RoundRecord round = run_round<WaitFree<>>(plan);
  unsigned rests = 0;
  std::uint32_t most_seen = 0;
  for (const Epoch& epoch : round.history.epochs) {
    if (epoch.has_contents) continue;
    ++rests;
    EXPECT_EQ(epoch.end - epoch.first, shape.places);
    for (std::uint32_t i = epoch.first; i != epoch.end; ++i)
      most_seen = std::max(most_seen, round.history.operations[i].count);
  }
  EXPECT_GE(rests, 3u);
  EXPECT_GT(most_seen, 1000u);
}

TEST(StressHistory, AThreadThatCannotBeCreatedIsAOneLineError) {
  if (kSanitized) GTEST_SKIP() << "sanitizers reserve address space without measure";
  EXPECT_EQ(status_with_little_memory([] {
              RoundPlan plan;
              plan.shape = &all_shapes().front();
              plan.threads = 4'000;
              plan.operations = 1;
              try {
                run_round<GlobalMutexCache<>>(plan);
              } catch (const std::runtime_error& error) {
                const std::string text = error.what();
                const bool good = text.starts_with("cannot create thread ") &&
                                  text.find(" of 4000: ") != text.npos && text.find('\n') == text.npos;
                return good ? 0 : 1;
              }
              return 2;
            }),
            0);
}

/// Histories the checker may rely on: ids at most once, stamps that rise in each thread but within batches, epochs end
/// to end.
TEST(StressHistory, IsWellFormed) {
  for (const Shape& shape : all_shapes()) {
    RoundPlan plan;
    plan.shape = &shape;
    plan.threads = kThreads;
    plan.operations = 3'000;
    plan.clock = some_clock(0);
    plan.delay_every = 64;
    const RoundRecord round = run_round<Delayed<WaitFree<>>>(plan);
    const History& h = round.history;
    std::set<std::uint32_t> ids;
    std::uint32_t at = 0, batched = 0;
    for (const Epoch& epoch : h.epochs) {
      ASSERT_EQ(epoch.first, at);
      at = epoch.end;
      for (std::uint32_t i = epoch.first; i != epoch.end; ++i) {
        const Operation& o = h.operations[i];
        ASSERT_LE(o.call, o.ret);
        if (i > epoch.first && h.operations[i - 1].thread == o.thread) {
          const Operation& before = h.operations[i - 1];
          const bool is_batch =
              before.is_query() && o.is_query() && before.call == o.call && before.ret == o.ret;
          ASSERT_TRUE(before.ret < o.call || is_batch);
          batched += is_batch;
        }
        if (o.is_query()) {
          ASSERT_LE(o.first + o.count, h.seen.size());
        } else {
          ASSERT_LT(o.first, h.ids);
          ASSERT_TRUE(ids.insert(o.first).second);
        }
      }
    }
    EXPECT_EQ(at, h.operations.size());
    EXPECT_GT(ids.size(), 100u);
    EXPECT_GT(batched, 20u) << "queries in one call with others";
  }
}

TEST(StressHistory, ASmallPoolRefusesSomeInserts) {
  RoundPlan plan;
  plan.shape = &all_shapes().back();
  plan.threads = kThreads;
  plan.operations = 2'000;
  plan.clock = some_clock(0);
  const RoundRecord round = run_round<WaitFree<>>(plan);
  std::size_t refused = 0;
  for (const Operation& o : round.history.operations) refused += o.is_refused();
  EXPECT_GT(refused, 0u);
}

TEST(StressHistory, TheSealTellsEveryFieldAndTheUpdate) {
  const Landscape landscape(all_shapes().front(), 1, 0.5f);
  const Record whole = landscape.record(1, 42, 3);
  EXPECT_EQ(shown_id(whole, 3), 42u);
  EXPECT_EQ(shown_id(whole, 4), 42u | kTorn);
  for (std::size_t i = 0; i < sizeof(Record) / sizeof(std::uint32_t); ++i) {
    Record torn = whole;
    std::uint32_t word;
    std::memcpy(&word, reinterpret_cast<const std::byte*>(&whole) + 4 * i, 4);
    word ^= 2u;
    std::memcpy(reinterpret_cast<std::byte*>(&torn) + 4 * i, &word, 4);
    EXPECT_NE(shown_id(torn, 3) & kTorn, 0u) << "word " << i;
  }
}

/// If a store returned before a load was called, by the clock, the load sees it.
void expect_sound(ClockSource source) {
  constexpr std::uint32_t kStores = 500'000;
  StressClock clock(source);
  std::atomic<std::uint32_t> word{0};
  std::vector<Stamp> returned(kStores + 1);
  struct Load {
    Stamp call;
    std::uint32_t value;
  };
  std::vector<Load> loads;
  loads.reserve(4 * kStores);
  {
    std::jthread writer([&] {
      for (std::uint32_t i = 1; i <= kStores; ++i) {
        word.store(i, std::memory_order_release);
        returned[i] = clock.after();
      }
    });
    while (loads.size() < loads.capacity() && word.load(std::memory_order_acquire) < kStores) {
      const Stamp call = clock.before();
      loads.push_back({call, word.load(std::memory_order_acquire)});
    }
  }
  std::uint32_t due = 0;
  for (const Load& load : loads) {
    while (due < kStores && returned[due + 1] < load.call) ++due;
    ASSERT_GE(load.value, due);
  }
}

TEST(StressClock, CounterClaimsNoOrderThatWasNotThere) { expect_sound(ClockSource::counter); }
TEST(StressClock, TscClaimsNoOrderThatWasNotThere) {
  if (!tsc_is_usable()) GTEST_SKIP() << "the cores' counters disagree";
  expect_sound(ClockSource::tsc);
}

TEST(StressCampaign, TakesTurnsAndAddsUp) {
  const Subject& wait_free =
      *std::find_if(all_subjects().begin(), all_subjects().end(),
                    [](const Subject& subject) { return subject.traits.name == "wait_free"; });
  CampaignOptions options;
  options.operations = 70'000;
  options.use_counter = some_clock(0) == ClockSource::counter;
  options.use_tsc = tsc_is_usable();
  double reported = 0.0;
  const Totals totals = run_campaign(wait_free, options, [&](double operations) { reported += operations; });
  EXPECT_GE(totals.judgement.operations, options.operations);
  EXPECT_EQ(reported, static_cast<double>(totals.judgement.operations));
  EXPECT_GE(totals.rounds, 2 * all_shapes().size());
  EXPECT_TRUE(totals.judgement.holds(Check::regular)) << totals.judgement[Check::regular].witness;
}

}  // namespace
}  // namespace icbench::stress
