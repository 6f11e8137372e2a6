// Ward's octree: every record is stored once, in the cell that fits its extent; a query visits the cells
// whose enlarged cube holds the point (core/octree.h). The structure of Dubla 2012, Listing 7.1, under every
// access mechanism.
//
// Use: this is a *structure*. WardTree<PlainSync> is the sequential one that locks and thread-local copies
// wrap; WardTree<StdSync> is the wait-free cache; WardTree<PlainSync, SpinNodeLock<>> locks node by node. All
// three are this code.
//
// A node's records are a list of chunks of 4, 8, 16, ... slots. A slot's place is fixed by one fetch_add on
// the node's count, so appends never compete for a link in a loop.
//
// Publication pairs (StdSync)
//   P1  append: slot state store release        -> scan: slot state load acquire; publishes the record
//   P2  install: child CAS release              -> descend: child load acquire; publishes the node (zeroed
//   memory) P3  install: chunk link CAS release         -> walk: link load acquire; publishes the chunk
//   (zeroed memory) P2 and P3 carry the zeroing of memory that a `clear` in another thread did.
//
// Progress (StdSync), in shared-memory steps; D = kMaxLevel, C = kMaxChunks:
//   insert  wait-free: per level one load and at most one CAS (the loser adopts the winner's node); one load
//   and one
//           fetch_add for the slot; per chunk up to its own one load and at most one CAS; one store. With
//           allocation by one load and one fetch_add each: at most 4 D + 4 C + 3 = 4 * 20 + 4 * 26 + 3 steps.
//   visit   wait-free: per visited node at most 8 child loads, one count load, one load a slot below that
//   count and one
//           a chunk. The count is read once, so records that arrive meanwhile cost nothing. The cells to
//           visit are fixed by the point: 8 a level, up to 27 where the slack of kSlack units counts, 125 in
//           the smallest cells.
// Linearization (StdSync): a record becomes visible by its P1 store. A visit walks several lists and so has
// no linearization point: it is per-record linearizable, not a snapshot.
#pragma once

#include <bit>
#include <new>
#include <utility>

#include "caches/locks.h"
#include "core/arena.h"
#include "core/cache.h"
#include "core/octree.h"
#include "core/sync.h"

namespace icbench {

template <class Sync, class NodeLock = NoNodeLock>
class WardTree {
  template <class T>
  using Atomic = typename Sync::template Atomic<T>;

  struct Node;
  struct Slot;
  struct Chunk;
  static constexpr std::size_t kNodeBytes = 64;
  static constexpr std::size_t kSlotUnitBytes = 16;
  static constexpr int kMaxChunks = 26;  // 4 (2^26 - 1) slots in a node's list, four times kMaxCapacity
  // Under a lock per node the nodes are plain memory, but sessions still allocate side by side.
  using PoolSync = std::conditional_t<NodeLock::kOn, StdSync, Sync>;
  using NodeArena = Arena<PoolSync, kNodeBytes>;
  using SlotArena = Arena<PoolSync, kSlotUnitBytes>;

 public:
  static constexpr std::string_view kPrefix = "";
  static constexpr std::string_view kStructure = "ward";
  static constexpr CacheTraits kTraits = Sync::kConcurrent ? CacheTraits{"wait_free",
                                                                         kStructure,
                                                                         "wait_free",
                                                                         ProgressGuarantee::wait_free,
                                                                         ProgressGuarantee::wait_free,
                                                                         Consistency::per_record_linearizable,
                                                                         false,
                                                                         "Dubla 2012, 7.2.3 (WF)"}
                                         : NodeLock::kOn
                                             ? CacheTraits{"node_lock",
                                                           kStructure,
                                                           "node_lock",
                                                           ProgressGuarantee::blocking,
                                                           ProgressGuarantee::blocking,
                                                           Consistency::per_record_linearizable,
                                                           false,
                                                           "a lock per node"}
                                             : CacheTraits{"sequential",
                                                           kStructure,
                                                           "none",
                                                           ProgressGuarantee::wait_free,
                                                           ProgressGuarantee::wait_free,
                                                           Consistency::linearizable,
                                                           true,
                                                           "Dubla 2012, Listing 7.1; Ward et al. 1988"};

