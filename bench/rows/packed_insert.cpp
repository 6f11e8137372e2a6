// What copies cost: time of an insert into the packed octree over one into Ward's, and its memory.
#include <fmt/format.h>
#include <unistd.h>

#include <fstream>
#include <stdexcept>

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
  if (refused != 0) throw InvalidTrial(fmt::format("{} inserts refused", refused));
  return time;
}

/// Time to tidy a cache, over that to insert its records one by one.
class TidyOverInsert : public Experiment {
 public:
  TidyOverInsert(const Machine& machine, std::string_view workload)
      : rays_(make_scene("cornell_box")),
        plan_(parse_workload(workload), rays_, machine.seed),
        cache_(plan_.config(1)) {
    machine.bind();
  }

  Sample sample() override {
    const double insert = fill(cache_, plan_);
    return {seconds([&] { cache_.tidy(); }) / insert};
  }

 private:
  RayTracer rays_;
  SyntheticPlan plan_;
  PackedWaitFree<> cache_;
};

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

/// Bytes of this process in memory.
std::size_t resident_bytes() {
  std::ifstream statm("/proc/self/statm");
  std::size_t size = 0, pages = 0;
  if (!(statm >> size >> pages)) throw std::runtime_error("/proc/self/statm tells no resident memory");
  return pages * static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
}

class Memory : public Experiment {
 public:
  Memory(const Machine& machine, std::uint32_t records, bool resident)
      : rays_(make_scene("cornell_box")), plan_(plan_of(records, rays_, machine.seed)), resident_(resident) {}

  Sample sample() override {
    const std::size_t before = resident_ ? resident_bytes() : 0;
    PackedWaitFree<> cache(plan_.config(1));
    fill(cache, plan_);
    const std::size_t bytes = resident_ ? resident_bytes() - before : cache.memory_bytes();
    return {static_cast<double>(bytes) / static_cast<double>(plan_.records().size()) / kBytes};
  }

 private:
  static constexpr double kBytes = 150.0;

  RayTracer rays_;
  SyntheticPlan plan_;
  bool resident_;
};

}  // namespace

std::unique_ptr<Experiment> packed_insert_over_ward(const Machine& machine, std::uint32_t records) {
  return std::make_unique<InsertOverWard>(machine, records);
}

std::unique_ptr<Experiment> packed_memory(const Machine& machine, std::uint32_t records) {
  return std::make_unique<Memory>(machine, records, false);
}

std::unique_ptr<Experiment> packed_memory_resident(const Machine& machine, std::uint32_t records) {
  return std::make_unique<Memory>(machine, records, true);
}

std::unique_ptr<Experiment> packed_tidy_over_insert(const Machine& machine, std::string_view workload) {
  return std::make_unique<TidyOverInsert>(machine, workload);
}

}  // namespace icbench
