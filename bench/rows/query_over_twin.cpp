// What publication by atomics costs a reader: the same structure with and without them, on one thread.
#include <chrono>

#include "caches/registry.h"
#include "core/random.h"
#include "rows/rows.h"
#include "scene/registry.h"
#include "workload/synthetic_plan.h"

namespace icbench {
namespace {

constexpr std::uint32_t kQueries =
    4000;  // a block; long against the clock, short against the machine's drift

class QueryOverTwin : public Experiment {
 public:
  explicit QueryOverTwin(const Machine& machine)
      : rays_(make_scene("cornell_box")),
        plan_(parse_workload("read_only"), rays_, machine.seed),
        wait_free_(plan_.config(1)),
        twin_(plan_.config(1)),
        random_(machine.seed) {
    fill(wait_free_);
    fill(twin_);
    machine.bind();
  }

  Sample sample() override {
    const std::uint32_t first = random_.below(static_cast<std::uint32_t>(plan_.points().size() - kQueries));
    // Who goes first alternates, since the first one warms the shared points.
    double a = 0.0, b = 0.0;
    const bool twin_first = (count_++ & 1u) != 0;
    if (twin_first) b = time(twin_, first);
    a = time(wait_free_, first);
    if (!twin_first) b = time(twin_, first);
    return {a / b};
  }

 private:
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
  WaitFree<> wait_free_;
  Sequential<> twin_;
  Pcg32 random_;
  unsigned count_ = 0;
  double checksum_ = 0.0;
};

}  // namespace

std::unique_ptr<Experiment> query_over_twin(const Machine& machine) {
  return std::make_unique<QueryOverTwin>(machine);
}

}  // namespace icbench
