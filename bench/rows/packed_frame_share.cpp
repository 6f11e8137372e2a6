// How much of a rendered frame is spent in the cache: all of its queries and inserts, timed one by one, over the
// threads' time. The clock's own time is taken off both.
#include "caches/registry.h"
#include "harness/ticks.h"
#include "rows/rows.h"
#include "scene/registry.h"
#include "workload/ray_traced_trial.h"

namespace icbench {
namespace {

constexpr int kWidth = 256, kHeight = 192;

class FrameShare : public Experiment {
 public:
  explicit FrameShare(const Machine& machine)
      : machine_(machine),
        rays_(make_scene("cornell_box")),
        primary_(centre_hits(rays_, kWidth, kHeight)),
        reference_(make_reference(rays_, primary_, 2, machine.seed)),  // nobody looks at the error
        plan_(parse_workload("cornell_box:rays=256"), rays_, primary_, reference_, machine.seed),
        rate_(calibrate_ticks()),
        team_(machine.topology, Placement::compact, machine.units()) {}

  Sample sample() override {
    const TrialOutcome o = run_ray_traced_trial<PackedWaitFree>(
        plan_, {team_, machine_.work, machine_.seed + count_++, /*latency_every=*/1});
    if (!o.error.empty()) throw InvalidTrial(o.error);
    const auto operations = static_cast<double>(o.query_ticks.count() + o.insert_ticks.count());
    const double clock = rate_.to_ns(clock_ticks()) * operations;
    const double in_cache = rate_.to_ns(o.query_ticks.sum() + o.insert_ticks.sum()) - clock;
    return {std::max(in_cache, 0.0) / (o.wall_ns * team_.size() - clock)};
  }

 private:
  /// What two looks at the clock take, one right after the other.
  static std::uint64_t clock_ticks() {
    Histogram empty;
    for (int i = 0; i < 10'000; ++i) {
      const std::uint64_t start = ticks();
      empty.record(ticks() - start);
    }
    return empty.percentile(0.5);
  }

  Machine machine_;
  RayTracer rays_;
  PrimaryHits primary_;
  Reference reference_;
  RayTracedPlan plan_;
  TickRate rate_;
  ThreadTeam team_;
  unsigned count_ = 0;
};

}  // namespace

std::unique_ptr<Experiment> packed_frame_share(const Machine& machine) {
  return std::make_unique<FrameShare>(machine);
}

}  // namespace icbench
