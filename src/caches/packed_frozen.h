// What is left of the packed octree's costs when nothing can change any more: the records of a filled cache, built once
// into a structure that is only read. It answers as the cache does, and is the floor that a live cache is held against.
//
// Use: `PackedFrozen frozen(cache.config(), records)`, then `query` or `visit` from any number of threads.
//
// Memory. Records are sorted along a space-filling curve (Morton order), so that those of a neighbourhood share pages.
// An octree's leaves partition space, and a leaf knows all records that reach it, whatever their size, in one run of
// lanes (caches/packed_lanes.h). A query looks up one word of a dense grid, goes down from there, tests one run, and
// reads the records that are kept. Without marks, masks or spare room.
#pragma once

#include <algorithm>
#include <cstring>
#include <optional>
#include <span>
#include <vector>

#include "caches/packed_filter.h"
#include "caches/packed_lanes.h"
#include "caches/packed_reach.h"
#include "caches/session.h"
#include "caches/tidy.h"
#include "core/cache.h"
#include "core/interpolation.h"
#include "core/large_page_allocator.h"
#include "core/octree.h"

namespace icbench {

class PackedFrozen {
 public:
  /// `records`: what is_storable within config.bounds.
  PackedFrozen(const CacheConfig& config, std::span<const Record> records)
      : config_(checked(config)), addressing_(config.bounds) {
    records_.reserve(records.size());
    for (const std::uint32_t i : order_in_space(records, addressing_)) records_.push_back(records[i]);
    std::vector<PackedReach> reaches;
    reaches.reserve(records_.size());
    std::vector<UnitIndex> all(records_.size());
    for (UnitIndex i = 0; i < records_.size(); ++i) {
      reaches.emplace_back(addressing_, records_[i], config_.a_max);
      all[i] = i;
    }
    while (grid_level_ < kMostGridLevel && records_.size() >> (2 * grid_level_ + 5) != 0) ++grid_level_;
    grid_.resize(std::size_t{1} << (3 * grid_level_));
    words_.resize(kStripLanes);  // run 0: empty
    fill_grid({0, 0, 0, 0}, all, reaches);
    words_.resize(words_.size() + kStripLanes);  // strips are loaded whole
    words_.shrink_to_fit();
    nodes_.shrink_to_fit();
  }

  /// Calls f(record, weight) for every record valid at x.
  template <class F>
  void visit(const SurfacePoint& x, F&& f) const noexcept {
    if (!is_askable(x, config_.bounds)) return;
    const glm::vec3 p = addressing_.to_grid(x.p);
    const GridPoint u = OctreeAddressing::quantise_grid(p);
    std::uint32_t word = grid_[grid_index(u)];
    for (int level = grid_level_; (word & kIsNode) != 0; ++level)
      word = nodes_[word & ~kIsNode].child[OctreeAddressing::octant(u, level)];
    const std::uint32_t* run = words_.data() + std::size_t{word} * kRunUnit;
    const std::uint32_t n = run[0] & kMostLanes;
    __builtin_prefetch(run + kStripLanes);
    const float share = make_lane_share(config_.a, config_.a_max);
    LaneRun lanes{nullptr, nullptr, 0, make_lane_point(p, u, static_cast<int>(run[0] >> kLevelShift))};
    std::array<UnitIndex, kCellLanes + kStripLanes> kept;
    for (std::uint32_t first = 0; first < n; first += kCellLanes) {
      lanes.first = run + 1 + first;
      lanes.more = lanes.first + kStripLanes;
      lanes.mask = ~std::uint64_t{0} >> (kCellLanes - std::min(n - first, kCellLanes));
      const std::uint32_t k = kernels_.filter(share, {kStripLanes, n}, &lanes, 1, kept.data());
      if (k == 0) continue;
      std::fill_n(kept.begin() + k, kWeighed, kept[0]);  // there is a record behind the last one
      for (std::uint32_t i = 0; i < k; i += kWeighed) {
        ShownRecords shown;
        for (std::uint32_t j = 0; j < kWeighed; ++j) shown[j] = &records_[kept[i + j]];
        show_valid(kernels_, x, config_.a, shown, std::min(k - i, kWeighed), f);
      }
    }
  }

  std::optional<Irradiance> query(const SurfacePoint& x) const noexcept {
    Interpolator interpolator;
    visit(x, interpolator);
    return interpolator.result();
  }

  std::size_t memory_bytes() const noexcept {
    return records_.size() * sizeof(Record) + nodes_.size() * sizeof(Node) +
           (grid_.size() + words_.size()) * sizeof(std::uint32_t);
  }

 private:
  // A word of the grid or of a node: a node's index, or where a leaf's run begins in units of kRunUnit words. A run is
  // a count and the leaf's level, so many lanes' places, and their indices. A leaf above the grid's level is in all
  // entries of the grid that it covers.
  static constexpr std::uint32_t kIsNode = 1u << 31;
  static constexpr std::size_t kRunUnit = 4;
  static constexpr int kLevelShift = 27;
  static constexpr std::uint32_t kMostLanes = (1u << kLevelShift) - 1;
  static_assert(kMaxCapacity <= kMostLanes && kPackedLevels < 32);
  static constexpr int kMostGridLevel = 7;
  // A leaf of more lanes is split, unless its children would hold as many, though half of its records reach less far
  // than an eighth of its side.
  static constexpr std::size_t kLeafLanes = 64;
  static constexpr double kLeastGain = 0.75;
  static constexpr float kSmallShare = 8.0f;

