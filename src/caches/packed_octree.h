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
// listed there is valid nearby, and every level down makes two to four times the copies. The lists hold indices, and
// their records are tested one by one.
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
//   P6  insert: mask fetch_add release -> visit: mask load acquire; publishes the lane's words, and where they are,
//       which whoever wrote the lane had acquired. A fetch_add by another insert is in its release sequence.
//
// Progress (StdSync), in steps on shared memory. Every loop is over levels, children, strips or an extent read once.
//
//   insert  wait-free: at most 8 cells a level are looked at on the record's own level and on two above, below the
//           grid at the end of 8 paths of nodes, and 27 get a copy; each look at a cell is at most the noting of its
//           level and two words, each of which costs a load, an allocation (4 steps) and a CAS if it is missing, whose
//           loser adopts the winner's; a copy is a lane, and if that was in vain a place in the list (insert_steps).
//
//   visit   wait-free: the levels in use; a brick and a hint for each level of the grid, two words a level; of each
//           cell on the path the mask, the word of its further lanes and the list's count; then the lanes and places
//           that these showed, once (list_steps), but without snapshots the mark of the first record up to eight
//           times. A cell counts as two lists, its lanes and the rest.
//
// Linearization (StdSync): by Visibility, as for the Ward tree: a record appears everywhere at once, by its mark, so
// visits are per-record linearizable; a snapshot is linearizable. For P4, a record's lanes are published before its
// tick is drawn.
#pragma once

#include <mutex>

#include "caches/packed_cells.h"
#include "caches/packed_filter.h"
#include "caches/packed_regions.h"
#include "core/cache.h"

namespace icbench {

template <class Sync, class Visibility = AtFirstSight, class Lanes = SimdLanes, class NodeLock = NoNodeLock>
class Packed {
  template <class T>
  using Atomic = typename Sync::template Atomic<T>;
  using Marks = typename Visibility::template In<Sync>;

 public:
  /// Under a lock per region the cells are plain memory, but sessions still allocate side by side.
  using SharedSync = typename NodeLock::template Shared<Sync>;

 private:
  using Cells = PackedCells<Sync, SharedSync>;
  using Regions = PackedRegions<NodeLock>;
  using Cell = typename Cells::Cell;
  using Branch = typename Cells::Branch;
  using List = typename Cells::List;

  static constexpr std::size_t kLineBytes = 64, kStoredAlign = 16;
  static constexpr std::uint32_t kFreedBatch = 16;
  struct alignas(kStoredAlign) Stored {
    Record record;
    typename Marks::Mark mark;
  };
  static_assert(sizeof(Stored) <= kLineBytes, "a record is two cache lines at most");
  using Table = Arena<SharedSync, sizeof(Stored)>;

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
                                    kVisitBound = Visibility::kIsSnapshot
                                                      ? "41 + per list (3 + links + 5 slots)"
                                                      : "47 + per list (3 + links + 2 slots)";
  static constexpr std::uint32_t kVisitSteps = 1 + 2 * (kPackedLevels + 1) + (Cells::kMostGridLevels + 1) +
                                               2 + Marks::kMomentSteps +
                                               (Visibility::kIsSnapshot ? 0 : kWeighed - 1);
  static_assert(kVisitSteps == (Visibility::kIsSnapshot ? 41 : 47));
  static constexpr std::uint32_t kMostLists = 2 * (kPackedLevels + 1);

