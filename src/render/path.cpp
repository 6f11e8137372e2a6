#include "render/path.h"

#include <glm/geometric.hpp>
#include <limits>
#include <numbers>

#include "render/specular.h"
#include "render/transport.h"

namespace icbench {
namespace {

// Mean over samples of the radiance that a visible point reflects.
glm::vec3 reflected(Tracer& tracer, const Visible& x, Light light, std::uint32_t spp, const SampleKey& key,
                    Purpose purpose) noexcept {
  glm::dvec3 sum(0.0);
  for (std::uint32_t s = 0; s < spp; ++s) {
    Pcg32 random(x.key(key.next_sample(s), purpose));
    sum += sample_irradiance(tracer, x.hit, light, random);
  }
  return tracer.shared().albedo(x.hit) * std::numbers::inv_pi_v<float> *
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
    Ray ray{rays.leave(at.p, at.ng), std::numeric_limits<float>::infinity(), d};
    std::uint32_t specular = 0;
    const Hit next = light == Light::direct
                         ? tracer.intersect(ray)
                         : intersect_beyond_specular(tracer, ray, random, weight, specular);
    if (next.missed()) return E;
    const Material& material = rays.material(next);
    if (next.front && material.emits()) {
      // What comes by way of a mirror or glass is indirect, and no shadow ray can find it.
      const bool straight = specular == 0;
      const float share = !straight ? 1.0f : count_light ? emitter_weight(rays, next, d, p_b, q) : 0.0f;
      if (share > 0.0f) E += std::numbers::pi_v<float> * share / q * weight * material.emission;
    }
    if (light == Light::direct) return E;

    weight *= rays.albedo(next) / q;
    q = survival(weight);
    if (!(q > 0.0f)) return E;
    at = next;
  }
}

void path_indirect_tile(Tracer& tracer, const PrimaryHits& primary, std::uint32_t spp, const SampleKey& key,
                        const Tile& tile, Image& indirect) noexcept {
  for_each_visible(tile, primary, [&](const Visible& x) {
    x.show(indirect, reflects(tracer.shared(), x.hit)
                         ? reflected(tracer, x, Light::indirect, spp, key, Purpose::path)
                         : glm::vec3(0.0f));
  });
}

void direct_tile(Tracer& tracer, const PrimaryHits& primary, std::uint32_t spp, const SampleKey& key,
                 const Tile& tile, Image& direct) noexcept {
  for_each_visible(tile, primary, [&](const Visible& x) {
    glm::vec3 L = tracer.shared().emitted(x.hit);
    if (reflects(tracer.shared(), x.hit)) L += reflected(tracer, x, Light::direct, spp, key, Purpose::direct);
    x.show(direct, L);
  });
}

}  // namespace icbench
