// What it costs when threads are four times as many as processing units: throughput, and the slowest queries.
#include <algorithm>

#include "caches/registry.h"
#include "harness/thread_team.h"
#include "rows/rows.h"
#include "scene/registry.h"
#include "workload/synthetic_trial.h"

namespace icbench {
namespace {

constexpr double kSlowest = 0.999;

/// Trials of packed_wait_free, mix 90/10.
class Oversubscribed : public Experiment {
 public:
  Oversubscribed(const Machine& machine, Oversubscription figure)
      : machine_(machine),
        figure_(figure),
        rays_(make_scene("cornell_box")),
        plan_(parse_workload("mix_90_10:operations=1000000"), rays_, machine.seed),
        all_(machine.topology, Placement::compact, machine.units()),
        many_(machine.topology, Placement::compact, std::min(4 * machine.units(), kMaxThreads)) {}

  Sample sample() override {
    const auto [all, many] = in_turns(
        count_++, [&] { return trial(all_); }, [&] { return trial(many_); });
    switch (figure_) {
      case Oversubscription::throughput:
        return {all.wall_ns / many.wall_ns};
      case Oversubscription::slowest:
        return {slowest(many) / slowest(all)};
      case Oversubscription::spread:
        break;
    }
    return {slowest(many) / static_cast<double>(many.query_ticks.percentile(0.5))};
  }

 private:
  static double slowest(const TrialOutcome& o) {
    return static_cast<double>(o.query_ticks.percentile(kSlowest));
  }

  TrialOutcome trial(ThreadTeam& team) {
    // All operations are timed when that is what is asked for, and none otherwise.
    const std::uint32_t every = figure_ == Oversubscription::throughput ? 0 : 1;
    TrialOutcome o = run_synthetic_trial<PackedWaitFree, NoCounters>(
        plan_, {team, machine_.work, machine_.seed + count_, every});
    if (!o.error.empty()) throw InvalidTrial(o.error);
    return o;
  }

  Machine machine_;
  Oversubscription figure_;
  RayTracer rays_;
  SyntheticPlan plan_;
  ThreadTeam all_, many_;
  unsigned count_ = 0;
};

}  // namespace

std::unique_ptr<Experiment> packed_oversubscribed(const Machine& machine, Oversubscription figure) {
  return std::make_unique<Oversubscribed>(machine, figure);
}

}  // namespace icbench
