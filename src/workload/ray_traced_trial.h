// Runs the indirect pass of a ray-traced workload through one cache. Instantiated once per cache, in a
// translation unit of its own.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "core/cache.h"
#include "workload/cached_pass.h"
#include "workload/ray_traced_plan.h"
#include "workload/team_crew.h"
#include "workload/trial.h"
#include "workload/validation.h"

namespace icbench {

/// Passes on to a source of hemisphere gathers what a source of one frame is asked, and remembers by id what the cache
/// accepted.
class RememberingSource final : public RecordSource {
 public:
  RememberingSource(std::unique_ptr<RecordSource> source, std::span<Record> accepted)
      : source_(std::move(source)), accepted_(accepted) {}

  RecordsThen begin_frame(const SceneChange& change, Crew& crew) override {
    return source_->begin_frame(change, crew);
  }
  void found_no_room() noexcept override { source_->found_no_room(); }
  Record evaluate(unsigned thread, Tracer& tracer, const Visible& x, const SampleKey& key) noexcept override {
    return source_->evaluate(thread, tracer, x, key);
  }
  void settle(unsigned thread, const Record& r, InsertResult result) noexcept override {
    if (result == InsertResult::inserted) accepted_[r.id] = r;  // ids are unique, so nobody else writes here
    source_->settle(thread, r, result);
  }

 private:
  std::unique_ptr<RecordSource> source_;
  std::span<Record> accepted_;
};

template <template <class> class CacheTemplate>
TrialOutcome run_ray_traced_trial(const RayTracedPlan& plan, const TrialSetup& setup) {
  using Cache = typename CachedPass<CacheTemplate>::Cache;
  const std::size_t pixels = plan.primary().hits.size();
  TeamCrew crew(setup.team, plan.rays());
  std::vector<Record> accepted(plan.primary().layers() * pixels, Record{});  // R = 0 where there is none
  CachedPassSetup cached{plan.config(crew.size())};
  cached.prefault = static_cast<std::uint32_t>(pixels / 8 / crew.size() + 1);
  cached.latency_every = setup.latency_every;
  cached.seed = setup.seed;
  cached.accounts = setup.accounts;
  CachedPass<CacheTemplate> pass(cached, std::make_unique<RememberingSource>(plan.source(), accepted), crew);
  Cache& cache = pass.cache();
  Image indirect = make_image(plan.primary().width, plan.primary().height);

  const SampleKey key{setup.seed, 0, 0};
  TileCursor cursor(plan.tiles());
  pass.begin_frame({});
  pass.begin_sample(plan.primary(), key);
  const TeamTimes times = crew.time([&](unsigned thread, Tracer& tracer) {
    accounted(setup.account(thread), [&] {
      while (const Tile* tile = cursor.next())
        pass.tile(thread, tracer, plan.primary(), key, *tile, indirect);
    });
  });
  const FrameEnd frame_end = timed_end([&] { pass.end_sample(plan.primary(), indirect); });

  TrialOutcome out = outcome_of(cache, times, frame_end);
  account_for(setup, times, frame_end, out);
  out.operations = out.counts.queries + out.counts.inserted + out.counts.full + out.counts.rejected;
  const std::uint64_t inserts = pass.figures().use.inserts;
  pass.for_each_session([&](const auto& session) {
    out.query_ticks.merge(session.query_ticks);
    out.insert_ticks.merge(session.insert_ticks);
  });
  out.rays = crew.rays();
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
