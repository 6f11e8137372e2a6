// Which cells of the packed octree a record must be known in: those its validity region may reach, and no others.
//
// A record is placed at the level whose cells are kCellWidth to 2 kCellWidth times as wide as its reach a_max R (the
// root if it is larger, kPackedLevels if it is tiny). There its sphere meets two cells an axis at most, eight in all;
// one level below, three an axis. A cell is left out if it lies outside the sphere, or wholly behind the record:
//
//   Valid at x means d.(n + n_x)/2 >= -0.01 R for d = x - p (core/interpolation.h). With |n - n_x| = sqrt(2 bend) and
//   sqrt(bend) < a - |d|/R, it follows that d.n >= -0.01 R - |d| (a - |d|/R) / sqrt(2) >= -(0.01 + a^2/4/sqrt(2)) R. So
//   no valid point is deeper below the record's plane than kInFrontTolerance/a + a/4/sqrt(2) of its reach.
//
// Both tests have slack for rounding: |u(x) - u(p)| errs by less than 0.44 grid units an axis (core/octree.h), and the
// last cells hold what lies up to a unit behind them.
#pragma once

#include <utility>

#include "core/interpolation.h"
#include "core/octree.h"
#include "core/types.h"

namespace icbench {

/// Levels below the root of the packed octree; its smallest cells are 2^-13 of the root's side, 2^7 grid units.
inline constexpr int kPackedLevels = 13;

/// A cell: its corner in units of its level's cells.
struct PackedCell {
  std::int32_t x, y, z;
  int level;

  PackedCell child(unsigned octant) const noexcept {
    return {2 * x + static_cast<std::int32_t>(octant & 1u),
            2 * y + static_cast<std::int32_t>((octant >> 1) & 1u),
            2 * z + static_cast<std::int32_t>(octant >> 2), level + 1};
  }
  /// Grid units.
  float side() const noexcept { return static_cast<float>(1 << (kMaxLevel - level)); }
  /// Lower corner, grid units.
  glm::vec3 corner() const noexcept {
    return glm::vec3(static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)) * side();
  }
};

/// A record's reach in grid units.
class PackedReach {
 public:
  /// Least width of a record's cell, in its reaches: so little above 2 that a sphere meets two cells an axis at most,
  /// for at the last level a cell is 2^7 units, and 2 (2^7 / 2.1 + kSlack) < 2^7.
  static constexpr float kCellWidth = 2.1f;

  PackedReach(const OctreeAddressing& addressing, const Record& r, float a_max) noexcept
      : p_(addressing.to_grid(r.p)),
        n_(r.n),
        reach_(addressing.to_grid(a_max * r.R)),
        depth_((kInFrontTolerance / a_max + a_max * 0.17677670f) * reach_ * 1.001f + kDepthSlack),
        level_(level_of(addressing, r, a_max)) {
    const float far = std::min(reach_ + kSlack, static_cast<float>(1 << kMaxLevel));
    for (int axis = 0; axis < 3; ++axis) {
      low_[axis] = grid(p_[axis] - far);
      high_[axis] = grid(p_[axis] + far);
    }
  }

  static int level_of(const OctreeAddressing& addressing, const Record& r, float a_max) noexcept {
    return std::min(addressing.level_for(0.5f * kCellWidth * a_max * r.R), kPackedLevels);
  }

  const glm::vec3& p() const noexcept { return p_; }
  const glm::vec3& n() const noexcept { return n_; }
  float reach() const noexcept { return reach_; }
  int level() const noexcept { return level_; }

  /// The least and the greatest cell of `level` that the sphere's box touches.
  std::pair<GridPoint, GridPoint> cells(int level) const noexcept {
    const int shift = kMaxLevel - level;
    return {{low_[0] >> shift, low_[1] >> shift, low_[2] >> shift},
            {high_[0] >> shift, high_[1] >> shift, high_[2] >> shift}};
  }

  /// Children of `cell` that the sphere's box touches, a bit each: at least one if the box touches the cell.
  unsigned children(const PackedCell& cell) const noexcept {
    const int shift = kMaxLevel - cell.level - 1;
    const auto axis = [&](int i, std::int32_t corner, unsigned lower, unsigned upper) {
      const std::int32_t middle = (2 * corner + 1) << shift;
      return (low_[i] < middle ? lower : 0u) | (high_[i] >= middle ? upper : 0u);
    };
    return axis(0, cell.x, 0x55u, 0xaau) & axis(1, cell.y, 0x33u, 0xccu) & axis(2, cell.z, 0x0fu, 0xf0u);
  }

  /// Whether the record may be valid somewhere in the cell.
  bool touches(const PackedCell& cell) const noexcept {
    const float side = cell.side();
    const glm::vec3 corner = cell.corner();
    float distance2 = 0.0f, height = 0.0f;  // height: of the corner farthest along the normal
    for (int i = 0; i < 3; ++i) {
      const float below = corner[i] - p_[i], above = p_[i] - (corner[i] + side);
      const float outside = std::max({below, above, 0.0f});
      distance2 += outside * outside;
      height += n_[i] * (n_[i] > 0.0f ? -above : below);
    }
    const float most = reach_ + kSlack;
    return distance2 <= most * most && height >= -depth_;
  }

 private:
  static constexpr float kSlack = 2.5f, kDepthSlack = 5.0f;  // grid units

  static std::int32_t grid(float u) noexcept {
    constexpr float kLast = static_cast<float>((1 << kMaxLevel) - 1);
    return static_cast<std::int32_t>(std::clamp(u, 0.0f, kLast));
  }

  glm::vec3 p_, n_;
  float reach_, depth_;
  int level_;
  std::int32_t low_[3], high_[3];
};

}  // namespace icbench
