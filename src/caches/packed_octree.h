// The packed octree: every record is stored once, in a table, and known in every cell that its validity region reaches
// (caches/packed_reach.h); a query walks one path from the root and tests the records of the cells on it.
//
// Use: this is a *structure*. Packed<PlainSync> is the sequential one that locks and thread-local copies wrap;
// Packed<StdSync> is the wait-free cache, Packed<StdSync, Snapshot> the linearizable one. All are this code.
//
// Memory. A node is one cache line: its eight children, of each the node below and the cell itself, if they are there.
// A cell, two lines, has the mask of its lanes, their count, the first 8 of them, where further chunks of 16 and 40
// are, and a list for what does not fit. A lane is 12 bytes of a record (caches/packed_lanes.h), tested many at once; a
// record is 44 bytes and its mark, read only when one of its lanes was kept. Cells without records and nodes without
// cells below are not there, so a query waits for memory once a level, then for the cells all at once, then for the
// records.
//
// Hot cells. A record that finds its cell full goes one level down, into the children it reaches; where those are full
// as well, into their lists. A second split would not pay: a child is at most 2.5 reaches wide, so most of what is
// listed there is valid nearby, and every level down makes two to four times the copies. The lists hold indices, and
// their records are tested one by one.
//
// What an insert does, step by step, and what others see if it stops there for ever
//
//   1  takes a place in the table                     the place is not used; nobody sees it
//   2  in every cell: installs missing nodes, cells and chunks, reserves a lane or a place in the list
//                                                     the lanes stay out of the mask, the places unmarked: nobody reads them
//   3  writes the record, then lane by lane: words, mask bit
//                                                     queries find lanes whose record's mark is empty, and pass on
//   4  marks the record (caches/visibility.h)         it is there, in all cells at once
//
// If memory runs out in 1 or 2, what was reserved stays empty, the place goes to the session's next insert, and nothing
// was linked; 3 and 4 cannot fail. Lanes handed to failed inserts are lost until records are dropped or cleared, nodes
// without records until `clear`.
//
// Publication pairs (StdSync); P1, P4, P5 are those of caches/visibility.h, P3 that of the list (caches/slot_list.h)
//
//   P1  insert: mark store release -> visit: mark load acquire; publishes the record. The query acquired the lane first;
//       a record that is seen has all its lanes published before, so that no later query misses it anywhere.
//
//   P2  install: CAS release of a child's, cell's or chunk's word -> descend, step: its load acquire; publishes the node,
//       cell or chunk, and with it the zeroing of its memory by a clear in another thread
//
//   P6  insert: mask fetch_add release -> visit: mask load acquire; publishes the lane's words, and the chunk, which
//       whoever wrote the lane had acquired. A fetch_add by another insert is in its release sequence.
//
// Progress (StdSync), in steps on shared memory; L = kPackedLevels = 13. Every loop is over levels, children, chunks or
// an extent read once; nothing is retried.
//
//   insert  wait-free: at most 8 paths of L nodes, 27 cells at their own level or one below, and a node above each of these;
//           each that is missing costs a load, an allocation (4 steps) and a CAS, whose loser adopts the winner's; a lane
//           in each cell (9 steps), or a look at a full one (2) and a place in a list (insert_steps).
//
//   visit   wait-free: two words a level; of each cell on the path the mask, two chunks and the list's count; then the lanes
//           and places that these showed, once (list_steps). A cell counts as two lists, its lanes and the rest.
//
// Linearization (StdSync): by Visibility, as for the Ward tree: a record appears everywhere at once, by its mark, so
// visits are per-record linearizable; a snapshot is linearizable. For P4, a record's lanes are published before its
// tick is drawn.
#pragma once

#include <mutex>

#include "caches/packed_filter.h"
#include "caches/packed_lanes.h"
#include "caches/packed_reach.h"
#include "caches/slot_list.h"
#include "core/cache.h"

namespace icbench {

template <class Sync, class Visibility = AtFirstSight, class Lanes = SimdLanes>
class Packed {
  template <class T>
  using Atomic = typename Sync::template Atomic<T>;
  using Marks = typename Visibility::template In<Sync>;
  using List = SlotPool<Sync, Sync, AtFirstSight, UnitIndex>;

