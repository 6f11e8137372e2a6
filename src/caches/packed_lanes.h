// Lanes: what a cell of the packed octree knows of a record, 8 bytes of it, and the test that needs no more.
//
// A lane is one word for its record's reach, a float of 5 bits, and place, to 9 bits an axis of four cells' width, and
// one, its index, by which the record is found. `keeps` tells from the first whether the record may be valid at a
// point. It is conservative: it never turns away a valid record, and what it keeps is tested exactly by the record
// itself (core/interpolation.h). So how a lane is tested changes no answer; scalar code and SIMD of every width keep
// the same lanes even so, for they do the same operations in single precision, each correctly rounded. Normals are not
// in it: a cell holds only records that it is not wholly behind (caches/packed_reach.h), which leaves so few of other
// orientations that looking for them costs more than it saves (Cornell box, 10^5 records: of 43 lanes 6.1 reach a
// point, and 5.9 of these are valid there).
//
// Units. Positions are in grid units (core/octree.h); a step is 2^-7 of the cell's side. Reach is a_max R.
//
// Why it is conservative. Valid means |p - p_i| < R a in single precision, that is |p - p_i| < reach a / a_max. Of the
// quantities in this
//
//   distance   errs by half a step an axis, 0.87 steps, for the lane's place, and 2^-15 steps for the rounding of the
//              query's; by 0.44 grid units an axis for the scaling of both positions and the validity test itself
//              (core/octree.h), 0.77 in all. kSlackSteps and kSlackUnits are more, and are given to the right-hand
//              side.
//   reach      is rounded up; kReachAlways stands for a reach or place that cannot be expressed: kept whatever the
//              distance.
//   a / a_max  is enlarged by a share of kRoundingSlack, worth a hundred roundings.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <limits>

#include "core/arena.h"
#include "core/interpolation.h"
#include "core/octree.h"

