// Runs a synthetic workload on one cache. Instantiated once per cache, in a translation unit of its own.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
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
  std::uint64_t queries = 0;
  std::uint64_t hits = 0;
  std::uint64_t inserted = 0;
  std::uint64_t refused = 0;
  double sum = 0.0;                                      // of the answers' red channel
  float least = std::numeric_limits<float>::infinity();  // of the same
  float most = -std::numeric_limits<float>::infinity();
  std::uint64_t work = 0;  // end of the chain of simulated work
};

/// The timed loop of one thread.
template <class Session>
void run_stream(Session& session, const SyntheticPlan& plan, const Streams& streams, unsigned thread,
                std::uint64_t work_units, LatencySampler sampler, SyntheticWorker& shared) noexcept {
  const bool miss_driven = plan.spec().kind == WorkloadKind::miss_driven;
  SyntheticWorker out;
  out.work = thread;
  const auto insert = [&](const Record& r) {
    const InsertResult result = sampler.run(out.insert_ticks, session, [&] { return session.insert(r); });
    ++(result == InsertResult::inserted ? out.inserted : out.refused);
  };
  for (std::uint32_t i = streams.begin[thread]; i < streams.begin[thread + 1]; ++i) {
    const std::uint32_t operation = streams.operations[i];
    if (operation & Streams::kInsert) {
      insert(plan.records()[operation & Streams::kIndex]);
      continue;
    }
    ++out.queries;
    const SurfacePoint x = plan.points()[operation];  // at hand before anything is timed
    if (const auto E = sampler.run(out.query_ticks, session, [&] { return session.query(x); })) {
      ++out.hits;
      out.sum += E->x;
      out.least = std::min(out.least, E->x);
      out.most = std::max(out.most, E->x);
    } else if (miss_driven) {
      out.work = do_work(work_units, out.work);
      insert(plan.record_at(streams, i));
    }
  }
  shared = out;
}

/// What a valid trial's answers must keep, whatever the schedule; one line, or empty.
///
/// Interpolated values lie between those of the records. A cache only grows, so no query misses that hits among the
/// records stored beforehand; where nothing is inserted, hits and sum are the oracle's.
inline std::string validate_answers(const SyntheticPlan& plan, const Streams& streams,
                                    const SyntheticWorker& all) {
  constexpr float kRounding = 1e-4f;
  if (all.hits != 0 &&
      !(all.least >= kLeastIrradiance - kRounding && all.most <= kMostIrradiance + kRounding)) {
    return fmt::format("answers reach from {} to {}, records from {} to {}", all.least, all.most,
                       kLeastIrradiance, kMostIrradiance);
  }
  if (plan.prefilled() == 0) return {};
  const SyntheticPlan::Answers expected = plan.expected_answers(streams);
  if (all.hits < expected.hits) {
    return fmt::format("{} queries hit where the records stored beforehand alone make {} hit", all.hits,
                       expected.hits);
  }
  if (plan.spec().kind != WorkloadKind::read_only) return {};
  if (all.hits != expected.hits)
    return fmt::format("{} queries hit where the oracle hits {}", all.hits, expected.hits);
  if (!(std::abs(all.sum - expected.sum) <= kRounding * expected.sum)) {
    return fmt::format("the answers' sum is {} where the oracle's is {}", all.sum, expected.sum);
  }
  return {};
}

/// `Counters` is WithCounters where contention is to be reported, NoCounters where nothing may disturb the times.
template <template <class> class CacheTemplate, class Counters>
TrialOutcome run_synthetic_trial(const SyntheticPlan& plan, const TrialSetup& setup) {
  using Cache = CacheTemplate<Counters>;
  const unsigned threads = setup.team.size();
  const Streams streams = plan.streams(threads, setup.seed);
  Cache cache(plan.config(threads));

  auto first = cache.open_session(0);
  for (std::uint32_t i = 0; i < plan.prefilled(); ++i) first.insert(plan.records()[i]);
  cache.end_frame();
  if constexpr (TidyCache<Cache>) {
    if (plan.spec().tidied) cache.tidy();
  }

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
    ThreadAccount* const account = setup.account(t);
    const LatencySampler sampler(setup.latency_every, hash_keys(setup.seed, t, 6), account,
                                 setup.is_in_order);
    accounted(account, [&] { run_stream(sessions[t], plan, streams, t, work_units, sampler, *workers[t]); });
  });
  const FrameEnd frame_end = timed_end([&] { cache.end_frame(); });

  TrialOutcome out = outcome_of(cache, times, frame_end);
  account_for(setup, times, frame_end, out);
  SyntheticWorker all;
  for (unsigned t = 0; t < threads; ++t) {
    const auto& worker = workers[t];
    if (t >= setup.latencies_from) {
      out.query_ticks.merge(worker->query_ticks);
      out.insert_ticks.merge(worker->insert_ticks);
    }
    all.queries += worker->queries;
    all.hits += worker->hits;
    all.inserted += worker->inserted;
    all.refused += worker->refused;
    all.sum += worker->sum;
    all.least = std::min(all.least, worker->least);
    all.most = std::max(all.most, worker->most);
  }
  out.operations = all.queries + all.inserted + all.refused;

  if constexpr (Cache::kTraits.consistency != Consistency::none) {
    Record made;
    const auto expected = [&](std::uint32_t id) -> const Record* {
      if (spec.kind != WorkloadKind::miss_driven)
        return id < plan.records().size() ? &plan.records()[id] : nullptr;
      if (id >= streams.operations.size()) return nullptr;
      made = plan.record_at(streams, id);
      return &made;
    };
    const std::uint64_t accepted = plan.prefilled() + all.inserted;
    out.error =
        validate_records(cache, first, accepted, sample_points(plan.points(), kOracleSamples), expected);
    if (out.error.empty()) out.error = validate_answers(plan, streams, all);
    if (out.error.empty() && all.refused != 0) out.error = fmt::format("{} inserts refused", all.refused);
  }
  return out;
}

}  // namespace icbench