  static constexpr std::size_t kNodeBytes = 64, kCellBytes = 128, kLineBytes = 64;
  static constexpr std::uint32_t kFreedBatch = 16;
  struct Stored {
    typename Marks::Mark mark;
    Record record;
  };
  using Nodes = Arena<Sync, kNodeBytes>;
  using Cells = Arena<Sync, kCellBytes>;
  using Chunks = Arena<Sync, kLineBytes>;
  using Table = Arena<Sync, sizeof(Stored)>;

 public:
  using SharedSync = Sync;
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
    if (!Sync::kConcurrent) return wait_free("packed_sequential", "none", Consistency::linearizable, true);
    if (Visibility::kIsSnapshot)
      return wait_free("packed_wait_free_snapshot", "wait_free_snapshot", Consistency::linearizable, false);
    return wait_free("packed_wait_free", "wait_free", Consistency::per_record_linearizable, false);
  }();

  /// Cells a record is known in: three an axis at most, below a full one.
  static constexpr std::uint32_t kMostCopies = 27;
  /// Of these at a record's own level.
  static constexpr std::uint32_t kMostCells = 8;

  // Step bounds (caches/session.h).
  static constexpr std::string_view kInsertBound =
                                        Visibility::kIsSnapshot ? "48 level + 2665" : "48 level + 2663",
                                    kVisitBound = Visibility::kIsSnapshot
                                                      ? "29 + per list (5 + links + 5 slots)"
                                                      : "28 + per list (5 + links + 2 slots)";
  static constexpr std::uint32_t kVisitSteps = 2 * (kPackedLevels + 1) + Marks::kMomentSteps;
  static constexpr std::uint32_t kMostLists = 2 * (kPackedLevels + 1);

  /// Of an insert at `level`.
  static constexpr std::uint32_t insert_steps(int level) noexcept {
    constexpr std::uint32_t kDescendSteps = 1 + ArenaCursor<Nodes>::kAllocateSteps + 1;
    constexpr std::uint32_t kLaneSteps = 2 + kDescendSteps + 1;
    constexpr std::uint32_t kTakeSteps = 2 + ArenaCursor<Table>::kAllocateSteps;
    // Of a cell: its word, the node above it, a lane, and if that was in vain a place in the list.
    constexpr std::uint32_t kCopySteps = 2 * kDescendSteps + kLaneSteps + List::kAppendSteps;
    static_assert(kTakeSteps + kMostCells * (kDescendSteps + 2) + kMostCopies * kCopySteps +
                      Marks::kPublishSteps ==
                  (Visibility::kIsSnapshot ? 2665 : 2663));
    return kTakeSteps + static_cast<std::uint32_t>(level) * kMostCells * kDescendSteps +
           kMostCells * (kDescendSteps + 2) + kMostCopies * kCopySteps + Marks::kPublishSteps;
  }
  std::uint32_t insert_steps(const Record& r) const noexcept {
    return insert_steps(PackedReach::level_of(addressing_, r, a_max_));
  }

  /// Of the lanes of a cell on a visit and what else there is to read in it, or of its list.
  static constexpr std::uint64_t list_steps(std::uint32_t extent) noexcept {
    return 1 + kChunks + List::visit_steps(extent) + std::uint64_t{extent} * Marks::kShowsSteps;
  }

  /// A session's own allocation state.
  class Workspace {
    friend Packed;
    ArenaCursor<Nodes> nodes_;
    ArenaCursor<Cells> cells_;
    ArenaCursor<Chunks> chunks_;
    ArenaCursor<Table> table_;
    typename List::Workspace list_;
    // Set aside by lost races; zero, as allocated.
    UnitIndex spare_node_ = 0, spare_cell_ = 0;
    std::array<UnitIndex, kChunks> spare_chunks_{};
    std::array<UnitIndex, kFreedBatch> freed_{};  // places that dropped records left, this session's
    std::uint32_t freed_left_ = 0;
    UnitIndex spare_place_ = 0;  // of an insert that failed
  };

