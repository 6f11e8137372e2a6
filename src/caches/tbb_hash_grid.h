// A hierarchy of hashed grids in oneTBB's containers: the cache that a production library would build of what it has.
//
// Use: Direct<TbbHashGrid>, a rival to measure the octrees against. There is a grid for each size of cell; a record is
// known in all cells that its validity region can reach of the grid whose cells are one to two such regions wide, and a
// query looks up one cell in every grid that has records. Cells are found through one tbb::concurrent_unordered_map, in
// which those of all grids are; records lie in a tbb::concurrent_vector, and the entries of a cell in one of its own.
//
// A concurrent_vector cannot be read by index while it grows: size() counts elements that are not constructed yet, and
// does not count those behind a segment that another thread is still allocating, though their own insert has returned.
// Its elements stay where they are, however, so the entries of a cell are linked, newest first, and queries follow the
// links.
//
// Publication pairs
//
//   P1  insert: mark store release -> visit: mark load acquire; publishes that all entries of the record are linked: it
//       appears in all cells at once, and no later query misses it anywhere
//
//   P2  the map publishes a cell that it has inserted to whoever finds it (oneTBB)
//
//   P3  link: newest CAS release -> visit: newest load acquire; publishes the entry and its record, and by the release
//       sequence of CASes all entries behind it
//
// Progress: blocking, as oneTBB's documentation promises no more. Insert: where a segment of a vector is missing, all
// threads that have elements in it spin until the one that came first has allocated it; and the allocator may lock. A
// query takes no lock where it only reads, but the map splits its buckets as it grows, and a find that is first in a
// new one allocates. Memory that the system does not have ends the process, as with any container.
//
// Linearization: insert by its mark (P1). Queries visit several cells: per-record linearizable, as the octrees are.
#pragma once

#include <oneapi/tbb/concurrent_unordered_map.h>
#include <oneapi/tbb/concurrent_vector.h>

#include <atomic>
#include <bit>

#include "caches/session.h"
#include "core/octree.h"
#include "core/parallel.h"
#include "core/random.h"

namespace icbench {

class TbbHashGrid {
 public:
  using SharedSync = StdSync;
  static constexpr std::string_view kPrefix = "";
  static constexpr std::string_view kStructure = "hash_grid";
  static constexpr CacheTraits kTraits{"tbb_hash_grid",
                                       kStructure,
                                       "tbb",
                                       ProgressGuarantee::blocking,
                                       ProgressGuarantee::blocking,
                                       Consistency::per_record_linearizable,
                                       false,
                                       "oneTBB's containers",
                                       true};

  struct Workspace {};

  explicit TbbHashGrid(const CacheConfig& config) : addressing_(config.bounds), a_max_(config.a_max) {}

  template <class Counters>
  bool insert(Workspace&, const Record& r, Counters&) {
    insert(r);
    return true;
  }

  template <class Counters, class F>
  void visit(const SurfacePoint& x, float a, Counters& counters, F&& f) const {
    const GridPoint u = addressing_.quantise(x.p);
    // Relaxed: as in insert.
    for (std::uint32_t rest = levels_.load(std::memory_order_relaxed); rest != 0; rest &= rest - 1) {
      const int level = std::countr_zero(rest);
      const int shift = kMaxLevel - level;
      const auto found = cells_.find(key(level, u.x >> shift, u.y >> shift, u.z >> shift));
      if (found == cells_.end()) continue;
      const Entry* entry = found->second.newest.load(std::memory_order_acquire /* P3 */);
      for (; entry != nullptr; entry = entry->next) {
        counters.template add<&Counts::records_read>(1);
        const float weight = split_sphere_weight(x, entry->record, a);
        if (weight > 0.0f && entry->stored->mark.load(std::memory_order_acquire /* P1 */)) {
          counters.template add<&Counts::records_valid>(1);
          f(entry->record, weight);
        }
      }
    }
  }

  /// Builds all anew if anything is dropped, else brings the copies in cells up to date. Quiescent.
  template <class F>
  void update(F&& f) {
    // Memory first: if there is none, nothing has changed. Copies that f's changes did not reach would show what is no
    // more.
    std::vector<UpdateResult> verdicts(records_.size(), UpdateResult::keep);
    std::vector<Record> kept;
    kept.reserve(verdicts.size());
    std::vector<Cell*> cells;
    for (auto& [key, cell] : cells_) cells.push_back(&cell);
    FirstException exception;
    exception.guard([&] {
      parallel_chunks(records_.size(), kUpdateGrain, [&](std::size_t first, std::size_t last) {
        for (std::size_t i = first; i < last; ++i) verdicts[i] = f(records_[i].record);
      });
    });
    for (std::size_t i = 0; i < verdicts.size(); ++i) {
      if (verdicts[i] == UpdateResult::keep) kept.push_back(records_[i].record);
    }
    // The cells' copies follow, also where f threw.
    if (kept.size() == verdicts.size()) {
      renew_copies(cells);
    } else {
      clear();
      parallel_chunks(kept.size(), kUpdateGrain, [&](std::size_t first, std::size_t last) noexcept {
        for (std::size_t i = first; i < last; ++i) insert(kept[i]);
      });
    }
    exception.rethrow();
  }

