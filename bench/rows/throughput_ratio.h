// Throughput of one cache over that of another on a synthetic workload: whole validated trials, no counters.
#pragma once

#include <string_view>

#include "harness/thread_team.h"
#include "rows/row.h"
#include "scene/registry.h"
#include "workload/synthetic_trial.h"

namespace icbench {

/// A sample runs both caches, one right after the other, on the same operations.
template <template <class> class Above, template <class> class Below>
class ThroughputRatio : public Experiment {
 public:
  ThroughputRatio(const Machine& machine, std::string_view workload, unsigned threads)
      : machine_(machine),
        rays_(make_scene("cornell_box")),
        plan_(parse_workload(workload), rays_, machine.seed),
        team_(machine.topology, Placement::compact, threads) {}

  Sample sample() override {
    const TrialSetup setup{team_, machine_.work, machine_.seed + count_, 0};
    const auto [above, below] = in_turns(
        count_++, [&] { return throughput<Above>(setup); }, [&] { return throughput<Below>(setup); });
    return {above / below};
  }

 private:
  template <template <class> class Cache>
  double throughput(const TrialSetup& setup) {
    const TrialOutcome o = run_synthetic_trial<Cache, NoCounters>(plan_, setup);
    if (!o.error.empty()) throw InvalidTrial(o.error);
    return static_cast<double>(plan_.spec().operations) / o.wall_ns;
  }

  Machine machine_;
  RayTracer rays_;
  SyntheticPlan plan_;
  ThreadTeam team_;
  unsigned count_ = 0;
};

}  // namespace icbench
