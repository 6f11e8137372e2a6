// The cells of the packed octree (caches/packed_octree.h): what they are made of, where they are, and how those that
// are missing get there.
//
// Cells down to a level that suits the capacity stand in a grid and are found without a walk: the upper levels as a
// whole, the two finest in bricks, which are there where records are. Below are nodes, a cache line each: eight
// children, of each the node below and the cell itself, if they are there. A cell is the mask of its lanes, their
// count, 16 lanes, a word that says where 48 more are, and a list for what does not fit. Cells without records and
// nodes without cells below are not there. A brick says where its cells' further lanes are, too, so that a query waits
// for memory three times as a rule: for a brick's entry, for a cell with all its lanes, and for the records.
//
// Publication pair P2: install, CAS release of the word of a brick, node, cell or further lanes -> whoever follows it,
// load acquire; publishes what it points at, and with it the zeroing of its memory by the session that took it ahead.
//
// The levels in use are read and set relaxed: an insert notes its level before it marks the record, so whoever has seen
// the record, or what its thread did afterwards, sees the level. What a brick says of further lanes is a hint for
// prefetching, relaxed: nothing is read by it.
//
// Progress: every method that sessions call is a bounded number of steps, but `prefault`, which is lock-free as
// Arena::take_ahead is (core/arena.h); beside it nothing is retried but the noting of a level, whose CAS fails only if
// another level was noted meanwhile.
#pragma once

#include "caches/packed_lanes.h"
#include "caches/packed_reach.h"
#include "caches/slot_list.h"
#include "core/arena.h"

namespace icbench {

/// Cells under `Sync`, whose pools and levels in use, which all sessions share, are under `SharedSync`.
template <class Sync, class SharedSync = Sync>
class PackedCells {
  template <class T>
  using Atomic = typename Sync::template Atomic<T>;

  static constexpr std::size_t kLineBytes = 64, kNodeBytes = 64, kCellBytes = 192, kMoreBytes = 384,
                               kEntryBytes = 12, kBrickBytes = 72 * kEntryBytes;
  using Grid = Arena<SharedSync, kEntryBytes>;
  using Bricks = Arena<SharedSync, kBrickBytes>;
  using Nodes = Arena<SharedSync, kNodeBytes>;
  using Cells = Arena<SharedSync, kCellBytes>;
  using More = Arena<SharedSync, kMoreBytes>;

 public:
  /// What does not fit into a cell's lanes.
  using List = SlotPool<Sync, SharedSync, AtFirstSight, UnitIndex>;

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
    Atomic<UnitIndex> more;                                // the other strips
    alignas(kLineBytes) std::uint32_t strip[kStripWords];  // the first
  };
  static_assert(sizeof(Cell) == kCellBytes, "a cell and its first strip are three cache lines");
  static_assert(kMoreBytes == (kCellStrips - 1) * kStripWords * sizeof(std::uint32_t));

  // A cell of the grid.
  struct Entry {
    Branch branch;
    Atomic<UnitIndex> more;  // the cell's, a hint
  };

  static constexpr int kMostGridLevels = 8;
  /// Cells that a record reaches on one level, at most.
  static constexpr std::uint32_t kMostCells = 8;
  /// Most steps of following a word to what it points at, installed if missing.
  static constexpr std::uint32_t kFollowSteps = 1 + ArenaCursor<Nodes>::kAllocateSteps + 1;
  /// Most steps of noting a level.
  static constexpr std::uint32_t kNoteSteps = 1 + kMostGridLevels;

  /// A session's own allocation state.
  class Workspace {
    friend PackedCells;
    ArenaCursor<Bricks> bricks_;
    ArenaCursor<Nodes> nodes_;
    ArenaCursor<Cells> cells_;
    ArenaCursor<More> more_;
    // Set aside by lost races; zero, as allocated.
    UnitIndex spare_brick_ = 0, spare_node_ = 0, spare_cell_ = 0, spare_more_ = 0;
  };

