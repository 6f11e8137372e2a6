// What vectors are worth by themselves: the tests of lanes and records of a packed octree's queries, noted and made
// again by scalar code and by vectors, without what else a query does.
#include <vector>

#include "caches/registry.h"
#include "core/random.h"
#include "rows/rows.h"
#include "scene/registry.h"
#include "workload/synthetic_plan.h"

namespace icbench {
namespace {

/// The calls of kernels that queries make.
struct NotedCalls {
  struct Filter {
    float share;
    LaneLayout layout;
    std::size_t first;
    std::uint32_t n;
  };
  struct Add {
    SurfacePoint x;
    float a;
    std::size_t first;
    std::uint32_t n;
  };
  std::vector<Filter> filters;
  std::vector<LaneRun> runs;
  std::vector<Add> adds;
  std::vector<const Record*> records;

  static NotedCalls* now;  // where calls are noted; single-threaded
};
NotedCalls* NotedCalls::now = nullptr;

/// Scalar code that notes what it is called for.
struct NotingLanes {
  static LaneKernels best() noexcept { return {filter, weigh_records_scalar, add}; }

 private:
  static std::uint32_t filter(float share, LaneLayout layout, const LaneRun* runs, std::uint32_t n,
                              UnitIndex* out) {
    NotedCalls& calls = *NotedCalls::now;
    calls.filters.push_back({share, layout, calls.runs.size(), n});
    calls.runs.insert(calls.runs.end(), runs, runs + n);
    return filter_lanes_scalar(share, layout, runs, n, out);
  }
  static std::uint32_t add(const SurfacePoint& x, float a, const Record* const* records, std::uint32_t n,
                           WeightedSums& sums) {
    NotedCalls& calls = *NotedCalls::now;
    calls.adds.push_back({x, a, calls.records.size(), n});
    calls.records.insert(calls.records.end(), records, records + n);
    calls.records.resize((calls.records.size() + kWeighed - 1) / kWeighed * kWeighed, records[0]);
    return add_records_scalar(x, a, records, n, sums);
  }
};

class ScalarOverVectors : public Experiment {
 public:
  ScalarOverVectors(const Machine& machine, std::string_view workload)
      : rays_(make_scene("cornell_box")),
        plan_(parse_workload(workload), rays_, machine.seed),
        cache_(plan_.config(1)),
        random_(machine.seed) {
    auto session = cache_.open_session(0);
    for (const Record& r : plan_.records()) session.insert(r);
    machine.bind();
  }

  Sample sample() override {
    // So few that all of it is at hand: it is not memory that is measured.
    constexpr std::uint32_t kQueries = 100;
    constexpr int kRounds = 200;
    NotedCalls calls;
    NotedCalls::now = &calls;
    auto session = cache_.open_session(0);
    const std::uint32_t first = random_.below(static_cast<std::uint32_t>(plan_.points().size() - kQueries));
    for (std::uint32_t i = first; i < first + kQueries; ++i) session.query(plan_.points()[i]);
    const auto time = [&](const LaneKernels& kernels) {
      repeat(kernels, calls);
      return seconds([&] {
        for (int round = 0; round < kRounds; ++round) repeat(kernels, calls);
      });
    };
    const auto [scalar, vectors] = in_turns(
        count_++, [&] { return time(ScalarLanes::best()); }, [&] { return time(SimdLanes::best()); });
    return {scalar / vectors};
  }

 private:
  void repeat(const LaneKernels& kernels, const NotedCalls& calls) {
    for (const NotedCalls::Filter& f : calls.filters) {
      kept_.resize(f.n * kCellLanes + kStripLanes);
      checksum_ += kernels.filter(f.share, f.layout, &calls.runs[f.first], f.n, kept_.data());
    }
    for (const NotedCalls::Add& add : calls.adds) {
      WeightedSums sums{};
      kernels.add(add.x, add.a, &calls.records[add.first], add.n, sums);
      checksum_ += sums[0];
    }
  }

  RayTracer rays_;
  SyntheticPlan plan_;
  Direct<Packed<StdSync, AtFirstSight, NotingLanes>> cache_;
  Pcg32 random_;
  std::vector<UnitIndex> kept_;
  unsigned count_ = 0;
  double checksum_ = 0.0;
};

}  // namespace

std::unique_ptr<Experiment> packed_scalar_over_vector_kernels(const Machine& machine,
                                                              std::string_view workload) {
  return std::make_unique<ScalarOverVectors>(machine, workload);
}

}  // namespace icbench