namespace icbench {

/// Steps of a lane's place that make a cell's side, as a power of two.
inline constexpr int kStepBits = 7;
/// Bits an axis of a lane's place: from the lowest on a lane is its reach, x, y and z.
inline constexpr int kReachBits = 5, kPlaceBits = 9;
/// Where y lies: there, alone, it makes a float of kPlaceOrigin, which is kPlaceOrigin + y.
inline constexpr std::uint32_t kPlaceMask = ((1u << kPlaceBits) - 1) << (kReachBits + kPlaceBits);
inline constexpr float kPlaceOrigin = 1 << kPlaceBits;
static_assert(kReachBits + 3 * kPlaceBits == 32 &&
                  kReachBits + 2 * kPlaceBits == std::numeric_limits<float>::digits - 1,
              "y is the upper part of a mantissa");
/// Most that a record's reach may be, in sides of the cell its lane lies in.
inline constexpr float kLaneMargin = 1.5f;

/// How a lane's reach is a float's bits: exponent and three bits of mantissa, from 2^3 steps on.
inline constexpr int kReachShift = 20;
inline constexpr std::uint32_t kReachBase = std::uint32_t{127 + 3} << 23;
inline constexpr std::uint32_t kReachAlways = (1u << kReachBits) - 1;
/// Steps; stands for any reach.
inline constexpr float kFarReach = 1e15f;

inline constexpr float kSlackSteps = 1.0f;
inline constexpr float kSlackUnits = 0.85f;
inline constexpr float kRoundingSlack = 1e-5f;

/// Steps of a cell of `level` that make a grid unit: 2^(kStepBits - kMaxLevel + level).
inline float steps_of_unit(int level) noexcept {
  return std::bit_cast<float>(static_cast<std::uint32_t>(127 + kStepBits - kMaxLevel + level) << 23);
}

/// The first word of a lane of a record in a cell of `level` with lower corner `corner`: the reach, and x, y, z in
/// steps from kLaneMargin sides in front of the cell. `p` and `reach` in grid units.
inline std::uint32_t make_lane(const glm::vec3& p, float reach, const glm::vec3& corner, int level) noexcept {
  constexpr float kEnd = 1 << kPlaceBits;
  const float steps = steps_of_unit(level);
  std::uint32_t lane = 0;
  bool is_expressible = true;
  for (int axis = 0; axis < 3; ++axis) {
    const float at = (p[axis] - corner[axis]) * steps + kLaneMargin * (1 << kStepBits);
    is_expressible &= at >= 0.0f && at < kEnd;
    lane |= static_cast<std::uint32_t>(std::clamp(at, 0.0f, kEnd - 1.0f)) << (kReachBits + kPlaceBits * axis);
  }
  const float least = std::bit_cast<float>(kReachBase);
  const float rounded = std::min(std::max(reach * steps * (1.0f + kRoundingSlack), least), kFarReach);
  const std::uint32_t bits = std::bit_cast<std::uint32_t>(rounded) - kReachBase;
  const std::uint32_t code = (bits + (1u << kReachShift) - 1) >> kReachShift;
  return lane | (is_expressible ? std::min(code, kReachAlways) : kReachAlways);
}

/// Share of its reach that a record may be away from a query for accuracy a: a / a_max, and a little more.
inline float make_lane_share(float a, float a_max) noexcept { return a / a_max * (1.0f + kRoundingSlack); }

/// Where a query is for the lanes of one cell, which it is inside: steps from kPlaceOrigin in front of their place 0.
struct LanePoint {
  float x, y, z;
  float slack;
};

/// A query at `p`, in grid units, in the cell of `level` that holds `u`. What is taken from p is exact: p lies in the
/// cell.
inline LanePoint make_lane_point(const glm::vec3& p, const GridPoint& u, int level) noexcept {
  const float steps = steps_of_unit(level);
  const std::int32_t of_cell = -(1 << (kMaxLevel - level));
  const glm::vec3 corner(u.x & of_cell, u.y & of_cell, u.z & of_cell);
  // Half a step: a lane's place is the lower end of where it may be.
  constexpr float kOrigin = kPlaceOrigin + kLaneMargin * (1 << kStepBits) - 0.5f;
  return {(p.x - corner.x) * steps + kOrigin, (p.y - corner.y) * steps + kOrigin,
          (p.z - corner.z) * steps + kOrigin, kSlackSteps + kSlackUnits * steps};
}

/// Steps. `code`: a lane's lowest kReachBits.
constexpr float reach_of(std::uint32_t code) noexcept {
  return code == kReachAlways ? kFarReach : std::bit_cast<float>((code << kReachShift) + kReachBase);
}

/// Whether a lane's record may be valid; never that of a lane of zeros. `share`: of make_lane_share, about 1 at most.
inline bool keeps(float share, const LanePoint& at, std::uint32_t lane) noexcept {
  const auto place = [](std::uint32_t bits) {
    return std::bit_cast<float>((bits & kPlaceMask) | std::bit_cast<std::uint32_t>(kPlaceOrigin));
  };
  const float dx = at.x - place(lane << kPlaceBits);
  const float dy = at.y - place(lane);
  const float dz = at.z - place(lane >> kPlaceBits);
  const float distance2 = dx * dx + dy * dy + dz * dz;
  const float most = reach_of(lane & kReachAlways) * share + at.slack;
  return distance2 < most * most;
}

// A query inside its cell is at least kLaneMargin sides from place 0 on every axis; at the finest level a step is 2^-7
// grid units.
static_assert(kLaneMargin * (1 << kStepBits) - 1.0f >
                  1.01f * reach_of(0) + kSlackSteps + kSlackUnits * (1 << kStepBits),
              "a lane of zeros is kept nowhere");

/// Most lanes that are tested at once.
inline constexpr std::uint32_t kStripLanes = 16;
inline constexpr std::uint64_t kStripMask = (std::uint64_t{1} << kStripLanes) - 1;

/// Lanes lie in strips of so many, in structure-of-arrays form: their places, then their indices. A cell has four
/// strips at most, and one bit of its mask a lane.
inline constexpr std::uint32_t kStripWords = 2 * kStripLanes;
inline constexpr std::uint32_t kCellStrips = 4;
inline constexpr std::uint32_t kCellLanes = kCellStrips * kStripLanes;

/// The lanes of a cell, in strips. Those outside `mask` may be written by others just now and must not be loaded.
struct LaneRun {
  const std::uint32_t* first;  ///< the first strip's places
  const std::uint32_t* more;   ///< the second's, if a lane of it is in the mask; the others' follow
  std::uint64_t mask;          ///< which lanes have been published
  LanePoint at;
};

/// Where the words of a run lie, in words from one another.
struct LaneLayout {
  std::uint32_t step;    ///< from the second strip's places to the third's, and so on
  std::uint32_t stride;  ///< from a lane's place to its index
};

/// How lanes, and the records that they keep, are tested.
struct LaneKernels {
  /// Writes the indices of all lanes of `n` runs that `keeps` keeps to `out`, in their order; returns how many. `out`
  /// has room for kStripLanes more than there are lanes.
  std::uint32_t (*filter)(float share, LaneLayout layout, const LaneRun* runs, std::uint32_t n,
                          UnitIndex* out);

