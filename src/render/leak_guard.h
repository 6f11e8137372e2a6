// A guard against light leaks: a record does not count where something stands between it and the point that asks.
//
// What leaks. A record's radius is a mean over all that it sees. Where little of that is near, as on a floor beside a
// low or thin wall, the region in which it is valid reaches through the wall, and the light of one side is interpolated
// to the other. No accuracy prevents it: radii have lower limits.
//
// The guard (the idea is that of Radiance's ambient cache by G. Ward, src/rt/ambcomp.c and ambient.c: flags of
// directions with each value, and a short ray where they warn). When a record is gathered, its tangent plane is divided
// into kLeakSectors sectors. Those are marked into which a ray went low, less than 45 degrees above the plane, and met
// something that is nearer along the plane than the record's reach a R, or of which a flat wall between two rays may
// be; and so are the sectors of the rays beside it. Such rays are those of the gather, and besides one into each
// sector that rises by kLeakLowSlope of its distance alone, since those of the gather pass over low walls. At a query
// the record counts as it is in unmarked directions, and everywhere nearer than such a wall may be. Elsewhere it counts
// only after a ray from the point to the record meets nothing, and not at all if it would bring less than kLeakWorth of
// what counts already. The ray's ends are lifted off the surfaces by the tracer's epsilon and by shares of their
// distance: the point's by kLeakLift, so that what is lower than that stops nothing, and the record's by kLeakRise, so
// that a slit under a wall lets nothing through unless the point lies close behind it.
//
// Records by virtual point lights gather no hemisphere, and the few rays that tell their radius pass over a low wall:
// of these a ray asks for each, wherever the point lies. It meets what stands there now, so that a record which lives
// on from frame to frame keeps nothing that would have to be renewed.
//
// What it cannot know. Of marked records: things that no ray met, thinner than the gap between two rays or lower than
// the low ones see. Of all: what is lower than the ends of the ray. Glass counts as a wall. A record that is stopped
// without need costs another record, no light.
//
// Costs: kLeakSectors short shadow rays a record. Marks are 8 bytes of a RecordDetail, which records that are
// extrapolated have anyway and others get for it. Unguarded, nothing. At a query one comparison for a record that has
// marked nothing, and one ray at most, kLeakPacket traced together, for each record that is valid at the point. So the
// steps of a query are those of its visit and a ray for each record visited.
#pragma once

#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <limits>

#include "core/types.h"
#include "render/hemisphere.h"
#include "render/ray_tracer.h"

namespace icbench {

inline constexpr std::uint32_t kLeakSectors = 32;  ///< a bit each
inline constexpr float kLeakLowSlope = 0.05f;      ///< of the distance along the tangent plane
inline constexpr float kLeakLift = 0.05f;          ///< of the distance
inline constexpr float kLeakRise = 0.25f;          ///< of the distance
inline constexpr std::uint32_t kLeakPacket = 16;   ///< rays
inline constexpr double kLeakWorth = 1.0 / 32;     ///< of the weight of what counts already

/// The sector of the direction (x, y) in a tangent plane; 0 of (0, 0). Sectors are even shares of the border of the
/// square |x| + |y| <= 1, counter-clockwise from (0, -1): no arc tangent tells them.
inline std::uint32_t leak_sector(float x, float y) noexcept {
  const float to_border = std::fabs(x) + std::fabs(y);
  if (!(to_border > 0.0f)) return 0;
  const float rise = y / to_border;                          // -1 to 1
  const float along = x < 0.0f ? 3.0f - rise : 1.0f + rise;  // 0 to 4
  return static_cast<std::uint32_t>(along * (0.25f * kLeakSectors)) % kLeakSectors;
}

/// The unit vector to the middle of a sector's share of that border.
inline glm::vec2 middle_of_leak_sector(std::uint32_t sector) noexcept {
  const float along = (static_cast<float>(sector) + 0.5f) * (4.0f / kLeakSectors);
  const float rise = along < 2.0f ? along - 1.0f : 3.0f - along;
  const float x = 1.0f - std::fabs(rise);
  return glm::normalize(glm::vec2(along < 2.0f ? x : -x, rise));
}

/// Where something stands around a record, by azimuth in the basis of its normal.
struct LeakMarks {
  std::uint32_t sectors = 0;  ///< bit i: in leak_sector i
  /// How near it may be along the tangent plane, metres.
  float nearest = std::numeric_limits<float>::infinity();
};

/// What is taken for the marks of a record of which nothing is known.
inline constexpr LeakMarks kMarkedEverywhere{~0u, 0.0f};

/// Which records have to be asked for: none without a guard, those in whose marks the point lies, or all.
enum class LeakSuspects : std::uint8_t { none, marked, all };

/// The marks of a record that is valid to the distance `reach`, metres, by what its gather saw.
LeakMarks leak_marks(const Hemisphere& seen, float reach) noexcept;

/// Adds what stands too low for that, by a ray into each sector. `basis`: of the record's normal.
void mark_low(LeakMarks& marks, Tracer& tracer, const Hit& at, const Basis& basis, float reach) noexcept;

/// What a guard did.
struct LeakTests {
  std::uint64_t rays = 0;     ///< traced, one a record and query
  std::uint64_t stopped = 0;  ///< of those, that met something

  LeakTests& operator+=(const LeakTests& o) noexcept {
    rays += o.rays;
    stopped += o.stopped;
    return *this;
  }
};

/// Whether only a ray can tell that light at the record `r` is light at the point.
inline bool is_suspect(const SurfacePoint& x, const Record& r, const LeakMarks& marks) noexcept {
  const glm::vec3 d = x.p - r.p;
  if (!(glm::dot(d, d) > marks.nearest * marks.nearest)) return false;
  const Basis basis(r.n);
  return (marks.sectors >> leak_sector(glm::dot(d, basis.s), glm::dot(d, basis.t)) & 1u) != 0;
}

/// The ray that tells; nothing lies on it: the record counts.
inline Ray leak_ray(const RayTracer& rays, const SurfacePoint& x, const Record& r) noexcept {
  const float distance = glm::distance(x.p, r.p);
  const glm::vec3 from = rays.leave(x.p, x.n) + kLeakLift * distance * x.n;
  const glm::vec3 to = rays.leave(r.p, r.n) + kLeakRise * distance * r.n;
  return {from, 1.0f, to - from};
}

}  // namespace icbench