  /// Of an insert `below` levels below the grid.
  static constexpr std::uint32_t insert_steps(int below) noexcept {
    constexpr std::uint32_t kLaneSteps = 2 + Cells::kFollowSteps + 1 + 1;
    constexpr std::uint32_t kTakeSteps = 2 + ArenaCursor<Table>::kAllocateSteps;
    // A look at a cell that takes no more: its level, its brick or node, its word, its count.
    constexpr std::uint32_t kLookSteps = Cells::kNoteSteps + 2 * Cells::kFollowSteps + 2;
    // Of a copy: the same, a lane, and if that was in vain a place in the list.
    constexpr std::uint32_t kCopySteps = kLookSteps + kLaneSteps + List::kAppendSteps;
    constexpr std::uint32_t kLeast = kTakeSteps + (kGuestLevels + 1) * Cells::kMostCells * kLookSteps +
                                     kMostCopies * kCopySteps + Marks::kPublishSteps;
    static_assert(kLeast == (Visibility::kIsSnapshot ? 3477 : 3475));
    return kLeast + static_cast<std::uint32_t>(below) * Cells::kMostCells * Cells::kFollowSteps;
  }
  std::uint32_t insert_steps(const Record& r) const noexcept {
    return insert_steps(std::max(PackedReach::level_of(addressing_, r, a_max_) - cells_.grid_level(), 0));
  }

  /// Of the lanes of a cell on a visit and what else there is to read in it, or of its list.
  static constexpr std::uint64_t list_steps(std::uint32_t extent) noexcept {
    return 2 + List::visit_steps(extent) + std::uint64_t{extent} * Marks::kShowsSteps;
  }

  /// A session's own allocation state.
  class Workspace {
    friend Packed;
    typename Cells::Workspace cells_;
    ArenaCursor<Table> table_;
    typename List::Workspace list_;
    std::array<UnitIndex, kFreedBatch> freed_{};  // places that dropped records left, this session's
    std::uint32_t freed_left_ = 0;
    UnitIndex spare_place_ = 0;  // of an insert that failed
  };

  explicit Packed(const CacheConfig& config)
      : addressing_(config.bounds),
        a_max_(config.a_max),
        sessions_(config.max_sessions),
        cells_(config.capacity, sessions_, kSpareRoom, is_large(config)),
        regions_(cells_.top_level()),
        table_(config.capacity + 2 * sessions_ * kIdlePlaces, is_large(config)),
        list_(kSpareRoom * config.capacity * kWorstListUnits + sessions_ * List::kIdleUnits) {}

  /// Stores `r`; false if a pool is used up, and then no query ever sees anything of it.
  template <class Counters>
  bool insert(Workspace& workspace, const Record& r, Counters& counters) noexcept {
    const UnitIndex place = take_place(workspace);
    if (place == 0) return false;
    const PackedReach reach(addressing_, r, a_max_);
    const int level = level_from(reach);
    Insertion insertion(workspace, reach);
    // A full cell is split once.
    typename Regions::template InsertScope<Counters> scope(regions_, reach, level, reach.level() + 1,
                                                           counters);
    if (!reserve(insertion, level, counters)) {
      workspace.spare_place_ = place;
      return false;
    }
    Stored& stored = at(place);
    Sync::writes(&stored.record, sizeof r);
    stored.record = r;
    for (std::uint32_t i = 0; i < insertion.reserved; ++i) publish(insertion.copies[i], reach, place);
    marks_.publish(stored.mark);
    return true;
  }

  /// Calls f(record, weight) for every published record valid at x for accuracy a.
  template <class Counters, class F>
  void visit(const SurfacePoint& x, float a, Counters& counters, F&& f) noexcept {
    Walk walk = start(x);
    const std::uint32_t levels = cells_.levels_in_use();
    typename Regions::template VisitScope<Counters> scope(regions_, walk.u, levels, counters);
    enter(walk, levels);
    while (step(walk)) {
    }
    Candidates candidates;
    look(walk, candidates);
    filter(walk, a, candidates);
    test(walk, candidates, x, a, counters, f);
  }

  /// Queries that are under way at once in a batch.
  static constexpr std::size_t kBatch = 16;

