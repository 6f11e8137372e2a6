// What the packed octree is to be faster than: the same copies of records in cells, found by one walk from the root,
// but whole records, tested one by one in scalar code. Read-only, for one thread or many, on large pages as the packed
// octree is.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "caches/packed_reach.h"
#include "core/cache.h"
#include "core/interpolation.h"
#include "core/large_page_allocator.h"
#include "core/octree.h"

namespace icbench {

class ReplicatedOctree {
 public:
  ReplicatedOctree(const CacheConfig& config, std::span<const Record> records)
      : addressing_(config.bounds), a_(config.a), cells_(1) {
    std::vector<std::vector<std::uint32_t>> lists(1);
    for (std::uint32_t i = 0; i < records.size(); ++i) {
      const PackedReach reach(addressing_, records[i], config.a_max);
      store(i, reach, {0, 0, 0, 0}, 0, lists);
    }
    for (std::size_t c = 0; c < cells_.size(); ++c) {
      cells_[c].first = static_cast<std::uint32_t>(copies_.size());
      for (const std::uint32_t i : lists[c]) copies_.push_back(records[i]);
      cells_[c].end = static_cast<std::uint32_t>(copies_.size());
    }
  }

  std::optional<Irradiance> query(const SurfacePoint& x) const noexcept {
    Interpolator interpolator;
    const GridPoint u = addressing_.quantise(x.p);
    for (std::uint32_t at = 0, level = 0;; ++level) {
      const Cell& cell = cells_[at];
      for (std::uint32_t i = cell.first; i < cell.end; ++i) {
        const float weight = split_sphere_weight(x, copies_[i], a_);
        if (weight > 0.0f) interpolator(copies_[i], weight);
      }
      if (level == kPackedLevels) break;
      at = cell.child[OctreeAddressing::octant(u, static_cast<int>(level))];
      if (at == 0) break;
    }
    return interpolator.result();
  }

 private:
  struct Cell {
    std::uint32_t child[8] = {};  // 0: none
    std::uint32_t first = 0, end = 0;
  };

  void store(std::uint32_t record, const PackedReach& reach, const PackedCell& where, std::uint32_t at,
             std::vector<std::vector<std::uint32_t>>& lists) {
    if (where.level == reach.level()) {
      lists[at].push_back(record);
      return;
    }
    for (unsigned i = 0; i < 8; ++i) {
      const PackedCell child = where.child(i);
      if (!reach.touches(child)) continue;
      std::uint32_t below = cells_[at].child[i];
      if (below == 0) {
        below = cells_[at].child[i] = static_cast<std::uint32_t>(cells_.size());
        cells_.emplace_back();
        lists.emplace_back();
      }
      store(record, reach, child, below, lists);
    }
  }

  OctreeAddressing addressing_;
  float a_;
  std::vector<Cell, LargePageAllocator<Cell>> cells_;
  std::vector<Record, LargePageAllocator<Record>> copies_;
};

}  // namespace icbench
