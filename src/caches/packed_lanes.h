// Lanes: what a cell of the packed octree knows of a record, 12 bytes of it, and the test that needs no more.
//
// A lane holds the record's place to 10 bits an axis of four cells' width, its normal to 8 bits an axis, its reach as a
// float of 8 bits, and its index. `keeps` tells from that whether the record may be valid at a point. It is
// conservative: it never turns away a valid record, and what it keeps is tested exactly by the record itself
// (core/interpolation.h). So how a lane is tested changes no answer; scalar code and SIMD of every width keep the same
// lanes even so, for they do the same operations in single precision, each correctly rounded.
//
// Units. Positions are in grid units (core/octree.h); a step is 2^-8 of the cell's side. Reach is a_max R.
//
// Why it is conservative. With u = |p - p_i| / (a_max R), valid means a_max u + sqrt(bend) < a in single precision,
// that is |p - p_i| < reach (a - sqrt(bend)) / a_max. Of the quantities in this
//
//   distance   errs by half a step an axis, 0.87 steps, for the lane's place; by 0.44 grid units an axis for the scaling
//              of both positions and the validity test itself (core/octree.h), 0.77 in all. kSlackSteps and kSlackUnits
//              are more, and are given to the right-hand side.
//   reach      is rounded up; 0xff stands for a reach or place that cannot be expressed: kept whatever the distance.
//   bend       1 - n.n_i errs by sqrt(3) / 2 / 127 < kNormalSlack for the lane's normal, which is taken off.
//   a / a_max  is enlarged by a share of kRoundingSlack, worth a hundred roundings.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <glm/vec3.hpp>

#include "core/arena.h"
#include "core/octree.h"