  /// `visit` for each of at most kBatch points, side by side: while one waits for memory, the others go on. The visitor
  /// of points[i] is visitors[i]. Steps are those of the visits.
  template <class Counters, class Visitors>
  void visit_batch(std::span<const SurfacePoint> points, float a, Counters& counters,
                   Visitors visitors) noexcept {
    const std::size_t n = points.size();
    if constexpr (NodeLock::kOn) {  // one after the other: locks of two visits are in no order
      for (std::size_t i = 0; i < n; ++i) visit(points[i], a, counters, visitors[i]);
      return;
    }
    std::array<Walk, kBatch> walks;
    std::array<Candidates, kBatch> candidates;
    for (std::size_t i = 0; i < n; ++i) walks[i] = start(points[i]);
    const std::uint32_t levels = cells_.levels_in_use();
    for (std::size_t i = 0; i < n; ++i) enter(walks[i], levels);
    for (unsigned under_way = (1u << n) - 1; under_way != 0;) {
      for (unsigned rest = under_way; rest != 0; rest &= rest - 1) {
        const auto i = static_cast<unsigned>(std::countr_zero(rest));
        if (!step(walks[i])) under_way &= ~(1u << i);
      }
    }
    for (std::size_t i = 0; i < n; ++i) look(walks[i], candidates[i]);
    for (std::size_t i = 0; i < n; ++i) {
      filter(walks[i], a, candidates[i]);
      prefetch_records(candidates[i]);
    }
    for (std::size_t i = 0; i < n; ++i) test(walks[i], candidates[i], points[i], a, counters, visitors[i]);
  }

