// Time of a query in one cache over that in another: read-only, one thread.
#pragma once

#include <chrono>

#include "core/random.h"
#include "rows/row.h"
#include "scene/registry.h"
#include "workload/synthetic_plan.h"

namespace icbench {

/// Both caches hold the same records; a sample asks both at the same points, in blocks.
template <class Above, class Below>
class QueryRatio : public Experiment {
 public:
  /// `workload`: a read-only one, with 10^5 records unless it says otherwise.
  explicit QueryRatio(const Machine& machine, std::string_view workload = "read_only")
      : rays_(make_scene("cornell_box")),
        plan_(parse_workload(workload), rays_, machine.seed),
        above_(plan_.config(1)),
        below_(plan_.config(1)),
        random_(machine.seed) {
    fill(above_);
    fill(below_);
    machine.bind();
  }

  Sample sample() override {
    const std::uint32_t first = random_.below(static_cast<std::uint32_t>(plan_.points().size() - kQueries));
    // Whoever goes first warms the points, and one half of the samples would differ from the other: so both go first.
    const double a = time(above_, first);
    const double b = time(below_, first) + time(below_, first);
    return {(a + time(above_, first)) / b};
  }

 private:
  /// A block: long against the clock, short against the machine's drift.
  static constexpr std::uint32_t kQueries = 4000;

  template <class Cache>
  void fill(Cache& cache) {
    auto session = cache.open_session(0);
    for (const Record& r : plan_.records()) session.insert(r);
  }

  template <class Cache>
  double time(Cache& cache, std::uint32_t first) {
    auto session = cache.open_session(0);
    double sum = 0.0;
    const auto start = std::chrono::steady_clock::now();
    for (std::uint32_t i = first; i < first + kQueries; ++i) {
      if (const auto E = session.query(plan_.points()[i])) sum += E->x;
    }
    const auto took = std::chrono::steady_clock::now() - start;
    checksum_ += sum;
    return std::chrono::duration<double>(took).count();
  }

  RayTracer rays_;
  SyntheticPlan plan_;
  Above above_;
  Below below_;
  Pcg32 random_;
  double checksum_ = 0.0;
};

}  // namespace icbench
