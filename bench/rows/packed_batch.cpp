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
    const std::uint32_t first = random_.below(static_cast<std::uint32_t>(plan_.points().size() - kQueries));
    const std::span points = std::span(plan_.points()).subspan(first, kQueries);
    auto session = cache_.open_session(0);
    const auto one_by_one = [&] {
      for (std::size_t i = 0; i < kQueries; ++i) single_[i] = session.query(points[i]);
    };
    // Single queries go first and last, so that neither side has the points warmer.
    const double a = seconds(one_by_one);
    const double b = seconds([&] { session.query_batch(points, batched_); }) +
                     seconds([&] { session.query_batch(points, batched_); });
    const double ratio = (a + seconds(one_by_one)) / b;
    if (single_ != batched_) throw std::runtime_error("a batch answers differently from single queries");
    return {ratio};
  }

 private:
  static constexpr std::uint32_t kQueries = 4000;

  RayTracer rays_;
  SyntheticPlan plan_;
  PackedWaitFree<> cache_;
  Pcg32 random_;
  std::vector<std::optional<Irradiance>> single_, batched_;
};

}  // namespace

std::unique_ptr<Experiment> packed_single_over_batch(const Machine& machine, std::string_view workload) {
  return std::make_unique<SingleOverBatch>(machine, workload);
}

}  // namespace icbench
