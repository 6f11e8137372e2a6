// Runs the indirect pass of a ray-traced workload through one cache. Instantiated once per cache, in a
// translation unit of its own.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "core/cache.h"
#include "core/sync.h"
#include "workload/ray_traced_plan.h"
#include "workload/trial.h"
#include "workload/validation.h"

namespace icbench {

/// What one thread keeps of a ray-traced pass, on lines of its own.
template <class Session>
struct alignas(kNoSharing) RayTracedWorker {
  RayTracedWorker(Session s, std::span<Record> shared, const RayTracer& rays, std::uint32_t latency_every,
                  std::uint64_t seed)
      : session(s), accepted(shared), timed(Remembering{this}, latency_every, seed), tracer(rays) {}

  /// Passes operations through and remembers what was accepted, for validation.
  struct Remembering {
    RayTracedWorker* worker;
    std::optional<Irradiance> query(const SurfacePoint& x) noexcept { return worker->session.query(x); }
    InsertResult insert(const Record& r) noexcept {
      const InsertResult result = worker->session.insert(r);
      if (result == InsertResult::inserted) worker->accepted[r.id] = r;
      return result;
    }
  };

  Session session;
  std::span<Record> accepted;  // by id; shared by all workers
  TimedSession<Remembering> timed;
  Tracer tracer;
  CacheUse use;
};

template <template <class> class CacheTemplate>
TrialOutcome run_ray_traced_trial(const RayTracedPlan& plan, const TrialSetup& setup) {
  using Cache = CacheTemplate<WithCounters>;
  using Worker = RayTracedWorker<typename Cache::Session>;
  const unsigned threads = setup.team.size();
  const std::size_t pixels = plan.primary().hits.size();
  Cache cache(plan.config(threads));
  Image indirect = make_image(plan.primary().width, plan.primary().height);

  std::vector<Record> accepted(plan.primary().layers() * pixels, Record{});  // R = 0 where there is none
  std::vector<std::unique_ptr<Worker>> workers(threads);
  setup.team.run([&](unsigned t) {
    auto session = cache.open_session(t);
    session.prefault(static_cast<std::uint32_t>(pixels / 8 / threads + 1));
    workers[t] = std::make_unique<Worker>(session, accepted, plan.rays(), setup.latency_every,
                                          hash_keys(setup.seed, t, 7));
  });

  cache.reset_counters();

  const IrradianceCacheParams params = plan.params(setup.seed);
  TileCursor cursor(plan.tiles());
  cache.begin_frame();
  const TeamTimes times = setup.team.run([&](unsigned t) {
    Worker& w = *workers[t];
    while (const Tile* tile = cursor.next()) {
      irradiance_cache_tile(w.timed, w.tracer, plan.primary(), params, *tile, indirect, w.use);
    }
  });
  const FrameEnd frame_end = timed_end_frame(cache);

  TrialOutcome out = outcome_of(cache, times, frame_end);
  out.operations = out.counts.queries + out.counts.inserted + out.counts.full + out.counts.rejected;
  std::uint64_t inserts = 0;
  for (const auto& w : workers) {
    inserts += w->use.inserts;
    out.query_ticks.merge(w->timed.query_ticks);
    out.insert_ticks.merge(w->timed.insert_ticks);
    out.rays += w->tracer.counts;
  }
  plan.judge(indirect, out);
  if constexpr (Cache::kTraits.consistency != Consistency::none) {
    const auto expected = [&](std::uint32_t id) -> const Record* {
      return id < accepted.size() && accepted[id].R > 0.0f ? &accepted[id] : nullptr;
    };
    std::vector<SurfacePoint> points;
    for (const Hit& hit : plan.primary().hits) {
      if (reflects(plan.rays(), hit)) points.push_back({hit.p, hit.n});
    }
    auto session = cache.open_session(0);
    out.error = validate_records(cache, session, inserts, sample_points(points, 32), expected);
    if (out.error.empty() && out.counts.rejected + out.counts.full != 0) {
      out.error = fmt::format("{} inserts refused", out.counts.full + out.counts.rejected);
    }
  }
  return out;
}

}  // namespace icbench
