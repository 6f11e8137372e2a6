// Time of a query in one cache over that in another: read-only, one thread.
#pragma once

#include <span>

#include "core/random.h"
#include "rows/row.h"
#include "scene/registry.h"
#include "workload/synthetic_plan.h"

namespace icbench {

/// A cache with the records of a plan in it.
template <class Cache>
class Filled {
 public:
  explicit Filled(const SyntheticPlan& plan) : cache_(plan.config(1)) {
    auto session = this->session();
    session.prefault(static_cast<std::uint32_t>(plan.records().size()));
    for (const Record& r : plan.records()) session.insert(r);
    cache_.end_frame();
  }

  /// Something with `query`.
  auto session() { return cache_.open_session(0); }

 protected:
  Cache cache_;
};

/// A cache that was tidied once it was full.
template <TidyCache Cache>
struct Tidied {};

template <class Cache>
class Filled<Tidied<Cache>> : public Filled<Cache> {
 public:
  explicit Filled(const SyntheticPlan& plan) : Filled<Cache>(plan) { this->cache_.tidy(); }
};

/// Asks `asked`, something with `query`, at `queries` of `points` from number `first` on, round and round; adds to
/// `checksum` what keeps the answers from being left out. Where the next would be.
template <class Asked>
std::uint32_t ask_queries(Asked& asked, std::span<const SurfacePoint> points, std::uint32_t first,
                          std::uint32_t queries, double& checksum) {
  std::uint32_t next = first;
  double sum = 0.0;
  for (std::uint32_t i = 0; i < queries; ++i) {
    if (const auto E = asked.query(points[next])) sum += E->x;
    if (++next == points.size()) next = 0;
  }
  checksum += sum;
  return next;
}

/// Wall time of kTimedQueries queries to `asked` from number `first` on. What was asked last is warm: so it is first
/// asked at the points before, untimed, until the processor's caches hold of it what they hold when nothing else is
/// asked. Long against the clock, short against the machine's drift. A query to the largest structure reads some 20
/// cache lines, so that those before the clock starts replace what a few tens of megabytes hold.
inline constexpr std::uint32_t kTimedQueries = 16'000, kQueriesBefore = 24'000;
template <class Asked>
double query_seconds(Asked& asked, std::span<const SurfacePoint> points, std::uint32_t first,
                     double& checksum) {
  const std::uint32_t next = ask_queries(asked, points, first, kQueriesBefore, checksum);
  return seconds([&] { ask_queries(asked, points, next, kTimedQueries, checksum); });
}

/// Both caches hold the same records; a sample asks both at the same points, one after the other. `Above` and `Below`:
/// what Filled is defined for.
template <class Above, class Below>
class QueryRatio : public Experiment {
 public:
  /// `workload`: a read-only one, with 10^5 records unless it says otherwise.
  explicit QueryRatio(const Machine& machine, std::string_view workload = "read_only")
      : rays_(make_scene("cornell_box")),
        plan_(parse_workload(workload), rays_, machine.seed),
        above_(plan_),
        below_(plan_),
        random_(machine.seed) {
    machine.bind();
  }

  Sample sample() override {
    const std::uint32_t first = random_.below(static_cast<std::uint32_t>(plan_.points().size()));
    const auto [above, below] = in_turns(
        count_++, [&] { return time(above_, first); }, [&] { return time(below_, first); });
    return {above / below};
  }

 private:
  template <class Cache>
  double time(Filled<Cache>& cache, std::uint32_t first) {
    auto&& session = cache.session();
    return query_seconds(session, plan_.points(), first, checksum_);
  }

  RayTracer rays_;
  SyntheticPlan plan_;
  Filled<Above> above_;
  Filled<Below> below_;
  Pcg32 random_;
  unsigned count_ = 0;
  double checksum_ = 0.0;
};

}  // namespace icbench
