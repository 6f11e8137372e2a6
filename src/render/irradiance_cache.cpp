#include "render/irradiance_cache.h"

#include <numbers>

namespace icbench {

RecordsThen HemisphereSource::begin_frame(const SceneChange& change, Crew&) {
  const bool light_changed = !change.moved.empty() || change.materials || change.lights;
  return light_changed ? RecordsThen::go : RecordsThen::stay;
}

Record HemisphereSource::evaluate(unsigned, Tracer& tracer, const Hit& hit, const SampleKey& key,
                                  std::uint32_t place) noexcept {
  const GatherResult g = gather(tracer, hit, strata_, key.of_pixel(place, Purpose::gather));
  return {hit.p, hit.n, limits_.clamp(g.R), g.E, key.sample * pixels_ + place};
}

glm::vec3 reflected_radiance(const RayTracer& rays, const Hit& hit, const Irradiance& E) noexcept {
  return rays.albedo(hit) * std::numbers::inv_pi_v<float> * E;
}

}  // namespace icbench
