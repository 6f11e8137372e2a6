#include "workload/surface_points.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "core/interpolation.h"
#include "core/parallel.h"
#include "core/random.h"
#include "render/camera.h"
#include "render/primary.h"
#include "render/sampling.h"
#include "render/tiles.h"

namespace icbench {
namespace {

constexpr std::size_t kGrain = 256;  // points per parallel chunk
constexpr std::uint32_t kRadiusRays = 16;
constexpr int kMaxBounces = 5;

/// Harmonic mean distance to the surfaces seen from a hit, within the scene's limits.
float mean_distance(Tracer& tracer, const Hit& hit, const RadiusLimits& limits, Pcg32& random) {
  std::array<Ray, kRadiusRays> rays;
  std::array<Hit, kRadiusRays> hits;
  const Basis basis(hit.n);
  for (Ray& ray : rays) {
    const float u = random.uniform(), v = random.uniform();
    ray = {tracer.shared().leave(hit.p, hit.ng), std::numeric_limits<float>::infinity(),
           cosine_direction(basis, u, v)};
  }
  tracer.intersect(rays, hits);
  double inverse = 0.0;
  for (const Hit& h : hits) {
    if (!h.missed()) inverse += 1.0 / std::max(h.t, limits.min);
  }
  return limits.clamp(static_cast<float>(kRadiusRays / inverse));
}

RadiusLimits limits_of(const RayTracer& rays) {
  return RadiusLimits::for_scene(rays.scene().bounds, 0.002f, 0.2f);
}

/// Keeps a hit inside the cache's bounds, which rounding at the outermost surfaces may leave.
SurfacePoint point_of(const Hit& hit, const Bounds& bounds) {
  return {glm::clamp(hit.p, bounds.lower, bounds.upper), hit.n};
}

}  // namespace

SurfacePoints scattered_points(const RayTracer& rays, std::uint32_t n, std::uint64_t seed,
                               WithRadii with_radii) {
  constexpr int kFilm = 4096;
  const CameraView view(rays.scene().camera, kFilm, kFilm);
  const RadiusLimits limits = limits_of(rays);
  SurfacePoints out{rays.scene().bounds, std::vector<SurfacePoint>(n), {}};
  if (with_radii == WithRadii::yes) out.radii.resize(n);
  std::atomic<bool> lost{false};
  parallel_chunks(n, kGrain, [&](std::size_t begin, std::size_t end) {
    Tracer tracer(rays);
    for (std::size_t i = begin; i < end; ++i) {
      Pcg32 random(hash_keys(seed, i));
      // A walk may leave an open scene; a few attempts find the scene unless the camera looks past it.
      constexpr int kAttempts = 64;
      Hit hit;
      for (int attempt = 0; attempt < kAttempts && hit.missed(); ++attempt) {
        const float x = kFilm * random.uniform(), y = kFilm * random.uniform();
        hit = tracer.intersect(view.ray(x, y));
        const auto bounces = static_cast<int>(random.below(kMaxBounces + 1));
        for (int b = 0; b < bounces && !hit.missed(); ++b) {
          const float u = random.uniform(), v = random.uniform();
          const Ray ray{rays.leave(hit.p, hit.ng), std::numeric_limits<float>::infinity(),
                        cosine_direction(Basis(hit.n), u, v)};
          const Hit next = tracer.intersect(ray);
          if (!next.missed()) hit = next;
        }
      }
      if (hit.missed()) {
        lost.store(true, std::memory_order_relaxed);  // relaxed: read after the threads are joined
        return;
      }
      out.points[i] = point_of(hit, out.bounds);
      if (with_radii == WithRadii::yes) out.radii[i] = mean_distance(tracer, hit, limits, random);
    }
  });
  if (lost.load(std::memory_order_relaxed)) {
    throw std::runtime_error("scene '" + rays.scene().name +
                             "': the camera sees no surface; point it at the scene");
  }
  return out;
}

SurfacePoints image_points(const RayTracer& rays, int width, int height, std::uint64_t seed,
                           WithRadii with_radii, std::vector<std::uint32_t>& tile_ends) {
  constexpr int kTile = 16;
  const CameraView view(rays.scene().camera, width, height);
  const RadiusLimits limits = limits_of(rays);
  const std::vector<Tile> tiles = make_tiles(width, height, kTile, TileOrder::morton);
  struct TilePoints {
    std::vector<SurfacePoint> points;
    std::vector<float> radii;
  };
  std::vector<TilePoints> found(tiles.size());
  parallel_chunks(tiles.size(), 1, [&](std::size_t t, std::size_t) {
    Tracer tracer(rays);
    for_each_pixel(tiles[t], width, [&](std::uint32_t pixel) {
      const auto x = static_cast<int>(pixel % static_cast<std::uint32_t>(width));
      const auto y = static_cast<int>(pixel / static_cast<std::uint32_t>(width));
      const Hit hit = primary_hit(tracer, view, Lens::centre, {}, x, y, pixel);
      if (!reflects(rays, hit)) return;
      found[t].points.push_back(point_of(hit, rays.scene().bounds));
      if (with_radii == WithRadii::no) return;
      Pcg32 random(hash_keys(seed, pixel));
      found[t].radii.push_back(mean_distance(tracer, hit, limits, random));
    });
  });
  SurfacePoints out{rays.scene().bounds, {}, {}};
  tile_ends.clear();
  for (const TilePoints& tile : found) {
    out.points.insert(out.points.end(), tile.points.begin(), tile.points.end());
    out.radii.insert(out.radii.end(), tile.radii.begin(), tile.radii.end());
    if (!tile.points.empty()) tile_ends.push_back(static_cast<std::uint32_t>(out.points.size()));
  }
  if (out.points.empty()) {
    throw std::runtime_error("scene '" + rays.scene().name +
                             "': the camera sees no surface; point it at the scene");
  }
  return out;
}

}  // namespace icbench
