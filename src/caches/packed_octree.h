// The packed octree: every record is stored once, in a table, and known in every cell that its validity region reaches
// (caches/packed_reach.h); a query walks one path from the root and tests the records of the cells on it.
//
// Use: this is a *structure*. Packed<PlainSync> is the sequential one that locks and thread-local copies wrap;
// Packed<StdSync> is the wait-free cache, Packed<StdSync, Snapshot> the linearizable one; under SpinNodeLock<> it has a
// lock for every region (caches/packed_regions.h). All are this code.
//
// Memory. What cells are made of and where they are is said in caches/packed_cells.h: lanes of 8 bytes of a record
// (caches/packed_lanes.h), tested many at once, and a list for what does not fit. A record is 44 bytes and its mark,
// read only if one of its lanes was kept.
//
// Guests. A record is stored at the level whose cells suit its reach (caches/packed_reach.h), or up to two levels above
// in cells of the grid or below that have few lanes. So what is small and alone, as at edges, has no nodes, cells and
// copies of its own (10^5 records of Cornell box: a quarter of the nodes, two fifths of the cells).
//
// Hot cells. A record that finds its cell full goes one level down, into the children it reaches; where those are full
// as well, into their lists. A second split would not pay: a child is at most 2.1 reaches wide, so most of what is
// listed there is valid nearby, and every level down makes two to four times the copies. The lists hold places, and
// their records are tested one by one. No list grows but with what is valid at one point, as long as reaches are at
// least 1 / 17,000 of the bounds' largest side (kPackedLevels; in wider bounds cells are larger than what is in them,
// and in 100 km a query among records of 0.1 m reads thousands: give a cache the bounds of what it holds): its records,
// of reach r, meet a cell of side s <= 2.1 r, so they lie in that cell widened by r, of side 4.1 r. On a surface nine
// squares of side 1.37 r cover it, in space 64 cubes of side 1.03 r, each within r of its centre: so at one of these
// centres a ninth of the records, a 64th in space, is valid for a_max, as far as distance goes.
//
// What an insert does, step by step, and what others see if it stops there for ever
//
//   1  takes a place in the table                     the place is not used; nobody sees it
//   2  in every cell: installs missing bricks, nodes, cells and lanes, reserves a lane or a place in the list; notes
//      the cell's level among those in use, if it is above the grid's finest
//                                                     the lanes stay out of the mask, the places unmarked: nobody
//                                                     reads them
//   3  writes the record, then lane by lane: words, mask bit
//                                                     queries find lanes whose record's mark is empty, and pass on
//   4  marks the record (caches/visibility.h)         it is there, in all cells at once
//
// If memory runs out in 1 or 2, what was reserved stays empty, the place goes to the session's next insert, and nothing
// was linked; 3 and 4 cannot fail. Lanes handed to failed inserts are lost until records are dropped or cleared, nodes
// without records until `clear`.
//
// Publication pairs (StdSync); P1, P4, P5 are those of caches/visibility.h, P2 that of the cells
// (caches/packed_cells.h), P3 that of their lists (caches/slot_list.h)
//
//   P1  insert: mark store release -> visit: mark load acquire; publishes the record. The query acquired the lane
//       first; a record that is seen has all its lanes published before, so that no later query misses it anywhere.
//
//   P6  insert: mask fetch_add release -> visit: mask load acquire; publishes the lane's words, where they are, which
//       whoever wrote the lane had acquired, and the record behind it, which is written before its first lane (step 3):
//       vectors load whole groups of records, those that are not marked yet among them, and use what is marked. A
//       fetch_add by another insert is in its release sequence.
//
// Progress (StdSync), in steps on shared memory. Every loop is over levels, children, strips or an extent read once.
//
//   insert  wait-free: at most 8 cells a level are looked at on the record's own level and on two above, below the
//           grid at the end of 8 paths of nodes, and 27 get a copy; each look at a cell is at most the noting of its
//           level and two words, each of which costs a load, an allocation (4 steps) and a CAS if it is missing, whose
//           loser adopts the winner's; a copy is a lane, and if that was in vain a place in the list (insert_steps).
//
//   visit   wait-free: caches/packed_store.h.
//
// Linearization (StdSync): by Visibility, as for the Ward tree: a record appears everywhere at once, by its mark, so
// visits are per-record linearizable; a snapshot is linearizable. For P4, a record's lanes are published before its
// tick is drawn.
#pragma once

#include "caches/packed_regions.h"
#include "caches/packed_store.h"
#include "core/cache.h"

