// The packed octree: every record is stored once, in a table, and known in every cell that its validity region reaches
// (caches/packed_reach.h); a query walks one path from the root and tests the records of the cells on it.
//
// Use: this is a *structure*. Packed<PlainSync> is the sequential one that locks and thread-local copies wrap;
// Packed<StdSync> is the wait-free cache, Packed<StdSync, Snapshot> the linearizable one. All are this code.
//
// Memory. A node is one cache line: eight children, the mask of its 64 lanes, their count, the chunks they lie in, and a
// list for what does not fit. A lane is 12 bytes of a record (caches/packed_lanes.h), tested many at once; a record is 44
// bytes and its mark, read only when one of its lanes was kept.
//
// Hot cells. A record that finds its cell full goes one level down, into the children it reaches; where those are full as
// well, into their lists. A second split would not pay: a child is at most 3 reaches wide, so most of what is listed there
// is valid nearby, and every level down makes two to four times the copies. The lists hold indices, and their records are
// tested one by one.
//
// What an insert does, step by step, and what others see if it stops there for ever
//
//   1  takes a place in the table                     the place is not used; nobody sees it
//   2  in every cell: installs missing nodes and chunks, reserves a lane or a place in the list
//                                                     the lanes stay out of the mask, the places unmarked: nobody reads them
//   3  writes the record, then lane by lane: words, mask bit
//                                                     queries find lanes whose record's mark is empty, and pass on
//   4  marks the record (caches/visibility.h)         it is there, in all cells at once
//
// If memory runs out in 1 or 2, what was reserved stays empty, the place goes to the session's next insert, and nothing
// was linked; 3 and 4 cannot fail. Lanes handed to failed inserts are lost until `clear`, as are nodes without records.
//
// Publication pairs (StdSync); P1, P4, P5 are those of caches/visibility.h, P3 that of the list (caches/slot_list.h)
//
//   P1  insert: mark store release -> visit: mark load acquire; publishes the record. The query acquired the lane first;
//       a record that is seen has all its lanes published before, so that no later query misses it anywhere.
//
//   P2  install: child or chunk CAS release -> descend, visit: child load acquire; descend: chunk load acquire; publishes
//       the node or chunk, and with it the zeroing of its memory by a clear in another thread
//
//   P6  insert: mask fetch_add release -> visit: mask load acquire; publishes the lane's words, and the chunk, which
//       whoever wrote the lane had acquired. A fetch_add by another insert is in its release sequence.
//
// Progress (StdSync), in steps on shared memory; L = kPackedLevels = 13. Every loop is over levels, children, chunks or
// an extent read once; nothing is retried.
//
//   insert  wait-free: at most 8 paths of L nodes and 27 of their children, of which each missing one costs a load, an
//           allocation (4 steps) and a CAS, whose loser adopts the winner's node; a lane in each of 27 cells at most (8
//           steps, and 1 to publish it), after a failed look at up to 8 full ones, or a place in the list (insert_steps).
//
//   visit   wait-free: per node the mask, a child, three chunks and the list's count; then the lanes and places that these
//           showed, once (list_steps). A node counts as two lists, its lanes and the rest: kMostLists = 2 (L + 1).
//
// Linearization (StdSync): by Visibility, as for the Ward tree: a record appears everywhere at once, by its mark, so visits
// are per-record linearizable; a snapshot is linearizable. For P4, a record's lanes are published before its tick is drawn.
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

  static constexpr std::size_t kNodeBytes = 64, kLineBytes = 64;
  static constexpr std::uint32_t kFreedBatch = 16;
  struct Stored {
    typename Marks::Mark mark;
    Record record;
  };
  using Nodes = Arena<Sync, kNodeBytes>;
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
  static constexpr std::string_view kInsertBound = "48 level + 2554",
                                    kVisitBound = "per list (12 + links + slots)";
  static constexpr std::uint32_t kVisitSteps = Marks::kMomentSteps;
  static constexpr std::uint32_t kMostLists = 2 * (kPackedLevels + 1);

  /// Of an insert at `level`.
  static constexpr std::uint32_t insert_steps(int level) noexcept {
    constexpr std::uint32_t kDescendSteps = 1 + ArenaCursor<Nodes>::kAllocateSteps + 1;
    constexpr std::uint32_t kLaneSteps = 2 + 1 + ArenaCursor<Chunks>::kAllocateSteps + 1 + 1;
    constexpr std::uint32_t kTakeSteps = 2 + ArenaCursor<Table>::kAllocateSteps;
    return kTakeSteps + static_cast<std::uint32_t>(level) * kMostCells * kDescendSteps +
           kMostCells * kLaneSteps + kMostCopies * (kDescendSteps + kLaneSteps + List::kAppendSteps) +
           Marks::kPublishSteps;
  }
  std::uint32_t insert_steps(const Record& r) const noexcept {
    return insert_steps(PackedReach::level_of(addressing_, r, a_max_));
  }

  /// Of the lanes of a node on a visit, and what else there is to read in it, or of its list.
  static constexpr std::uint64_t list_steps(std::uint32_t extent) noexcept {
    return 2 + kChunks + List::visit_steps(extent) + std::uint64_t{extent} * Marks::kShowsSteps;
  }

  /// A session's own allocation state.
  class Workspace {
    friend Packed;
    ArenaCursor<Nodes> nodes_;
    ArenaCursor<Chunks> chunks_;
    ArenaCursor<Table> table_;
    typename List::Workspace list_;
    UnitIndex spare_node_ = 0;                       // set aside by a lost race; zero, as allocated
    std::array<UnitIndex, kChunks> spare_chunks_{};  // the same
    std::array<UnitIndex, kFreedBatch> freed_{};     // places that dropped records left, this session's
    std::uint32_t freed_left_ = 0;
    UnitIndex spare_place_ = 0;  // of an insert that failed
  };

  explicit Packed(const CacheConfig& config)
      : addressing_(config.bounds),
        a_max_(config.a_max),
        idle_nodes_(std::uint64_t{config.max_sessions} * (2 * kNodePiece + 1)),
        idle_lines_(std::uint64_t{config.max_sessions} *
                    (2 * kChunkPiece + chunk_lines(0) + chunk_lines(1) + chunk_lines(2))),
        idle_places_(std::uint64_t{config.max_sessions} * (2 * kTablePiece + kFreedBatch + 1)),
        idle_list_(std::uint64_t{config.max_sessions} * List::kIdleUnits),
        nodes_(kSpareRoom * config.capacity * kWorstNodes + idle_nodes_ + 1),
        chunks_(kSpareRoom * config.capacity * kWorstLines + idle_lines_),
        table_(config.capacity + 2 * idle_places_),
        list_(kSpareRoom * config.capacity * kWorstListUnits + idle_list_) {
    nodes_.take(1);  // the root
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
    filter(walk);
    test(walk, x, a, counters, f);
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
    parallel_chunks(nodes_.end() - kRoot, kUpdateGrain, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i != last; ++i) forget_dropped(node(kRoot + static_cast<UnitIndex>(i)));
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
    chunks_.reset();
    table_.reset();
    list_.reset();
    marks_.clear();
    freed_.clear();
    next_freed_.store(0, std::memory_order_relaxed);  // relaxed: quiescent
    nodes_.take(1);
  }

  /// Records that still fit for certain, whatever their places and whichever sessions insert them. Quiescent.
  std::uint32_t room() const noexcept {
    const auto records = [](std::uint64_t left, std::uint64_t idle, std::uint64_t worst) {
      return left > idle ? (left - idle) / worst : 0;
    };
    const std::uint64_t freed =
        freed_.size() - std::min<std::uint64_t>(next_freed_.load(std::memory_order_relaxed), freed_.size());
    const std::uint64_t fit = std::min({records(nodes_.left(), idle_nodes_, kWorstNodes),
                                        records(chunks_.left(), idle_lines_, kWorstLines),
                                        records(table_.left() + freed, idle_places_, 1),
                                        records(list_.units_left(), idle_list_, kWorstListUnits)});
    return static_cast<std::uint32_t>(std::min<std::uint64_t>(fit, UINT32_MAX));
  }

  /// Takes and touches memory for about n inserts of one session.
  void prefault(Workspace& workspace, std::uint32_t n) noexcept {
    workspace.nodes_.prefault(nodes_, n / 2, kNodeBytes);
    workspace.chunks_.prefault(chunks_, 2 * std::min(n, 1u << 30), kLineBytes);
    workspace.table_.prefault(table_, n, sizeof(Stored));
  }
  /// Touches memory for about n inserts behind `offset` others. Quiescent.
  void touch(std::uint32_t offset, std::uint32_t n) noexcept {
    nodes_.touch(offset / 2, n / 2);
    chunks_.touch(2 * std::uint64_t{offset}, 2 * std::uint64_t{n});
    table_.touch(offset, n);
  }

  /// Bytes that `workspace` has allocated.
  static std::size_t bytes(const Workspace& workspace) noexcept {
    return workspace.nodes_.units_used() * kNodeBytes + workspace.chunks_.units_used() * kLineBytes +
           workspace.table_.units_used() * sizeof(Stored) + List::bytes(workspace.list_);
  }

 private:
  // Invariants: a child or chunk word goes from 0 to an index once between clears. Lanes 0 .. count - 1 have been handed
  // out, each to one insert; the mask has bits of these only, and none goes out between quiescent points.
  struct alignas(kNodeBytes) Node {
    Atomic<UnitIndex> child[8];
    Atomic<std::uint64_t> mask;
    typename List::List rest;
    Atomic<std::uint32_t> count;
    Atomic<UnitIndex> chunk[kChunks];
  };
  static_assert(sizeof(Node) == kNodeBytes, "a node is one cache line");

  static constexpr UnitIndex kRoot = 1;  // the first unit an empty arena hands out
  // Address space over what the capacity can need, for nodes that dropped records leave behind (see keep_room).
  static constexpr std::uint64_t kSpareRoom = 2;
  static constexpr std::uint32_t kNodePiece = 64, kChunkPiece = 64, kTablePiece = 64;
  // What a record can need at worst: eight paths, and a chunk at the end of each. Lower cells, and lists, are used only
  // where many records are, and take less for each: 27 places of 8 bytes in chunks that double.
  static constexpr std::uint64_t kWorstNodes = kMostCells * kPackedLevels, kWorstLines = kMostCells * 3,
                                 kWorstListUnits = 32;
  static constexpr std::size_t kUpdateGrain = 1024;

  static constexpr std::uint32_t chunk_lines(int chunk) noexcept {
    return chunk_lanes(chunk) * 3 * sizeof(std::uint32_t) / kLineBytes;
  }

  // Nodes are never constructed: zeroed memory is an empty node by the requirement on Sync (core/sync.h).
  Node& node(UnitIndex i) const noexcept { return *std::launder(static_cast<Node*>(nodes_.at(i))); }
  Stored& at(UnitIndex place) const noexcept { return *std::launder(static_cast<Stored*>(table_.at(place))); }
  std::uint32_t* words(UnitIndex chunk) const noexcept {
    return std::launder(static_cast<std::uint32_t*>(chunks_.at(chunk)));
  }
  static bool is_empty(const Stored& s) noexcept {
    return s.mark.word.load(std::memory_order_relaxed) == 0;  // relaxed: quiescent
  }

  /// A copy of a record to be: a lane of a node or, if `words` is null, a place in a node's list.
  struct Copy {
    PackedCell cell;
    Node* node;
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

  /// A query on its way: the nodes on its path, what their masks showed, and the records that lanes were kept of.
  struct Walk {
    GridPoint u;
    glm::vec3 p;  // grid units
    LaneQuery q;
    [[no_unique_address]] typename Marks::Moment moment;
    Node* next;
    int length;
    std::uint32_t kept;
    std::array<Node*, kPackedLevels + 1> nodes;
    std::array<std::uint64_t, kPackedLevels + 1> masks;
    std::array<UnitIndex, kPackedLevels * kCellLanes + kFilterRoom> places;
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
    return reserve(insertion, node(kRoot), {0, 0, 0, 0}, counters);
  }

  template <class Counters>
  bool reserve(Insertion& insertion, Node& n, const PackedCell& cell, Counters& counters) noexcept {
    const PackedReach& reach = insertion.reach;
    if (cell.level >= reach.level()) {
      Copy& copy = insertion.copies[insertion.reserved];
      copy.cell = cell;
      copy.node = &n;
      // Relaxed: the count only fixes places; what lies there is published by P6. The load keeps it from wrapping round.
      if (n.count.load(std::memory_order_relaxed) < kCellLanes) {
        copy.lane = n.count.fetch_add(1, std::memory_order_relaxed);
        if (copy.lane < kCellLanes) {
          copy.words = chunk_for(insertion.workspace, n, chunk_of(copy.lane), counters);
          ++insertion.reserved;
          return copy.words != nullptr;
        }
      }
      // A record that covers the cell is in all of its children, and nothing would be gained.
      if (cell.level > reach.level() || cell.level == kPackedLevels || reach.reach() > cell.side()) {
        copy.words = nullptr;
        copy.rest = list_.reserve(insertion.workspace.list_, n.rest, counters);
        ++insertion.reserved;
        return static_cast<bool>(copy.rest);
      }
    }
    for (unsigned rest = reach.children(cell); rest != 0; rest &= rest - 1) {
      const auto i = static_cast<unsigned>(std::countr_zero(rest));
      const PackedCell below = cell.child(i);
      if (!reach.touches(below)) continue;
      const UnitIndex child = descend(insertion.workspace, n, i, counters);
      if (child == 0 || !reserve(insertion, node(child), below, counters)) return false;
    }
    return true;
  }

  /// Child `i` of `n`, installed if missing; 0 if the pool is used up.
  template <class Counters>
  UnitIndex descend(Workspace& workspace, Node& n, unsigned i, Counters& counters) noexcept {
    if (const UnitIndex child = n.child[i].load(std::memory_order_acquire /* P2 */)) return child;
    UnitIndex fresh = std::exchange(workspace.spare_node_, 0);
    if (fresh == 0) {
      fresh = workspace.nodes_.allocate(nodes_, 1, kNodePiece);
      if (fresh == 0) return 0;
      counters.template add<&Counts::nodes_allocated>(1);
    }
    return install<Sync>(n.child[i], fresh, workspace.spare_node_, counters);
  }

  /// The words of chunk `k` of `n`, installed if missing; null if the pool is used up.
  template <class Counters>
  std::uint32_t* chunk_for(Workspace& workspace, Node& n, int k, Counters& counters) noexcept {
    if (const UnitIndex chunk = n.chunk[k].load(std::memory_order_acquire /* P2 */)) return words(chunk);
    UnitIndex& spare = workspace.spare_chunks_[static_cast<std::size_t>(k)];
    UnitIndex fresh = std::exchange(spare, 0);
    if (fresh == 0) {
      fresh = workspace.chunks_.allocate(chunks_, chunk_lines(k), kChunkPiece);
      if (fresh == 0) return nullptr;
      counters.template add<&Counts::nodes_allocated>(1);
    }
    return words(install<Sync>(n.chunk[k], fresh, spare, counters));
  }

  /// Writes a copy of the record at `place`, and then shows it.
  void publish(const Copy& copy, const PackedReach& reach, UnitIndex place) noexcept {
    if (copy.words == nullptr) return list_.publish(copy.rest, place);
    const Lane lane = make_lane(reach.p(), reach.n(), reach.reach(), copy.cell.corner(), copy.cell.level);
    const int k = chunk_of(copy.lane);
    std::uint32_t* word = copy.words + (copy.lane - kChunkBegin[static_cast<std::size_t>(k)]);
    for (const std::uint32_t value : {lane.place, lane.shape, place}) {
      Sync::writes(word, sizeof *word);
      *word = value;
      word += chunk_lanes(k);
    }
    // An addition, which no other insert does of this bit, and so as good as an or.
    copy.node->mask.fetch_add(std::uint64_t{1} << copy.lane, std::memory_order_release /* P6 */);
  }

  void begin(Walk& walk, const SurfacePoint& x, float a) noexcept {
    walk.u = addressing_.quantise(x.p);
    walk.p = addressing_.to_grid(x.p);
    walk.q = make_lane_query(x.n, a, a_max_);
    walk.moment = marks_.moment();
    walk.next = &node(kRoot);
    walk.length = 0;
    walk.kept = 0;
  }

  /// Goes to the next node of the path and reads how far its lanes reach; false if it is the last one.
  bool step(Walk& walk) noexcept {
    Node& n = *walk.next;
    const std::uint64_t mask = n.mask.load(std::memory_order_acquire /* P6 */);
    Sync::extent(static_cast<std::uint32_t>(std::popcount(mask)));
    const int level = walk.length++;
    walk.nodes[static_cast<std::size_t>(level)] = &n;
    walk.masks[static_cast<std::size_t>(level)] = mask;
    if (level == kPackedLevels) return false;
    const UnitIndex child =
        n.child[OctreeAddressing::octant(walk.u, level)].load(std::memory_order_acquire /* P2 */);
    if (child == 0) return false;
    walk.next = &node(child);
    return true;
  }

  /// Collects the places of the records that lanes are kept of.
  void filter(Walk& walk) noexcept {
    for (int level = 0; level < walk.length; ++level) {
      const std::uint64_t mask = walk.masks[static_cast<std::size_t>(level)];
      if (mask == 0) continue;
      const CellLanes lanes = lanes_of(*walk.nodes[static_cast<std::size_t>(level)], mask);
      const int shift = kMaxLevel - level;
      const PackedCell cell{walk.u.x >> shift, walk.u.y >> shift, walk.u.z >> shift, level};
      move_to_cell(walk.q, walk.p, cell.corner(), level);
      UnitIndex* out = walk.places.data() + walk.kept;
      const std::uint32_t kept = filter_(lanes, walk.q, out);
      for (std::uint32_t i = 0; i < kept; ++i) __builtin_prefetch(&at(out[i]));
      walk.kept += kept;
    }
  }

  CellLanes lanes_of(Node& n, std::uint64_t mask) const noexcept {
    CellLanes lanes{{}, mask};
    for (int k = 0; k < kChunks; ++k) {
      const std::uint32_t begin = kChunkBegin[static_cast<std::size_t>(k)], size = chunk_lanes(k);
      const std::uint64_t bits = mask >> begin & (~std::uint64_t{0} >> (64 - size));
      if (bits == 0) continue;
      // Relaxed: the mask that shows one of its lanes was acquired (P6).
      const std::uint32_t* at_chunk = words(n.chunk[k].load(std::memory_order_relaxed));
      lanes.chunk[static_cast<std::size_t>(k)] = at_chunk;
      for (std::uint64_t rest = bits; rest != 0; rest &= rest - 1) {
        for (std::uint32_t w = 0; w < 3; ++w)
          Sync::reads(at_chunk + w * size + static_cast<std::uint32_t>(std::countr_zero(rest)),
                      sizeof *at_chunk);
      }
    }
    return lanes;
  }

  /// Tests records exactly and calls f for those that are valid.
  template <class Counters, class F>
  void test(Walk& walk, const SurfacePoint& x, float a, Counters& counters, F& f) noexcept {
    const auto test_one = [&](UnitIndex place) {
      Stored& stored = at(place);
      if (!marks_.shows(stored.mark, walk.moment)) return;
      Sync::reads(&stored.record, sizeof stored.record);
      counters.template add<&Counts::records_read>(1);
      const float weight = split_sphere_weight(x, stored.record, a);
      if (weight > 0.0f) {
        counters.template add<&Counts::records_valid>(1);
        f(static_cast<const Record&>(stored.record), weight);
      }
    };
    for (std::uint32_t i = 0; i < walk.kept; ++i) test_one(walk.places[i]);
    for (int level = 0; level < walk.length; ++level)
      list_.visit(walk.nodes[static_cast<std::size_t>(level)]->rest, list_.moment(), test_one);
  }

  /// Takes the copies of dropped records out of a node; what is kept moves up. Quiescent.
  void forget_dropped(Node& n) {
    // All orders relaxed: quiescent; the caller's synchronisation publishes.
    std::uint64_t mask = 0;
    std::uint32_t kept = 0;
    for (std::uint64_t rest = n.mask.load(std::memory_order_relaxed); rest != 0; rest &= rest - 1) {
      const LanePlace from(*this, n, static_cast<std::uint32_t>(std::countr_zero(rest)));
      if (is_empty(at(from.word[2 * from.stride]))) continue;
      LanePlace to(*this, n, kept);
      // A chunk that could not be had leaves a gap.
      while (to.word == nullptr) to = LanePlace(*this, n, ++kept);
      for (std::uint32_t w = 0; w < 3; ++w) to.word[w * to.stride] = from.word[w * from.stride];
      mask |= std::uint64_t{1} << kept++;
    }
    n.mask.store(mask, std::memory_order_relaxed);
    n.count.store(kept, std::memory_order_relaxed);
    list_.update(n.rest, [this](UnitIndex& place) {
      return is_empty(at(place)) ? UpdateResult::drop : UpdateResult::keep;
    });
  }

  /// Where a lane's words are: `stride` apart; nowhere if its chunk is missing. Quiescent.
  struct LanePlace {
    LanePlace(const Packed& packed, const Node& n, std::uint32_t lane) noexcept {
      const int k = chunk_of(lane);
      const UnitIndex chunk = n.chunk[k].load(std::memory_order_relaxed);  // relaxed: quiescent
      stride = chunk_lanes(k);
      word = chunk == 0 ? nullptr : packed.words(chunk) + (lane - kChunkBegin[static_cast<std::size_t>(k)]);
    }
    std::uint32_t* word;
    std::uint32_t stride;
  };

  OctreeAddressing addressing_;
  float a_max_;
  LaneFilter filter_ = Lanes::best();
  std::uint64_t idle_nodes_, idle_lines_, idle_places_, idle_list_;
  Nodes nodes_;
  Chunks chunks_;
  Table table_;
  List list_;
  [[no_unique_address]] Marks marks_;
  // Places that dropped records left. Changed at rest only; sessions take batches of it, as of an arena.
  std::vector<UnitIndex> freed_;
  alignas(kNoSharing) Atomic<std::uint64_t> next_freed_{0};
};

}  // namespace icbench