  /// For `records` at most by `sessions`. `spare_room`: address space over what so many can need.
  PackedCells(std::uint64_t records, std::uint64_t sessions, std::uint64_t spare_room, LargePages large_pages)
      : grid_level_(grid_level(records)),
        sessions_(sessions),
        expected_bricks_(records / kPerBrick + 1),
        grid_(dense_entries(), 0, large_pages, dense_entries()),
        bricks_(top_cells() + sessions * kIdleBricks + 1, 0, large_pages, expected_bricks_),
        nodes_(spare_room * records * worst_nodes() + sessions * kIdleNodes + 1, records / kPerNode,
               large_pages, records / kPerNode),
        cells_(spare_room * records * kWorstCells + sessions * kIdleCells + 1, records / kPerCell,
               large_pages, records / kPerCell),
        more_(spare_room * records * kWorstMore + sessions * kIdleMore, records / kPerMore, large_pages,
              records / kPerMore) {
    plant();
  }

  /// The grid's finest level, and the finest of the levels that are there as a whole.
  int grid_level() const noexcept { return grid_level_; }
  int top_level() const noexcept { return grid_level_ - kBrickLevels; }

  /// A bit for every level above the grid's finest that has cells with records.
  std::uint32_t levels_in_use() const noexcept {
    return levels_in_use_.load(std::memory_order_relaxed);  // relaxed: see the header
  }
  void note_level(int level) noexcept {
    const std::uint32_t bit = 1u << level;
    std::uint32_t levels = levels_in_use();
    while ((levels & bit) == 0 &&
           !levels_in_use_.compare_exchange_strong(levels, levels | bit, std::memory_order_relaxed,
                                                   std::memory_order_relaxed)) {
    }
  }

  /// The grid's entry for the cell of its finest level that holds u; one without anything if its brick is missing.
  const Entry& finest_entry_at(const GridPoint& u) const noexcept {
    // Brick 0 is nobody's: no cell is there.
    return finest_entry_in(dense_entry(top_level(), u).branch.node.load(std::memory_order_acquire /* P2 */),
                           u);
  }
  /// The grid's entry for the cell of `level` that holds u; one without anything if its brick is missing.
  const Entry& entry_at(int level, const GridPoint& u) const noexcept {
    const Entry& entry = dense_entry(std::min(level, top_level()), u);
    if (level <= top_level()) return entry;
    return entry_in(entry.branch.node.load(std::memory_order_acquire /* P2 */), level, u);
  }
  Node& node(UnitIndex i) const noexcept { return *std::launder(static_cast<Node*>(nodes_.at(i))); }
  // Nodes and cells are never constructed: zeroed memory is an empty one by the requirement on Sync (core/sync.h).
  Cell& cell(UnitIndex i) const noexcept { return *std::launder(static_cast<Cell*>(cells_.at(i))); }
  std::uint32_t* strips(UnitIndex more) const noexcept {
    return std::launder(static_cast<std::uint32_t*>(more_.at(more)));
  }
  /// The first word of a lane, whose further strips are `more`.
  std::uint32_t* lane(Cell& c, UnitIndex more, std::uint32_t lane) const noexcept {
    if (lane < kStripLanes) return c.strip + lane;
    return strips(more) + (lane / kStripLanes - 1) * kStripWords + lane % kStripLanes;
  }

  // What is missing is installed; null if the pool is used up.

  /// The entry of a cell of the grid.
  template <class Counters>
  Entry* entry_for(Workspace& w, const PackedCell& where, Counters& counters) noexcept {
    const int shift = kMaxLevel - where.level;
    const GridPoint u{where.x << shift, where.y << shift, where.z << shift};
    Entry& entry = dense_entry(std::min(where.level, top_level()), u);
    if (where.level <= top_level()) return &entry;
    const UnitIndex brick =
        follow(entry.branch.node, bricks_, w.bricks_, kBrickPiece, w.spare_brick_, counters);
    return brick == 0 ? nullptr : &entry_in(brick, where.level, u);
  }
  template <class Counters>
  Node* node_for(Workspace& w, Branch& branch, Counters& counters) noexcept {
    const UnitIndex n = follow(branch.node, nodes_, w.nodes_, kNodePiece, w.spare_node_, counters);
    return n == 0 ? nullptr : &node(n);
  }
  template <class Counters>
  Cell* cell_for(Workspace& w, Branch& branch, Counters& counters) noexcept {
    const UnitIndex c = follow(branch.cell, cells_, w.cells_, kCellPiece, w.spare_cell_, counters);
    return c == 0 ? nullptr : &cell(c);
  }
  /// The first word of a lane. `hint`: the entry's, null below the grid.
  template <class Counters>
  std::uint32_t* lane_for(Workspace& w, Cell& c, std::uint32_t number, Atomic<UnitIndex>* hint,
                          Counters& counters) noexcept {
    if (number < kStripLanes) return lane(c, 0, number);
    const UnitIndex more = follow(c.more, more_, w.more_, kMorePiece, w.spare_more_, counters);
    if (more == 0) return nullptr;
    if (hint != nullptr) hint->store(more, std::memory_order_relaxed);  // relaxed: see the header
    return lane(c, more, number);
  }