namespace icbench {

template <class Sync, class Visibility = AtFirstSight, class Lanes = SimdLanes, class NodeLock = NoNodeLock>
class Packed {
  template <class T>
  using Atomic = typename Sync::template Atomic<T>;

 public:
  /// Under a lock per region the cells are plain memory, but sessions still allocate side by side.
  using SharedSync = typename NodeLock::template Shared<Sync>;

 private:
  using Store = PackedStore<Sync, SharedSync, Visibility, Lanes>;
  using Cells = typename Store::Cells;
  using Records = typename Store::Records;
  using List = typename Store::List;
  using Cell = typename Cells::Cell;
  using Branch = typename Cells::Branch;
  using Regions = PackedRegions<NodeLock>;

 public:
  static constexpr std::string_view kPrefix = "packed_";
  static constexpr std::string_view kStructure = "packed";
  static constexpr CacheTraits kTraits = [] {
    const auto wait_free = [](std::string_view name, std::string_view mechanism, Consistency consistency,
                              bool single_thread) {
      return CacheTraits{name,
                         kStructure,
                         mechanism,
                         ProgressGuarantee::wait_free,
                         ProgressGuarantee::wait_free,
                         consistency,
                         single_thread,
                         "this project"};
    };
    if (NodeLock::kOn) {
      return CacheTraits{"packed_node_lock",
                         kStructure,
                         "node_lock",
                         ProgressGuarantee::blocking,
                         ProgressGuarantee::blocking,
                         Consistency::per_record_linearizable,
                         false,
                         "a lock per region"};
    }
    if (!Sync::kConcurrent) return wait_free("packed_sequential", "none", Consistency::linearizable, true);
    if (Visibility::kIsSnapshot)
      return wait_free("packed_wait_free_snapshot", "wait_free_snapshot", Consistency::linearizable, false);
    return wait_free("packed_wait_free", "wait_free", Consistency::per_record_linearizable, false);
  }();

  /// Cells a record is known in: three an axis at most, below a full one.
  static constexpr std::uint32_t kMostCopies = 27;
  // Step bounds (caches/session.h).
  static constexpr std::string_view kInsertBound = Visibility::kIsSnapshot ? "48 level below the grid + 3477"
                                                                           : "48 level below the grid + 3475",
                                    kVisitBound = Store::kVisitBound;
  static constexpr std::uint32_t kVisitSteps = Store::kVisitSteps, kMostLists = Store::kMostLists;
  static constexpr std::uint64_t list_steps(std::uint32_t extent) noexcept {
    return Store::list_steps(extent);
  }

  /// Of an insert `below` levels below the grid.
  static constexpr std::uint32_t insert_steps(int below) noexcept {
    constexpr std::uint32_t kLaneSteps = 2 + Cells::kFollowSteps + 1 + 1;
    // A look at a cell that takes no more: its level, its brick or node, its word, its count.
    constexpr std::uint32_t kLookSteps = Cells::kNoteSteps + 2 * Cells::kFollowSteps + 2;
    // Of a copy: the same, a lane, and if that was in vain a place in the list.
    constexpr std::uint32_t kCopySteps = kLookSteps + kLaneSteps + List::kAppendSteps;
    constexpr std::uint32_t kLeast = Records::kTakeSteps +
                                     (kGuestLevels + 1) * Cells::kMostCells * kLookSteps +
                                     kMostCopies * kCopySteps + Records::Marks::kPublishSteps;
    static_assert(kLeast == (Visibility::kIsSnapshot ? 3477 : 3475));
    return kLeast + static_cast<std::uint32_t>(below) * Cells::kMostCells * Cells::kFollowSteps;
  }
  std::uint32_t insert_steps(const Record& r) const noexcept {
    return insert_steps(
        std::max(PackedReach::level_of(store_.addressing, r, store_.a_max) - store_.cells.grid_level(), 0));
  }

  using Workspace = typename Store::Workspace;

  explicit Packed(const CacheConfig& config) : store_(config), regions_(store_.cells.top_level()) {}

  /// Stores `r`; false if a pool is used up, and then no query ever sees anything of it.
  template <class Counters>
  bool insert(Workspace& workspace, const Record& r, Counters& counters) noexcept {
    const UnitIndex place = store_.records.take(workspace.records);
    if (place == 0) return false;
    const PackedReach reach(store_.addressing, r, store_.a_max);
    const int level = level_from(reach);
    Insertion insertion(workspace, reach);
    // A full cell is split once.
    typename Regions::template InsertScope<Counters> scope(regions_, reach, level, reach.level() + 1,
                                                           counters);
    if (!reserve(insertion, level, counters)) {
      Records::give_back(workspace.records, place);
      return false;
    }
    auto& stored = store_.records.write(place, r);
    for (std::uint32_t i = 0; i < insertion.reserved; ++i) publish(insertion.copies[i], reach, place);
    store_.records.publish(stored);
    return true;
  }

