// The cached integrator: for every stored primary hit, those seen in mirrors and through glass included, ask the cache, on a miss gather and insert.
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

/// Gathers the record of a hit of a pixel: radius clamped. Its id, modulo 2^32, is unique within a frame: pixel + pixels
/// of the image * (layer + sample * L), where L is 1 in scenes without specular surfaces, else kMaxVisible.
Record gather_record(Tracer& tracer, const Visible& x, const IrradianceCacheParams& params,
                     const PrimaryHits& primary) noexcept;

/// Radiance, W/(m^2 sr), that a hit reflects of irradiance E.
glm::vec3 reflected_radiance(const RayTracer& rays, const Hit& hit, const Irradiance& E) noexcept;

/// Indirect radiance at the stored hits of a tile, through the cache. Pixels that reflect nothing are 0 and
/// ask nothing. Rays are counted in `tracer`.
template <class Session>
void irradiance_cache_tile(Session& session, Tracer& tracer, const PrimaryHits& primary,
                           const IrradianceCacheParams& params, const Tile& tile, Image& indirect,
                           CacheUse& use) noexcept {
  for_each_visible_coarse_to_fine(tile, primary, [&](const Visible& x) {
    if (!reflects(tracer.shared(), x.hit)) {
      x.show(indirect, glm::vec3(0.0f));
      return;
    }
    ++use.queries;
    std::optional<Irradiance> E = session.query(SurfacePoint{x.hit.p, x.hit.n});
    if (E) {
      ++use.hits;
    } else {
      const Record record = gather_record(tracer, x, params, primary);
      use.count(session.insert(record));
      E = record.E;
    }
    x.show(indirect, reflected_radiance(tracer.shared(), x.hit, *E));
  });
}

}  // namespace icbench
