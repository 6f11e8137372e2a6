// What becomes of the others when a thread is stopped in the middle of an operation: trials on a synthetic workload,
// with one thread of the team held again and again at moments of nobody's choosing, and without.
//
// Only the others' latencies count. Since a thread that waits does not ask, one long wait is one operation among many
// thousands; `stalled_share` weighs it by its time: of the others' time, what went into operations that took more than
// half a hold.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "harness/results.h"
#include "harness/topology.h"
#include "workload/dispatch.h"
#include "workload/spec.h"

namespace icbench {

struct PreemptRequest {
  WorkloadSpec workload;  ///< synthetic
  std::vector<std::string> caches;
  unsigned threads = 2;  ///< the one that is held and those that are measured: 2 at least
  Placement placement = Placement::compact;
  unsigned repetitions = 7;
  std::uint64_t seed = 1;
  unsigned hold_ms = 10;  ///< of every hold
  /// Mean between two holds, drawn from 0.5 to 1.5 times that; then the next tick that finds it at work.
  unsigned pause_ms = 10;
};

class Preempt {
 public:
  /// Throws std::runtime_error with one line for a workload that renders, a cache for a single thread, or too few
  /// threads.
  Preempt(PreemptRequest request, const Topology& topology);
  ~Preempt();

  const PreemptRequest& request() const noexcept { return request_; }
  const TickRate& tick_rate() const noexcept { return tick_rate_; }
  const Work& work() const noexcept { return work_; }
  /// Takes simulated work as it was for the run that this one resumes.
  void use(const Work& work) noexcept { work_ = work; }

  struct Point {
    const CacheEntry* cache;
    bool is_held;
  };
  /// In the random order of a repetition.
  std::vector<Point> points(unsigned repetition) const;
  /// "preempt/WORKLOAD/CACHE/threads:N/held" or ".../free".
  std::string name_of(const Point& point) const;

  /// Throws InvalidTrial (workload/trial_entry.h) if the trial was not valid.
  Entry run(const Point& point, unsigned repetition);

 private:
  PreemptRequest request_;
  const Topology& topology_;
  Work work_;
  TickRate tick_rate_;
  std::unique_ptr<SyntheticPlan> plan_;
  std::unique_ptr<ThreadTeam> team_;
};

}  // namespace icbench
