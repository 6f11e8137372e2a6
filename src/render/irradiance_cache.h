// The cached integrator: for every stored primary hit ask the cache, on a miss gather and insert.
//
// Templated on the cache's session so that dispatch happens once per pass, never per operation; all else is
// compiled once, in irradiance_cache.cpp. Random numbers of a gather depend on seed, frame, sample and pixel;
// which pixels gather depends on what the cache holds when they ask, hence on the schedule.
#pragma once

#include <cstdint>
#include <optional>

#include "core/interpolation.h"
#include "core/types.h"
#include "image/image.h"
#include "render/gather.h"
#include "render/primary.h"
#include "render/ray_tracer.h"
#include "render/sampling.h"
#include "render/tiles.h"

namespace icbench {

struct IrradianceCacheParams {
  Strata strata = Strata::for_rays(256);  ///< gather rays per record
  RadiusLimits limits{};                  ///< of new records, metres; to be set (RadiusLimits::for_scene)
  SampleKey key{};
};

/// What a thread did to the cache.
struct CacheUse {
  std::uint64_t queries = 0;
  std::uint64_t hits = 0;      ///< queries answered by the cache; each of the others gathered
  std::uint64_t inserts = 0;   ///< accepted
  std::uint64_t full = 0;      ///< refused: out of capacity
  std::uint64_t rejected = 0;  ///< refused: not storable

  void count(InsertResult result) noexcept;
  CacheUse& operator+=(const CacheUse& o) noexcept;
};

/// Gathers the record of a pixel: radius clamped, id = sample * pixels of the image + pixel, modulo 2^32,
/// unique within a frame.
Record gather_record(Tracer& tracer, const Hit& hit, const IrradianceCacheParams& params, std::uint32_t pixel,
                     std::uint32_t pixels) noexcept;

/// Radiance, W/(m^2 sr), that a hit reflects of irradiance E.
glm::vec3 reflected_radiance(const RayTracer& rays, const Hit& hit, const Irradiance& E) noexcept;

/// Indirect radiance at the stored hits of a tile, through the cache. Pixels that reflect nothing are 0 and
/// ask nothing. Rays are counted in `tracer`.
template <class Session>
void irradiance_cache_tile(Session& session, Tracer& tracer, const PrimaryHits& primary,
                           const IrradianceCacheParams& params, const Tile& tile, Image& indirect,
                           CacheUse& use) noexcept {
  const auto pixels = static_cast<std::uint32_t>(primary.hits.size());
  for_each_pixel_coarse_to_fine(tile, primary.width, [&](std::uint32_t pixel) {
    const Hit& hit = primary.hits[pixel];
    if (!reflects(tracer.shared(), hit)) {
      indirect.pixels[pixel] = glm::vec3(0.0f);
      return;
    }
    ++use.queries;
    std::optional<Irradiance> E = session.query(SurfacePoint{hit.p, hit.n});
    if (E) {
      ++use.hits;
    } else {
      const Record record = gather_record(tracer, hit, params, pixel, pixels);
      use.count(session.insert(record));
      E = record.E;
    }
    indirect.pixels[pixel] = reflected_radiance(tracer.shared(), hit, *E);
  });
}

}  // namespace icbench
