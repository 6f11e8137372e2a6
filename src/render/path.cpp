#include "render/path.h"

#include <glm/geometric.hpp>
#include <limits>
#include <numbers>

#include "render/transport.h"

namespace icbench {
namespace {

// Mean over samples of the radiance that x reflects.
glm::vec3 reflected(Tracer& tracer, const Hit& x, Light light, std::uint32_t pixel, std::uint32_t spp,
                    const SampleKey& key, Purpose purpose) noexcept {
  glm::dvec3 sum(0.0);
  for (std::uint32_t s = 0; s < spp; ++s) {
    Pcg32 random(key.next_sample(s).of_pixel(pixel, purpose));
    sum += sample_irradiance(tracer, x, light, random);
  }
  return tracer.shared().albedo(x) * std::numbers::inv_pi_v<float> *
         glm::vec3(sum / static_cast<double>(spp));
}

}  // namespace

Irradiance sample_irradiance(Tracer& tracer, const Hit& x, Light light, Pcg32& random) noexcept {
  const RayTracer& rays = tracer.shared();
  glm::vec3 E(0.0f), weight(1.0f);
  Hit at = x;
  float q = 1.0f;
  for (bool count_light = light != Light::indirect;; count_light = true) {
    LightProposal proposal;
    if (count_light && propose_light(rays, at, q, random, proposal) && !tracer.occluded(proposal.shadow))
      E += weight * proposal.E;

    if (q < 1.0f && !(random.uniform() < q)) return E;
    const float u_elevation = random.uniform(), u_azimuth = random.uniform();
    const glm::vec3 d = cosine_direction(Basis(at.n), u_elevation, u_azimuth);
    if (!(glm::dot(d, at.ng) > 0.0f)) return E;  // into the surface, past a tilted shading normal
    const float p_b = glm::dot(d, at.n) * std::numbers::inv_pi_v<float>;
    const Hit next =
        tracer.intersect(Ray{rays.leave(at.p, at.ng), std::numeric_limits<float>::infinity(), d});
    if (next.missed()) return E;
    const Material& material = rays.material(next);
    if (count_light && next.front && material.emits())
      E += std::numbers::pi_v<float> * emitter_weight(rays, next, d, p_b, q) / q * weight * material.emission;
    if (light == Light::direct) return E;

    weight *= rays.albedo(next) / q;
    q = survival(weight);
    if (!(q > 0.0f)) return E;
    at = next;
  }
}

void path_indirect_tile(Tracer& tracer, const PrimaryHits& primary, std::uint32_t spp, const SampleKey& key,
                        const Tile& tile, Image& indirect) noexcept {
  for_each_pixel(tile, primary.width, [&](std::uint32_t pixel) {
    const Hit& hit = primary.hits[pixel];
    indirect.pixels[pixel] = reflects(tracer.shared(), hit)
                                 ? reflected(tracer, hit, Light::indirect, pixel, spp, key, Purpose::path)
                                 : glm::vec3(0.0f);
  });
}

void direct_tile(Tracer& tracer, const PrimaryHits& primary, std::uint32_t spp, const SampleKey& key,
                 const Tile& tile, Image& direct) noexcept {
  for_each_pixel(tile, primary.width, [&](std::uint32_t pixel) {
    const Hit& hit = primary.hits[pixel];
    direct.pixels[pixel] = tracer.shared().emitted(hit);
    if (reflects(tracer.shared(), hit))
      direct.pixels[pixel] += reflected(tracer, hit, Light::direct, pixel, spp, key, Purpose::direct);
  });
}

}  // namespace icbench
