// What it brings to have several queries under way at once: single queries of the packed octree against batched ones.
#include <vector>

#include "caches/registry.h"
#include "core/random.h"
#include "rows/rows.h"
#include "scene/registry.h"
#include "workload/synthetic_plan.h"

namespace icbench {
namespace {

class SingleOverBatch : public Experiment {
 public:
  SingleOverBatch(const Machine& machine, std::string_view workload)
      : rays_(make_scene("cornell_box")),
        plan_(parse_workload(workload), rays_, machine.seed),
        cache_(plan_.config(1)),
        random_(machine.seed),
        single_(kQueries),
        batched_(kQueries) {
    auto session = cache_.open_session(0);
    for (const Record& r : plan_.records()) session.insert(r);
    machine.bind();
  }

  Sample sample() override {
    const auto some = [&] {
      return std::span(plan_.points())
          .subspan(random_.below(static_cast<std::uint32_t>(plan_.points().size() - kQueries)), kQueries);
    };
    auto session = cache_.open_session(0);
    const auto one_by_one = [&](std::span<const SurfacePoint> points) {
      for (std::size_t i = 0; i < kQueries; ++i) single_[i] = session.query(points[i]);
    };
    // Each at points of its own: what was asked just now is warm.
    const std::span apart = some(), together = some();
    const auto time_single = [&] { return seconds([&] { one_by_one(apart); }); };
    const auto time_batch = [&] { return seconds([&] { session.query_batch(together, batched_); }); };
    const bool batch_first = (count_++ & 1u) != 0;
    double single = 0.0, batch = 0.0;
    if (batch_first) batch = time_batch();
    single = time_single();
    if (!batch_first) batch = time_batch();
    one_by_one(together);
    if (single_ != batched_) throw std::runtime_error("a batch answers differently from single queries");
    return {single / batch};
  }

 private:
  static constexpr std::uint32_t kQueries = 16'000;

  RayTracer rays_;
  SyntheticPlan plan_;
  PackedWaitFree<> cache_;
  Pcg32 random_;
  std::vector<std::optional<Irradiance>> single_, batched_;
  unsigned count_ = 0;
};

}  // namespace

std::unique_ptr<Experiment> packed_single_over_batch(const Machine& machine, std::string_view workload) {
  return std::make_unique<SingleOverBatch>(machine, workload);
}

}  // namespace icbench
