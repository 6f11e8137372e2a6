// Octree addressing: which cell holds a record, and which cells a query must visit.
//
// Everything below the first float-to-integer step is integer arithmetic, so that insert and query can never
// disagree by rounding. Coordinates are in units of the smallest cell, 2^-kMaxLevel of the root's side.
//
// Ward's scheme (Ward, Rubinstein, Clear 1988): a record of extent r = a_max R is stored once, in the cell
// around its position whose side s satisfies 2 r <= s < 4 r (the root if r is larger than that allows, the
// smallest cell if r is tiny). Its validity sphere then stays within the cell enlarged by s/2 on every side,
// so a query visits exactly the cells whose enlarged cube holds the point: about 2^3 a level.
//
// Rounding: |u(p) - u(p_i)| <= r in units + 1 (two floors) + 0.44 (scaling, and the float test of validity),
// so the enlargement by s/2 gets a slack of kSlack = 2 units and no valid record is ever missed.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "core/types.h"

namespace icbench {

/// Levels below the root; the smallest cell has 2^-20 of the root's side: 0.1 mm in a hall of 100 m.
inline constexpr int kMaxLevel = 20;

/// Integer position, units of the smallest cell, each in [0, 2^kMaxLevel).
struct GridPoint {
  std::int32_t x, y, z;
};

class OctreeAddressing {
 public:
  explicit OctreeAddressing(const Bounds& b) noexcept : origin_(b.lower) {
    const glm::vec3 size = b.upper - b.lower;
    side_ = std::max({size.x, size.y, size.z, kSmallestSide});
    scale_ = static_cast<float>(1 << kMaxLevel) / side_;
  }

  /// Cell of the smallest size around `p`, which lies inside the bounds.
  GridPoint quantise(const glm::vec3& p) const noexcept { return quantise_grid(to_grid(p)); }
  /// The same of a point in units of the smallest cell.
  [[gnu::always_inline]] static GridPoint quantise_grid(const glm::vec3& p) noexcept {
    return {quantise_grid(p.x), quantise_grid(p.y), quantise_grid(p.z)};
  }

  /// `p` in units of the smallest cell, not rounded to one.
  glm::vec3 to_grid(const glm::vec3& p) const noexcept {
    return {(p.x - origin_.x) * scale_, (p.y - origin_.y) * scale_, (p.z - origin_.z) * scale_};
  }

  /// A length of `r` metres in units of the smallest cell; may be infinite.
  float to_grid(float r) const noexcept { return r * scale_; }

  /// Level at which a record of extent `r` metres is stored, 0 (root) to kMaxLevel.
  int level_for(float r) const noexcept {
    const float cells = side_ / (2.0f * r);  // infinite for a denormal r: the smallest cell
    if (!(cells >= 1.0f)) return 0;
    if (cells >= static_cast<float>(1 << kMaxLevel)) return kMaxLevel;
    return std::ilogb(cells);
  }

  /// Which child of a cell at `level` holds `u`: bit 0 for x, 1 for y, 2 for z.
  static unsigned octant(const GridPoint& u, int level) noexcept {
    const int shift = kMaxLevel - level - 1;
    return ((static_cast<unsigned>(u.x) >> shift) & 1u) |
           (((static_cast<unsigned>(u.y) >> shift) & 1u) << 1) |
           (((static_cast<unsigned>(u.z) >> shift) & 1u) << 2);
  }

 private:
  // Bounds smaller than this, a single point among them, are addressed as if they were this large: scale_ stays finite,
  // and distances whose squares would underflow lie within one cell.
  static constexpr float kSmallestSide = 1e-9f;

  static std::int32_t quantise_grid(float u) noexcept {
    return std::clamp(static_cast<std::int32_t>(u), 0, (1 << kMaxLevel) - 1);
  }

  glm::vec3 origin_;
  float side_;   // metres
  float scale_;  // units per metre
};

/// The cells of each level whose enlarged cube holds a query point: 8 a level, up to 27 where kSlack counts, 64 and
/// 125 in the two finest levels.
class WardNeighbourhood {
 public:
  explicit WardNeighbourhood(const GridPoint& u) noexcept : u_(u) {}

  /// Bit i is set if child i of cell (x, y, z) at `level` (coordinates in units of that level's cells) is to
  /// be visited.
  unsigned children(int level, std::int32_t x, std::int32_t y, std::int32_t z) const noexcept {
    const int shift = kMaxLevel - level - 1;
    const std::int32_t reach = ((1 << shift) >> 1) + kSlack;
    return axis(u_.x, reach, shift, 2 * x, 0x55u, 0xaau) & axis(u_.y, reach, shift, 2 * y, 0x33u, 0xccu) &
           axis(u_.z, reach, shift, 2 * z, 0x0fu, 0xf0u);
  }

 private:
  static constexpr std::int32_t kSlack = 2;

  static unsigned axis(std::int32_t u, std::int32_t reach, int shift, std::int32_t first, unsigned low,
                       unsigned high) noexcept {
    const std::int32_t from = (u - reach) >> shift;
    const std::int32_t to = (u + reach) >> shift;
    return (first >= from && first <= to ? low : 0u) | (first + 1 >= from && first + 1 <= to ? high : 0u);
  }

  GridPoint u_;
};

}  // namespace icbench