  /// Calls f(record, weight) for every published record valid at x for accuracy a.
  template <class Counters, class F>
  void visit(const SurfacePoint& x, float a, Counters& counters, F&& f) noexcept {
    const auto locked = [&](const GridPoint& u, std::uint32_t levels) noexcept {
      return typename Regions::template VisitScope<Counters>(regions_, u, levels, counters);
    };
    store_.visit(x, a, counters, locked, f);
  }

  /// Queries that are under way at once in a batch.
  static constexpr std::size_t kBatch = Store::kBatch;

  /// `visit` for each of at most kBatch points; the visitor of points[i] is visitors[i]. Steps are those of the visits.
  template <class Counters, class Visitors>
  void visit_batch(std::span<const SurfacePoint> points, float a, Counters& counters,
                   Visitors visitors) noexcept {
    if constexpr (NodeLock::kOn) {  // one after the other: locks of two visits are in no order
      for (std::size_t i = 0; i < points.size(); ++i) visit(points[i], a, counters, visitors[i]);
    } else {
      store_.visit_batch(points, a, counters, visitors);
    }
  }

  /// f(Record&) -> UpdateResult for every record, in parallel over the table. Quiescent.
  template <class F>
  void update(F&& f) {
    store_.records.update(f, [this] { store_.cells.for_each_cell([this](Cell& c) { forget_dropped(c); }); });
  }

  /// f(const Record&) for every record. Quiescent.
  template <class F>
  void for_each(F&& f) const {
    store_.records.for_each(f);
  }

  /// Forgets everything. Quiescent; workspaces must be made anew.
  void clear() { store_.clear(); }

  std::uint64_t room(std::uint64_t live) const noexcept { return store_.room(live); }
  void prefault(Workspace& workspace, std::uint32_t n) noexcept { store_.prefault(workspace, n); }
  void touch(std::uint32_t offset, std::uint32_t n) noexcept { store_.touch(offset, n); }

  /// Bytes that the structure has whatever is in it.
  std::size_t fixed_bytes() const noexcept { return store_.cells.fixed_bytes() + regions_.bytes(); }

  static std::size_t bytes(const Workspace& workspace) noexcept { return Store::bytes(workspace); }

 private:
  // A record may stay as a guest in a cell up to so many levels above its own that has fewer lanes than that: where
  // records are few or of many sizes, as at edges, that saves cells and copies.
  static constexpr int kGuestLevels = 2;
  static constexpr std::uint32_t kGuestLanes = kStripLanes;

  /// A copy of a record to be: a lane of a cell or, if `words` is null, a place in the cell's list.
  struct Copy {
    PackedCell where;
    Cell* cell;
    std::uint32_t* words;
    std::uint32_t lane;
    typename List::Place rest;
  };

  struct Insertion {
    Insertion(Workspace& w, const PackedReach& r) noexcept : workspace(w), reach(r) {}
    Workspace& workspace;
    const PackedReach& reach;
    std::uint32_t reserved = 0;
    std::array<Copy, kMostCopies> copies;
  };

  /// The coarsest level at which a cell may take a record: cells that take guests are of the grid or below.
  int level_from(const PackedReach& reach) const noexcept {
    return std::max(std::min(reach.level(), store_.cells.grid_level()), reach.level() - kGuestLevels);
  }

  /// Reserves a copy in every cell that the record is to be in; false if a pool is used up. `level`: from which on
  /// cells may take it.
  template <class Counters>
  bool reserve(Insertion& insertion, int level, Counters& counters) noexcept {
    const PackedReach& reach = insertion.reach;
    const int from = std::min(level, store_.cells.grid_level());
    const auto [low, high] = reach.cells(from);
    for (std::int32_t z = low.z; z <= high.z; ++z) {
      for (std::int32_t y = low.y; y <= high.y; ++y) {
        for (std::int32_t x = low.x; x <= high.x; ++x) {
          const PackedCell where{x, y, z, from};
          if (reach.touches(where) && !reserve_in_grid(insertion, where, level, counters)) return false;
        }
      }
    }
    return true;
  }

  /// The same of a cell of the grid and what is below. `level`: from which on cells may take it.
  template <class Counters>
  bool reserve_in_grid(Insertion& insertion, const PackedCell& where, int level,
                       Counters& counters) noexcept {
    auto* entry = store_.cells.entry_for(insertion.workspace.cells, where, counters);
    return entry != nullptr && reserve(insertion, where, level, entry->branch, &entry->more, counters);
  }