  /// A session's own allocation state.
  class Workspace {
    friend WardTree;
    ArenaCursor<NodeArena> nodes_;
    ArenaCursor<SlotArena> slots_;
    UnitIndex spare_node_ = 0;  // set aside by a lost race; zero, as allocated
    std::array<UnitIndex, kMaxChunks> spare_chunks_{};
  };

  explicit WardTree(const CacheConfig& config)
      : addressing_(config.bounds),
        a_max_(config.a_max),
        nodes_(kSpare * config.capacity * kMaxLevel + std::uint64_t{config.max_sessions} * kNodePiece + 1),
        slots_(kSpare * config.capacity * kWorstSlotUnits +
               std::uint64_t{config.max_sessions} * 2 * kSlotPiece) {
    nodes_.take(1);  // the root
  }

  /// Stores `r`; false if the pool is used up, and then no query ever sees anything of it.
  template <class Counters>
  bool insert(Workspace& workspace, const Record& r, Counters& counters) noexcept {
    const GridPoint u = addressing_.quantise(r.p);
    const int level = addressing_.level_for(a_max_ * r.R);
    Node* n = &node(kRoot);
    for (int l = 0; l < level; ++l) {
      const UnitIndex child = descend(workspace, *n, OctreeAddressing::octant(u, l), counters);
      if (child == 0) return false;
      n = &node(child);
    }
    typename NodeLock::template Scope<Counters> scope(n->lock, counters);
    return append(workspace, *n, r, counters);
  }

  /// Calls f(record, weight) for every published record valid at x for accuracy a.
  template <class Counters, class F>
  void visit(const SurfacePoint& x, float a, Counters& counters, F&& f) noexcept {
    struct Cell {
      UnitIndex node;
      std::int32_t x, y, z;
      int level;
    };
    // A cell pops before its children push, and the deepest three levels may visit all 8 children of a node.
    std::array<Cell, 7 * kMaxLevel + 8> stack;
    const WardNeighbourhood neighbourhood(addressing_.quantise(x.p));
    stack[0] = {kRoot, 0, 0, 0, 0};
    for (std::size_t top = 1; top > 0;) {
      const Cell cell = stack[--top];
      Node& n = node(cell.node);
      typename NodeLock::template Scope<Counters> scope(n.lock, counters);
      scan(n, x, a, counters, f);
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

  /// f(Record&) -> UpdateResult for every record, in parallel over nodes; dropped ones leave no hole.
  /// Quiescent.
  template <class F>
  void update(F&& f) {
    parallel_chunks(nodes_.end() - kRoot, kUpdateGrain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i != end; ++i) update_node(node(kRoot + static_cast<UnitIndex>(i)), f);
    });
  }

  /// f(const Record&) for every record. Quiescent.
  template <class F>
  void for_each(F&& f) const {
    for (UnitIndex i = kRoot; i != nodes_.end(); ++i) {
      for (SlotWalk walk(*this, node(i)); Slot* s = walk.next();) {
        if (s->state.load(std::memory_order_acquire /* P1 */) != 0) f(static_cast<const Record&>(s->record));
      }
    }
  }

  /// Forgets everything. Quiescent; workspaces must be made anew.
  void clear() {
    nodes_.reset();
    slots_.reset();
    nodes_.take(1);  // the root
  }

  /// Records that still fit for certain, whatever their places. Quiescent.
  std::uint32_t room() const noexcept {
    const std::uint64_t records = std::min(nodes_.left() / kMaxLevel, slots_.left() / kWorstSlotUnits);
    return static_cast<std::uint32_t>(std::min<std::uint64_t>(records, UINT32_MAX));
  }

  void prefault(Workspace& workspace, std::uint32_t n) noexcept {
    workspace.nodes_.prefault(nodes_, n, kNodeBytes);
    workspace.slots_.prefault(slots_, std::min<std::uint32_t>(n, 1u << 26) * kWorstSlotUnits, kSlotUnitBytes);
  }

  /// Bytes of nodes and chunks that `workspace` has allocated.
  static std::size_t bytes(const Workspace& workspace) noexcept {
    return workspace.nodes_.units_used() * kNodeBytes + workspace.slots_.units_used() * kSlotUnitBytes;
  }

