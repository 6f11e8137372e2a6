// What a lock around the cache costs when threads are many and records cheap.
#include "caches/registry.h"
#include "harness/thread_team.h"
#include "rows/rows.h"
#include "scene/registry.h"
#include "workload/synthetic_trial.h"

namespace icbench {
namespace {

class MissDrivenOverMutex : public Experiment {
 public:
  explicit MissDrivenOverMutex(const Machine& machine)
      : machine_(machine),
        rays_(make_scene("cornell_box")),
        plan_(parse_workload("miss_driven:cost=1"), rays_, machine.seed),
        team_(machine.topology, Placement::compact, std::min(4 * machine.units(), kMaxThreads)) {}

  Sample sample() override {
    const TrialSetup setup{team_, machine_.work, machine_.seed + count_, 0};
    const bool mutex_first = (count_++ & 1u) != 0;
    double mutex = 0.0, wait_free = 0.0;
    if (mutex_first) mutex = throughput<GlobalMutexCache>(setup);
    wait_free = throughput<WaitFree>(setup);
    if (!mutex_first) mutex = throughput<GlobalMutexCache>(setup);
    return {wait_free / mutex};
  }

 private:
  template <template <class> class Cache>
  double throughput(const TrialSetup& setup) {
    const TrialOutcome o = run_synthetic_trial<Cache, NoCounters>(plan_, setup);
    if (!o.error.empty()) throw std::runtime_error(o.error);
    return static_cast<double>(plan_.spec().operations) / o.wall_ns;
  }

  Machine machine_;
  RayTracer rays_;
  SyntheticPlan plan_;
  ThreadTeam team_;
  unsigned count_ = 0;
};

}  // namespace

std::unique_ptr<Experiment> miss_driven_over_mutex(const Machine& machine) {
  return std::make_unique<MissDrivenOverMutex>(machine);
}

}  // namespace icbench
