// A picture through a cache: for every sample the primary hits, direct light, and indirect light from the
// cache, which lives through all samples. Instantiated once per cache, in a translation unit of its own.
#pragma once

#include <memory>
#include <vector>

#include "core/cache.h"
#include "render/path.h"
#include "workload/picture.h"
#include "workload/ray_traced_plan.h"
#include "workload/trial.h"

namespace icbench {

template <template <class> class CacheTemplate>
PictureOutcome render_cached_picture(const PictureRequest& r) {
  using Cache = CacheTemplate<WithCounters>;
  const unsigned threads = r.team.size();
  const std::vector<Tile> tiles = make_tiles(r.width, r.height, kPictureTile, r.tiles, r.seed);
  const Scene& scene = r.rays.scene();
  const CameraView view(scene.camera, r.width, r.height);
  const std::uint64_t pixels = static_cast<std::uint64_t>(r.width) * static_cast<std::uint64_t>(r.height);

  CacheConfig config;
  config.bounds = scene.bounds;
  config.a_max = config.a = r.a;
  config.max_sessions = threads;
  config.capacity = capacity_for(2 * pixels, threads);
  Cache cache(config);

  struct alignas(kNoSharing) Worker {
    Worker(typename Cache::Session s, const RayTracer& rays) : session(s), tracer(rays) {}
    typename Cache::Session session;
    Tracer tracer;
    CacheUse use;
  };
  std::vector<std::unique_ptr<Worker>> workers(threads);
  r.team.run([&](unsigned t) { workers[t] = std::make_unique<Worker>(cache.open_session(t), r.rays); });

  PrimaryHits primary(scene, r.width, r.height);
  Image direct = make_image(r.width, r.height), indirect = make_image(r.width, r.height);
  PictureOutcome out;
  out.picture = make_image(r.width, r.height);
  IrradianceCacheParams params;
  params.strata = Strata::for_rays(r.gather);
  params.limits = RadiusLimits::for_scene(scene.bounds, kMinRadiusOfDiagonal, kMaxRadiusOfDiagonal);

  for (std::uint32_t sample = 0; sample < r.spp; ++sample) {
    const SampleKey key{r.seed, 0, sample};
    params.key = key;
    TileCursor visible(tiles), cached(tiles);
    const TeamTimes first = r.team.run([&](unsigned t) {
      while (const Tile* tile = visible.next()) {
        primary_tile(workers[t]->tracer, view, Lens::jittered, key, *tile, primary);
        direct_tile(workers[t]->tracer, primary, 1, key, *tile, direct);
      }
    });
    cache.begin_frame();
    const TeamTimes second = r.team.run([&](unsigned t) {
      Worker& w = *workers[t];
      while (const Tile* tile = cached.next()) {
        irradiance_cache_tile(w.session, w.tracer, primary, params, *tile, indirect, w.use);
        r.progress(1.0);
      }
    });
    const double indirect_ns = static_cast<double>(second.wall_ns()) + timed_end_frame(cache).wall_ns;
    out.seconds += 1e-9 * (static_cast<double>(first.wall_ns()) + indirect_ns);
    out.seconds_indirect += 1e-9 * indirect_ns;
    for (std::size_t i = 0; i < pixels; ++i) {
      out.picture.pixels[i] += (direct.pixels[i] + indirect.pixels[i]) / static_cast<float>(r.spp);
    }
  }
  for (const auto& w : workers) out.rays += w->tracer.counts;
  out.counts = cache.counters();
  cache.for_each_record([&](const Record&) { ++out.records; });
  return out;
}

}  // namespace icbench