 private:
  // Invariants: chunk k of a list holds slots [4 (2^k - 1), 4 (2^(k+1) - 1)); a slot's state goes from 0 to 1
  // once between quiescent points; a child or link word goes from 0 to an index once between clears.
  struct alignas(kNodeBytes) Node {
    Atomic<UnitIndex> child[8];   // node arena
    Atomic<std::uint32_t> count;  // slots handed out; those whose chunk could not be had stay empty
    Atomic<UnitIndex> head;       // slot arena: chunk 0
    [[no_unique_address]] NodeLock lock;
  };
  static_assert(sizeof(Node) == kNodeBytes, "a node is one cache line");

  struct Slot {
    Record record;
    Atomic<std::uint32_t> state;  // 0 empty, 1 published
  };
  static_assert(sizeof(Slot) == 48, "a slot is three pool units");

  struct Chunk {
    Atomic<UnitIndex> next;
    std::uint32_t padding[3];
    Slot* slots() noexcept { return reinterpret_cast<Slot*>(this + 1); }
  };
  static_assert(sizeof(Chunk) == kSlotUnitBytes, "a chunk's header is one pool unit");

  static constexpr UnitIndex kRoot = 1;  // the first unit an empty arena hands out
  static constexpr std::uint32_t kFirstChunk = 4;
  static constexpr std::uint32_t kMaxCount = kFirstChunk * ((1u << kMaxChunks) - 1);
  static constexpr std::uint32_t kUnitsPerSlot = sizeof(Slot) / kSlotUnitBytes;
  static constexpr std::uint32_t kWorstSlotUnits =
      1 + kFirstChunk * kUnitsPerSlot;  // a chunk for a single record
  // Address space over what the capacity can need: for nodes that dropped records leave behind (see
  // keep_room) and for chunks that lost races set aside.
  static constexpr std::uint64_t kSpare = 2;
  static constexpr std::size_t kUpdateGrain = 1024;
  static constexpr std::uint32_t kNodePiece = 64;    // 4 KiB
  static constexpr std::uint32_t kSlotPiece = 1024;  // 16 KiB

  static constexpr std::uint32_t chunk_slots(int k) noexcept { return kFirstChunk << k; }
  static constexpr std::uint32_t chunk_units(int k) noexcept { return 1 + chunk_slots(k) * kUnitsPerSlot; }
  static int chunk_of(std::uint32_t i) noexcept { return std::bit_width(i / kFirstChunk + 1) - 1; }
  static std::uint32_t first_of(int k) noexcept { return kFirstChunk * ((1u << k) - 1); }

  Node& node(UnitIndex i) const noexcept { return *std::launder(static_cast<Node*>(nodes_.at(i))); }
  Chunk& chunk(UnitIndex i) const noexcept { return *std::launder(static_cast<Chunk*>(slots_.at(i))); }

  /// Makes `word` point at `fresh` unless another thread was faster; returns the winner. One CAS.
  template <class Counters>
  static UnitIndex install(Atomic<UnitIndex>& word, UnitIndex fresh, UnitIndex& spare,
                           Counters& counters) noexcept {
    UnitIndex winner = 0;
    counters.template add<&Counts::cas_attempts>(1);
    if (word.compare_exchange_strong(winner, fresh, std::memory_order_release /* P2, P3 */,
                                     std::memory_order_acquire /* P2, P3 */)) {
      return fresh;
    }
    counters.template add<&Counts::cas_failures>(1);
    counters.template add<&Counts::nodes_discarded>(1);
    spare = fresh;
    return winner;
  }

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
    return install(n.child[i], fresh, workspace.spare_node_, counters);
  }

  /// The chunk that `link` points at, chunk k of its list, installed if missing; 0 if the pool is used up.
  template <class Counters>
  UnitIndex follow(Workspace& workspace, Atomic<UnitIndex>& link, int k, Counters& counters) noexcept {
    if (const UnitIndex next = link.load(std::memory_order_acquire /* P3 */)) return next;
    UnitIndex& spare = workspace.spare_chunks_[static_cast<std::size_t>(k)];
    UnitIndex fresh = std::exchange(spare, 0);
    if (fresh == 0) {
      fresh = workspace.slots_.allocate(slots_, chunk_units(k), kSlotPiece);
      if (fresh == 0) return 0;
      counters.template add<&Counts::nodes_allocated>(1);
    }
    return install(link, fresh, spare, counters);
  }

