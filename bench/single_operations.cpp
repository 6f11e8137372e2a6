// Single operations of every cache on one thread, for Google Benchmark and its tools:
//   query    at points where records are valid, 10^5 records
//   miss     at points where none is
//   insert   into a growing cache
// Run with --benchmark_filter=wait_free, --benchmark_format=json and the like.
#include <benchmark/benchmark.h>

#include "caches/registry.h"
#include "core/random.h"
#include "scene/registry.h"
#include "workload/synthetic_plan.h"

namespace icbench {
namespace {

const SyntheticPlan& plan() {
  static const RayTracer rays(make_scene("cornell_box"));
  static const SyntheticPlan made(parse_workload("read_only"), rays, 1);
  return made;
}

template <class Cache>
void query(benchmark::State& state) {
  Cache cache(plan().config(1));
  auto session = cache.open_session(0);
  for (const Record& r : plan().records()) session.insert(r);
  cache.end_frame();
  std::size_t i = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(session.query(plan().points()[i]));
    if (++i == plan().points().size()) i = 0;
  }
}

/// Points of the scene turned round: no record there has such a normal.
template <class Cache>
void miss(benchmark::State& state) {
  Cache cache(plan().config(1));
  auto session = cache.open_session(0);
  for (const Record& r : plan().records()) session.insert(r);
  cache.end_frame();
  std::size_t i = 0;
  for (auto _ : state) {
    const SurfacePoint& x = plan().points()[i];
    benchmark::DoNotOptimize(session.query({x.p, -x.n}));
    if (++i == plan().points().size()) i = 0;
  }
}

template <class Cache>
void insert(benchmark::State& state) {
  Cache cache(plan().config(1));
  auto session = cache.open_session(0);
  session.prefault(static_cast<std::uint32_t>(plan().records().size()));
  std::size_t i = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(session.insert(plan().records()[i]));
    if (++i == plan().records().size()) {
      state.PauseTiming();
      cache.clear();
      i = 0;
      state.ResumeTiming();
    }
  }
}

template <class Cache>
void add(std::string_view name) {
  const auto add_one = [&](const char* operation, void (*f)(benchmark::State&)) {
    benchmark::RegisterBenchmark((operation + ("/" + std::string(name))).c_str(), f);
  };
  add_one("query", query<Cache>);
  add_one("miss", miss<Cache>);
  add_one("insert", insert<Cache>);
}

}  // namespace
}  // namespace icbench

int main(int argc, char** argv) {
#define ICBENCH_ADD(id, Type) icbench::add<icbench::Type<icbench::NoCounters>>(#id);
  ICBENCH_CACHES(ICBENCH_ADD)
#undef ICBENCH_ADD
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
