// The error that threads add: where records of a shared cache lie depends on which thread asks first, so that pictures
// of one seed differ. How far, beside how far they are from the truth anyway?
//
// Several runs of one frame, all with the same seed, by every cache on every number of threads; compared is the
// indirect light at identical primary hits, one through the centre of each pixel, by its root-mean-square difference
// from
//     the picture that one thread makes through the same cache,
//     the run before on as many threads: sqrt(2) times the deviation of a run, in expectation,
//     the same run on the next smaller number of threads that was asked for,
// each as it is, relative to the picture's mean, and relative to the picture's own error. That is judged by path-traced
// indirect light at the same hits, less the reference's own error, which stands beside it.
//
// With one thread nothing is left to chance: every difference between two runs is 0.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "harness/results.h"
#include "harness/topology.h"
#include "workload/frame_renderer.h"
#include "workload/ray_traced_plan.h"

namespace icbench {

struct RepeatabilityRequest {
  /// Scene, integrator through a cache, parameters and seed; team and cache are not used.
  FrameRequest frame;
  std::string scene;         ///< name in the results
  std::uint32_t number = 0;  ///< of the frame
  Placement placement = Placement::compact;
  unsigned repetitions = 3;
  std::uint32_t reference_spp = 256;  ///< at least 2
};

/// A cache on a number of threads.
struct RepeatabilityPoint {
  const CacheEntry* cache;
  unsigned threads;
  unsigned fewer;  ///< the next smaller number that is measured; 0: none
};

/// The points of caches, each by rising thread count. Those that serve a single thread have the point of 1 alone.
std::vector<RepeatabilityPoint> repeatability_points(std::span<const CacheEntry* const> caches,
                                                     std::vector<unsigned> threads);

/// Bytes that a study takes beside the pictures of one frame.
std::uint64_t repeatability_bytes(const RepeatabilityRequest& request, std::size_t points);

class RepeatabilityStudy {
 public:
  /// Path traces the reference. `progress` is told how much of reference_work was done.
  RepeatabilityStudy(const RepeatabilityRequest& request, const Topology& topology,
                     const std::function<void(double)>& progress);

  static double reference_work(const RepeatabilityRequest& request);

  /// Name in the results, "repeatability/SCENE/INTEGRATOR/CACHE/threads:N"; deterministic:
  /// ".../deterministic/CACHE...".
  std::string name_of(const RepeatabilityPoint& point) const;

  /// Measures a point. Pictures that it is compared with and that this study has not rendered, since an earlier process
  /// measured them, are rendered again without being measured.
  Entry run(const RepeatabilityPoint& point, unsigned repetition);

 private:
  struct Rendered {
    unsigned repetition;
    FrameCost cost;
    double cpu_seconds;
    Image indirect;

    std::uint64_t records_made() const noexcept { return cost.pass.use.queries - cost.pass.use.hits; }
  };

  FrameRequest request_of(const RepeatabilityPoint& point);
  Rendered render(const RepeatabilityPoint& point, unsigned repetition);
  const Rendered& single(const CacheEntry& cache);
  const Rendered& last(const RepeatabilityPoint& point, unsigned repetition);

  RepeatabilityRequest request_;
  const Topology& topology_;
  Reference reference_;
  std::map<unsigned, std::unique_ptr<ThreadTeam>> teams_;  // by size
  std::map<const CacheEntry*, Rendered> single_;           // by one thread, its first run
  std::map<std::string, Rendered> last_;                   // run of every point, by name
};

}  // namespace icbench