  /// f(Record&) -> UpdateResult for every record, in parallel over the table. Quiescent.
  template <class F>
  void update(F&& f) {
    std::mutex mutex;
    const std::size_t freed_before = freed_.size();
    parallel_chunks(table_.end() - 1, kUpdateGrain, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first + 1; i <= last; ++i) {
        Stored& s = at(static_cast<UnitIndex>(i));
        if (is_empty(s) || f(s.record) == UpdateResult::keep) continue;
        s.mark.word.store(0, std::memory_order_relaxed);  // relaxed: quiescent, as all here
        const std::scoped_lock lock(mutex);
        freed_.push_back(static_cast<UnitIndex>(i));
      }
    });
    if (freed_.size() == freed_before) return;
    const auto taken = static_cast<std::ptrdiff_t>(next_freed_.load(std::memory_order_relaxed));
    freed_.erase(freed_.begin(), freed_.begin() + std::min(taken, static_cast<std::ptrdiff_t>(freed_before)));
    next_freed_.store(0, std::memory_order_relaxed);
    cells_.for_each_cell([this](Cell& c) { forget_dropped(c); });
  }

  /// f(const Record&) for every record. Quiescent.
  template <class F>
  void for_each(F&& f) const {
    for (UnitIndex i = 1; i < table_.end(); ++i) {
      if (!is_empty(at(i))) f(static_cast<const Record&>(at(i).record));
    }
  }

  /// Forgets everything. Quiescent; workspaces must be made anew.
  void clear() {
    cells_.reset();
    table_.reset();
    list_.reset();
    marks_.clear();
    freed_.clear();
    next_freed_.store(0, std::memory_order_relaxed);  // relaxed: quiescent
  }

  /// Records that still fit for certain, whatever their places and whichever sessions insert them. Quiescent.
  std::uint32_t room() const noexcept {
    const auto records = [this](std::uint64_t left, std::uint64_t idle, std::uint64_t worst) {
      return left > sessions_ * idle ? (left - sessions_ * idle) / worst : 0;
    };
    const std::uint64_t freed = freed_.size();
    const std::uint64_t reusable = freed - std::min(next_freed_.load(std::memory_order_relaxed), freed);
    const std::uint64_t fit = std::min({cells_.room(), records(table_.left() + reusable, kIdlePlaces, 1),
                                        records(list_.units_left(), List::kIdleUnits, kWorstListUnits)});
    return static_cast<std::uint32_t>(std::min<std::uint64_t>(fit, UINT32_MAX));
  }

  /// Takes and touches memory for about n inserts of one session.
  void prefault(Workspace& workspace, std::uint32_t n) noexcept {
    cells_.prefault(workspace.cells_, n);
    workspace.table_.prefault(table_, n, sizeof(Stored));
  }
  /// Touches memory for about n inserts behind `offset` others. Quiescent.
  void touch(std::uint32_t offset, std::uint32_t n) noexcept {
    cells_.touch(offset, n);
    table_.touch(offset, n);
  }

  /// Bytes that the structure has whatever is in it.
  std::size_t fixed_bytes() const noexcept { return cells_.fixed_bytes() + regions_.bytes(); }

  /// Bytes that `workspace` has allocated.
  static std::size_t bytes(const Workspace& workspace) noexcept {
    return Cells::bytes(workspace.cells_) + workspace.table_.units_used() * sizeof(Stored) +
           List::bytes(workspace.list_);
  }

 private:
  // What is filled of a cell's further strips, as a rule.
  static constexpr std::size_t kHintedBytes = (kCellStrips - 1) * kStripWords * sizeof(std::uint32_t) / 3 * 2;

  // A record may stay as a guest in a cell up to so many levels above its own that has fewer lanes than that: where
  // records are few or of many sizes, as at edges, that saves cells and copies.
  static constexpr int kGuestLevels = 2;
  static constexpr std::uint32_t kGuestLanes = kStripLanes;

  // Address space over what the capacity can need, for nodes that dropped records leave behind (see keep_room).
  static constexpr std::uint64_t kSpareRoom = 2;
  static constexpr std::uint32_t kTablePiece = 64;
  // What a record can need of lists at worst: they are used only where many records are, and take less for each.
  static constexpr std::uint64_t kWorstListUnits = 32;
  static constexpr std::size_t kUpdateGrain = 1024;

  // What a session may hold without a record in it: the rest of two pieces, and spares.
  static constexpr std::uint64_t kIdlePlaces = 2 * kTablePiece + kFreedBatch + 1;

  Stored& at(UnitIndex place) const noexcept { return *std::launder(static_cast<Stored*>(table_.at(place))); }
  static bool is_empty(const Stored& s) noexcept {
    return s.mark.word.load(std::memory_order_relaxed) == 0;  // relaxed: quiescent
  }

  /// Whether large pages are worth the time it takes to clear one: the memory of so many records is several of them.
  static bool is_large(const CacheConfig& config) noexcept { return config.capacity > 1u << 16; }

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

  static constexpr std::uint32_t kMostPath = kPackedLevels + 1;

  /// A query on its way, and the cells on its path.
  struct Walk {
    GridPoint u;
    glm::vec3 p;  // grid units
    [[no_unique_address]] typename Marks::Moment moment;
    UnitIndex below;  // the node to go to
    int level;        // of its children
    std::uint32_t cells;
    std::array<Cell*, kMostPath> cell;
    std::array<int, kMostPath> cell_level;
  };

  /// What the kernels read and write, and so not of the walk, which else would have to stay in memory: the lanes that
  /// the cells' masks showed, and the places of the records that lanes were kept of.
  struct Candidates {
    std::uint32_t kept;
    std::array<LaneRun, kMostPath> lanes;
    std::array<UnitIndex, kMostPath * kCellLanes + kStripLanes> places;
  };

  UnitIndex take_place(Workspace& w) noexcept {
    if (w.spare_place_ != 0) return std::exchange(w.spare_place_, 0);
    // Relaxed, as in Arena::take.
    if (w.freed_left_ == 0 && next_freed_.load(std::memory_order_relaxed) < freed_.size()) {
      const std::uint64_t first = next_freed_.fetch_add(kFreedBatch, std::memory_order_relaxed);
      const std::uint64_t end = std::min<std::uint64_t>(first + kFreedBatch, freed_.size());
      for (std::uint64_t i = first; i < end; ++i) w.freed_[w.freed_left_++] = freed_[i];
    }
    if (w.freed_left_ != 0) return w.freed_[--w.freed_left_];
    return w.table_.allocate(table_, 1, kTablePiece);
  }

  /// The coarsest level at which a cell may take a record: cells that take guests are of the grid or below.
  int level_from(const PackedReach& reach) const noexcept {
    return std::max(std::min(reach.level(), cells_.grid_level()), reach.level() - kGuestLevels);
  }

  /// Reserves a copy in every cell that the record is to be in; false if a pool is used up. `level`: from which on
  /// cells may take it.
  template <class Counters>
  bool reserve(Insertion& insertion, int level, Counters& counters) noexcept {
    const PackedReach& reach = insertion.reach;
    const int from = std::min(level, cells_.grid_level());
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
    auto* entry = cells_.entry_for(insertion.workspace.cells_, where, counters);
    return entry != nullptr && reserve(insertion, where, level, entry->branch, &entry->more, counters);
  }

  /// The same of any cell. `hint`: null below the grid.
  template <class Counters>
  bool reserve(Insertion& insertion, const PackedCell& where, int level, Branch& branch,
               Atomic<UnitIndex>* hint, Counters& counters) noexcept {
    const PackedReach& reach = insertion.reach;
    Workspace& workspace = insertion.workspace;
    if (where.level >= level) {
      if (where.level < cells_.grid_level()) cells_.note_level(where.level);
      Cell* c = cells_.cell_for(workspace.cells_, branch, counters);
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
          copy.words = cells_.lane_for(workspace.cells_, *c, copy.lane, hint, counters);
          ++insertion.reserved;
          return copy.words != nullptr;
        }
      }
      // A record that covers the cell is in all of its children, and nothing would be gained by going there.
      if (where.level > reach.level() || where.level == kPackedLevels || reach.reach() > where.side()) {
        copy.words = nullptr;
        copy.rest = list_.reserve(workspace.list_, c->rest, counters);
        ++insertion.reserved;
        return static_cast<bool>(copy.rest);
      }
    }
    typename Cells::Node* below = nullptr;
    if (where.level >= cells_.grid_level()) {
      below = cells_.node_for(workspace.cells_, branch, counters);
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
    if (copy.words == nullptr) return list_.publish(copy.rest, place);
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

  /// What is known of a query before anything is read, but for its moment.
  Walk start(const SurfacePoint& x) noexcept {
    Walk walk;
    walk.p = addressing_.to_grid(x.p);
    walk.u = OctreeAddressing::quantise_grid(walk.p);
    walk.moment = marks_.moment();
    walk.cells = 0;
    return walk;
  }

  /// Takes the grid's cells up. `levels`: in use, read after the query's moment, or its snapshot would lack records
  /// whose level was new.
  void enter(Walk& walk, std::uint32_t levels) noexcept {
    for (std::uint32_t rest = levels; rest != 0; rest &= rest - 1) {
      const int level = std::countr_zero(rest);
      go_by(walk, cells_.entry_at(level, walk.u), level);
    }
    const auto& finest = cells_.finest_entry_at(walk.u);
    go_by(walk, finest, cells_.grid_level());
    walk.below = finest.branch.node.load(std::memory_order_acquire /* P2 */);
    walk.level = cells_.grid_level() + 1;
    __builtin_prefetch(&cells_.node(walk.below));
  }

  /// Takes a cell of the grid up.
  void go_by(Walk& walk, const typename Cells::Entry& entry, int level) noexcept {
    take_up(walk, entry.branch, level);
    // Unit 0 of a pool is nobody's, and harmless to prefetch.
    prefetch(cells_.strips(entry.more.load(std::memory_order_relaxed)), kHintedBytes);
  }

  /// Puts a branch's cell on the path if it is there.
  void take_up(Walk& walk, const Branch& branch, int level) noexcept {
    const UnitIndex here = branch.cell.load(std::memory_order_acquire /* P2 */);
    // No branch on what cannot be foreseen, here and below.
    Cell& c = cells_.cell(here);
    prefetch(&c, sizeof c);
    walk.cell[walk.cells] = &c;
    walk.cell_level[walk.cells] = level;
    walk.cells += here != 0;
  }

  /// Goes one level down; false at the end of the path.
  bool step(Walk& walk) noexcept {
    if (walk.below == 0) return false;
    const Branch& branch = cells_.node(walk.below).child[OctreeAddressing::octant(walk.u, walk.level - 1)];
    take_up(walk, branch, walk.level++);
    walk.below = branch.node.load(std::memory_order_acquire /* P2 */);
    __builtin_prefetch(&cells_.node(walk.below));
    return true;
  }

  /// Reads which lanes the cells have.
  void look(const Walk& walk, Candidates& candidates) noexcept {
    for (std::uint32_t i = 0; i < walk.cells; ++i) {
      Cell& c = *walk.cell[i];
      LaneRun& lanes = candidates.lanes[i];
      lanes.at = make_lane_point(walk.p, walk.u, walk.cell_level[i]);
      lanes.mask = c.mask.load(std::memory_order_acquire /* P6 */);
      lanes.first = c.strip;
      // Relaxed: a mask that shows one of its lanes was acquired (P6).
      const UnitIndex more = c.more.load(std::memory_order_relaxed);
      lanes.more = cells_.strips(more);
      Sync::extent(static_cast<std::uint32_t>(std::popcount(lanes.mask)));
      for (std::uint64_t rest = lanes.mask; rest != 0; rest &= rest - 1) {
        const std::uint32_t* word = cells_.lane(c, more, static_cast<std::uint32_t>(std::countr_zero(rest)));
        Sync::reads(word, sizeof *word);
        Sync::reads(word + kStripLanes, sizeof *word);
      }
    }
  }

  /// Collects the places of the records that lanes are kept of, and behind them, to whole groups, the first once more:
  /// how many there are cannot be foreseen, so that what follows goes by groups.
  void filter(const Walk& walk, float a, Candidates& candidates) noexcept {
    auto& [kept, lanes, places] = candidates;
    kept = kernels_.filter(make_lane_share(a, a_max_), {kStripWords, kStripLanes}, lanes.data(), walk.cells,
                           places.data());
    if (kept != 0) std::fill_n(places.begin() + kept, kWeighed, places[0]);
  }

  void prefetch_records(const Candidates& candidates) noexcept {
    for (std::uint32_t i = 0; i < candidates.kept; i += kWeighed) {
#pragma GCC unroll kWeighed
      for (std::uint32_t k = 0; k < kWeighed; ++k) {
        const Stored* stored = &at(candidates.places[i + k]);
        __builtin_prefetch(stored);
        __builtin_prefetch(reinterpret_cast<const std::byte*>(stored + 1) - 1);
      }
    }
  }

  static void prefetch(const void* from, std::size_t bytes) noexcept {
    for (std::size_t line = 0; line < bytes; line += kLineBytes)
      __builtin_prefetch(static_cast<const std::byte*>(from) + line);
  }

  /// Tests records exactly and calls f for those that are valid.
  template <class Counters, class F>
  void test(const Walk& walk, const Candidates& candidates, const SurfacePoint& x, float a,
            Counters& counters, F&& f) noexcept {
    ShownRecords records;
    for (std::uint32_t i = 0; i < candidates.kept; i += kWeighed) {
      const UnitIndex* places = candidates.places.data() + i;
      std::uint32_t n = std::min(candidates.kept - i, kWeighed);
      // A look that may write is not made for nothing.
      const std::uint32_t looks = Visibility::kIsSnapshot ? n : kWeighed;
      std::array<Stored*, kWeighed> stored;  // nobody else's, so that looks leave it in registers
#pragma GCC unroll kWeighed
      for (std::uint32_t k = 0; k < kWeighed; ++k) {
        stored[k] = &at(places[k]);
        records[k] = &stored[k]->record;
      }
      std::array<bool, kWeighed> shows;
      bool all = true;
#pragma GCC unroll kWeighed
      for (std::uint32_t k = 0; k < looks; ++k) all &= shows[k] = marks_.shows(stored[k]->mark, walk.moment);
      if (!all) [[unlikely]] {
        const std::uint32_t kept = std::exchange(n, 0);
        for (std::uint32_t k = 0; k < kept; ++k) {
          records[n] = records[k];
          n += shows[k];
        }
        if (n == 0) continue;
      }
      show(records, n, x, a, counters, f);
    }
    for (std::uint32_t i = 0; i < walk.cells; ++i) {
      const auto& list = walk.cell[i]->rest;
      if (const std::uint32_t extent = list_.extent(list); extent != 0) [[unlikely]]
        test_list(list, extent, walk.moment, x, a, counters, f);
    }
  }

  /// The same of the first `extent` records of a list. Apart, since most lists are empty.
  template <class Counters, class F>
  [[gnu::noinline]] void test_list(const typename List::List& list, std::uint32_t extent,
                                   typename Marks::Moment moment, const SurfacePoint& x, float a,
                                   Counters& counters, F&& f) noexcept {
    list_.visit(list, extent, list_.moment(), [&](UnitIndex place) noexcept {
      Stored& stored = at(place);
      if (!marks_.shows(stored.mark, moment)) return;
      ShownRecords records;
      records.fill(&stored.record);
      show(records, 1, x, a, counters, f);
    });
  }

  template <class Counters, class F>
  void show(const ShownRecords& records, std::uint32_t n, const SurfacePoint& x, float a, Counters& counters,
            F&& f) noexcept {
    for (std::uint32_t k = 0; k < n; ++k) Sync::reads(records[k], sizeof(Record));
    const std::uint32_t valid = show_valid(kernels_, x, a, records, n, f);
    counters.template add<&Counts::records_read>(n);
    counters.template add<&Counts::records_valid>(valid);
  }

  /// Takes the copies of dropped records out of a cell; what is kept moves up. Quiescent.
  void forget_dropped(Cell& c) {
    // All orders relaxed: quiescent; the caller's synchronisation publishes.
    const UnitIndex more = c.more.load(std::memory_order_relaxed);
    const auto lane_at = [&](std::uint32_t lane) { return cells_.lane(c, more, lane); };
    std::uint64_t mask = 0;
    std::uint32_t kept = 0;
    // Where strips could not be had, no lane is published, so that none is asked for.
    for (std::uint64_t rest = c.mask.load(std::memory_order_relaxed); rest != 0; rest &= rest - 1) {
      const std::uint32_t* from = lane_at(static_cast<std::uint32_t>(std::countr_zero(rest)));
      const UnitIndex place = from[kStripLanes];
      if (is_empty(at(place))) continue;
      std::uint32_t* to = lane_at(kept);
      to[0] = from[0];
      to[kStripLanes] = place;
      mask |= std::uint64_t{1} << kept++;
    }
    c.mask.store(mask, std::memory_order_relaxed);
    c.count.store(kept, std::memory_order_relaxed);
    list_.update(c.rest, [this](UnitIndex& place) {
      return is_empty(at(place)) ? UpdateResult::drop : UpdateResult::keep;
    });
  }

  OctreeAddressing addressing_;
  float a_max_;
  LaneKernels kernels_ = Lanes::best();
  std::uint64_t sessions_;
  Cells cells_;
  [[no_unique_address]] Regions regions_;
  Table table_;
  List list_;
  [[no_unique_address]] Marks marks_;
  // Places that dropped records left. Changed at rest only; sessions take batches of it, as of an arena.
  std::vector<UnitIndex> freed_;
  alignas(kNoSharing) typename SharedSync::template Atomic<std::uint64_t> next_freed_{0};
};

}  // namespace icbench