  explicit Packed(const CacheConfig& config)
      : addressing_(config.bounds),
        a_max_(config.a_max),
        sessions_(config.max_sessions),
        nodes_(kSpareRoom * config.capacity * kWorstNodes + sessions_ * kIdleNodes + 1, is_large(config)),
        cells_(kSpareRoom * config.capacity * kMostCells + sessions_ * kIdleCells + 1, is_large(config)),
        chunks_(kSpareRoom * config.capacity * kWorstLines + sessions_ * kIdleLines, is_large(config)),
        table_(config.capacity + 2 * sessions_ * kIdlePlaces, is_large(config)),
        list_(kSpareRoom * config.capacity * kWorstListUnits + sessions_ * List::kIdleUnits) {
    plant();
  }

  /// Stores `r`; false if a pool is used up, and then no query ever sees anything of it.
  template <class Counters>
  bool insert(Workspace& workspace, const Record& r, Counters& counters) noexcept {
    const UnitIndex place = take_place(workspace);
    if (place == 0) return false;
    const PackedReach reach(addressing_, r, a_max_);
    Insertion insertion(workspace, reach);
    if (!reserve(insertion, counters)) {
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
    Walk walk;
    begin(walk, x, a);
    while (step(walk)) {
    }
    look(walk);
    filter(walk);
    test(walk, x, a, counters, f);
  }

  /// Queries that are under way at once in a batch.
  static constexpr std::size_t kBatch = 8;

  /// `visit` for each of at most kBatch points, side by side: while one waits for memory, the others go on. Calls
  /// f(i, record, weight), point by point. Steps are those of the visits.
  template <class Counters, class F>
  void visit_batch(std::span<const SurfacePoint> points, float a, Counters& counters, F&& f) noexcept {
    std::array<Walk, kBatch> walks;
    const std::size_t n = points.size();
    for (std::size_t i = 0; i < n; ++i) begin(walks[i], points[i], a);
    for (unsigned under_way = (1u << n) - 1; under_way != 0;) {
      for (unsigned rest = under_way; rest != 0; rest &= rest - 1) {
        const auto i = static_cast<unsigned>(std::countr_zero(rest));
        if (!step(walks[i])) under_way &= ~(1u << i);
      }
    }
    for (std::size_t i = 0; i < n; ++i) look(walks[i]);
    for (std::size_t i = 0; i < n; ++i) {
      filter(walks[i]);
      for (std::uint32_t k = 0; k < walks[i].kept; ++k) prefetch(&at(walks[i].places[k]), sizeof(Stored));
    }
    for (std::size_t i = 0; i < n; ++i) {
      const auto shown = [&](const Record& r, float weight) noexcept { f(i, r, weight); };
      test(walks[i], points[i], a, counters, shown);
    }
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
    parallel_chunks(cells_.end() - 1, kUpdateGrain, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first + 1; i <= last; ++i) forget_dropped(cell(static_cast<UnitIndex>(i)));
    });
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
    nodes_.reset();
    cells_.reset();
    chunks_.reset();
    table_.reset();
    list_.reset();
    marks_.clear();
    freed_.clear();
    next_freed_.store(0, std::memory_order_relaxed);  // relaxed: quiescent
    plant();
  }

  /// Records that still fit for certain, whatever their places and whichever sessions insert them. Quiescent.
  std::uint32_t room() const noexcept {
    const auto records = [this](std::uint64_t left, std::uint64_t idle, std::uint64_t worst) {
      return left > sessions_ * idle ? (left - sessions_ * idle) / worst : 0;
    };
    const std::uint64_t freed = freed_.size();
    const std::uint64_t reusable = freed - std::min(next_freed_.load(std::memory_order_relaxed), freed);
    const std::uint64_t fit = std::min(
        {records(nodes_.left(), kIdleNodes, kWorstNodes), records(cells_.left(), kIdleCells, kMostCells),
         records(chunks_.left(), kIdleLines, kWorstLines), records(table_.left() + reusable, kIdlePlaces, 1),
         records(list_.units_left(), List::kIdleUnits, kWorstListUnits)});
    return static_cast<std::uint32_t>(std::min<std::uint64_t>(fit, UINT32_MAX));
  }

  /// Takes and touches memory for about n inserts of one session.
  void prefault(Workspace& workspace, std::uint32_t n) noexcept {
    workspace.nodes_.prefault(nodes_, n / 8, kNodeBytes);
    workspace.cells_.prefault(cells_, n / 3, kCellBytes);
    workspace.chunks_.prefault(chunks_, n / 2, kLineBytes);
    workspace.table_.prefault(table_, n, sizeof(Stored));
  }
  /// Touches memory for about n inserts behind `offset` others. Quiescent.
  void touch(std::uint32_t offset, std::uint32_t n) noexcept {
    nodes_.touch(offset / 8, n / 8);
    cells_.touch(offset / 3, n / 3);
    chunks_.touch(offset / 2, n / 2);
    table_.touch(offset, n);
  }

  /// Bytes that `workspace` has allocated.
  static std::size_t bytes(const Workspace& workspace) noexcept {
    return workspace.nodes_.units_used() * kNodeBytes + workspace.cells_.units_used() * kCellBytes +
           workspace.chunks_.units_used() * kLineBytes + workspace.table_.units_used() * sizeof(Stored) +
           List::bytes(workspace.list_);
  }

 private:
  // Invariant: words that hold an index go from 0 to it once between clears.
  struct Branch {
    Atomic<UnitIndex> node;  // what is below
    Atomic<UnitIndex> cell;  // the records known here
  };
  struct alignas(kNodeBytes) Node {
    Branch child[8];
  };
  static_assert(sizeof(Node) == kNodeBytes, "a node is one cache line");

  // Invariant: lanes 0 .. count - 1 have been handed out, each to one insert; the mask has bits of these only, and none
  // goes out between quiescent points.
  struct alignas(kLineBytes) Cell {
    Atomic<std::uint64_t> mask;
    typename List::List rest;
    Atomic<std::uint32_t> count;
    Atomic<UnitIndex> chunk[kChunks - 1];     // the second and third
    std::uint32_t lanes[3 * chunk_lanes(0)];  // the first
  };
  static_assert(sizeof(Cell) == kCellBytes, "a cell and its first lanes are two cache lines");

  // Address space over what the capacity can need, for nodes that dropped records leave behind (see keep_room).
  static constexpr std::uint64_t kSpareRoom = 2;
  static constexpr std::uint32_t kNodePiece = 64, kCellPiece = 16, kChunkPiece = 64, kTablePiece = 64;
  // What a record can need at worst: eight paths, and a cell at the end of each. Further chunks, lower cells, and lists
  // are used only where many records are, and take less for each.
  static constexpr std::uint64_t kWorstNodes = kMostCells * kPackedLevels, kWorstLines = 8,
                                 kWorstListUnits = 32;
  static constexpr std::size_t kUpdateGrain = 1024;

  static constexpr std::uint32_t chunk_lines(int chunk) noexcept {
    return (chunk_lanes(chunk) * 3 * sizeof(std::uint32_t) + kLineBytes - 1) / kLineBytes;
  }
  // What a session may hold without a record in it: the rest of two pieces, and spares.
  static constexpr std::uint64_t kIdleNodes = 2 * kNodePiece + 1, kIdleCells = 2 * kCellPiece + 1,
                                 kIdleLines = 2 * kChunkPiece + chunk_lines(1) + chunk_lines(2),
                                 kIdlePlaces = 2 * kTablePiece + kFreedBatch + 1;

  // Nodes and cells are never constructed: zeroed memory is an empty one by the requirement on Sync (core/sync.h).
  Node& node(UnitIndex i) const noexcept { return *std::launder(static_cast<Node*>(nodes_.at(i))); }
  Cell& cell(UnitIndex i) const noexcept { return *std::launder(static_cast<Cell*>(cells_.at(i))); }
  Stored& at(UnitIndex place) const noexcept { return *std::launder(static_cast<Stored*>(table_.at(place))); }
  std::uint32_t* words(UnitIndex chunk) const noexcept {
    return std::launder(static_cast<std::uint32_t*>(chunks_.at(chunk)));
  }
  static bool is_empty(const Stored& s) noexcept {
    return s.mark.word.load(std::memory_order_relaxed) == 0;  // relaxed: quiescent
  }

  /// Whether large pages are worth the time it takes to clear one: the memory of so many records is several of them.
  static bool is_large(const CacheConfig& config) noexcept { return config.capacity > 1u << 16; }

  /// The root's node and cell. Quiescent.
  void plant() noexcept {
    root_.node.store(nodes_.take(1), std::memory_order_relaxed);
    root_.cell.store(cells_.take(1), std::memory_order_relaxed);
  }

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

  /// A query on its way: the cells on its path, what their masks showed, and the records that lanes were kept of.
  static constexpr std::uint32_t kMostPath = kPackedLevels + 1;
  struct Walk {
    GridPoint u;
    glm::vec3 p;  // grid units
    LaneQuery q;
    [[no_unique_address]] typename Marks::Moment moment;
    const Branch* next;
    int level;
    std::uint32_t cells, strips, kept;
    std::array<Cell*, kMostPath> cell;
    std::array<int, kMostPath> cell_level;
    std::array<LanePoint, kMostPath> point;
    std::array<LaneStrip, kMostPath * kCellStrips> strip;
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

  /// Reserves a copy in every cell that the record reaches; false if a pool is used up.
  template <class Counters>
  bool reserve(Insertion& insertion, Counters& counters) noexcept {
    return reserve(insertion, root_, {0, 0, 0, 0}, counters);
  }

  /// The same of `where` and what is below.
  template <class Counters>
  bool reserve(Insertion& insertion, Branch& branch, const PackedCell& where, Counters& counters) noexcept {
    const PackedReach& reach = insertion.reach;
    Workspace& workspace = insertion.workspace;
    if (where.level >= reach.level()) {
      const UnitIndex here =
          follow(branch.cell, cells_, 1, workspace.cells_, kCellPiece, workspace.spare_cell_, counters);
      if (here == 0) return false;
      Cell& c = cell(here);
      Copy& copy = insertion.copies[insertion.reserved];
      copy.where = where;
      copy.cell = &c;
      // Relaxed: the count only fixes places; what lies there is published by P6. The load keeps it from wrapping
      // round.
      if (c.count.load(std::memory_order_relaxed) < kCellLanes) {
        copy.lane = c.count.fetch_add(1, std::memory_order_relaxed);
        if (copy.lane < kCellLanes) {
          copy.words = chunk_for(workspace, c, chunk_of(copy.lane), counters);
          ++insertion.reserved;
          return copy.words != nullptr;
        }
      }
      // A record that covers the cell is in all of its children, and nothing would be gained by going there.
      if (where.level > reach.level() || where.level == kPackedLevels || reach.reach() > where.side()) {
        copy.words = nullptr;
        copy.rest = list_.reserve(workspace.list_, c.rest, counters);
        ++insertion.reserved;
        return static_cast<bool>(copy.rest);
      }
    }
    const UnitIndex below =
        follow(branch.node, nodes_, 1, workspace.nodes_, kNodePiece, workspace.spare_node_, counters);
    if (below == 0) return false;
    Node& n = node(below);
    for (unsigned rest = reach.children(where); rest != 0; rest &= rest - 1) {
      const auto i = static_cast<unsigned>(std::countr_zero(rest));
      const PackedCell child = where.child(i);
      if (reach.touches(child) && !reserve(insertion, n.child[i], child, counters)) return false;
    }
    return true;
  }

  /// What `word` points at, installed if missing; 0 if the pool is used up.
  template <class Pool, class Counters>
  UnitIndex follow(Atomic<UnitIndex>& word, Pool& pool, std::uint32_t units, ArenaCursor<Pool>& cursor,
                   std::uint32_t piece, UnitIndex& spare, Counters& counters) noexcept {
    if (const UnitIndex there = word.load(std::memory_order_acquire /* P2 */)) return there;
    UnitIndex fresh = std::exchange(spare, 0);
    if (fresh == 0) {
      fresh = cursor.allocate(pool, units, piece);
      if (fresh == 0) return 0;
      counters.template add<&Counts::nodes_allocated>(1);
    }
    return install<Sync>(word, fresh, spare, counters);
  }

  /// The words of chunk `k` of a cell, installed if missing; null if the pool is used up.
  template <class Counters>
  std::uint32_t* chunk_for(Workspace& workspace, Cell& c, int k, Counters& counters) noexcept {
    if (k == 0) return c.lanes;
    const UnitIndex chunk = follow(c.chunk[k - 1], chunks_, chunk_lines(k), workspace.chunks_, kChunkPiece,
                                   workspace.spare_chunks_[static_cast<std::size_t>(k)], counters);
    return chunk == 0 ? nullptr : words(chunk);
  }

  /// Writes a copy of the record at `place`, and then shows it.
  void publish(const Copy& copy, const PackedReach& reach, UnitIndex place) noexcept {
    if (copy.words == nullptr) return list_.publish(copy.rest, place);
    const Lane lane = make_lane(reach.p(), reach.n(), reach.reach(), copy.where.corner(), copy.where.level);
    const int k = chunk_of(copy.lane);
    std::uint32_t* word = copy.words + (copy.lane - kChunkBegin[static_cast<std::size_t>(k)]);
    for (const std::uint32_t value : {lane.place, lane.shape, place}) {
      Sync::writes(word, sizeof *word);
      *word = value;
      word += chunk_lanes(k);
    }
    // An addition, which no other insert does of this bit, and so as good as an or.
    copy.cell->mask.fetch_add(std::uint64_t{1} << copy.lane, std::memory_order_release /* P6 */);
  }

  void begin(Walk& walk, const SurfacePoint& x, float a) noexcept {
    walk.u = addressing_.quantise(x.p);
    walk.p = addressing_.to_grid(x.p);
    walk.q = make_lane_query(x.n, a, a_max_);
    walk.moment = marks_.moment();
    walk.next = &root_;
    walk.level = 0;
    walk.cells = walk.strips = walk.kept = 0;
  }

  /// Goes one level down; false at the end of the path.
  bool step(Walk& walk) noexcept {
    const int level = walk.level++;
    const UnitIndex below = walk.next->node.load(std::memory_order_acquire /* P2 */);
    const UnitIndex here = walk.next->cell.load(std::memory_order_acquire /* P2 */);
    // No branch on what cannot be foreseen, here and below: unit 0 of a pool is nobody's, and harmless to prefetch.
    Cell& c = cell(here);
    prefetch(&c, kCellBytes);
    walk.cell[walk.cells] = &c;
    walk.cell_level[walk.cells] = level;
    walk.cells += here != 0;
    if (below == 0 || level == kPackedLevels) return false;
    walk.next = &node(below).child[OctreeAddressing::octant(walk.u, level)];
    __builtin_prefetch(walk.next);
    return true;
  }

  /// Reads how far the cells' lanes reach, and lists them.
  void look(Walk& walk) noexcept {
    for (std::uint32_t i = 0; i < walk.cells; ++i) {
      Cell& c = *walk.cell[i];
      const int level = walk.cell_level[i], shift = kMaxLevel - level;
      const PackedCell where{walk.u.x >> shift, walk.u.y >> shift, walk.u.z >> shift, level};
      walk.point[i] = make_lane_point(walk.p, where.corner(), level);
      const std::uint64_t mask = c.mask.load(std::memory_order_acquire /* P6 */);
      Sync::extent(static_cast<std::uint32_t>(std::popcount(mask)));
      for (int k = 0; k < kChunks; ++k) {
        const std::uint32_t size = chunk_lanes(k);
        // Relaxed: the mask that shows one of its lanes was acquired (P6). Without such a lane it may be missing still.
        const std::uint32_t* lanes = k == 0 ? c.lanes : words(c.chunk[k - 1].load(std::memory_order_relaxed));
        if (k != 0) prefetch(lanes, chunk_lines(k) * kLineBytes);
        for (std::uint32_t at_lane = 0; at_lane < size; at_lane += kStripLanes) {
          const std::uint32_t first = kChunkBegin[static_cast<std::size_t>(k)] + at_lane;
          const auto bits =
              static_cast<std::uint32_t>(mask >> first) & ((1u << std::min(kStripLanes, size - at_lane)) - 1);
          walk.strip[walk.strips] = {lanes + at_lane, &walk.point[i], size, bits};
          walk.strips += bits != 0;
          for (std::uint32_t rest = bits; rest != 0; rest &= rest - 1) {
            for (std::uint32_t w = 0; w < 3; ++w)
              Sync::reads(lanes + at_lane + w * size + std::countr_zero(rest), sizeof *lanes);
          }
        }
      }
    }
  }

  /// Collects the places of the records that lanes are kept of.
  void filter(Walk& walk) noexcept {
    walk.kept = filter_(walk.q, walk.strip.data(), walk.strips, walk.places.data());
  }

  static void prefetch(const void* from, std::size_t bytes) noexcept {
    for (std::size_t line = 0; line < bytes; line += kLineBytes)
      __builtin_prefetch(static_cast<const std::byte*>(from) + line);
  }

  /// Tests records exactly and calls f for those that are valid.
  template <class Counters, class F>
  void test(Walk& walk, const SurfacePoint& x, float a, Counters& counters, F&& f) noexcept {
    const auto weigh = [&](UnitIndex place) noexcept {
      Stored& stored = at(place);
      if (!marks_.shows(stored.mark, walk.moment)) return 0.0f;
      Sync::reads(&stored.record, sizeof stored.record);
      counters.template add<&Counts::records_read>(1);
      return likely_split_sphere_weight(x, stored.record, a);
    };
    const auto show = [&](UnitIndex place, float weight) noexcept {
      if (!(weight > 0.0f)) return;
      counters.template add<&Counts::records_valid>(1);
      f(static_cast<const Record&>(at(place).record), weight);
    };
    // Weights of several first, one by the other's side, and then what depends on them.
    constexpr std::uint32_t kAtOnce = 8;
    std::array<float, kAtOnce> weights;
    for (std::uint32_t i = 0; i < walk.kept; i += kAtOnce) {
      const std::uint32_t n = std::min(kAtOnce, walk.kept - i);
      for (std::uint32_t k = 0; k < n; ++k) weights[k] = weigh(walk.places[i + k]);
      for (std::uint32_t k = 0; k < n; ++k) show(walk.places[i + k], weights[k]);
    }
    for (std::uint32_t i = 0; i < walk.cells; ++i)
      list_.visit(walk.cell[i]->rest, list_.moment(),
                  [&](UnitIndex place) noexcept { show(place, weigh(place)); });
  }

  /// Where a lane's words are: `stride` apart; nowhere if its chunk is missing.
  template <class Word>
  struct LanePlace {
    LanePlace(const std::array<Word*, kChunks>& chunk, std::uint32_t lane) noexcept {
      const auto k = static_cast<std::size_t>(chunk_of(lane));
      stride = chunk_lanes(static_cast<int>(k));
      word = chunk[k] == nullptr ? nullptr : chunk[k] + (lane - kChunkBegin[k]);
    }
    Word* word;
    std::uint32_t stride;
  };

  /// Takes the copies of dropped records out of a cell; what is kept moves up. Quiescent.
  void forget_dropped(Cell& c) {
    // All orders relaxed: quiescent; the caller's synchronisation publishes.
    std::array<std::uint32_t*, kChunks> chunks = {c.lanes};
    for (int k = 1; k < kChunks; ++k) {
      const UnitIndex chunk = c.chunk[k - 1].load(std::memory_order_relaxed);
      if (chunk != 0) chunks[static_cast<std::size_t>(k)] = words(chunk);
    }
    std::uint64_t mask = 0;
    std::uint32_t kept = 0;
    for (std::uint64_t rest = c.mask.load(std::memory_order_relaxed); rest != 0; rest &= rest - 1) {
      const LanePlace<std::uint32_t> from(chunks, static_cast<std::uint32_t>(std::countr_zero(rest)));
      if (is_empty(at(from.word[2 * from.stride]))) continue;
      LanePlace<std::uint32_t> to(chunks, kept);
      // A chunk that could not be had leaves a gap.
      while (to.word == nullptr) to = LanePlace<std::uint32_t>(chunks, ++kept);
      for (std::uint32_t w = 0; w < 3; ++w) to.word[w * to.stride] = from.word[w * from.stride];
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
  LaneFilter filter_ = Lanes::best();
  std::uint64_t sessions_;
  Nodes nodes_;
  Cells cells_;
  Chunks chunks_;
  Table table_;
  List list_;
  [[no_unique_address]] Marks marks_;
  Branch root_;
  // Places that dropped records left. Changed at rest only; sessions take batches of it, as of an arena.
  std::vector<UnitIndex> freed_;
  alignas(kNoSharing) Atomic<std::uint64_t> next_freed_{0};
};

}  // namespace icbench