  /// The same of any cell. `hint`: null below the grid.
  template <class Counters>
  bool reserve(Insertion& insertion, const PackedCell& where, int level, Branch& branch,
               Atomic<UnitIndex>* hint, Counters& counters) noexcept {
    const PackedReach& reach = insertion.reach;
    Workspace& workspace = insertion.workspace;
    if (where.level >= level) {
      if (where.level < store_.cells.grid_level()) store_.cells.note_level(where.level);
      Cell* c = store_.cells.cell_for(workspace.cells, branch, counters);
      if (c == nullptr) return false;
      Copy& copy = insertion.copies[insertion.reserved];
      copy.where = where;
      copy.cell = c;
      const std::uint32_t room = where.level < reach.level() ? kGuestLanes : kCellLanes;
      // Relaxed: the count only fixes places; what lies there is published by P6. The load keeps it from wrapping
      // round.
      if (c->count.load(std::memory_order_relaxed) < room) {
        copy.lane = c->count.fetch_add(1, std::memory_order_relaxed);
        if (copy.lane < kCellLanes) {
          copy.words = store_.cells.lane_for(workspace.cells, *c, copy.lane, hint, counters);
          ++insertion.reserved;
          return copy.words != nullptr;
        }
      }
      // A record that covers the cell is in all of its children, and nothing would be gained by going there.
      if (where.level > reach.level() || where.level == kPackedLevels || reach.reach() > where.side()) {
        copy.words = nullptr;
        copy.rest = store_.list.reserve(workspace.list, c->rest, counters);
        ++insertion.reserved;
        return static_cast<bool>(copy.rest);
      }
    }
    typename Cells::Node* below = nullptr;
    if (where.level >= store_.cells.grid_level()) {
      below = store_.cells.node_for(workspace.cells, branch, counters);
      if (below == nullptr) return false;
    }
    for (unsigned rest = reach.children(where); rest != 0; rest &= rest - 1) {
      const auto i = static_cast<unsigned>(std::countr_zero(rest));
      const PackedCell child = where.child(i);
      if (!reach.touches(child)) continue;
      if (!(below != nullptr ? reserve(insertion, child, level, below->child[i], nullptr, counters)
                             : reserve_in_grid(insertion, child, level, counters))) {
        return false;
      }
    }
    return true;
  }

  /// Writes a copy of the record at `place`, and then shows it.
  void publish(const Copy& copy, const PackedReach& reach, UnitIndex place) noexcept {
    if (copy.words == nullptr) return store_.list.publish(copy.rest, place);
    std::uint32_t* word = copy.words;
    for (const std::uint32_t value :
         {make_lane(reach.p(), reach.reach(), copy.where.corner(), copy.where.level), place}) {
      Sync::writes(word, sizeof *word);
      *word = value;
      word += kStripLanes;
    }
    // An addition, which no other insert does of this bit, and so as good as an or.
    copy.cell->mask.fetch_add(std::uint64_t{1} << copy.lane, std::memory_order_release /* P6 */);
  }

  /// Takes the copies of dropped records out of a cell; what is kept moves up. Quiescent.
  void forget_dropped(Cell& c) {
    // All orders relaxed: quiescent; the caller's synchronisation publishes.
    const UnitIndex more = c.more.load(std::memory_order_relaxed);
    const auto lane_at = [&](std::uint32_t lane) { return store_.cells.lane(c, more, lane); };
    std::uint64_t mask = 0;
    std::uint32_t kept = 0;
    // Where strips could not be had, no lane is published, so that none is asked for.
    for (std::uint64_t rest = c.mask.load(std::memory_order_relaxed); rest != 0; rest &= rest - 1) {
      const std::uint32_t* from = lane_at(static_cast<std::uint32_t>(std::countr_zero(rest)));
      const UnitIndex place = from[kStripLanes];
      if (Records::is_empty(store_.records.at(place))) continue;
      std::uint32_t* to = lane_at(kept);
      to[0] = from[0];
      to[kStripLanes] = place;
      mask |= std::uint64_t{1} << kept++;
    }
    c.mask.store(mask, std::memory_order_relaxed);
    c.count.store(kept, std::memory_order_relaxed);
    store_.list.update(c.rest, [this](UnitIndex& place) {
      return Records::is_empty(store_.records.at(place)) ? UpdateResult::drop : UpdateResult::keep;
    });
  }

  Store store_;
  [[no_unique_address]] Regions regions_;
};

}  // namespace icbench