  template <class F>
  void for_each(F&& f) const {
    for (const Stored& stored : records_) f(stored.record);
  }

  void clear() {
    cells_.clear();
    records_.clear();
    levels_.store(0, std::memory_order_relaxed);  // relaxed: quiescent
  }

  std::uint64_t room(std::uint64_t /*live*/) const noexcept { return UINT32_MAX; }
  /// The containers cannot be asked for memory from several threads at once.
  void prefault(Workspace&, std::uint32_t) noexcept {}

  static std::size_t bytes(const Workspace&) noexcept { return 0; }
  /// Of records, cells and their entries, and a pointer for each bucket of the map; what the allocator adds is not
  /// known. Quiescent.
  std::size_t memory_bytes() const {
    std::size_t bytes = records_.capacity() * sizeof(Stored) + cells_.unsafe_bucket_count() * sizeof(void*);
    for (const auto& entry : cells_)
      bytes += sizeof entry + 2 * sizeof(void*) + entry.second.entries.capacity() * sizeof(Entry);
    return bytes;
  }

 private:
  struct Stored {
    explicit Stored(const Record& r) noexcept : record(r) {}
    Record record;
    std::atomic<bool> mark{false};
  };
  struct Entry {
    Record record;  // a copy: one place in memory to wait for
    const Stored* stored;
    const Entry* next;  // fixed before P3
  };
  struct Cell {
    tbb::concurrent_vector<Entry> entries;
    std::atomic<const Entry*> newest{nullptr};
  };
  struct KeyHash {
    std::size_t operator()(std::uint64_t key) const noexcept { return mix64(key); }
  };

  // The finest grid: 3 coordinates of 16 bits beside 5 bits of level make a key, and kSlack below stays small against a
  // cell of 16 units.
  static constexpr int kFinest = 16;
  static constexpr std::size_t kUpdateGrain = 1024;

  void insert(const Record& r) {
    const float extent = a_max_ * r.R;
    const int level = std::min(addressing_.level_for(extent), kFinest);
    Stored& stored = *records_.emplace_back(r);
    // What rounding adds (core/octree.h): two floors and the scaling.
    constexpr std::int32_t kSlack = 2;
    const auto reach =
        static_cast<std::int32_t>(std::min(addressing_.to_grid(extent), static_cast<float>(1 << kMaxLevel))) +
        kSlack;
    const GridPoint u = addressing_.quantise(r.p);
    const Range xs(u.x, reach, level), ys(u.y, reach, level), zs(u.z, reach, level);
    for (std::int32_t z = zs.first; z <= zs.last; ++z) {
      for (std::int32_t y = ys.first; y <= ys.last; ++y) {
        for (std::int32_t x = xs.first; x <= xs.last; ++x) link(cells_[key(level, x, y, z)], stored);
      }
    }
    // Relaxed: grids are never taken back, and what is in them is published by the pairs above. An insert that returns
    // has seen its grid's bit or set it, so a query that is called later sees it too, and one that is called after a
    // query that saw the record.
    const std::uint32_t bit = 1u << level;
    if ((levels_.load(std::memory_order_relaxed) & bit) == 0)
      levels_.fetch_or(bit, std::memory_order_relaxed);
    stored.mark.store(true, std::memory_order_release /* P1 */);
  }

  /// Brings those in `cells` up to date.
  static void renew_copies(std::span<Cell* const> cells) {
    parallel_chunks(cells.size(), kUpdateGrain, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i)
        for (Entry& entry : cells[i]->entries) entry.record = entry.stored->record;
    });
  }

  /// Cells of a grid that hold coordinates within `reach` of u: two an axis, or three where the slack counts.
  struct Range {
    Range(std::int32_t u, std::int32_t reach, int level) noexcept
        : first(std::max(u - reach, 0) >> (kMaxLevel - level)),
          last(std::min((u + reach) >> (kMaxLevel - level), (1 << level) - 1)) {}
    std::int32_t first, last;
  };

  static std::uint64_t key(int level, std::int32_t x, std::int32_t y, std::int32_t z) noexcept {
    const auto part = [](std::int32_t i) { return static_cast<std::uint64_t>(i); };
    return part(level) << 48 | part(z) << 32 | part(y) << 16 | part(x);
  }

  static void link(Cell& cell, const Stored& stored) {
    Entry& entry =
        *cell.entries.push_back({stored.record, &stored, cell.newest.load(std::memory_order_relaxed)});
    // Relaxed load and failure: who comes before is not read here.
    while (!cell.newest.compare_exchange_weak(entry.next, &entry, std::memory_order_release /* P3 */,
                                              std::memory_order_relaxed)) {
    }
  }

  OctreeAddressing addressing_;
  float a_max_;
  tbb::concurrent_vector<Stored> records_;
  tbb::concurrent_unordered_map<std::uint64_t, Cell, KeyHash> cells_;
  std::atomic<std::uint32_t> levels_{0};  // bit l: the grid of level l has had records
};

}  // namespace icbench
