// Ward's octree: every record is stored once, in the cell that fits its extent; a query visits the cells whose enlarged
// cube holds the point (core/octree.h). The structure of Dubla 2012, Listing 7.1, under every access mechanism.
//
// Use: this is a *structure*. WardTree<PlainSync> is the sequential one that locks and thread-local copies wrap;
// WardTree<StdSync> is the wait-free cache, WardTree<StdSync, NoNodeLock, Snapshot> the linearizable one;
// WardTree<PlainSync, SpinNodeLock<>> locks node by node. All are this code, and their records lie in the lists of
// caches/slot_list.h.
//
// Publication pairs (StdSync); P1 and P3 are those of the lists
//
//   P2  install: child CAS release  -> descend, visit: child load acquire; publishes the node, and with it the zeroing
//                                      of its memory by a session that took it ahead
//
// Progress (StdSync), in steps on shared memory; D = kMaxLevel = 20
//
//   insert  wait-free: per level one load and, if the child is missing, one allocation (4 steps) and one CAS, whose
//           loser adopts the winner's node; then one append (74 steps) and what makes the record visible (1, or 3 for
//           a snapshot): at most 6 D + 77 = 197, and 2 for the ticket that its session draws (insert_steps).
//
//   visit   wait-free: per node at most 8 child loads and one visit of its list, which is bounded by what is there when
//           the list's count is read (list_steps). The cells to visit are fixed by the point: 8 a level, up to 27 where
//           the slack of the addressing counts, 64 and 125 in the two finest levels; 372 nodes in all at the very worst
//           (kMostLists). A snapshot adds one load, and 3 steps for each record that it finds pending.
//
// Linearization (StdSync): by Visibility. At first sight, a record becomes visible by its P1 store, and a visit, which
// walks several lists, has no linearization point: it is per-record linearizable. A snapshot is linearizable.
#pragma once

#include "caches/locks.h"
#include "caches/slot_list.h"
#include "core/cache.h"
#include "core/octree.h"
#include "core/sync.h"

namespace icbench {

template <class Sync, class NodeLock = NoNodeLock, class Visibility = AtFirstSight>
class WardTree {
  template <class T>
  using Atomic = typename Sync::template Atomic<T>;

 public:
  /// Under a lock per node the nodes are plain memory, but sessions still allocate side by side.
  using SharedSync = typename NodeLock::template Shared<Sync>;

 private:
  static constexpr std::size_t kNodeBytes = 64;
  using Nodes = Arena<SharedSync, kNodeBytes>;
  using Slots = SlotPool<Sync, SharedSync, Visibility>;

 public:
  static constexpr std::string_view kPrefix = "";
  static constexpr std::string_view kStructure = "ward";
  static constexpr CacheTraits kTraits = [] {
    constexpr auto wait_free = [](std::string_view name, Consistency consistency, std::string_view source) {
      return CacheTraits{
          name,        kStructure, name,  ProgressGuarantee::wait_free, ProgressGuarantee::wait_free,
          consistency, false,      source};
    };
    if (NodeLock::kOn) {
      return CacheTraits{"node_lock",
                         kStructure,
                         "node_lock",
                         ProgressGuarantee::blocking,
                         ProgressGuarantee::blocking,
                         Consistency::per_record_linearizable,
                         false,
                         "a lock per node"};
    }
    if (!Sync::kConcurrent) {
      return CacheTraits{"sequential",
                         kStructure,
                         "none",
                         ProgressGuarantee::wait_free,
                         ProgressGuarantee::wait_free,
                         Consistency::linearizable,
                         true,
                         "Dubla 2012, Listing 7.1; Ward et al. 1988"};
    }
    if (Visibility::kIsSnapshot)
      return wait_free("wait_free_snapshot", Consistency::linearizable, "this project");
    return wait_free("wait_free", Consistency::per_record_linearizable, "Dubla 2012, 7.2.3 (WF)");
  }();

  // Step bounds (caches/session.h).
  static constexpr std::string_view kInsertBound = Visibility::kIsSnapshot ? "6 level + 77" : "6 level + 75",
                                    kVisitBound = Visibility::kIsSnapshot
                                                      ? "1 + per list (9 + links + 4 slots)"
                                                      : "per list (9 + links + slots)";
  static constexpr std::uint32_t kVisitSteps = Slots::kMomentSteps;
  static constexpr std::uint32_t kMostLists = 372;

