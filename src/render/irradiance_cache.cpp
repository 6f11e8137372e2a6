#include "render/irradiance_cache.h"

#include <numbers>

namespace icbench {

void CacheUse::count(InsertResult result) noexcept {
  switch (result) {
    case InsertResult::inserted:
      ++inserts;
      break;
    case InsertResult::full:
      ++full;
      break;
    case InsertResult::rejected:
      ++rejected;
      break;
  }
}

CacheUse& CacheUse::operator+=(const CacheUse& o) noexcept {
  queries += o.queries;
  hits += o.hits;
  inserts += o.inserts;
  full += o.full;
  rejected += o.rejected;
  return *this;
}

Record gather_record(Tracer& tracer, const Hit& hit, const IrradianceCacheParams& params, std::uint32_t pixel,
                     std::uint32_t pixels) noexcept {
  const GatherResult g = gather(tracer, hit, params.strata, params.key.of_pixel(pixel, Purpose::gather));
  return {hit.p, hit.n, params.limits.clamp(g.R), g.E, params.key.sample * pixels + pixel};
}

glm::vec3 reflected_radiance(const RayTracer& rays, const Hit& hit, const Irradiance& E) noexcept {
  return rays.albedo(hit) * std::numbers::inv_pi_v<float> * E;
}

}  // namespace icbench
