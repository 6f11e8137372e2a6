// Replays a trace on one cache: its queries tile by tile, tiles by whichever thread is free, as in the render; on a
// miss work for as long as the record took, times the plan's scale, and the record is inserted. No rays are traced.
// What the renderer did between an answer and the next query (materials, the picture) is not in the trace.
//
// On one thread, a trace that was captured from one leaves the same records, bit for bit, with every cache that keeps
// its promise: whether a query is answered depends on which records are there and valid, and on nothing else. Replayed
// as captured, any trace does, on any number of threads: a trace from several has records that two threads made at
// once, of which one thread that goes by its own answers makes the first alone. Queries
// whose valid records the renderer refused (elliptic records, the guard against leaks) miss as they did there; records
// that the cache refused there are worked for and not offered.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstring>
#include <memory>
#include <vector>

#include "core/cache.h"
#include "core/sync.h"
#include "workload/trace_plan.h"
#include "workload/trial.h"
#include "workload/validation.h"

namespace icbench {

/// One worker's state and results, on lines of its own.
struct alignas(kNoSharing) TraceWorker {
  explicit TraceWorker(const LatencySampler& s) : sampler(s) {}

  LatencySampler sampler;
  Histogram query_ticks;
  Histogram insert_ticks;
  std::uint64_t queries = 0;
  std::uint64_t inserted = 0;
  std::uint64_t refused = 0;
  std::uint64_t stand_ins = 0;
  double sum = 0.0;        // of the answers' red channel
  std::uint64_t work = 0;  // end of the chain of simulated work
};

/// The timed loop over the operations of a tile. `accepted[i]` is set where operation i inserted a record; operations
/// are run by one thread each.
template <class Session>
void replay_tile(Session& session, const TracePlan& plan, const Trace::Tile& tile,
                 const std::vector<std::uint64_t>& work_units, TraceWorker& out,
                 std::vector<unsigned char>& accepted) noexcept {
  const Trace& trace = plan.trace();
  for (std::uint32_t i = tile.begin; i < tile.end; ++i) {
    ++out.queries;
    const SurfacePoint x = trace.points[i];  // at hand before anything is timed
    const auto E = out.sampler.run(out.query_ticks, session, [&] { return session.query(x); });
    if (!plan.makes_a_record(i, E.has_value())) {
      if (E) out.sum += E->x;
      continue;
    }
    const TracedRecord& origin = trace.records[plan.origin(i)];
    const bool was_hit = plan.is_stand_in(i);
    out.work = do_work(work_units[plan.origin(i)], out.work);
    if ((origin.flags & TracedRecord::kAskedNeighbours) != 0)
      session.visit(x, RecordCallback{[](void*, const Record&, float) noexcept {}, nullptr});
    if (!was_hit && origin.result != InsertResult::inserted) continue;
    const Record record = plan.record(i);
    const InsertResult result =
        out.sampler.run(out.insert_ticks, session, [&] { return session.insert(record); });
    if (result == InsertResult::inserted) {
      accepted[i] = 1;
      ++out.inserted;
      out.stand_ins += was_hit;
    } else {
      ++out.refused;
    }
  }
}

inline bool comes_before(const Record& a, const Record& b) noexcept {
  return std::memcmp(&a, &b, sizeof a) < 0;
}

/// What the records of a quiescent cache must be: bit for bit those that it began with and those that were accepted.
/// One line, or empty.
inline std::string validate_stored(const TracePlan& plan, Trace::Range epoch,
                                   const std::vector<unsigned char>& accepted, std::vector<Record>& stored) {
  const Trace& trace = plan.trace();
  std::vector<Record> given;
  const Trace::Range first = trace.frames[epoch.begin].first;
  for (std::uint32_t i = first.begin; i < first.end; ++i) given.push_back(trace.records[i].record);
  const Trace::Range operations = plan.operations(epoch);
  for (std::uint32_t i = operations.begin; i < operations.end; ++i)
    if (accepted[i] != 0) given.push_back(plan.record(i));
  if (stored.size() != given.size())
    return fmt::format("{} records accepted but {} stored", given.size(), stored.size());
  std::sort(stored.begin(), stored.end(), comes_before);
  std::sort(given.begin(), given.end(), comes_before);
  for (std::size_t i = 0; i < given.size(); ++i)
    if (!same_bits(stored[i], given[i]))
      return fmt::format("a record is stored that was not given, or not as often: {}", stored[i].id);
  return {};
}

template <template <class> class CacheTemplate>
TrialOutcome run_trace_trial(const TracePlan& plan, const TrialSetup& setup) {
  using Cache = CacheTemplate<WithCounters>;
  constexpr bool kKeeps = Cache::kTraits.consistency != Consistency::none;
  const Trace& trace = plan.trace();
  const unsigned threads = setup.team.size();
  const std::vector<std::uint64_t> work_units = plan.work_units(setup.work);
  std::vector<unsigned char> accepted(trace.points.size());
  Cache cache(plan.config(threads));
  const auto expected = static_cast<std::uint32_t>(trace.records.size() / plan.epochs().size() / threads + 1);
  auto first = cache.open_session(0);
  std::vector<typename Cache::Session> sessions(threads, first);
  std::vector<std::unique_ptr<TraceWorker>> workers(threads);
  setup.team.run([&](unsigned t) {
    sessions[t] = cache.open_session(t);
    sessions[t].prefault(expected);
    workers[t] = std::make_unique<TraceWorker>(LatencySampler(
        setup.latency_every, hash_keys(setup.seed, t, 10), setup.account(t), setup.is_in_order));
  });

  TrialOutcome out;
  out.same_records = kKeeps;
  const auto run_segment = [&](Trace::Range tiles) {
    alignas(kNoSharing) std::atomic<std::uint32_t> next{tiles.begin};
    cache.begin_frame();
    const TeamTimes times = setup.team.run([&](unsigned t) {
      accounted(setup.account(t), [&] {
        for (;;) {
          // relaxed: tiles are immutable and were shared before the threads started; only uniqueness matters.
          const std::uint32_t tile = next.fetch_add(1, std::memory_order_relaxed);
          if (tile >= tiles.end) return;
          replay_tile(sessions[t], plan, trace.tiles[tile], work_units, *workers[t], accepted);
        }
      });
    });
    const FrameEnd end = timed_end([&] { cache.end_frame(); });
    out.merge_ns += end.wall_ns;
    out.merge_cpu_ns += end.cpu_ns;
    out.wall_ns += static_cast<double>(times.wall_ns()) + end.wall_ns;
    out.cpu_ns += static_cast<double>(times.cpu_ns()) + end.cpu_ns;
    out.start_skew_ns = std::max(out.start_skew_ns, static_cast<double>(times.start_skew_ns()));
    account_for(setup, times, end, out);
    out.counts += cache.counters();
    cache.reset_counters();
  };

  std::vector<Record> stored;
  for (const Trace::Range epoch : plan.epochs()) {
    if (epoch.begin != 0) cache.clear();
    const Trace::Range given = trace.frames[epoch.begin].first;
    cache.begin_frame();
    for (std::uint32_t i = given.begin; i < given.end; ++i) first.insert(trace.records[i].record);
    cache.end_frame();
    cache.reset_counters();
    for (std::uint32_t f = epoch.begin; f < epoch.end; ++f) {
      const Trace::Frame& frame = trace.frames[f];
      for (std::uint32_t s = frame.segments.begin; s < frame.segments.end; ++s)
        run_segment(trace.segments[s]);
      stored.clear();
      RecordsDigest digest;
      cache.for_each_record([&](const Record& r) {
        stored.push_back(r);
        digest.add(r);
      });
      out.same_records &= stored.size() == frame.stored && digest.value() == frame.digest;
    }
    out.records += stored.size();
    out.bytes += cache.memory_bytes();
    if constexpr (kKeeps) {
      if (out.error.empty()) out.error = validate_stored(plan, epoch, accepted, stored);
      if (out.error.empty()) out.error = validate_queries(cache, first, stored, plan.samples(epoch));
    }
  }
  for (const auto& worker : workers) {
    out.query_ticks.merge(worker->query_ticks);
    out.insert_ticks.merge(worker->insert_ticks);
    out.operations += worker->queries + worker->inserted + worker->refused;
    out.queries += worker->queries;
    out.stand_ins += worker->stand_ins;
    out.checksum += worker->sum;
    if (kKeeps && out.error.empty() && worker->refused != 0)
      out.error = fmt::format("{} inserts refused", worker->refused);
  }
  return out;
}

}  // namespace icbench
