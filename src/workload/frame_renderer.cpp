#include "workload/frame_renderer.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "render/vpl.h"
#include "workload/cached_pass.h"

namespace icbench {
namespace {

std::unique_ptr<IndirectPass> make_pass(const FrameRequest& r, Crew& crew, std::function<void(double)> did) {
  PassSetup setup{r.rays,   crew,        r.width, r.height,
                  r.gather, r.vpls,      r.a,     r.interpolation,
                  r.seed,   r.cell_size, r.paths, guards_against_leaks(r)};
  setup.samples = r.spp;
  // The same whichever frame comes first, so that a still is as in the animation.
  if (r.integrator.uses_vpls && r.rays.scene().frames > 1)
    setup.vpl_paths = plan_paths_of_animation(r.rays, {r.vpls, r.seed});
  if (!r.integrator.needs_cache()) return r.integrator.pass(setup);
  CachedPassSetup cached;
  cached.cache = cache_config(r, crew.size());
  cached.deterministic = r.deterministic ? &r.rays : nullptr;
  cached.overture = r.overture;
  cached.did = std::move(did);
  cached.trace = r.trace;
  return r.cache.pass(cached, r.integrator.source(setup), crew);
}

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// What seeing a tile counts of its work, the rest being its indirect light. How long either takes is for the scene and
/// the integrator to say; told of the latter alone, a picture of one sample would seem to take hours as it begins.
constexpr double kVisibleWork = 0.25, kIndirectWork = 1.0 - kVisibleWork;

/// What tiles count of their indirect light, the rest being told of by the pass (CachedPassSetup::did).
double share_of_tiles(const FrameRequest& r) noexcept {
  if (!r.integrator.needs_cache()) return 1.0;
  if (r.deterministic) return 0.0;
  return r.overture ? 1.0 - kOvertureWork : 1.0;
}

template <class F>
double timed(F&& f) {
  const auto start = std::chrono::steady_clock::now();
  f();
  return seconds_since(start);
}

}  // namespace

bool guards_against_leaks(const FrameRequest& r) noexcept {
  return r.leak_guard.value_or(!r.integrator.uses_vpls && r.interpolation != Interpolation::split_sphere);
}

CacheConfig cache_config(const FrameRequest& r, unsigned threads) {
  CacheConfig config;
  config.bounds = r.rays.scene().bounds;
  config.a_max = config.a = search_reach(r.interpolation, r.integrator.uses_vpls) * r.a;
  config.max_sessions = threads;
  config.capacity = capacity_for(room_for_records(r.width, r.height, r.spp) + r.records.size(), threads);
  return config;
}

std::uint64_t frame_bytes(const FrameRequest& r) {
  const std::uint64_t pixels = static_cast<std::uint64_t>(r.width) * static_cast<std::uint64_t>(r.height);
  return pixels * (sizeof(Hit) + 3 * sizeof(glm::vec3) + sizeof(glm::dvec3)) +
         ResidualEstimator::bytes(pixels, r.spp, r.residual_share, r.keeps_residual);
}

double frame_work(const FrameRequest& r) {
  return static_cast<double>(make_tiles(r.width, r.height, kFrameTile, r.tiles, r.seed).size()) * r.spp;
}

FrameRenderer::FrameRenderer(const FrameRequest& request)
    : request_(request),
      crew_(request.team, request.rays),
      tiles_(make_tiles(request.width, request.height, kFrameTile, request.tiles, request.seed)),
      pass_(make_pass(request_, crew_,
                      [this](double share) {
                        request_.progress(kIndirectWork * share * static_cast<double>(tiles_.size()));
                      })),
      primary_(request.rays.scene(), request.width, request.height),
      direct_(make_image(request.width, request.height)),
      indirect_(direct_),
      picture_(direct_),
      sum_(picture_.pixels.size()) {}

FrameCost FrameRenderer::render(std::uint32_t frame) {
  const FrameRequest& r = request_;
  FrameCost cost;
  SceneChange change;
  const RayCounts rays_before = crew_.rays();
  cost.seconds = timed([&] { change = r.rays.go_to(static_cast<float>(frame)); });
  cost.seconds_indirect = timed([&] {
    pass_->begin_frame(change);
    if (!r.records.empty()) cost.records_taken = pass_->take_records(std::exchange(request_.records, {}));
  });

  const Lens lens = r.spp == 1 ? Lens::centre : Lens::jittered;
  const double tile_work = kIndirectWork * share_of_tiles(r);
  const CameraView view(r.rays.scene().camera, r.width, r.height);
  std::fill(sum_.begin(), sum_.end(), glm::dvec3(0.0));
  if (r.residual_share > 0.0f)
    residual_.emplace(r.width, r.height, r.residual_share, crew_.size(), r.keeps_residual);
  for (std::uint32_t sample = 0; sample < r.spp; ++sample) {
    const SampleKey key{r.seed, frame, sample};
    TileCursor seen(tiles_), lit(tiles_);
    const TeamTimes first = crew_.time([&](unsigned, Tracer& tracer) {
      while (const Tile* tile = seen.next()) {
        visible_tile(tracer, pass_->light(), view, lens, key, r.light_samples, *tile, primary_, direct_);
        r.progress(kVisibleWork);
      }
    });
    cost.seconds += 1e-9 * static_cast<double>(first.wall_ns());
    cost.seconds_indirect += timed([&] { pass_->begin_sample(primary_, key); });
    const TeamTimes second = crew_.time([&](unsigned thread, Tracer& tracer) {
      while (const Tile* tile = lit.next()) {
        pass_->tile(thread, tracer, primary_, key, *tile, indirect_);
        r.progress(tile_work);
      }
    });
    cost.seconds_indirect += 1e-9 * static_cast<double>(second.wall_ns());
    cost.seconds_indirect += timed([&] { pass_->end_sample(primary_, indirect_); });
    if (residual_) {
      const RayCounts before = crew_.rays();
      cost.seconds_residual += timed([&] { add_to_residual(key); });
      cost.rays_residual += crew_.rays() - before;
    }
    for (std::size_t i = 0; i < sum_.size(); ++i)
      sum_[i] += glm::dvec3(direct_.pixels[i]) + glm::dvec3(indirect_.pixels[i]);
  }
  for (std::size_t i = 0; i < sum_.size(); ++i)
    picture_.pixels[i] = glm::vec3(sum_[i] / static_cast<double>(r.spp));
  cost.seconds += cost.seconds_indirect;
  cost.rays = crew_.rays() - rays_before - cost.rays_residual;
  cost.pass = pass_->figures();
  cost.threads = crew_.size();
  if (residual_) cost.residual = residual_->figures();
  return cost;
}

void FrameRenderer::add_to_residual(const SampleKey& key) {
  crew_.for_each(tiles_.size(), 1, [&](unsigned thread, Tracer& tracer, std::size_t i) {
    residual_->tile(thread, tracer, pass_->light(), primary_, key, tiles_[i], indirect_);
  });
  residual_->end_sample(indirect_);
}

}  // namespace icbench
