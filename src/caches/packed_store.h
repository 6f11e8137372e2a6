// What a packed octree (caches/packed_octree.h) keeps, its cells, records and lists, and how a query goes through them:
// down one path from the root, taking up the cells on it; over their lanes, by vectors; and to the records of those
// that are kept, which are tested exactly.
//
// A query waits for memory as little as it can: cells and strips are asked for as soon as the words that lead to them
// are known, before anything in them is needed. Queries of a batch are all at one stage, so that one's waiting is the
// others' time.
//
// Publication pairs: those of caches/packed_cells.h (P2), slot_list.h (P3) and visibility.h (P1, P4, P5), and P6 of
// caches/packed_octree.h.
//
// Progress (StdSync), in steps on shared memory: wait-free, every loop is over levels, lanes or an extent read once.
// The levels in use; a brick and a hint for each level of the grid, two words a level; of each cell on the path the
// mask, the word of its further lanes and the list's count, and that once more if any of them has a list; then the
// lanes and places that these showed, once (list_steps), and up to seven times the mark of nobody's record. A cell
// counts as two lists, its lanes and the rest.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <span>

#include "caches/packed_cells.h"
#include "caches/packed_filter.h"
#include "caches/packed_records.h"
#include "core/cache.h"

namespace icbench {

/// Its parts are open to the octree, which inserts into them.
template <class Sync, class SharedSync, class Visibility, class Lanes>
struct PackedStore {
  using Cells = PackedCells<Sync, SharedSync>;
  using Records = PackedRecords<Sync, SharedSync, Visibility>;
  using Cell = typename Cells::Cell;
  using List = typename Cells::List;

 private:
  static constexpr bool kIsSnapshot = Visibility::kIsSnapshot;
  using Branch = typename Cells::Branch;
  using Marks = typename Records::Marks;
  using Stored = typename Records::Stored;

  static constexpr std::size_t kLineBytes = 64;
  // Address space over what the capacity can need, for nodes that dropped records leave behind (see keep_room).
  static constexpr std::uint64_t kSpareRoom = 2;
  // What a record can need of lists at worst: they are used only where many records are, and take less for each.
  static constexpr std::uint64_t kWorstListUnits = 32;
  // What is filled of a cell's further strips, as a rule.
  static constexpr std::size_t kHintedBytes = (kCellStrips - 1) * kStripWords * sizeof(std::uint32_t) / 3 * 2;

  static constexpr std::uint32_t kMostPath = kPackedLevels + 1;

  /// A query on its way, and the cells on its path.
  struct Walk {
    GridPoint u;
    glm::vec3 p;  // grid units
    [[no_unique_address]] typename Records::Moment moment;
    UnitIndex below;  // the node to go to
    int level;        // of its children
    std::uint32_t cells;
    std::array<Cell*, kMostPath> cell;
    std::array<int, kMostPath> cell_level;
  };

  /// What the kernels read and write, and so not of the walk, which else would have to stay in memory: the lanes that
  /// the cells' masks showed, and the places of the records that lanes were kept of; and whether there is more.
  struct Candidates {
    std::uint32_t kept;
    bool have_lists;
    std::array<LaneRun, kMostPath> lanes;
    std::array<UnitIndex, kMostPath * kCellLanes + kStripLanes> places;
  };

 public:
  /// A session's own allocation state.
  struct Workspace {
    typename Cells::Workspace cells;
    typename Records::Workspace records;
    typename List::Workspace list;
  };

  OctreeAddressing addressing;
  float a_max;
  std::uint64_t sessions;
  LaneKernels kernels = Lanes::best();
  Cells cells;
  Records records;
  List list;  ///< of all cells

  explicit PackedStore(const CacheConfig& config)
      : addressing(config.bounds),
        a_max(config.a_max),
        sessions(config.max_sessions),
        cells(config.capacity, sessions, kSpareRoom, large_pages_of(config)),
        records(config.capacity, sessions, large_pages_of(config)),
        list(kSpareRoom * config.capacity * kWorstListUnits + sessions * List::kIdleUnits) {}

  // Step bounds of queries (caches/session.h).
  static constexpr std::string_view kVisitBound =
      kIsSnapshot ? "48 + per list (3 + links + 5 slots)" : "47 + per list (3 + links + 2 slots)";
  static constexpr std::uint32_t kVisitSteps =
      1 + 2 * (kPackedLevels + 1) + (Cells::kMostGridLevels + 1) + 2 + Marks::kMomentSteps + kWeighed - 1;
  static_assert(kVisitSteps == (kIsSnapshot ? 48 : 47));
  static constexpr std::uint32_t kMostLists = 2 * (kPackedLevels + 1);

