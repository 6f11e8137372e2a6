// Time of a query in one cache over that in another: read-only, one thread.
#pragma once

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
  }

  /// Something with `query`.
  auto session() { return cache_.open_session(0); }

 private:
  Cache cache_;
};

/// Both caches hold the same records; a sample asks both at the same points, one after the other. What was asked last
/// is warm: so each is first asked at other points, untimed, until the processor's caches hold of it what they hold
/// when nothing else is asked. `Above` and `Below`: what Filled is defined for.
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
    const bool below_first = (count_++ & 1u) != 0;
    double above = 0.0, below = 0.0;
    if (below_first) below = time(below_, first);
    above = time(above_, first);
    if (!below_first) below = time(below_, first);
    return {above / below};
  }

 private:
  /// Long against the clock, short against the machine's drift. A query to the largest structure reads some 20 cache
  /// lines, so that those before the clock starts replace what a few tens of megabytes hold.
  static constexpr std::uint32_t kQueries = 16'000, kBefore = 24'000;

  template <class Cache>
  double time(Filled<Cache>& cache, std::uint32_t first) {
    auto&& session = cache.session();
    std::uint32_t next = first;
    const auto ask = [&](std::uint32_t queries) {
      double sum = 0.0;
      for (std::uint32_t i = 0; i < queries; ++i) {
        if (const auto E = session.query(plan_.points()[next])) sum += E->x;
        if (++next == plan_.points().size()) next = 0;
      }
      checksum_ += sum;
    };
    ask(kBefore);
    return seconds([&] { ask(kQueries); });
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
