// A hierarchy of hashed grids in oneTBB's containers: the cache that a production library would build of what it has.
//
// Use: Direct<TbbHashGrid>, a rival to measure the octrees against. There is a grid for each size of cell; a record is
// stored once, in the cell around it of the grid that fits its extent (Ward's addressing, core/octree.h), and a query
// looks up the eight cells around its point in every grid that has records. Cells are found through one
// tbb::concurrent_unordered_map, in which those of all grids are; the records of a cell lie in a tbb::concurrent_vector.
//
// A concurrent_vector cannot be read by index while it grows: size() counts elements that are not constructed yet, and
// does not count those behind a segment that another thread is still allocating, though their own insert has returned.
// Its elements stay where they are, however, so those of a cell are linked, newest first, and queries follow the links.
//
// Publication pairs
//
//   P1  insert: newest CAS release -> visit: newest load acquire; publishes the element, and by the release sequence of
//       CASes all those behind it
//
//   P2  the map publishes a cell that it has inserted to whoever finds it (oneTBB)
//
// Progress: blocking, as oneTBB's documentation promises no more. Insert: where a segment of a vector is missing, all
// threads that have elements in it spin until the one that came first has allocated it; and the allocator may lock. A
// query takes no lock where it only reads, but the map splits its buckets as it grows, and a find that is first in a
// new one allocates. Memory that the system does not have ends the process, as with any container.
//
// Linearization: insert by its CAS (P1). Queries visit several cells: per-record linearizable, as the octrees are.
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
    const int level = std::min(addressing_.level_for(a_max_ * r.R), kFinest);
    const GridPoint u = addressing_.quantise(r.p);
    const int shift = kMaxLevel - level;
    link(cells_[key(level, u.x >> shift, u.y >> shift, u.z >> shift)], r);
    // Relaxed: grids are never taken back, and what is in them is published by P1 and P2. An insert that returns has
    // seen its grid's bit or set it, so a query that is called later sees it too.
    const std::uint32_t bit = 1u << level;
    if ((levels_.load(std::memory_order_relaxed) & bit) == 0)
      levels_.fetch_or(bit, std::memory_order_relaxed);
    return true;
  }

  template <class Counters, class F>
  void visit(const SurfacePoint& x, float a, Counters& counters, F&& f) const {
    const GridPoint u = addressing_.quantise(x.p);
    // Relaxed: as in insert.
    for (std::uint32_t rest = levels_.load(std::memory_order_relaxed); rest != 0; rest &= rest - 1) {
      const int level = std::countr_zero(rest);
      const Range xs(u.x, level), ys(u.y, level), zs(u.z, level);
      for (std::int32_t z = zs.first; z <= zs.last; ++z) {
        for (std::int32_t y = ys.first; y <= ys.last; ++y) {
          for (std::int32_t at = xs.first; at <= xs.last; ++at) {
            const auto found = cells_.find(key(level, at, y, z));
            if (found != cells_.end()) visit(found->second, x, a, counters, f);
          }
        }
      }
    }
  }

  template <class F>
  void update(F&& f) {
    std::vector<Cell*> cells;
    for (auto& entry : cells_) cells.push_back(&entry.second);
    parallel_chunks(cells.size(), kUpdateGrain, [&](std::size_t first, std::size_t last) {
      std::vector<Record> kept;
      for (std::size_t i = first; i < last; ++i) {
        Cell& cell = *cells[i];
        kept.clear();
        for (Element& e : cell.elements) {
          if (f(e.record) == UpdateResult::keep) kept.push_back(e.record);
        }
        if (kept.size() == cell.elements.size()) continue;
        cell.newest.store(nullptr, std::memory_order_relaxed);  // relaxed: quiescent
        cell.elements.clear();
        for (const Record& r : kept) link(cell, r);
      }
    });
  }

  template <class F>
  void for_each(F&& f) const {
    for (const auto& entry : cells_) {
      for (const Element& e : entry.second.elements) f(e.record);
    }
  }

  void clear() {
    cells_.clear();
    levels_.store(0, std::memory_order_relaxed);  // relaxed: quiescent
  }

  std::uint32_t room() const noexcept { return UINT32_MAX; }
  /// The containers cannot be asked for memory from several threads at once.
  void prefault(Workspace&, std::uint32_t) noexcept {}

  static std::size_t bytes(const Workspace&) noexcept { return 0; }
  /// Of cells and their elements, and a pointer for each bucket of the map; what the allocator adds is not known.
  /// Quiescent.
  std::size_t memory_bytes() const {
    std::size_t bytes = cells_.unsafe_bucket_count() * sizeof(void*);
    for (const auto& entry : cells_)
      bytes += sizeof entry + 2 * sizeof(void*) + entry.second.elements.capacity() * sizeof(Element);
    return bytes;
  }

 private:
  struct Element {
    Record record;
    const Element* next;  // fixed before P1
  };
  struct Cell {
    tbb::concurrent_vector<Element> elements;
    std::atomic<const Element*> newest{nullptr};
  };
  struct KeyHash {
    std::size_t operator()(std::uint64_t key) const noexcept { return mix64(key); }
  };

  // The finest grid: 3 coordinates of 16 bits beside 5 bits of level make a key, and kSlack below stays small against a
  // cell of 16 units.
  static constexpr int kFinest = 16;
  static constexpr std::size_t kUpdateGrain = 64;

  /// Cells of a grid whose enlarged cube holds a coordinate u: two, or three where the slack counts (core/octree.h).
  struct Range {
    Range(std::int32_t u, int level) noexcept {
      constexpr std::int32_t kSlack = 2;
      const int shift = kMaxLevel - level;
      const std::int32_t reach = ((1 << shift) >> 1) + kSlack;
      first = std::max(u - reach, 0) >> shift;
      last = std::min((u + reach) >> shift, (1 << level) - 1);
    }
    std::int32_t first, last;
  };

  static std::uint64_t key(int level, std::int32_t x, std::int32_t y, std::int32_t z) noexcept {
    const auto part = [](std::int32_t i) { return static_cast<std::uint64_t>(i); };
    return part(level) << 48 | part(z) << 32 | part(y) << 16 | part(x);
  }

  static void link(Cell& cell, const Record& r) {
    Element& element = *cell.elements.push_back({r, cell.newest.load(std::memory_order_relaxed)});
    // Relaxed load and failure: who comes before is not read here.
    while (!cell.newest.compare_exchange_weak(element.next, &element, std::memory_order_release /* P1 */,
                                              std::memory_order_relaxed)) {
    }
  }

  template <class Counters, class F>
  static void visit(const Cell& cell, const SurfacePoint& x, float a, Counters& counters, F&& f) {
    for (const Element* e = cell.newest.load(std::memory_order_acquire /* P1 */); e != nullptr; e = e->next) {
      counters.template add<&Counts::records_read>(1);
      const float weight = split_sphere_weight(x, e->record, a);
      if (weight > 0.0f) {
        counters.template add<&Counts::records_valid>(1);
        f(e->record, weight);
      }
    }
  }

  OctreeAddressing addressing_;
  float a_max_;
  tbb::concurrent_unordered_map<std::uint64_t, Cell, KeyHash> cells_;
  std::atomic<std::uint32_t> levels_{0};  // bit l: the grid of level l has had records
};

}  // namespace icbench