  template <class T>
  using Array = std::vector<T, LargePageAllocator<T>>;

  struct Node {
    std::uint32_t child[8];
  };

  std::size_t grid_index(const GridPoint& u) const noexcept {
    const int shift = kMaxLevel - grid_level_;
    return static_cast<std::size_t>(((((u.z >> shift) << grid_level_) | (u.y >> shift)) << grid_level_) |
                                    (u.x >> shift));
  }

  /// Those of `some` that reach each child of `cell`.
  using Parts = std::array<std::vector<UnitIndex>, 8>;
  static Parts split(const PackedCell& cell, std::span<const UnitIndex> some,
                     const std::vector<PackedReach>& reaches) {
    Parts parts;
    for (unsigned i = 0; i < 8; ++i) {
      const PackedCell child = cell.child(i);
      for (const UnitIndex r : some) {
        if (reaches[r].touches(child)) parts[i].push_back(r);
      }
    }
    return parts;
  }
  /// Whether the children of `cell`, as far as there is anything in them, have enough less to test than the cell would,
  /// or those below them will.
  static bool gains(const PackedCell& cell, std::span<const UnitIndex> some, const Parts& parts,
                    const std::vector<PackedReach>& reaches) {
    std::size_t all = 0, filled = 0, small = 0;
    for (const auto& part : parts) {
      all += part.size();
      filled += !part.empty();
    }
    for (const UnitIndex i : some) small += kSmallShare * reaches[i].reach() < cell.side();
    return static_cast<double>(all) < kLeastGain * static_cast<double>(filled * some.size()) ||
           2 * small >= some.size();
  }

  /// The entries of the grid's cells within `cell`, which is no finer than those.
  void fill_grid(const PackedCell& cell, std::span<const UnitIndex> some,
                 const std::vector<PackedReach>& reaches) {
    if (some.empty()) return;
    if (cell.level == grid_level_) return set_grid(cell, build(cell, some, reaches));
    const Parts parts = split(cell, some, reaches);
    if (!gains(cell, some, parts, reaches)) return set_grid(cell, add_leaf(cell, some, reaches));
    for (unsigned i = 0; i < 8; ++i) fill_grid(cell.child(i), parts[i], reaches);
  }
  void set_grid(const PackedCell& cell, std::uint32_t word) {
    const std::int32_t side = 1 << (grid_level_ - cell.level);
    for (std::int32_t z = cell.z * side; z < (cell.z + 1) * side; ++z)
      for (std::int32_t y = cell.y * side; y < (cell.y + 1) * side; ++y)
        for (std::int32_t x = cell.x * side; x < (cell.x + 1) * side; ++x)
          grid_[static_cast<std::size_t>((((z << grid_level_) | y) << grid_level_) | x)] = word;
  }

  /// The word for a cell of the grid's level or below.
  std::uint32_t build(const PackedCell& cell, std::span<const UnitIndex> some,
                      const std::vector<PackedReach>& reaches) {
    if (some.empty()) return 0;
    if (some.size() > kLeafLanes && cell.level < kPackedLevels) {
      const Parts parts = split(cell, some, reaches);
      if (gains(cell, some, parts, reaches)) {
        const std::size_t n = nodes_.size();
        nodes_.emplace_back();
        for (unsigned i = 0; i < 8; ++i) {
          const std::uint32_t word = build(cell.child(i), parts[i], reaches);
          nodes_[n].child[i] = word;
        }
        return static_cast<std::uint32_t>(n) | kIsNode;
      }
    }
    return add_leaf(cell, some, reaches);
  }

  std::uint32_t add_leaf(const PackedCell& cell, std::span<const UnitIndex> some,
                         const std::vector<PackedReach>& reaches) {
    const std::size_t begin = words_.size();
    if (begin / kRunUnit >= kIsNode) fail_setup("a frozen cache of so many and large records is too large");
    words_.push_back(static_cast<std::uint32_t>(some.size()) | static_cast<std::uint32_t>(cell.level)
                                                                   << kLevelShift);
    for (const UnitIndex i : some)
      words_.push_back(make_lane(reaches[i].p(), reaches[i].reach(), cell.corner(), cell.level));
    words_.insert(words_.end(), some.begin(), some.end());
    words_.resize((words_.size() + kRunUnit - 1) / kRunUnit * kRunUnit);
    return static_cast<std::uint32_t>(begin / kRunUnit);
  }

  CacheConfig config_;
  OctreeAddressing addressing_;
  LaneKernels kernels_ = SimdLanes::best();
  Array<Record> records_;
  int grid_level_ = 0;
  Array<std::uint32_t> grid_, words_;
  Array<Node> nodes_;
};

}  // namespace icbench
