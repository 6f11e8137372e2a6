#include "render/irradiance_cache.h"

#include <numbers>

namespace icbench {

RecordsThen HemisphereSource::begin_frame(const SceneChange& change, Crew&) {
  const bool light_changed = !change.moved.empty() || change.materials || change.lights;
  return light_changed ? RecordsThen::go : RecordsThen::stay;
}

Record HemisphereSource::evaluate(unsigned, Tracer& tracer, const Visible& x, const SampleKey& key) noexcept {
  const GatherResult g = gather(tracer, x.hit, strata_, x.key(key, Purpose::gather));
  return {x.hit.p, x.hit.n, limits_.clamp(g.R), g.E, names_(x, key)};
}

glm::vec3 reflected_radiance(const RayTracer& rays, const Hit& hit, const Irradiance& E) noexcept {
  return rays.albedo(hit) * std::numbers::inv_pi_v<float> * E;
}

}  // namespace icbench
