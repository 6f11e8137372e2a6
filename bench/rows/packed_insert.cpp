// What copies cost: time of an insert into the packed octree over one into Ward's, and its memory.
#include <fmt/format.h>

#include "caches/registry.h"
#include "rows/rows.h"
#include "scene/registry.h"
#include "workload/synthetic_plan.h"

namespace icbench {
namespace {

/// A plan with `records` records.
SyntheticPlan plan_of(std::uint32_t records, const RayTracer& rays, std::uint64_t seed) {
  return SyntheticPlan(parse_workload(fmt::format("read_only:records={}", records)), rays, seed);
}

/// Inserts all records into `cache`, cleared; seconds.
template <class Cache>
double fill(Cache& cache, const SyntheticPlan& plan) {
  cache.clear();
  auto session = cache.open_session(0);
  session.prefault(static_cast<std::uint32_t>(plan.records().size()));
  std::size_t refused = 0;
  const double time = seconds([&] {
    for (const Record& r : plan.records()) refused += session.insert(r) != InsertResult::inserted;
  });
  if (refused != 0) throw std::runtime_error(fmt::format("{} inserts refused", refused));
  return time;
}

class InsertOverWard : public Experiment {
 public:
  InsertOverWard(const Machine& machine, std::uint32_t records)
      : rays_(make_scene("cornell_box")),
        plan_(plan_of(records, rays_, machine.seed)),
        packed_(plan_.config(1)),
        ward_(plan_.config(1)) {
    machine.bind();
  }

  Sample sample() override {
    const double ward = fill(ward_, plan_);
    return {fill(packed_, plan_) / ward};
  }

 private:
  RayTracer rays_;
  SyntheticPlan plan_;
  PackedWaitFree<> packed_;
  WaitFree<> ward_;
};

class Memory : public Experiment {
 public:
  Memory(const Machine& machine, std::uint32_t records)
      : rays_(make_scene("cornell_box")), plan_(plan_of(records, rays_, machine.seed)) {}

  Sample sample() override {
    PackedWaitFree<> cache(plan_.config(1));
    fill(cache, plan_);
    return {static_cast<double>(cache.memory_bytes()) / static_cast<double>(plan_.records().size()) / kBytes};
  }

 private:
  static constexpr double kBytes = 150.0;

  RayTracer rays_;
  SyntheticPlan plan_;
};

}  // namespace

std::unique_ptr<Experiment> packed_insert_over_ward(const Machine& machine, std::uint32_t records) {
  return std::make_unique<InsertOverWard>(machine, records);
}

std::unique_ptr<Experiment> packed_memory(const Machine& machine, std::uint32_t records) {
  return std::make_unique<Memory>(machine, records);
}

}  // namespace icbench
