// What a synthetic workload does, generated before any clock starts and the same for every cache.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/cache.h"
#include "workload/spec.h"
#include "workload/surface_points.h"

namespace icbench {

/// Operations of all threads, one after the other; thread t runs [begin[t], begin[t + 1]).
struct Streams {
  /// Top bit set: insert record `operation & kIndex` of the plan; else query that point.
  static constexpr std::uint32_t kInsert = 1u << 31;
  static constexpr std::uint32_t kIndex = kInsert - 1;

  std::vector<std::uint32_t> operations;
  std::vector<std::uint32_t> begin;

  std::span<const std::uint32_t> of(unsigned thread) const {
    return std::span(operations).subspan(begin[thread], begin[thread + 1] - begin[thread]);
  }
};

/// The points that a plan is made of.
struct PlanPoints {
  SurfacePoints queries;
  std::vector<std::uint32_t> tile_ends;  ///< coherent order: index past each tile's last query point
  SurfacePoints sites;                   ///< of the records that are known beforehand
};

/// Points of the workload on the scene's surfaces; some tenths of a second. `seed` fixes them.
PlanPoints plan_points(const WorkloadSpec& spec, const RayTracer& rays, std::uint64_t seed);

class SyntheticPlan {
 public:
  /// `given` has as many sites as the workload has records beforehand, and tiles for coherent order; `seed`
  /// fixes the rest.
  SyntheticPlan(const WorkloadSpec& spec, PlanPoints given, std::uint64_t seed);
  SyntheticPlan(const WorkloadSpec& spec, const RayTracer& rays, std::uint64_t seed)
      : SyntheticPlan(spec, plan_points(spec, rays, seed), seed) {}

  const WorkloadSpec& spec() const noexcept { return spec_; }
  const std::vector<SurfacePoint>& points() const noexcept { return points_.points; }

  /// Records of the workload: the first `prefilled()` are stored before the clock starts, streams insert the
  /// others.
  const std::vector<Record>& records() const noexcept { return records_; }
  std::uint32_t prefilled() const noexcept { return prefilled_; }

  /// The record that a miss-driven stream inserts when its operation number `operation` misses.
  Record record_at(const Streams& streams, std::uint32_t operation) const noexcept;

  /// The operations of a repetition, dealt to `threads` threads: the same ones in the same order for any
  /// number of threads, except that threads which ask coherently each take tiles of their own.
  Streams streams(unsigned threads, std::uint64_t seed) const;

  /// Configuration of a cache for `threads` threads, with room for every record that may come.
  CacheConfig config(unsigned threads) const;
  /// The same but for the bounds, which no plan is needed for.
  static CacheConfig config(const WorkloadSpec& spec, unsigned threads);

  /// What queries would answer if only the records stored beforehand were there, by a single thread.
  struct Answers {
    std::uint64_t hits = 0;
    double sum = 0.0;  ///< of the red channel
  };
  Answers expected_answers(const Streams& streams) const;

  /// Streams that a single thread has to run for what so many threads do: in coherent order these take tiles of their
  /// own, else operations do not depend on how they are dealt.
  unsigned streams_of_one_thread(unsigned threads) const noexcept {
    return spec_.order == PointOrder::coherent ? threads : 1;
  }

  /// Records that a single thread leaves behind when it runs so many streams of `seed`, an operation of each in turn:
  /// what is more is redundant. 0 for workloads whose inserts do not depend on misses.
  std::uint64_t records_of_one_thread(unsigned streams, std::uint64_t seed) const;

 private:
  void scale_radii();
  void add_hot_spot(std::uint64_t seed);

  WorkloadSpec spec_;
  SurfacePoints points_;
  std::vector<std::uint32_t> tile_ends_;  // coherent order
  std::vector<std::uint32_t> hot_;        // hot_spot order: indices of the points in the spot
  std::vector<Record> records_;
  std::uint32_t prefilled_ = 0;
  std::vector<float> answers_;  // at each point, by the records stored beforehand; negative: a miss
};

/// Range of smooth_irradiance.
inline constexpr float kLeastIrradiance = 1.0f, kMostIrradiance = 3.0f;

/// A made-up irradiance that varies smoothly over space, W/m^2.
Irradiance smooth_irradiance(const glm::vec3& p) noexcept;

}  // namespace icbench