  /// Of the lanes of a cell on a visit and what else there is to read in it, or of its list.
  static constexpr std::uint64_t list_steps(std::uint32_t extent) noexcept {
    return 2 + List::visit_steps(extent) + std::uint64_t{extent} * Marks::kShowsSteps;
  }

  /// Calls f(record, weight) for every published record valid at x for accuracy a. `guarded(u, levels)`: called before
  /// any cell is read, with where that is and the levels in use; what it returns lives until the last one was.
  template <class Counters, class Guarded, class F>
  void visit(const SurfacePoint& x, float a, Counters& counters, Guarded&& guarded, F&& f) noexcept {
    Walk walk = start(x);
    const std::uint32_t levels = cells.levels_in_use();
    [[maybe_unused]] const auto scope = guarded(walk.u, levels);
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
    std::array<Walk, kBatch> walks;
    std::array<Candidates, kBatch> candidates;
    for (std::size_t i = 0; i < n; ++i) walks[i] = start(points[i]);
    const std::uint32_t levels = cells.levels_in_use();
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

  /// Quiescent; workspaces must be made anew.
  void clear() {
    cells.reset();
    records.clear();
    list.reset();
  }

  /// As keep_room asks (caches/session.h). Quiescent.
  std::uint64_t room(std::uint64_t live) const noexcept {
    const std::uint64_t units = list.units_left(), idle = sessions * List::kIdleUnits;
    const std::uint64_t lists = units > idle ? (units - idle) / kWorstListUnits : 0;
    return std::min(room_beside(live, std::min(cells.room(), lists)), records.room());
  }

  /// Takes and touches memory for about n inserts of one session.
  void prefault(Workspace& workspace, std::uint32_t n) noexcept {
    cells.prefault(workspace.cells, n);
    records.prefault(workspace.records, n);
  }
  /// Touches memory for about n inserts behind `offset` others. Quiescent.
  void touch(std::uint32_t offset, std::uint32_t n) noexcept {
    cells.touch(offset, n);
    records.touch(offset, n);
  }

  /// Bytes that `workspace` has allocated.
  static std::size_t bytes(const Workspace& workspace) noexcept {
    return Cells::bytes(workspace.cells) + Records::bytes(workspace.records) + List::bytes(workspace.list);
  }

 private:
  /// What is known of a query before anything is read, but for its moment.
  Walk start(const SurfacePoint& x) noexcept {
    Walk walk;
    walk.p = addressing.to_grid(x.p);
    walk.u = OctreeAddressing::quantise_grid(walk.p);
    walk.moment = records.moment();
    walk.cells = 0;
    return walk;
  }

  /// Takes the grid's cells up. `levels`: in use, read after the query's moment, or its snapshot would lack records
  /// whose level was new.
  void enter(Walk& walk, std::uint32_t levels) noexcept {
    for (std::uint32_t rest = levels; rest != 0; rest &= rest - 1) {
      const int level = std::countr_zero(rest);
      go_by(walk, cells.entry_at(level, walk.u), level);
    }
    const auto& finest = cells.finest_entry_at(walk.u);
    go_by(walk, finest, cells.grid_level());
    walk.below = finest.branch.node.load(std::memory_order_acquire /* P2 */);
    walk.level = cells.grid_level() + 1;
    __builtin_prefetch(&cells.node(walk.below));
  }

  /// Takes a cell of the grid up.
  void go_by(Walk& walk, const typename Cells::Entry& entry, int level) noexcept {
    take_up(walk, entry.branch, level);
    // Unit 0 of a pool is nobody's, and harmless to prefetch.
    prefetch(cells.strips(entry.more.load(std::memory_order_relaxed)), kHintedBytes);
  }

  /// Puts a branch's cell on the path if it is there.
  void take_up(Walk& walk, const Branch& branch, int level) noexcept {
    const UnitIndex here = branch.cell.load(std::memory_order_acquire /* P2 */);
    // No branch on what cannot be foreseen, here and below.
    Cell& c = cells.cell(here);
    prefetch(&c, sizeof c);
    walk.cell[walk.cells] = &c;
    walk.cell_level[walk.cells] = level;
    walk.cells += here != 0;
  }

  /// Goes one level down; false at the end of the path.
  bool step(Walk& walk) noexcept {
    if (walk.below == 0) return false;
    const Branch& branch = cells.node(walk.below).child[OctreeAddressing::octant(walk.u, walk.level - 1)];
    take_up(walk, branch, walk.level++);
    walk.below = branch.node.load(std::memory_order_acquire /* P2 */);
    __builtin_prefetch(&cells.node(walk.below));
    return true;
  }

  /// Reads which lanes the cells have, and whether any has a list.
  void look(const Walk& walk, Candidates& candidates) noexcept {
    candidates.have_lists = false;
    for (std::uint32_t i = 0; i < walk.cells; ++i) {
      Cell& c = *walk.cell[i];
      LaneRun& lanes = candidates.lanes[i];
      lanes.at = make_lane_point(walk.p, walk.u, walk.cell_level[i]);
      lanes.mask = c.mask.load(std::memory_order_acquire /* P6 */);
      lanes.first = c.strip;
      // Relaxed: a mask that shows one of its lanes was acquired (P6).
      const UnitIndex more = c.more.load(std::memory_order_relaxed);
      lanes.more = cells.strips(more);
      candidates.have_lists |= list.was_used(c.rest);
      Sync::extent(static_cast<std::uint32_t>(std::popcount(lanes.mask)));
      for (std::uint64_t rest = lanes.mask; rest != 0; rest &= rest - 1) {
        const std::uint32_t* word = cells.lane(c, more, static_cast<std::uint32_t>(std::countr_zero(rest)));
        Sync::reads(word, sizeof *word);
        Sync::reads(word + kStripLanes, sizeof *word);
      }
    }
  }

  /// Collects the places of the records that lanes are kept of, and behind them, to whole groups, nobody's: how many
  /// there are cannot be foreseen, so that what follows goes by groups.
  void filter(const Walk& walk, float a, Candidates& candidates) noexcept {
    auto& [kept, have_lists, lanes, places] = candidates;
    kept = kernels.filter(make_lane_share(a, a_max), {kStripWords, kStripLanes}, lanes.data(), walk.cells,
                          places.data());
    std::fill_n(places.begin() + kept, kWeighed, Records::kNobodys);
  }

  void prefetch_records(const Candidates& candidates) noexcept {
    for (std::uint32_t i = 0; i < candidates.kept; i += kWeighed) {
#pragma GCC unroll kWeighed
      for (std::uint32_t k = 0; k < kWeighed; ++k) {
        const Stored* stored = &records.at(candidates.places[i + k]);
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
    ShownRecords shown;
    for (std::uint32_t i = 0; i < candidates.kept; i += kWeighed) {
      const UnitIndex* places = candidates.places.data() + i;
      std::uint32_t n = std::min(candidates.kept - i, kWeighed);
      std::array<Stored*, kWeighed> stored;  // nobody else's, so that looks leave it in registers
#pragma GCC unroll kWeighed
      for (std::uint32_t k = 0; k < kWeighed; ++k) {
        stored[k] = &records.at(places[k]);
        shown[k] = &stored[k]->record;
      }
      std::array<typename Marks::Word, kWeighed> words;
      std::uint32_t seen = 0;
#pragma GCC unroll kWeighed
      for (std::uint32_t k = 0; k < kWeighed; ++k)
        seen += Marks::is_shown_by(words[k] = records.look(*stored[k]), walk.moment);
      if (seen != n) [[unlikely]] {
        const std::uint32_t kept = std::exchange(n, 0);
        for (std::uint32_t k = 0; k < kept; ++k) {
          shown[n] = shown[k];
          n += Marks::is_shown_by(records.settled(*stored[k], words[k]), walk.moment);
        }
        if (n == 0) continue;
      }
      show(shown, n, x, a, counters, f);
    }
    if (candidates.have_lists) [[unlikely]]
      test_lists(walk, x, a, counters, f);
  }

  /// The same of the cells' lists. Apart, since most cells have none.
  template <class Counters, class F>
  [[gnu::noinline]] void test_lists(const Walk& walk, const SurfacePoint& x, float a, Counters& counters,
                                    F&& f) noexcept {
    for (std::uint32_t i = 0; i < walk.cells; ++i) {
      list.visit(walk.cell[i]->rest, list.moment(), [&](UnitIndex place) noexcept {
        Stored& stored = records.at(place);
        if (!records.shows(stored, walk.moment)) return;
        ShownRecords shown;
        shown.fill(&stored.record);
        show(shown, 1, x, a, counters, f);
      });
    }
  }

  template <class Counters, class F>
  void show(const ShownRecords& shown, std::uint32_t n, const SurfacePoint& x, float a, Counters& counters,
            F&& f) noexcept {
    for (const Record* record :
         shown) {  // vectors load all of them (P6), and nobody's, which is never written
      if (record != &records.at(Records::kNobodys).record) Sync::reads(record, sizeof *record);
    }
    const std::uint32_t valid = show_valid(kernels, x, a, shown, n, f);
    counters.template add<&Counts::records_read>(n);
    counters.template add<&Counts::records_valid>(valid);
  }
};

}  // namespace icbench