  /// f(Cell&) for every cell, in parallel. Quiescent.
  template <class F>
  void for_each_cell(F&& f) {
    parallel_chunks(cells_.end() - 1, kUpdateGrain, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first + 1; i <= last; ++i) f(cell(static_cast<UnitIndex>(i)));
    });
  }

  /// Forgets everything. Quiescent; workspaces must be made anew.
  void reset() {
    grid_.reset();
    bricks_.reset();
    nodes_.reset();
    cells_.reset();
    more_.reset();
    levels_in_use_.store(0, std::memory_order_relaxed);  // relaxed: quiescent
    plant();
  }

  /// Records for whose cells there is room for certain if none were there yet. Quiescent.
  std::uint64_t room() const noexcept {
    const auto records = [this](std::uint64_t left, std::uint64_t idle, std::uint64_t worst) {
      return left > sessions_ * idle ? (left - sessions_ * idle) / worst : 0;
    };
    return std::min({records(nodes_.left(), kIdleNodes, worst_nodes()),
                     records(cells_.left(), kIdleCells, kWorstCells),
                     records(more_.left(), kIdleMore, kWorstMore)});
  }

  /// Takes and touches memory for about n inserts of one session, ahead.
  void prefault(Workspace& w, std::uint32_t n) noexcept {
    grid_.populate(dense_entries());
    bricks_.populate(std::min(sessions_ * n, expected_bricks_));
    w.nodes_.prefault(nodes_, n / kPerNode);
    w.cells_.prefault(cells_, n / kPerCell);
    w.more_.prefault(more_, n / kPerMore);
  }
  /// Touches memory for about n inserts behind `offset` others. Quiescent.
  void touch(std::uint32_t offset, std::uint32_t n) noexcept {
    grid_.populate(dense_entries());
    bricks_.populate(std::min(std::uint64_t{offset} + n, expected_bricks_));
    nodes_.touch(offset / kPerNode, n / kPerNode);
    cells_.touch(offset / kPerCell, n / kPerCell);
    more_.touch(offset / kPerMore, n / kPerMore);
  }

  /// Bytes that are there whatever is stored.
  std::size_t fixed_bytes() const noexcept {
    return dense_entries() * kEntryBytes + (top_level() == 0 ? kBrickBytes : 0);
  }
  /// Bytes that `w` has allocated.
  static std::size_t bytes(const Workspace& w) noexcept {
    return w.bricks_.units_used() * kBrickBytes + w.nodes_.units_used() * kNodeBytes +
           w.cells_.units_used() * kCellBytes + w.more_.units_used() * kMoreBytes;
  }

 private:
  // The part of the grid's two finest levels that lies in a cell of the level above, whose entry's `node` is the brick.
  struct Brick {
    Entry upper[8], finest[4][4][4];
  };
  static_assert(sizeof(Entry) == kEntryBytes && sizeof(Brick) == kBrickBytes);

  // The grid's finest level L is that at which a room's walls, some 6 4^L cells, hold 8 to 32 records each at capacity.
  static constexpr int kBrickLevels = 2;
  static constexpr int grid_level(std::uint64_t capacity) noexcept {
    int level = kBrickLevels;
    while (level < kMostGridLevels && capacity / 48 >> (2 * (level + 1)) != 0) ++level;
    return level;
  }
  // Entries of the levels above `level`: (8^level - 1) / 7.
  static constexpr std::uint32_t grid_begin(int level) noexcept { return ((1u << (3 * level)) - 1) / 7; }
  // Where in the arena the entries of a level begin, that of its unit 1 being the first.
  static constexpr auto kBegin = [] {
    std::array<UnitIndex, kMostGridLevels + 1> begin{};
    for (int level = 0; level <= kMostGridLevels; ++level) {
      begin[static_cast<std::size_t>(level)] = 1 + grid_begin(level);
    }
    return begin;
  }();
  std::uint32_t top_cells() const noexcept { return 1u << (3 * top_level()); }
  std::uint32_t dense_entries() const noexcept { return grid_begin(top_level() + 1); }

  static constexpr std::uint32_t kBrickPiece = 4, kNodePiece = 64, kCellPiece = 16, kMorePiece = 16;
  // What a record can need at worst, on average: eight paths below the grid, and a cell at the end of each. Further lanes
  // and lower cells are used only where many records are: a full cell has at most eight below it.
  std::uint64_t worst_nodes() const noexcept {
    return kMostCells * static_cast<std::uint64_t>(kPackedLevels - grid_level_);
  }
  static constexpr std::uint64_t kWorstCells = kMostCells + kMostCells / 2, kWorstMore = 2;
  // Records that one of each is expected for, of memory that is touched beforehand or on large pages.
  static constexpr std::uint32_t kPerBrick = 100, kPerNode = 16, kPerCell = 4, kPerMore = 16;
  // What a session may hold without a record in it: the rest of two pieces, and a spare.
  static constexpr std::uint64_t kIdleBricks = 2 * kBrickPiece + 1, kIdleNodes = 2 * kNodePiece + 1,
                                 kIdleCells = 2 * kCellPiece + 1, kIdleMore = 2 * kMorePiece + 1;
  static constexpr std::size_t kUpdateGrain = 1024;

  /// An empty grid; one that is a single brick has it from the start. Quiescent.
  void plant() noexcept {
    grid_.take(dense_entries());
    if (top_level() != 0) return;
    dense_entry(0, {}).branch.node.store(bricks_.take(1), std::memory_order_relaxed);
  }

  /// The entry of the cell of `level` that holds u. Above the bricks' levels.
  Entry& dense_entry(int level, const GridPoint& u) const noexcept {
    const int shift = kMaxLevel - level;
    const std::int32_t at = (((u.z >> shift << level) | u.y >> shift) << level) | u.x >> shift;
    const UnitIndex begin = kBegin[static_cast<std::size_t>(level)];
    return *std::launder(static_cast<Entry*>(grid_.at(begin + static_cast<UnitIndex>(at))));
  }
  Entry& entry_in(UnitIndex brick, int level, const GridPoint& u) const noexcept {
    if (level == grid_level_) return finest_entry_in(brick, u);
    return brick_at(brick).upper[OctreeAddressing::octant(u, top_level())];
  }
  Entry& finest_entry_in(UnitIndex brick, const GridPoint& u) const noexcept {
    const int shift = kMaxLevel - grid_level_;
    constexpr std::int32_t kLast = (1 << kBrickLevels) - 1;
    return brick_at(brick).finest[u.z >> shift & kLast][u.y >> shift & kLast][u.x >> shift & kLast];
  }
  Brick& brick_at(UnitIndex i) const noexcept { return *std::launder(static_cast<Brick*>(bricks_.at(i))); }

  /// What `word` points at, installed if missing; 0 if the pool is used up.
  template <class Pool, class Counters>
  UnitIndex follow(Atomic<UnitIndex>& word, Pool& pool, ArenaCursor<Pool>& cursor, std::uint32_t piece,
                   UnitIndex& spare, Counters& counters) noexcept {
    if (const UnitIndex there = word.load(std::memory_order_acquire /* P2 */)) return there;
    UnitIndex fresh = std::exchange(spare, 0);
    if (fresh == 0) {
      fresh = cursor.allocate(pool, 1, piece);
      if (fresh == 0) return 0;
      counters.template add<&Counts::nodes_allocated>(1);
    }
    return install<Sync>(word, fresh, spare, counters);
  }

  int grid_level_;
  std::uint64_t sessions_, expected_bricks_;
  Grid grid_;
  Bricks bricks_;
  Nodes nodes_;
  Cells cells_;
  More more_;
  typename SharedSync::template Atomic<std::uint32_t> levels_in_use_{0};
};

}  // namespace icbench
