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

Record gather_record(Tracer& tracer, const Visible& x, const IrradianceCacheParams& params,
                     const PrimaryHits& primary) noexcept {
  const GatherResult g = gather(tracer, x.hit, params.strata, x.key(params.key, Purpose::gather));
  const auto pixels = static_cast<std::uint32_t>(primary.hits.size());
  const std::uint32_t layers = primary.is_plain() ? 1 : kMaxVisible;
  const std::uint32_t id = (params.key.sample * layers + x.layer) * pixels + x.pixel;
  return {x.hit.p, x.hit.n, params.limits.clamp(g.R), g.E, id};
}

glm::vec3 reflected_radiance(const RayTracer& rays, const Hit& hit, const Irradiance& E) noexcept {
  return rays.albedo(hit) * std::numbers::inv_pi_v<float> * E;
}

}  // namespace icbench
