// A lock for every region of the packed octree (caches/packed_cells.h): the mechanism of `packed_node_lock`.
//
// A region is a cell of the grid's upper levels, for itself, and at the finest of these, whose cells hold a brick each,
// with the brick and everything below it. Whoever comes by takes the locks of all regions that it will read or write
// before it does, from coarse to fine and on each level in order of z, y and x, and keeps them to its end:
//
//   visit   the regions that hold the point, on the levels in use
//   insert  the regions that the record's box touches, from the coarsest level at which a cell may take it
//
// All take locks in one order, so that nobody waits in a circle. What is in a region is ordinary memory (L1,
// caches/locks.h); pools, the levels in use and places left by dropped records are shared beyond regions and stay
// atomic. An insert holds all locks at once, so its record appears everywhere at once. A visit that reads the levels in
// use before an insert adds one to them may see a later record but not that one: per-record linearizable.
//
// A lock in every cell and node below would cost a query more locks than it reads cache lines.
#pragma once

#include <bit>
#include <vector>

#include "caches/locks.h"
#include "caches/packed_reach.h"

namespace icbench {

template <class NodeLock>
class PackedRegions {
 public:
  /// Regions for the grid's levels 0 .. top.
  explicit PackedRegions(int top) : top_(top), regions_(begin_of(top + 1)) {}

  /// The locks that a visit to u holds. `levels`: those in use above the bricks, a bit each.
  template <class Counters>
  class VisitScope {
   public:
    VisitScope(PackedRegions& regions, const GridPoint& u, std::uint32_t levels, Counters& counters) noexcept
        : regions_(regions), u_(u), levels_((levels & ((1u << regions.top_) - 1)) | 1u << regions.top_) {
      each([&](Lock& lock) { acquire(lock, counters); });
    }
    ~VisitScope() {
      each([](Lock& lock) { lock.unlock(); });
    }
    VisitScope(const VisitScope&) = delete;
    VisitScope& operator=(const VisitScope&) = delete;

   private:
    template <class F>
    void each(F&& f) noexcept {
      for (std::uint32_t rest = levels_; rest != 0; rest &= rest - 1) {
        const int level = std::countr_zero(rest), shift = kMaxLevel - level;
        f(regions_.at(level, u_.x >> shift, u_.y >> shift, u_.z >> shift));
      }
    }
    PackedRegions& regions_;
    GridPoint u_;
    std::uint32_t levels_;
  };

  /// The locks that an insert holds whose record may be put into cells of levels `from` .. `to`.
  template <class Counters>
  class InsertScope {
   public:
    InsertScope(PackedRegions& regions, const PackedReach& reach, int from, int to,
                Counters& counters) noexcept
        : regions_(regions),
          reach_(reach),
          from_(std::min(from, regions.top_)),
          to_(std::min(to, regions.top_)) {
      each([&](Lock& lock) { acquire(lock, counters); });
    }
    ~InsertScope() {
      each([](Lock& lock) { lock.unlock(); });
    }
    InsertScope(const InsertScope&) = delete;
    InsertScope& operator=(const InsertScope&) = delete;

   private:
    template <class F>
    void each(F&& f) noexcept {
      for (int level = from_; level <= to_; ++level) {
        const auto [low, high] = reach_.cells(level);
        for (std::int32_t z = low.z; z <= high.z; ++z) {
          for (std::int32_t y = low.y; y <= high.y; ++y) {
            for (std::int32_t x = low.x; x <= high.x; ++x) f(regions_.at(level, x, y, z));
          }
        }
      }
    }
    PackedRegions& regions_;
    const PackedReach& reach_;
    int from_, to_;
  };

  std::size_t bytes() const noexcept { return regions_.size() * sizeof(Region); }

 private:
  using Lock = decltype(NodeLock::lock);
  struct alignas(kNoSharing) Region {
    Lock lock;
  };

  // Regions of the levels above `level`: (8^level - 1) / 7.
  static constexpr std::size_t begin_of(int level) noexcept {
    return ((std::size_t{1} << (3 * level)) - 1) / 7;
  }

  template <class Counters>
  static void acquire(Lock& lock, Counters& counters) noexcept {
    acquire_counted(
        counters, [&] { return lock.try_lock(); }, [&] { lock.lock(); });
  }
  Lock& at(int level, std::int32_t x, std::int32_t y, std::int32_t z) noexcept {
    const std::int32_t i = (((z << level) | y) << level) | x;
    return regions_[begin_of(level) + static_cast<std::size_t>(i)].lock;
  }

  int top_;
  std::vector<Region> regions_;
};

/// No locks: takes no memory and no time.
template <>
class PackedRegions<NoNodeLock> {
 public:
  explicit PackedRegions(int) noexcept {}
  template <class Counters>
  struct VisitScope {
    VisitScope(PackedRegions&, const GridPoint&, std::uint32_t, Counters&) noexcept {}
  };
  template <class Counters>
  struct InsertScope {
    InsertScope(PackedRegions&, const PackedReach&, int, int, Counters&) noexcept {}
  };
  static constexpr std::size_t bytes() noexcept { return 0; }
};

}  // namespace icbench
