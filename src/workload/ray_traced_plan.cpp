#include "workload/ray_traced_plan.h"

#include <numbers>
#include <stdexcept>

#include "caches/registry.h"
#include "core/parallel.h"
#include "image/metrics/mean_ratio.h"
#include "image/metrics/relmse.h"
#include "image/metrics/rmse.h"
#include "render/integrators.h"
#include "workload/team_crew.h"

namespace icbench {
namespace {

constexpr int kTile = 16;  // pixels

/// Calls f(tile, tracer) for all tiles, on all processors.
template <class F>
void for_all_tiles(const RayTracer& rays, int width, int height, F&& f) {
  const std::vector<Tile> tiles = make_tiles(width, height, kTile, TileOrder::morton);
  parallel_chunks(tiles.size(), 1, [&](std::size_t i, std::size_t) {
    Tracer tracer(rays);
    f(tiles[i], tracer);
  });
}

}  // namespace

Image irradiance_of(const RayTracer& rays, const PrimaryHits& primary, const Image& reflected) {
  Image out = reflected;
  for (std::size_t i = 0; i < out.pixels.size(); ++i) {
    const Hit& hit = primary.hits[i];
    const bool counts = reflects(rays, hit) && !primary.sees_through(i);
    const glm::vec3 albedo = counts ? rays.albedo(hit) : glm::vec3(0.0f);
    for (int c = 0; c < 3; ++c)
      out.pixels[i][c] = albedo[c] > 0.0f ? std::numbers::pi_v<float> / albedo[c] * out.pixels[i][c] : 0.0f;
  }
  return out;
}

PrimaryHits centre_hits(const RayTracer& rays, int width, int height) {
  PrimaryHits primary(rays.scene(), width, height);
  const CameraView view(rays.scene().camera, width, height);
  for_all_tiles(rays, width, height, [&](const Tile& tile, Tracer& tracer) {
    primary_tile(tracer, view, Lens::centre, {}, tile, primary);
  });
  return primary;
}

Reference make_reference(const RayTracer& rays, const PrimaryHits& primary, std::uint32_t spp,
                         std::uint64_t seed) {
  const std::uint32_t half_spp = std::max(1u, spp / 2);
  Image halves[2];
  for (std::uint32_t h = 0; h < 2; ++h) {
    halves[h] = make_image(primary.width, primary.height);
    for_all_tiles(rays, primary.width, primary.height, [&](const Tile& tile, Tracer& tracer) {
      path_indirect_tile(tracer, primary, half_spp, SampleKey{seed, 0, h * half_spp}, tile, halves[h]);
    });
  }
  Reference out;
  out.spp = 2 * half_spp;
  out.indirect = out.half_difference = halves[0];
  for (std::size_t i = 0; i < out.indirect.pixels.size(); ++i) {
    out.indirect.pixels[i] = 0.5f * (halves[0].pixels[i] + halves[1].pixels[i]);
    out.half_difference.pixels[i] = 0.5f * (halves[0].pixels[i] - halves[1].pixels[i]);
  }
  // A half lies as far from the mean of both, in expectation, as that mean lies from the truth.
  out.relmse =
      0.5 * (figure_of(relmse, out.indirect, halves[0]) + figure_of(relmse, out.indirect, halves[1]));
  out.scaled_relmse = 0.5 * (scaled_relmse(out.indirect, halves[0]) + scaled_relmse(out.indirect, halves[1]));
  out.rmse = figure_of(rmse, out.indirect, halves[0]);  // that of the other is the same
  const Image E = irradiance_of(rays, primary, out.indirect);
  for (Image& half : halves) half = irradiance_of(rays, primary, half);
  out.rmse_irradiance = figure_of(rmse, E, halves[0]);
  out.scaled_relmse_irradiance = 0.5 * (scaled_relmse(E, halves[0]) + scaled_relmse(E, halves[1]));
  return out;
}

RayTracedPlan::RayTracedPlan(const WorkloadSpec& spec, const RayTracer& rays, const PrimaryHits& primary,
                             const Reference& reference, std::uint64_t seed)
    : spec_(spec),
      rays_(&rays),
      primary_(&primary),
      reference_(&reference),
      tiles_(make_tiles(primary.width, primary.height, kTile, spec.tiles, seed)) {}

std::unique_ptr<RecordSource> RayTracedPlan::source() const {
  return std::make_unique<HemisphereSource>(Strata::for_rays(spec_.rays),
                                            radius_limits(rays_->scene().bounds),
                                            RecordNames(rays_->scene(), primary_->width, primary_->height));
}

CacheConfig RayTracedPlan::config(unsigned threads) const {
  CacheConfig config;
  config.bounds = rays_->scene().bounds;
  config.a_max = spec_.a;
  config.a = spec_.a;
  config.max_sessions = threads;
  config.capacity = capacity_for(primary_->count(), threads);  // at worst every hit is a record
  return config;
}

std::uint64_t RayTracedPlan::records_of_one_thread(std::uint64_t seed) const {
  Sequential<> cache(config(1));
  auto session = cache.open_session(0);
  Tracer tracer(*rays_);
  CacheUse use;
  Image indirect = make_image(primary_->width, primary_->height);
  const std::unique_ptr<RecordSource> records = source();
  for (const Tile& tile : tiles_) {
    irradiance_cache_tile(session, *records, 0, tracer, *primary_, SampleKey{seed, 0, 0}, tile, indirect,
                          use);
  }
  return use.inserts;
}

void RayTracedPlan::judge(const Image& indirect, TrialOutcome& out) const {
  out.rmse = figure_of(rmse, reference_->indirect, indirect);
  out.relmse = figure_of(relmse, reference_->indirect, indirect);
  out.mean_ratio = figure_of(mean_ratio, reference_->indirect, indirect);
}

TrialOutcome run_uncached_trial(const RayTracedPlan& plan, const TrialSetup& setup) {
  const PrimaryHits& primary = plan.primary();
  Image indirect = make_image(primary.width, primary.height);
  TeamCrew crew(setup.team, plan.rays());
  const SampleKey key{setup.seed, 0, 0};
  std::unique_ptr<IndirectPass> cells;  // none: every pixel's paths are its own
  if (plan.spec().method == Method::hash_cells) {
    PassSetup pass{plan.rays(), crew, primary.width, primary.height};
    pass.seed = setup.seed;
    pass.cell_size = plan.spec().cell;
    pass.paths = plan.spec().spp;
    cells = make_hash_cells(pass);
    cells->begin_frame({});
    cells->begin_sample(primary, key);
  }
  TileCursor cursor(plan.tiles());
  const TeamTimes times = crew.time([&](unsigned t, Tracer& tracer) {
    accounted(setup.account(t), [&] {
      while (const Tile* tile = cursor.next()) {
        if (cells) {
          cells->tile(t, tracer, primary, key, *tile, indirect);
        } else {
          path_indirect_tile(tracer, primary, plan.spec().spp, key, *tile, indirect);
        }
      }
    });
  });
  // The cells are filled at the end, by all threads.
  const FrameEnd end = cells ? timed_end([&] { cells->end_sample(primary, indirect); }) : FrameEnd{};
  TrialOutcome out;
  account_for(setup, times, end, out);
  out.merge_ns = end.wall_ns;
  out.merge_cpu_ns = end.cpu_ns;
  out.wall_ns = static_cast<double>(times.wall_ns()) + end.wall_ns;
  out.cpu_ns = static_cast<double>(times.cpu_ns()) + end.cpu_ns;
  out.rays = crew.rays();
  out.operations = primary.count() * plan.spec().spp;
  plan.judge(indirect, out);
  return out;
}

}  // namespace icbench