namespace icbench {

/// Steps of a lane's place that make a cell's side, as a power of two.
inline constexpr int kStepBits = 8;
/// Most that a record's reach may be, in sides of the cell its lane lies in.
inline constexpr float kLaneMargin = 1.5f;

/// A record as a cell knows it.
struct Lane {
  std::uint32_t place;  ///< x, y, z: 10 bits each, steps from kLaneMargin sides in front of the cell
  std::uint32_t shape;  ///< x, y, z of the normal: signed bytes, in 127ths; the reach: a byte
};

/// How a lane's reach is a float's bits: exponent and four bits of mantissa, from 2^-2 steps on.
inline constexpr int kReachShift = 19;
inline constexpr std::uint32_t kReachBase = std::uint32_t{127 - 2} << 23;
inline constexpr std::uint32_t kReachAlways = 0xff;
/// Steps; stands for any reach.
inline constexpr float kFarReach = 1e15f;

inline constexpr float kSlackSteps = 1.0f;
inline constexpr float kSlackUnits = 0.85f;
inline constexpr float kNormalSlack = 0.007f;
inline constexpr float kRoundingSlack = 1e-5f;

/// Steps of a cell of `level` that make a grid unit: 2^(kStepBits - kMaxLevel + level).
inline float steps_of_unit(int level) noexcept {
  return std::bit_cast<float>(static_cast<std::uint32_t>(127 + kStepBits - kMaxLevel + level) << 23);
}

/// The lane of a record in a cell of `level` with lower corner `corner`. `p` and `reach` in grid units.
inline Lane make_lane(const glm::vec3& p, const glm::vec3& n, float reach, const glm::vec3& corner,
                      int level) noexcept {
  const float steps = steps_of_unit(level);
  Lane lane{};
  bool is_expressible = true;
  for (int axis = 0; axis < 3; ++axis) {
    const float at = (p[axis] - corner[axis]) * steps + kLaneMargin * (1 << kStepBits);
    is_expressible &= at >= 0.0f && at < 1024.0f;
    lane.place |= static_cast<std::uint32_t>(std::clamp(at, 0.0f, 1023.0f)) << (10 * axis);
    const float normal = std::clamp(n[axis] * 127.0f, -127.0f, 127.0f);
    const auto byte = static_cast<std::int32_t>(normal + (normal < 0.0f ? -0.5f : 0.5f));
    lane.shape |= (static_cast<std::uint32_t>(byte) & 0xffu) << (8 * axis);
  }
  const float least = std::bit_cast<float>(kReachBase);
  const float rounded = std::min(std::max(reach * steps * (1.0f + kRoundingSlack), least), kFarReach);
  const std::uint32_t bits = std::bit_cast<std::uint32_t>(rounded) - kReachBase;
  const std::uint32_t code = (bits + (1u << kReachShift) - 1) >> kReachShift;
  lane.shape |= (is_expressible ? std::min(code, kReachAlways) : kReachAlways) << 24;
  return lane;
}

/// A query, as lanes see it, but for its place.
struct LaneQuery {
  float nx, ny, nz;  ///< normal / 127
  float a;           ///< a / a_max, and a little more
  float per_bend;    ///< 1 / a_max
};

inline LaneQuery make_lane_query(const glm::vec3& n, float a, float a_max) noexcept {
  constexpr float kByte = 1.0f / 127.0f;
  const float per_bend = 1.0f / a_max;
  return {n.x * kByte, n.y * kByte, n.z * kByte, a * per_bend * (1.0f + kRoundingSlack), per_bend};
}

/// Where a query is for the lanes of one cell: steps, from where their places count.
struct LanePoint {
  float x, y, z;
  float slack;
};

/// A query at `p`, in grid units, before a cell of `level` with lower corner `corner`. The differences are exact: p
/// lies in the cell.
inline LanePoint make_lane_point(const glm::vec3& p, const glm::vec3& corner, int level) noexcept {
  const float steps = steps_of_unit(level);
  // Half a step: a lane's place is the lower end of where it may be.
  constexpr float kOrigin = kLaneMargin * (1 << kStepBits) - 0.5f;
  return {(p.x - corner.x) * steps + kOrigin, (p.y - corner.y) * steps + kOrigin,
          (p.z - corner.z) * steps + kOrigin, kSlackSteps + kSlackUnits * steps};
}

/// Whether a lane's record may be valid.
inline bool keeps(const LaneQuery& q, const LanePoint& at, const Lane& lane) noexcept {
  const auto place = [&](int shift) { return static_cast<float>((lane.place >> shift) & 1023u); };
  const auto normal = [&](int shift) {
    return static_cast<float>(static_cast<std::int32_t>(lane.shape << (24 - shift)) >> 24);
  };
  const float dx = at.x - place(0), dy = at.y - place(10), dz = at.z - place(20);
  const float distance2 = dx * dx + dy * dy + dz * dz;
  const float dot = q.nx * normal(0) + q.ny * normal(8) + q.nz * normal(16);
  const float bend = std::max((1.0f - kNormalSlack) - dot, 0.0f);
  const float share = q.a - std::sqrt(bend) * q.per_bend;
  const std::uint32_t code = lane.shape >> 24;
  const float reach =
      code == kReachAlways ? kFarReach : std::bit_cast<float>((code << kReachShift) + kReachBase);
  const float most = reach * share + at.slack;
  return share > 0.0f && distance2 < most * most;
}

/// Lanes lie in chunks, in structure-of-arrays form: all places, all shapes, all indices. A cell has three chunks at
/// most, of 8, 16 and 40 lanes, numbered through, and one bit of its mask a lane.
inline constexpr int kChunks = 3;
inline constexpr std::uint32_t kCellLanes = 64;
inline constexpr std::array<std::uint32_t, kChunks + 1> kChunkBegin = {0, 8, 24, kCellLanes};

inline constexpr std::uint32_t chunk_lanes(int chunk) noexcept {
  return kChunkBegin[static_cast<std::size_t>(chunk) + 1] - kChunkBegin[static_cast<std::size_t>(chunk)];
}
inline constexpr int chunk_of(std::uint32_t lane) noexcept {
  return lane < kChunkBegin[1] ? 0 : lane < kChunkBegin[2] ? 1 : 2;
}

/// Most lanes that are tested at once, and strips of so many in a cell.
inline constexpr std::uint32_t kStripLanes = 16;
inline constexpr std::uint32_t kCellStrips = 5;

/// Neighbouring lanes of a chunk. Those outside `bits` may be written by others just now and must not be loaded.
struct LaneStrip {
  const std::uint32_t* words;  ///< places; shapes are `stride` further, indices once more
  const LanePoint* at;
  std::uint32_t stride;
  std::uint32_t bits;  ///< which lanes have been published
};

/// Writes the indices of all lanes of `n` strips that `keeps` keeps to `out`, in their order; returns how many. `out`
/// has room for kStripLanes more than there are lanes.
using LaneFilter = std::uint32_t (*)(const LaneQuery& q, const LaneStrip* strips, std::uint32_t n,
                                     UnitIndex* out);

/// One lane after the other.
inline std::uint32_t filter_lanes_scalar(const LaneQuery& q, const LaneStrip* strips, std::uint32_t n,
                                         UnitIndex* out) {
  std::uint32_t kept = 0;
  for (const LaneStrip* s = strips; s != strips + n; ++s) {
    for (std::uint32_t rest = s->bits; rest != 0; rest &= rest - 1) {
      const std::uint32_t* word = s->words + std::countr_zero(rest);
      if (keeps(q, *s->at, {word[0], word[s->stride]})) out[kept++] = word[2 * s->stride];
    }
  }
  return kept;
}

}  // namespace icbench
