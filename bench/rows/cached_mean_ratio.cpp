// Whether caching keeps the light: mean indirect radiance of the cached Cornell box against the path-traced
// one.
#include "harness/thread_team.h"
#include "rows/rows.h"
#include "scene/registry.h"
#include "workload/dispatch.h"

namespace icbench {
namespace {

class CachedMeanRatio : public Experiment {
 public:
  explicit CachedMeanRatio(const Machine& machine)
      : machine_(machine),
        rays_(make_scene("cornell_box")),
        spec_(parse_workload("cornell_box:rays=256:a=0.2:size=128x128")),
        primary_(centre_hits(rays_, static_cast<int>(spec_.width), static_cast<int>(spec_.height))),
        reference_(make_reference(rays_, primary_, kReferenceSpp, hash_keys(machine.seed, 1))),
        plan_(spec_, rays_, primary_, reference_, machine.seed),
        team_(machine.topology, Placement::compact, machine.units()) {}

  Sample sample() override {
    const TrialOutcome o =
        find_cache("wait_free")
            .ray_traced(plan_, {team_, machine_.work, hash_keys(machine_.seed, 2, count_++), 0});
    if (!o.error.empty()) throw InvalidTrial(o.error);
    return {o.mean_ratio};
  }
  bool starts_warm() const override { return true; }

 private:
  static constexpr std::uint32_t kReferenceSpp = 1024;

  Machine machine_;
  RayTracer rays_;
  WorkloadSpec spec_;
  PrimaryHits primary_;
  Reference reference_;
  RayTracedPlan plan_;
  ThreadTeam team_;
  std::uint64_t count_ = 0;
};

}  // namespace

std::unique_ptr<Experiment> cached_mean_ratio(const Machine& machine) {
  return std::make_unique<CachedMeanRatio>(machine);
}

}  // namespace icbench