  template <class Counters>
  bool append(Workspace& workspace, Node& n, const Record& r, Counters& counters) noexcept {
    // Relaxed: the count only fixes places and extents; the words behind it (P1, P3) publish. The first load
    // keeps it from wrapping round.
    if (n.count.load(std::memory_order_relaxed) >= kMaxCount / 2) return false;
    const std::uint32_t i = n.count.fetch_add(1, std::memory_order_relaxed);
    const int last = chunk_of(i);
    Atomic<UnitIndex>* link = &n.head;
    UnitIndex c = 0;
    for (int k = 0; k <= last; ++k) {
      c = follow(workspace, *link, k, counters);
      if (c == 0) return false;
      link = &chunk(c).next;
    }
    publish(chunk(c).slots()[i - first_of(last)], r);
    return true;
  }

  static void publish(Slot& slot, const Record& r) noexcept {
    slot.record = r;
    slot.state.store(1, std::memory_order_release /* P1 */);
  }

  template <class Counters, class F>
  void scan(Node& n, const SurfacePoint& x, float a, Counters& counters, F& f) const noexcept {
    // Relaxed, as in append; read once: it is the extent of this visit.
    std::uint32_t left = n.count.load(std::memory_order_relaxed);
    const Atomic<UnitIndex>* link = &n.head;
    for (int k = 0; left > 0; ++k) {
      const UnitIndex c = link->load(std::memory_order_acquire /* P3 */);
      if (c == 0) return;
      Chunk& list = chunk(c);
      const std::uint32_t here = std::min(left, chunk_slots(k));
      for (std::uint32_t i = 0; i < here; ++i) {
        const Slot& s = list.slots()[i];
        if (s.state.load(std::memory_order_acquire /* P1 */) == 0) continue;
        counters.template add<&Counts::records_read>(1);
        const float weight = split_sphere_weight(x, s.record, a);
        if (weight > 0.0f) {
          counters.template add<&Counts::records_valid>(1);
          f(static_cast<const Record&>(s.record), weight);
        }
      }
      left -= here;
      link = &list.next;
    }
  }

  /// Walks the slots of a node in order, up to its count. Quiescent.
  class SlotWalk {
   public:
    SlotWalk(const WardTree& tree, Node& n) noexcept
        : tree_(tree),
          link_(&n.head),
          left_(n.count.load(std::memory_order_relaxed)) {}  // relaxed: quiescent

    Slot* next() noexcept {
      if (left_ == 0) return nullptr;
      if (i_ == size_) {
        const UnitIndex c = link_->load(std::memory_order_relaxed);  // relaxed: quiescent
        if (c == 0) return nullptr;
        chunk_ = &tree_.chunk(c);
        link_ = &chunk_->next;
        size_ = chunk_slots(k_++);
        i_ = 0;
      }
      --left_;
      return &chunk_->slots()[i_++];
    }

   private:
    const WardTree& tree_;
    Atomic<UnitIndex>* link_;
    Chunk* chunk_ = nullptr;
    std::uint32_t left_, i_ = 0, size_ = 0;
    int k_ = 0;
  };

  template <class F>
  void update_node(Node& n, F& f) {
    SlotWalk out(*this, n);
    std::uint32_t kept = 0;
    // All orders relaxed: quiescent, and the parallel loop's join publishes to its caller.
    for (SlotWalk in(*this, n); Slot* s = in.next();) {
      if (s->state.load(std::memory_order_relaxed) == 0) continue;
      const bool keep = f(s->record) == UpdateResult::keep;
      s->state.store(0, std::memory_order_relaxed);
      if (!keep) continue;
      Slot* to = out.next();
      if (to != s) to->record = s->record;
      to->state.store(1, std::memory_order_relaxed);
      ++kept;
    }
    n.count.store(kept, std::memory_order_relaxed);
  }

  OctreeAddressing addressing_;
  float a_max_;
  NodeArena nodes_;
  SlotArena slots_;
};

}  // namespace icbench