  /// Of an insert at `level`.
  static constexpr std::uint32_t insert_steps(int level) noexcept {
    constexpr std::uint32_t kDescendSteps = 1 + ArenaCursor<Nodes>::kAllocateSteps + 1;
    return static_cast<std::uint32_t>(level) * kDescendSteps + Slots::kAppendSteps;
  }
  std::uint32_t insert_steps(const Record& r) const noexcept { return insert_steps(level_of(r)); }

  /// Of a node on a visit: its list, and its children.
  static constexpr std::uint64_t list_steps(std::uint32_t extent) noexcept {
    return Slots::visit_steps(extent) + 8;
  }

  /// A session's own allocation state.
  class Workspace {
    friend WardTree;
    ArenaCursor<Nodes> nodes_;
    UnitIndex spare_node_ = 0;  // set aside by a lost race; zero, as allocated
    typename Slots::Workspace slots_;
  };

  explicit WardTree(const CacheConfig& config)
      : addressing_(config.bounds),
        a_max_(config.a_max),
        idle_nodes_(std::uint64_t{config.max_sessions} * kIdleNodes),
        idle_units_(std::uint64_t{config.max_sessions} * Slots::kIdleUnits),
        nodes_(kSpareRoom * config.capacity * kMaxLevel + idle_nodes_ + 1, config.capacity,
               large_pages_of(config), config.capacity / kPerNode),
        slots_(kSpareRoom * config.capacity * Slots::kWorstUnits + idle_units_, config.capacity,
               large_pages_of(config)) {
    nodes_.take(1);  // the root
  }

  /// Stores `r`; false if the pool is used up, and then no query ever sees anything of it.
  template <class Counters>
  bool insert(Workspace& workspace, const Record& r, Counters& counters) noexcept {
    const GridPoint u = addressing_.quantise(r.p);
    const int level = level_of(r);
    Node* n = &node(kRoot);
    for (int l = 0; l < level; ++l) {
      const UnitIndex child = descend(workspace, *n, OctreeAddressing::octant(u, l), counters);
      if (child == 0) return false;
      n = &node(child);
    }
    typename NodeLock::template Scope<Counters> scope(n->lock, counters);
    return slots_.append(workspace.slots_, n->records, r, counters);
  }

  /// Calls f(record, weight) for every published record valid at x for accuracy a.
  template <class Counters, class F>
  void visit(const SurfacePoint& x, float a, Counters& counters, F&& f) noexcept {
    struct Cell {
      UnitIndex node;
      std::int32_t x, y, z;
      int level;
    };
    // Depth first: a cell is popped before its children, 8 at most, are pushed.
    std::array<Cell, 7 * kMaxLevel + 8> stack;
    const WardNeighbourhood neighbourhood(addressing_.quantise(x.p));
    const auto moment = slots_.moment();
    stack[0] = {kRoot, 0, 0, 0, 0};
    for (std::size_t top = 1; top > 0;) {
      const Cell cell = stack[--top];
      Node& n = node(cell.node);
      typename NodeLock::template Scope<Counters> scope(n.lock, counters);
      slots_.visit(n.records, moment, [&](const Record& r) {
        counters.template add<&Counts::records_read>(1);
        const float weight = split_sphere_weight(x, r, a);
        if (weight > 0.0f) {
          counters.template add<&Counts::records_valid>(1);
          f(r, weight);
        }
      });
      if (cell.level == kMaxLevel) continue;
      for (unsigned rest = neighbourhood.children(cell.level, cell.x, cell.y, cell.z); rest != 0;
           rest &= rest - 1) {
        const auto i = static_cast<unsigned>(std::countr_zero(rest));
        const UnitIndex child = n.child[i].load(std::memory_order_acquire /* P2 */);
        if (child == 0) continue;
        stack[top++] = {child, 2 * cell.x + static_cast<int>(i & 1),
                        2 * cell.y + static_cast<int>((i >> 1) & 1), 2 * cell.z + static_cast<int>(i >> 2),
                        cell.level + 1};
      }
    }
  }

