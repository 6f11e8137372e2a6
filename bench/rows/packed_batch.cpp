// What it brings to have several queries under way at once: single queries of the packed octree against batched ones.
#include <algorithm>
#include <optional>
#include <vector>

#include "caches/registry.h"
#include "rows/query_ratio.h"
#include "rows/rows.h"

namespace icbench {
namespace {

class SingleOverBatch : public Experiment {
 public:
  SingleOverBatch(const Machine& machine, std::string_view workload)
      : rays_(make_scene("cornell_box")),
        plan_(parse_workload(workload), rays_, machine.seed),
        filled_(plan_),
        random_(machine.seed) {
    machine.bind();
    check_answers();
  }

  Sample sample() override {
    // Each is first asked, untimed, at points before those that are timed: see query_seconds.
    const std::uint32_t first =
        random_.below(static_cast<std::uint32_t>(plan_.points().size()) - kQueriesBefore - kTimedQueries);
    const auto before = std::span(plan_.points()).subspan(first, kQueriesBefore);
    const auto timed = std::span(plan_.points()).subspan(first + kQueriesBefore, kTimedQueries);
    auto session = filled_.session();
    const auto time_single = [&] {
      one_by_one(session, before);
      return seconds([&] { one_by_one(session, timed); });
    };
    const auto time_batch = [&] {
      answers_.resize(kQueriesBefore);
      session.query_batch(before, std::span(answers_).first(before.size()));
      return seconds([&] { session.query_batch(timed, std::span(answers_).first(timed.size())); });
    };
    const auto [single, batch] = in_turns(
        count_++, [&] { return time_single(); }, [&] { return time_batch(); });
    return {single / batch};
  }

 private:
  template <class Session>
  void one_by_one(Session& session, std::span<const SurfacePoint> points) {
    answers_.resize(kQueriesBefore);
    for (std::size_t i = 0; i < points.size(); ++i) answers_[i] = session.query(points[i]);
  }

  void check_answers() {
    auto session = filled_.session();
    const auto some = std::span(plan_.points()).first(kTimedQueries);
    one_by_one(session, some);
    std::vector<std::optional<Irradiance>> batched(some.size());
    session.query_batch(some, batched);
    if (!std::equal(batched.begin(), batched.end(), answers_.begin()))
      throw InvalidTrial("a batch answers differently from single queries");
  }

  static_assert(kTimedQueries <= kQueriesBefore, "there is room for the answers of either");

  RayTracer rays_;
  SyntheticPlan plan_;
  Filled<PackedWaitFree<>> filled_;
  Pcg32 random_;
  std::vector<std::optional<Irradiance>> answers_;
  unsigned count_ = 0;
};

}  // namespace

std::unique_ptr<Experiment> packed_single_over_batch(const Machine& machine, std::string_view workload) {
  return std::make_unique<SingleOverBatch>(machine, workload);
}

}  // namespace icbench
