// The cached integrators' tile: for every stored primary hit, those seen in mirrors and through glass included, ask the
// cache, on a miss have a record made and insert it; and the classic source of records, hemisphere gathers.
//
// Templated on the cache's session so that dispatch happens once per tile, never per operation; all else is compiled
// once. Random numbers of a gather depend on seed, frame, sample and pixel; which pixels gather depends on what the
// cache holds when they ask, hence on the schedule.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "core/interpolation.h"
#include "core/types.h"
#include "image/image.h"
#include "render/gather.h"
#include "render/indirect_pass.h"
#include "render/primary.h"
#include "render/ray_tracer.h"
#include "render/record_source.h"
#include "render/sampling.h"
#include "render/tiles.h"

namespace icbench {

/// Radius limits of new records as shares of the scene's diagonal (Ward et al. 1988 leave them to the
/// implementation).
inline constexpr float kMinRadiusOfDiagonal = 0.003f;
inline constexpr float kMaxRadiusOfDiagonal = 0.3f;

inline RadiusLimits radius_limits(const Bounds& bounds) noexcept {
  return RadiusLimits::for_scene(bounds, kMinRadiusOfDiagonal, kMaxRadiusOfDiagonal);
}

/// Ids of records that are named after the hit they were made at: pixel + pixels of the image * (layer + sample * L),
/// where L is 1 in scenes without specular surfaces, else kMaxVisible. Modulo 2^32; unique within a frame below that.
class RecordNames {
 public:
  RecordNames(const Scene& scene, int width, int height) noexcept
      : pixels_(static_cast<std::uint32_t>(width) * static_cast<std::uint32_t>(height)),
        layers_(scene.has_specular() ? kMaxVisible : 1) {}

  std::uint32_t operator()(const Visible& x, const SampleKey& key) const noexcept {
    return x.pixel + pixels_ * (x.layer + key.sample * layers_);
  }

 private:
  std::uint32_t pixels_, layers_;
};

/// Records by hemisphere gathers. As a frame begins, they stay if nothing but the camera has changed, else all go.
class HemisphereSource final : public RecordSource {
 public:
  HemisphereSource(const Strata& strata, const RadiusLimits& limits, const RecordNames& names) noexcept
      : strata_(strata), limits_(limits), names_(names) {}

  RecordsThen begin_frame(const SceneChange& change, Crew& crew) override;
  Record evaluate(unsigned thread, Tracer& tracer, const Visible& x, const SampleKey& key) noexcept override;

 private:
  Strata strata_;
  RadiusLimits limits_;
  RecordNames names_;
};

/// Radiance, W/(m^2 sr), that a hit reflects of irradiance E.
glm::vec3 reflected_radiance(const RayTracer& rays, const Hit& hit, const Irradiance& E) noexcept;

/// Asks the cache, and tells `source` which records answered.
template <class Session>
std::optional<Irradiance> query_telling(Session& session, RecordSource& source,
                                        const SurfacePoint& x) noexcept {
  Interpolator sum;
  session.visit(x, [&](const Record& r, float weight) noexcept {
    sum(r, weight);
    source.used(r);
  });
  return sum.result();
}

/// Indirect radiance at the stored hits of a tile, through the cache. Pixels that reflect nothing are 0 and ask
/// nothing. `thread` is the caller's, for the source; rays are counted in `tracer`.
template <class Session>
void irradiance_cache_tile(Session& session, RecordSource& source, unsigned thread, Tracer& tracer,
                           const PrimaryHits& primary, const SampleKey& key, const Tile& tile,
                           Image& indirect, CacheUse& use) noexcept {
  const bool telling = source.wants_use();
  for_each_visible_coarse_to_fine(tile, primary, [&](const Visible& x) {
    if (!reflects(tracer.shared(), x.hit)) {
      x.show(indirect, glm::vec3(0.0f));
      return;
    }
    ++use.queries;
    const SurfacePoint at{x.hit.p, x.hit.n};
    std::optional<Irradiance> E = telling ? query_telling(session, source, at) : session.query(at);
    if (E) {
      ++use.hits;
    } else {
      const Record record = source.evaluate(thread, tracer, x, key);
      const InsertResult result = session.insert(record);
      use.count(result);
      source.settle(thread, record, result);
      E = record.E;
    }
    x.show(indirect, reflected_radiance(tracer.shared(), x.hit, *E));
  });
}

}  // namespace icbench