  /// weights[i] = split_sphere_weight(x, *records[i], a) for n records, bit for bit. Both arrays have room for
  /// kWeighed - 1 more, and there is a record at that many.
  void (*weigh)(const SurfacePoint& x, float a, const Record* const* records, std::uint32_t n,
                float* weights);

  /// Adds the irradiances of n <= kWeighed records, so weighted, and their weights to `sums`: the sums of these in
  /// single precision, of the first kSummed one after the other, of the others likewise, and then of both, bit for
  /// bit. Returns how many are valid. There is a record at kWeighed - 1 more.
  std::uint32_t (*add)(const SurfacePoint& x, float a, const Record* const* records, std::uint32_t n,
                       WeightedSums& sums);
};

/// Most records that are weighed at once, and of those so many are summed one after the other: each sum waits for the
/// one before.
inline constexpr std::uint32_t kWeighed = 8, kSummed = kWeighed / 2;

/// Records that are shown together: the first n of them, 0 < n <= kWeighed; behind them any records.
using ShownRecords = std::array<const Record*, kWeighed>;

/// Calls f(record, weight) for those that are valid at x, or adds them to the sums of an Interpolator
/// (core/interpolation.h). Returns how many are valid.
template <class F>
std::uint32_t show_valid(const LaneKernels& kernels, const SurfacePoint& x, float a,
                         const ShownRecords& records, std::uint32_t n, F& f) noexcept {
  if constexpr (std::is_same_v<F, Interpolator>) {
    return kernels.add(x, a, records.data(), n, f.sums());
  } else {
    std::array<float, kWeighed> weights;
    kernels.weigh(x, a, records.data(), n, weights.data());
    std::uint32_t valid = 0;
    for (std::uint32_t i = 0; i < n; ++i) {
      if (!(weights[i] > 0.0f)) continue;
      f(*records[i], weights[i]);
      ++valid;
    }
    return valid;
  }
}

/// One lane after the other.
inline std::uint32_t filter_lanes_scalar(float share, LaneLayout layout, const LaneRun* runs, std::uint32_t n,
                                         UnitIndex* out) {
  std::uint32_t kept = 0;
  for (const LaneRun* run = runs; run != runs + n; ++run) {
    const std::uint32_t *words = run->first, *next = run->more;
    for (std::uint64_t mask = run->mask; mask != 0;) {
      for (auto rest = static_cast<std::uint32_t>(mask & kStripMask); rest != 0; rest &= rest - 1) {
        const std::uint32_t* word = words + std::countr_zero(rest);
        if (keeps(share, run->at, *word)) out[kept++] = word[layout.stride];
      }
      mask >>= kStripLanes;
      if (mask == 0) break;
      words = next;
      next += layout.step;
    }
  }
  return kept;
}

/// One record after the other.
inline void weigh_records_scalar(const SurfacePoint& x, float a, const Record* const* records,
                                 std::uint32_t n, float* weights) {
  for (std::uint32_t i = 0; i < n; ++i) weights[i] = likely_split_sphere_weight(x, *records[i], a);
}
inline std::uint32_t add_records_scalar(const SurfacePoint& x, float a, const Record* const* records,
                                        std::uint32_t n, WeightedSums& sums) {
  glm::vec4 halves[] = {glm::vec4(0.0f), glm::vec4(0.0f)};
  std::uint32_t valid = 0;
  for (std::uint32_t i = 0; i < n; ++i) {
    const float weight = likely_split_sphere_weight(x, *records[i], a);
    halves[i / kSummed] += weight * glm::vec4(records[i]->E, 1.0f);
    valid += weight > 0.0f;
  }
  const glm::vec4 sum = halves[0] + halves[1];
  for (int i = 0; i < 4; ++i) sums[static_cast<std::size_t>(i)] += static_cast<double>(sum[i]);
  return valid;
}

}  // namespace icbench
