// The broken caches whose fault a schedule shows, and the scenarios that show it. In the order of stress/controls.cpp,
// without `update_keeps_copies` and `tidy_drops_last`, as no scenario updates or tidies anything; and with
// `installed_unordered` and `cells_unordered`, which no history shows: what is there is zero either way.
#include "caches/registry.h"
#include "stress/broken/copies.h"
#include "stress/broken/lists.h"
#include "stress/broken/trees.h"
#include "stress/explore/subject.h"

namespace icbench::stress::explore {

namespace {

template <class ModelCache>
constexpr ExploreSubject broken(std::string_view name) {
  return {name, ModelCache::kTraits, &explore_cache<ModelCache>, &replay_cache<ModelCache>};
}

constexpr ExploreControl kControls[] = {
    {broken<InModel<WaitFree<>>>("wait_free"),
     "declared linearizable, which it is not: a query reads several lists, one after the other",
     Check::linearizable,
     {"shallow_then_deep"}},
    {broken<RelaxedPublication<ModelSync>>("relaxed_publication"),
     "records and nodes are published by relaxed stores",
     Check::integrity,
     {"insert_query"}},
    {broken<LanesUnpublished<ModelSync>>("lanes_unpublished"),
     "a packed cell's mask is added to by relaxed steps",
     Check::integrity,
     {"insert_query"}},
    {broken<InstalledUnordered<ModelSync>>("installed_unordered"),
     "nodes and segments are installed by a relaxed compare-exchange",
     Check::integrity,
     {"prefault_query"}},
    {broken<CellsUnordered<ModelSync>>("cells_unordered"),
     "nodes and cells of the packed octree are installed by a relaxed compare-exchange",
     Check::integrity,
     {"prefault_query"}},
    {broken<PlainStoreInstall<ModelSync>>("plain_store_install"),
     "children are installed by test and store instead of CAS",
     Check::integrity,
     {"install"}},
    {broken<ChildInstalledTwice<ModelSync>>("child_installed_twice"),
     "the loser of an installing CAS goes on in its own node",
     Check::integrity,
     {"install"}},
    {broken<ExchangeThenLink<ModelSync>>("exchange_then_link"),
     "the head of a list is exchanged first and linked to the rest afterwards",
     Check::regular,
     {"insert_over_old"}},
    {broken<PublishBeforeFill<ModelSync>>("publish_before_fill"),
     "a slot is marked ready before it is filled",
     Check::integrity,
     {"insert_query"}},
    {broken<CounterAppend<ModelSync>>("counter_append"),
     "readers trust a size that is set when two counters meet",
     Check::regular,
     {"install", "two_inserts"}},
    {broken<MergeDropsLast<ModelSync, ModelPlainSync>>("merge_drops_last"),
     "the merge at the end of a frame forgets each session's last record",
     Check::integrity,
     {"install"}},
    {broken<ClearLeavesOne<ModelSync>>("clear_leaves_one"),
     "one record survives clear",
     Check::integrity,
     {"install"}},
    {broken<ReplicatedWithoutCommit<ModelSync>>("replicated_without_commit"),
     "copies of a record appear one after the other",
     Check::per_record_linearizable,
     {"insert_queries"}},
    {broken<LockReleasedEarly<ModelSync, ModelPlainSync>>("lock_released_early"),
     "the lock is released before the work is done",
     Check::integrity,
     {"install"}},
    {broken<LockWithoutOrder<ModelSync, ModelPlainSync>>("lock_without_order"),
     "readers and writers of the distributed lock are not sequentially consistent",
     Check::integrity,
     {"insert_query"}},
    {broken<LockStoresLate<ModelSync, ModelPlainSync>>("lock_stores_late"),
     "of the distributed lock's steps the loads alone are sequentially consistent",
     Check::integrity,
     {"insert_query"}},
    {broken<LockLoadsEarly<ModelSync, ModelPlainSync>>("lock_loads_early"),
     "of the distributed lock's steps the stores alone are sequentially consistent",
     Check::integrity,
     {"insert_query"}},
    {broken<MarksUnordered<ModelSync>>("marks_unordered"),
     "a packed record is marked by a relaxed store",
     Check::per_record_linearizable,
     {"across"}},
    {broken<ClockReadLate<ModelSync>>("clock_read_late"),
     "a snapshot query reads its clock when it meets records, not before the first list",
     Check::linearizable,
     {"shallow_then_deep"}},
    {broken<PendingNotHelped<ModelSync>>("pending_not_helped"),
     "a snapshot query passes over a pending record without stamping it",
     Check::linearizable,
     {"look_between"}},
    {broken<BatchLoadsAhead<ModelSync>>("batch_loads_ahead"),
     "a batch loads records before it looks at the marks that publish them",
     Check::integrity,
     {"insert_batch"}},
    {broken<BatchKeepsExtent<ModelSync>>("batch_keeps_extent"),
     "a batch looks no further than the list reached when the last batch was done",
     Check::regular,
     {"insert_batch"}},
};

}  // namespace

std::span<const ExploreControl> all_explore_controls() { return kControls; }

}  // namespace icbench::stress::explore
