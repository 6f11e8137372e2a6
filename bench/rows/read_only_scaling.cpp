// Whether readers get in each other's way: read-only throughput on all processing units against one.
#include <fmt/format.h>

#include "caches/registry.h"
#include "harness/thread_team.h"
#include "rows/rows.h"
#include "scene/registry.h"
#include "workload/synthetic_trial.h"

namespace icbench {
namespace {

// Pure computation must reach this share of N on N units, else they are not idle or not of equal speed and
// the sample says nothing about the cache.
constexpr double kIdle = 0.97;
constexpr double kProbeNs = 20e6;

template <template <class> class Cache>
class ReadOnlyScaling : public Experiment {
 public:
  explicit ReadOnlyScaling(const Machine& machine)
      : machine_(machine),
        rays_(make_scene("cornell_box")),
        plan_(parse_workload("read_only:operations=200000"), rays_, machine.seed),
        one_(machine.topology, Placement::compact, 1),
        all_(machine.topology, Placement::compact, machine.units()) {}

  Sample sample() override {
    if (machine_.units() < 2) return kSingleUnit;
    if (machine_.topology.equal_speed() == EqualSpeed::no)
      return {0.0, "the processing units are of several speeds"};
    const double before = computation_scaling();
    const TrialSetup one{one_, machine_.work, machine_.seed, 0}, all{all_, machine_.work, machine_.seed, 0};
    const auto [together, single] = in_turns(
        count_++, [&] { return wall_ns(all); }, [&] { return wall_ns(one); });
    const double scaling = single / together / machine_.units();
    const double idle = std::min(before, computation_scaling());
    if (idle < kIdle) {
      return {0.0,
              fmt::format(
                  "the processing units are not idle or not of equal speed: computation without any memory "
                  "reaches {:.2f} of N",
                  idle)};
    }
    return {scaling};
  }

 private:
  /// Throughput of independent computation on all units over N times that on one.
  double computation_scaling() {
    const std::uint64_t units = machine_.work.units_for_ns(kProbeNs);
    const auto probe = [&](unsigned t) { do_work(units, t); };
    const auto single = static_cast<double>(one_.run(probe).wall_ns());
    return single / static_cast<double>(all_.run(probe).wall_ns());
  }

  double wall_ns(const TrialSetup& setup) {
    const TrialOutcome o = run_synthetic_trial<Cache, NoCounters>(plan_, setup);
    if (!o.error.empty()) throw InvalidTrial(o.error);
    return o.wall_ns;
  }

  Machine machine_;
  RayTracer rays_;
  SyntheticPlan plan_;
  ThreadTeam one_;
  ThreadTeam all_;
  unsigned count_ = 0;
};

}  // namespace

std::unique_ptr<Experiment> read_only_scaling(const Machine& machine) {
  return std::make_unique<ReadOnlyScaling<WaitFree>>(machine);
}

std::unique_ptr<Experiment> packed_read_only_scaling(const Machine& machine) {
  return std::make_unique<ReadOnlyScaling<PackedWaitFree>>(machine);
}

}  // namespace icbench
