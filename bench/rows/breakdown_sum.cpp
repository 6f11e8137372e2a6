// Whether the parts of the time breakdown are all of the time: wall time x threads against the sum of parts that are
// measured each by itself.
#include <algorithm>
#include <cmath>
#include <vector>

#include "harness/ticks.h"
#include "rows/rows.h"
#include "scene/registry.h"
#include "workload/dispatch.h"

namespace icbench {
namespace {

class BreakdownSum : public Experiment {
 public:
  explicit BreakdownSum(const Machine& machine)
      : machine_(machine),
        rate_(calibrate_ticks()),
        rays_(make_scene("cornell_box")),
        plan_(parse_workload("miss_driven:cost=4"), rays_, machine.seed),
        fitting_(machine.topology, Placement::compact, machine.units()),
        crowded_(machine.topology, Placement::compact, std::min(4 * machine.units(), kMaxThreads)) {}

  /// The largest share that is missing, or counted twice, of any kind of cache, with and without oversubscription.
  Sample sample() override {
    double worst = 0.0;
    for (const char* cache :
         {"packed_global_mutex", "packed_global_spin", "packed_local_write", "packed_wait_free"})
      for (ThreadTeam* team : {&fitting_, &crowded_}) worst = std::max(worst, unexplained(cache, *team));
    ++count_;
    return {worst};
  }

 private:
  double unexplained(const char* cache, ThreadTeam& team) {
    std::vector<ThreadAccount> accounts;
    accounts.reserve(team.size());
    for (unsigned t = 0; t < team.size(); ++t) accounts.emplace_back(rate_);
    TrialSetup setup{team, machine_.work, machine_.seed + count_, 1};
    setup.accounts = accounts;
    TrialOutcome o = find_cache(cache).synthetic(plan_, setup);
    if (!o.error.empty()) throw InvalidTrial(o.error);
    for (const ThreadAccount& account : accounts) o.time.add_thread(account.thread_ticks(), rate_);
    return std::abs(1.0 - o.time.sum() / o.time.total);
  }

  Machine machine_;
  TickRate rate_;
  RayTracer rays_;
  SyntheticPlan plan_;
  ThreadTeam fitting_, crowded_;
  unsigned count_ = 0;
};

}  // namespace

std::unique_ptr<Experiment> breakdown_sum(const Machine& machine) {
  return std::make_unique<BreakdownSum>(machine);
}

}  // namespace icbench
