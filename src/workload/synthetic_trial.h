// Runs a synthetic workload on one cache. Instantiated once per cache, in a translation unit of its own.
#pragma once

#include <memory>
#include <vector>

#include "core/cache.h"
#include "core/sync.h"
#include "workload/synthetic_plan.h"
#include "workload/trial.h"
#include "workload/validation.h"

namespace icbench {

/// Queries at which a trial compares what is seen with the oracle.
inline constexpr std::size_t kOracleSamples = 32;

/// One worker's results, on lines of its own.
struct alignas(kNoSharing) SyntheticWorker {
  Histogram query_ticks;
  Histogram insert_ticks;
  double checksum = 0.0;
  std::uint64_t work = 0;  // end of the chain of simulated work
};

/// The timed loop of one thread.
template <class Session>
void run_stream(Session& session, const SyntheticPlan& plan, const Streams& streams, unsigned thread,
                std::uint64_t work_units, std::uint32_t latency_every, SyntheticWorker& out) noexcept {
  LatencySampler sampler(latency_every, hash_keys(thread, 6));
  const bool miss_driven = plan.spec().kind == WorkloadKind::miss_driven;
  double checksum = 0.0;
  std::uint64_t work = thread;
  for (std::uint32_t i = streams.begin[thread]; i < streams.begin[thread + 1]; ++i) {
    const std::uint32_t operation = streams.operations[i];
    if (operation & Streams::kInsert) {
      const Record& r = plan.records()[operation & Streams::kIndex];
      sampler.run(out.insert_ticks, [&] { return session.insert(r); });
      continue;
    }
    const SurfacePoint& x = plan.points()[operation];
    if (const auto E = sampler.run(out.query_ticks, [&] { return session.query(x); })) {
      checksum += E->x;
    } else if (miss_driven) {
      work = do_work(work_units, work);
      const Record r = plan.record_at(streams, i);
      sampler.run(out.insert_ticks, [&] { return session.insert(r); });
    }
  }
  out.checksum = checksum;
  out.work = work;
}

template <template <class> class CacheTemplate>
TrialOutcome run_synthetic_trial(const SyntheticPlan& plan, const TrialSetup& setup) {
  using Cache = CacheTemplate<WithCounters>;
  const unsigned threads = setup.team.size();
  const Streams streams = plan.streams(threads, setup.seed);
  Cache cache(plan.config(threads));

  auto first = cache.open_session(0);
  for (std::uint32_t i = 0; i < plan.prefilled(); ++i) first.insert(plan.records()[i]);
  cache.end_frame();

  // Before the clock: every thread opens its session and touches the memory it will need.
  const WorkloadSpec& spec = plan.spec();
  const std::uint64_t expected_inserts = spec.kind == WorkloadKind::miss_driven
                                             ? streams.operations.size() / 8
                                             : plan.records().size() - plan.prefilled();
  std::vector<typename Cache::Session> sessions(threads, first);
  std::vector<std::unique_ptr<SyntheticWorker>> workers(threads);
  setup.team.run([&](unsigned t) {
    sessions[t] = cache.open_session(t);
    sessions[t].prefault(static_cast<std::uint32_t>(expected_inserts / threads + 1));
    workers[t] = std::make_unique<SyntheticWorker>();
  });
  cache.reset_counters();

  const std::uint64_t work_units = setup.work.units_for_ns(1000.0 * spec.cost_us);
  cache.begin_frame();
  const TeamTimes times = setup.team.run([&](unsigned t) {
    run_stream(sessions[t], plan, streams, t, work_units, setup.latency_every, *workers[t]);
  });
  const double merge_ns = timed_end_frame(cache);

  TrialOutcome out = outcome_of(cache, times, merge_ns);
  for (const auto& worker : workers) {
    out.query_ticks.merge(worker->query_ticks);
    out.insert_ticks.merge(worker->insert_ticks);
    out.checksum += worker->checksum;
  }

  if constexpr (Cache::kTraits.consistency != Consistency::none) {
    Record made;
    const auto expected = [&](std::uint32_t id) -> const Record* {
      if (spec.kind != WorkloadKind::miss_driven)
        return id < plan.records().size() ? &plan.records()[id] : nullptr;
      if (id >= streams.operations.size()) return nullptr;
      made = plan.record_at(streams, id);
      return &made;
    };
    const std::uint64_t accepted = plan.prefilled() + out.counts.inserted;
    out.error =
        validate_records(cache, first, accepted, sample_points(plan.points(), kOracleSamples), expected);
    if (out.error.empty() && spec.kind == WorkloadKind::read_only &&
        out.counts.hits != plan.expected_hits(streams)) {
      out.error = fmt::format("{} queries hit where the oracle hits {}", out.counts.hits,
                              plan.expected_hits(streams));
    }
    if (out.error.empty() && out.counts.full + out.counts.rejected != 0) {
      out.error = fmt::format("{} inserts refused", out.counts.full + out.counts.rejected);
    }
  }
  return out;
}

}  // namespace icbench
