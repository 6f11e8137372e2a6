// A sweep: workloads x caches x thread counts x repetitions, each a validated trial that becomes one row of
// results.
//
// Within a workload and repetition all caches and thread counts run in random order, so that slow drift of
// the machine falls on all of them alike; rows of one repetition are paired.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "harness/results.h"
#include "harness/topology.h"
#include "workload/dispatch.h"
#include "workload/spec.h"
#include "workload/trace_plan.h"
#include "workload/trial_entry.h"

namespace icbench {

struct SweepRequest {
  std::vector<WorkloadSpec> workloads;
  std::vector<std::string> caches;
  std::vector<unsigned> threads;
  Placement placement = Placement::compact;
  unsigned repetitions = 7;
  std::uint64_t seed = 1;
  std::uint32_t latency_every = 16;
  std::uint32_t reference_spp = 1024;  ///< samples per pixel of the ray-traced workloads' reference
  bool breakdown = false;              ///< account for all time, and count by hardware where it can
};

/// One point of a sweep.
struct SweepPoint {
  std::size_t workload;     ///< index into the request
  const CacheEntry* cache;  ///< null for a workload that uses none
  unsigned threads;

  std::string_view cache_name() const noexcept { return cache == nullptr ? "none" : cache->traits.name; }
};

class Sweep {
 public:
  /// Throws std::runtime_error with one line for an unknown cache, a trace that cannot be read or a sweep without a
  /// single point.
  Sweep(SweepRequest request, const Topology& topology);
  ~Sweep();

  const SweepRequest& request() const noexcept { return request_; }
  const Work& work() const noexcept { return work_; }
  /// Takes simulated work as it was for the run that this one resumes.
  void use(const Work& work) noexcept { work_ = work; }
  const TickRate& tick_rate() const noexcept { return tick_rate_; }

  /// The points of a workload, in the random order of a repetition. Caches for a single thread appear with
  /// one only.
  std::vector<SweepPoint> points(std::size_t workload, unsigned repetition) const;

  /// Name of a point in the results: "sweep/WORKLOAD/CACHE/threads:N".
  std::string name_of(const SweepPoint& point) const;

  /// Runs one repetition of one point; its spans go to `timeline`, if there is one. Throws InvalidTrial with one line
  /// if the trial was not valid.
  Entry run(const SweepPoint& point, unsigned repetition, Timeline* timeline = nullptr);

 private:
  struct SceneData;  // tracer of a scene
  struct ViewData;   // primary hits and reference of a scene and size
  struct PlanData;   // the plan of the workload in hand

  /// Throws std::runtime_error, with workload and cache, if one of its caches cannot be set up.
  void require_room(std::size_t workload) const;
  /// Whether there is a number of records that suffices, beyond which threads make some at once.
  bool makes_redundant_records(const SweepPoint& point) const;
  const RayTracer& tracer(const std::string& scene);
  const ViewData& view(const WorkloadSpec& spec);
  PlanData& plan(std::size_t workload);
  std::uint64_t records_of_one_thread(PlanData& plan, unsigned threads, std::uint64_t seed);
  ThreadTeam& team(unsigned threads);

  SweepRequest request_;
  const Topology& topology_;
  Work work_;
  TickRate tick_rate_;
  std::map<std::string, std::unique_ptr<SceneData>> scenes_;
  std::map<std::string, std::unique_ptr<ViewData>> views_;
  std::unique_ptr<PlanData> plan_;
  std::map<unsigned, std::unique_ptr<ThreadTeam>> teams_;
};

}  // namespace icbench