  /// f(Record&) -> UpdateResult for every record, in parallel over nodes; dropped ones leave no hole. Quiescent.
  template <class F>
  void update(F&& f) {
    parallel_chunks(nodes_.end() - kRoot, kUpdateGrain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i != end; ++i)
        slots_.update(node(kRoot + static_cast<UnitIndex>(i)).records, f);
    });
  }

  /// f(const Record&) for every record. Quiescent.
  template <class F>
  void for_each(F&& f) const {
    for (UnitIndex i = kRoot; i != nodes_.end(); ++i) {
      slots_.for_each(node(i).records, f);
    }
  }

  /// Forgets everything. Quiescent; workspaces must be made anew.
  void clear() {
    nodes_.reset();
    slots_.reset();
    nodes_.take(1);
  }

  /// As keep_room asks (caches/session.h). Quiescent.
  std::uint64_t room(std::uint64_t live) const noexcept {
    const auto records = [](std::uint64_t left, std::uint64_t idle, std::uint64_t worst) {
      return left > idle ? (left - idle) / worst : 0;
    };
    return room_beside(live, std::min(records(nodes_.left(), idle_nodes_, kMaxLevel),
                                      records(slots_.units_left(), idle_units_, Slots::kWorstUnits)));
  }

  /// Takes and touches memory for about n inserts of one session, ahead.
  void prefault(Workspace& workspace, std::uint32_t n) noexcept {
    workspace.nodes_.prefault(nodes_, n);
    slots_.prefault(workspace.slots_, n);
  }
  /// Touches memory for about n inserts behind `offset` others. Quiescent.
  void touch(std::uint32_t offset, std::uint32_t n) noexcept {
    nodes_.touch(offset, n);
    slots_.touch(offset, n);
  }

  /// Bytes of nodes and lists that `workspace` has allocated.
  static std::size_t bytes(const Workspace& workspace) noexcept {
    return workspace.nodes_.units_used() * kNodeBytes + Slots::bytes(workspace.slots_);
  }

 private:
  // Invariant: a child word goes from 0 to an index once between clears.
  struct alignas(kNodeBytes) Node {
    Atomic<UnitIndex> child[8];
    typename Slots::List records;
    [[no_unique_address]] NodeLock lock;
  };
  static_assert(sizeof(Node) == kNodeBytes, "a node is one cache line");

  static constexpr UnitIndex kRoot = 1;  // the first unit an empty arena hands out
  // Address space over what the capacity can need, for nodes that dropped records leave behind: the structure is built
  // anew only when these have used it up (see keep_room).
  static constexpr std::uint64_t kSpareRoom = 2;
  static constexpr std::uint32_t kNodePiece = 64;  // 4 KiB
  static constexpr std::uint32_t kPerNode = 4;     // records that one is expected for, on large pages
  // A session's: the rest of two pieces, and a spare.
  static constexpr std::uint32_t kIdleNodes = 2 * kNodePiece + 1;
  static constexpr std::size_t kUpdateGrain = 1024;

  // Nodes are never constructed: zeroed memory is an empty node by the requirement on Sync (core/sync.h).
  Node& node(UnitIndex i) const noexcept { return *std::launder(static_cast<Node*>(nodes_.at(i))); }

  int level_of(const Record& r) const noexcept { return addressing_.level_for(a_max_ * r.R); }

  /// Child `i` of `n`, installed if missing; 0 if the pool is used up.
  template <class Counters>
  UnitIndex descend(Workspace& workspace, Node& n, unsigned i, Counters& counters) noexcept {
    typename NodeLock::template Scope<Counters> scope(n.lock, counters);
    if (const UnitIndex child = n.child[i].load(std::memory_order_acquire /* P2 */)) return child;
    UnitIndex fresh = std::exchange(workspace.spare_node_, 0);
    if (fresh == 0) {
      fresh = workspace.nodes_.allocate(nodes_, 1, kNodePiece);
      if (fresh == 0) return 0;
      counters.template add<&Counts::nodes_allocated>(1);
    }
    return install<Sync>(n.child[i], fresh, workspace.spare_node_, counters);
  }

  OctreeAddressing addressing_;
  float a_max_;
  std::uint64_t idle_nodes_;
  std::uint64_t idle_units_;
  Nodes nodes_;
  Slots slots_;
};

}  // namespace icbench
