#include "stress/controls.h"

#include <algorithm>

#include "caches/registry.h"
#include "stress/broken/copies.h"
#include "stress/broken/lists.h"
#include "stress/broken/trees.h"
#include "stress/delay_sync.h"

namespace icbench::stress {

namespace {

constexpr std::uint32_t kMostRounds = 400;  // some faults show in one round of twenty only
constexpr std::uint32_t kShareRounds = 12;
constexpr std::uint32_t kOptionalRounds = 8;
constexpr std::uint32_t kFewestThreads = 4;  // one of the faults takes three to show
constexpr std::uint32_t kMostThreads = 256;  // more show nothing new and take minutes
constexpr std::uint32_t kRoundOperations = 4'000;
constexpr std::uint32_t kDelayEvery = 24;

#if defined(__x86_64__)
constexpr bool kStoresStayInOrder = true;
#else
constexpr bool kStoresStayInOrder = false;
#endif

constexpr Control kControls[] = {
    {"wait_free", "declared linearizable, which it is not: a query reads several lists, one after the other",
     Check::linearizable, 0.25, false, &run_round<Delayed<WaitFree<>>>},
    {"relaxed_publication", "records and nodes are published by relaxed stores", Check::integrity, 0.0,
     kStoresStayInOrder, &run_round<RelaxedPublication<DelaySync>>},
    {"lanes_unpublished", "a packed cell's mask is added to by relaxed steps", Check::integrity, 0.0,
     kStoresStayInOrder, &run_round<LanesUnpublished<DelaySync>>},
    {"plain_store_install", "children are installed by test and store instead of CAS", Check::integrity, 0.0,
     false, &run_round<PlainStoreInstall<DelaySync>>},
    {"child_installed_twice", "the loser of an installing CAS goes on in its own node", Check::integrity, 0.0,
     false, &run_round<ChildInstalledTwice<DelaySync>>},
    {"exchange_then_link", "the head of a list is exchanged first and linked to the rest afterwards",
     Check::regular, 0.0, false, &run_round<ExchangeThenLink<DelaySync>>},
    {"publish_before_fill", "a slot is marked ready before it is filled", Check::integrity, 0.0, false,
     &run_round<PublishBeforeFill<DelaySync>>},
    {"counter_append", "readers trust a size that is set when two counters meet", Check::regular, 0.0, false,
     &run_round<CounterAppend<DelaySync>>},
    {"merge_drops_last", "the merge at the end of a frame forgets each session's last record",
     Check::integrity, 0.0, false, &run_round<MergeDropsLast<DelaySync, DelayPlainSync>>},
    {"clear_leaves_one", "one record survives clear", Check::integrity, 0.0, false,
     &run_round<ClearLeavesOne<DelaySync>>},
    {"tidy_drops_last", "laying records out anew forgets the last", Check::integrity, 0.0, false,
     &run_round<TidyDropsLast<DelaySync>>},
    {"update_keeps_copies", "an update that drops nothing leaves the copies that queries read as they were",
     Check::integrity, 0.0, false, &run_round<UpdateKeepsCopies<DelaySync>>},
    {"replicated_without_commit", "copies of a record appear one after the other",
     Check::per_record_linearizable, 0.0, false, &run_round<ReplicatedWithoutCommit<DelaySync>>},
    {"lock_released_early", "the lock is released before the work is done", Check::integrity, 0.0, false,
     &run_round<LockReleasedEarly<DelaySync, DelayPlainSync>>},
    {"lock_without_order", "readers and writers of the distributed lock are not sequentially consistent",
     Check::integrity, 0.0, true, &run_round<LockWithoutOrder<DelaySync, DelayPlainSync>>},
    {"lock_stores_late", "of the distributed lock's steps the loads alone are sequentially consistent",
     Check::integrity, 0.0, true, &run_round<LockStoresLate<DelaySync, DelayPlainSync>>},
    {"lock_loads_early", "of the distributed lock's steps the stores alone are sequentially consistent",
     Check::integrity, 0.0, true, &run_round<LockLoadsEarly<DelaySync, DelayPlainSync>>},
    {"marks_unordered", "a packed record is marked by a relaxed store", Check::per_record_linearizable, 0.0,
     kStoresStayInOrder, &run_round<MarksUnordered<DelaySync>>},
    {"clock_read_late", "a snapshot query reads its clock when it meets records, not before the first list",
     Check::linearizable, 0.0, false, &run_round<ClockReadLate<DelaySync>>},
    {"pending_not_helped", "a snapshot query passes over a pending record without stamping it",
     Check::linearizable, 0.0, false, &run_round<PendingNotHelped<DelaySync>>},
    {"batch_loads_ahead", "a batch loads records before it looks at the marks that publish them",
     Check::integrity, 0.0, false, &run_round<BatchLoadsAhead<DelaySync>>},
    {"batch_keeps_extent", "a batch looks no further than the list reached when the last batch was done",
     Check::regular, 0.0, false, &run_round<BatchKeepsExtent<DelaySync>>},
};

}  // namespace

std::span<const Control> all_controls() { return kControls; }

ControlOutcome run_control(const Control& control, const CampaignOptions& options) {
  ControlOutcome outcome;
  const auto check = static_cast<std::size_t>(control.check);
  const std::uint32_t rounds = control.share > 0.0         ? kShareRounds
                               : control.needs_weak_memory ? kOptionalRounds
                                                           : kMostRounds;
  for (std::uint32_t i = 0; i < rounds; ++i) {
    RoundPlan plan;
    // The first two shapes: few places, where most pairs overlap, and young trees, where installs race.
    plan.shape = &all_shapes()[control.share > 0.0 ? 0 : i % 2];
    plan.threads = std::clamp(options.threads, kFewestThreads, kMostThreads);
    plan.operations = kRoundOperations;
    plan.seed = hash_keys(options.seed, i, 1);
    plan.clock = clock_of_round(options, i / 2);
    plan.delay_every = kDelayEvery;
    outcome.totals.add(judge(control.run(plan).history), plan);
    const std::uint32_t violated = outcome.totals.rounds_violated[check];
    outcome.seen = violated > 0 && violated >= control.share * rounds;
    if (outcome.seen && control.share == 0.0) break;
  }
  return outcome;
}

}  // namespace icbench::stress
