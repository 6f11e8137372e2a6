#include "render/vpl_compensation.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>
#include <span>

#include "render/primary.h"
#include "render/sampling.h"
#include "render/transport.h"
#include "render/vpl_words.h"

namespace icbench {
namespace {

std::uint32_t reverse_bits(std::uint32_t x) noexcept {
  x = (x >> 1 & 0x55555555u) | (x & 0x55555555u) << 1;
  x = (x >> 2 & 0x33333333u) | (x & 0x33333333u) << 2;
  x = (x >> 4 & 0x0f0f0f0fu) | (x & 0x0f0f0f0fu) << 4;
  return __builtin_bswap32(x);
}

// Share of the light between two facing points that the clamp takes; 0 where it takes none.
float taken_share(const glm::vec3& from, const glm::vec3& n, const Hit& met, float clamp) noexcept {
  const glm::vec3 d = met.p - from;
  const float d2 = glm::dot(d, d);
  const float d4 = d2 * d2 + std::numeric_limits<float>::min();  // as in ToVpl
  const float G = glm::dot(d, n) * -glm::dot(d, met.ng) / d4;
  return G > clamp ? 1.0f - clamp / G : 0.0f;
}

constexpr std::uint32_t kProposals = 4;  // light samples of which one is asked; of eight, noise is no less

// Compensation rays that share an estimate of the light that arrives at what they met, as long as the clamp takes no
// more than what one of them would bring. Of 32 rays at a point, eight estimates make no more error than 32 beside that
// of 1,024 VPLs; four would leave edges that are seen.
constexpr std::uint32_t kPerEstimate = 4;

float sum_of(const glm::vec3& v) noexcept { return v.x + v.y + v.z; }

// One of the weights, drawn in their proportion: the first below whose end `target`, of [0, their sum), lies. `target`
// becomes what is left of it there. Where rounding carries it past all, the last.
std::size_t pick(std::span<const float> weights, float& target) noexcept {
  std::size_t i = 0;
  for (; i + 1 < weights.size() && !(target < weights[i]); ++i) target -= weights[i];
  return i;
}

// Irradiance from the lamps, weighted as propose_light does beside rays of length `reach`: of a few samples one is
// asked, drawn by what it would send if nothing lay between (importance resampling, Talbot et al. 2005). Where there
// are many lamps that spares most noise.
Irradiance sample_lamps(Tracer& tracer, const Hit& at, float q, float reach, Pcg32& random) noexcept {
  LightProposal proposals[kProposals];
  float sends[kProposals], total = 0.0f;
  for (std::uint32_t k = 0; k < kProposals; ++k) {
    sends[k] =
        propose_light(tracer.shared(), at, q, random, proposals[k], reach) ? sum_of(proposals[k].E) : 0.0f;
    total += sends[k];
  }
  const float u = random.uniform();
  if (!(total > 0.0f && total < kMaxIrradiance))
    return glm::vec3(0.0f);  // or beyond what a float can be summed to
  float target = u * total;
  const std::size_t k = pick(sends, target);
  if (!(sends[k] > 0.0f) || tracer.occluded(proposals[k].shadow)) return glm::vec3(0.0f);
  return total / kProposals * (proposals[k].E / sends[k]);
}

// Irradiance from all VPLs, clamped, by one of them: a sample of 64 is drawn at random, and of it one VPL, by what it
// would send if nothing lay between. When samples were neighbouring slots, asking four made the noise of compensation
// some 5 % less and its rays almost twice as many.
Irradiance sample_vpls(Tracer& tracer, const Hit& at, const VplArrays& vpls, float clamp,
                       Pcg32& random) noexcept {
  const auto samples = static_cast<float>(vpls.samples());
  const auto sample = static_cast<std::size_t>(random.uniform() * samples);
  const float u = random.uniform();
  if (sample >= vpls.samples()) return glm::vec3(0.0f);  // there are none, or it was rounded up
  const WordOfVpls v = WordOfVpls::sample(vpls, sample);
  alignas(64) float sends[kWord], flux[kWord];
  for (std::size_t i = 0; i < kWord; ++i) {
    const ToVpl to(v, i, at.p, at.n);
    const float surface = to.x * at.ng.x + to.y * at.ng.y + to.z * at.ng.z;
    const float G = to.here * to.there / to.d4();
    flux[i] = v.red[i] + v.green[i] + v.blue[i];
    const bool facing = (to.here > 0.0f) & (surface > 0.0f) & (to.there > 0.0f);
    sends[i] = (G < clamp ? G : clamp) * masked(flux[i], facing ? ~0u : 0u);
  }
  // Part by part: sums that do not wait for each other.
  constexpr std::size_t kParts = kWord / kLanes;
  float parts[kParts] = {};
  for (std::size_t l = 0; l < kLanes; ++l)
    for (std::size_t part = 0; part < kParts; ++part) parts[part] += sends[part * kLanes + l];
  float total = 0.0f;
  for (const float part : parts) total += part;
  if (!(total > 0.0f && total < kMaxIrradiance))
    return glm::vec3(0.0f);  // or beyond what a float can be summed to

  float target = u * total;
  const std::size_t first = pick(parts, target) * kLanes;
  const std::size_t i = first + pick({sends + first, kLanes}, target);
  if (!(sends[i] > 0.0f)) return glm::vec3(0.0f);
  const RayTracer& rays = tracer.shared();
  const glm::vec3 from = rays.leave(at.p, at.ng);
  const glm::vec3 to = rays.leave({v.px[i], v.py[i], v.pz[i]}, {v.nx[i], v.ny[i], v.nz[i]});
  if (tracer.occluded(Ray{from, 1.0f, to - from})) return glm::vec3(0.0f);
  const glm::vec3 colour(v.red[i] / flux[i], v.green[i] / flux[i], v.blue[i] / flux[i]);
  return samples * total * std::numbers::inv_pi_v<float> * colour;
}

// Irradiance at a surface, but for light straight from mirrors and glass: from the lamps, from the VPLs, and what the
// clamp takes of the latter. That comes from within reach, so no ray looks farther; lamps beyond are left to light
// samples.
Irradiance irradiance_at(Tracer& tracer, Hit at, const VplArrays& vpls, float clamp, Pcg32& random) noexcept {
  // What the clamp takes at the second surface counts little. Where it counts much, weights grow, and paths go on.
  constexpr float kGoOn = 0.5f;
  const RayTracer& rays = tracer.shared();
  const float reach = compensation_reach(clamp);
  glm::vec3 E(0.0f), weight(1.0f);
  for (;;) {
    const float q = survival(kGoOn * weight);
    if (!(q > 0.0f)) return E;
    E += weight * (sample_lamps(tracer, at, q, reach, random) + sample_vpls(tracer, at, vpls, clamp, random));

    if (!(random.uniform() < q)) return E;
    const float u_elevation = random.uniform(), u_azimuth = random.uniform();
    const glm::vec3 d = cosine_direction(Basis(at.n), u_elevation, u_azimuth);
    if (!(glm::dot(d, at.ng) > 0.0f)) return E;  // into the surface, past a tilted shading normal
    const Hit next = tracer.intersect(Ray{rays.leave(at.p, at.ng), reach, d});
    if (next.missed()) return E;
    const Material& material = rays.material(next);
    if (next.front && material.emits()) {
      const float p_b = glm::dot(d, at.n) * std::numbers::inv_pi_v<float>;
      E += std::numbers::pi_v<float> * emitter_weight(rays, next, d, p_b, q) / q * weight * material.emission;
    }
    if (!reflects(rays, next)) return E;
    weight *= taken_share(at.p, at.n, next, clamp) / q * rays.albedo(next);
    at = next;
  }
}

}  // namespace

float compensation_reach(float clamp) noexcept { return 1.0f / std::sqrt(clamp); }

Compensation compensate(Tracer& tracer, const Hit& hit, const VplArrays& vpls, float clamp,
                        std::uint32_t count, std::uint64_t key, Packing packing,
                        std::uint64_t which) noexcept {
  const RayTracer& rays = tracer.shared();
  const glm::vec3 from = rays.leave(hit.p, hit.ng);
  const Basis basis(hit.n);
  const float reach = compensation_reach(clamp);
  Pcg32 shifts(key);
  const float elevation_shift = shifts.uniform();
  const std::uint32_t azimuth_shift = shifts();
  Ray asked[kMaxCompensation];
  Hit met[kMaxCompensation];
  std::uint32_t index[kMaxCompensation];
  std::uint32_t n = 0;
  for (std::uint32_t i = 0; i < std::min(count, kMaxCompensation); ++i) {
    if ((which >> i & 1u) == 0) continue;
    // A Hammersley set, shifted at random: each direction has the cosine's density.
    const std::uint32_t reversed = reverse_bits(i) + azimuth_shift;
    const glm::vec3 d =
        cosine_direction(basis, (static_cast<float>(i) + elevation_shift) / static_cast<float>(count),
                         static_cast<float>(reversed >> 8) * 0x1p-24f);
    if (!(glm::dot(d, hit.ng) > 0.0f)) continue;
    asked[n] = {from, reach, d};
    index[n++] = i;
  }
  if (packing == Packing::fast)
    tracer.intersect({asked, n}, {met, n});
  else
    for (std::uint32_t k = 0; k < n; ++k) met[k] = tracer.intersect(asked[k]);

  Compensation out;
  for (std::uint32_t k = 0; k < n;) {
    // What the surfaces met count, in all.
    const std::uint32_t group = index[k] / kPerEstimate;
    float weights[kPerEstimate], total = 0.0f, taken = 0.0f;
    std::uint32_t counting[kPerEstimate], m = 0;
    for (; k < n && index[k] / kPerEstimate == group; ++k) {
      if (!reflects(rays, met[k])) continue;
      const float share = taken_share(hit.p, hit.n, met[k], clamp);
      const float weight = share * sum_of(rays.albedo(met[k]));
      if (!(weight > 0.0f)) continue;
      out.met |= std::uint64_t{1} << index[k];
      counting[m] = k;
      weights[m++] = weight;
      total += weight;
      taken += share;
    }
    if (m == 0) continue;
    // The light that arrives there, at one of them, or at more where the clamp takes more than what one would send. (In
    // a room with venetian blinds, each slat close to the next, the blinds as a whole came out up to 40 % too bright.)
    const auto estimates = static_cast<std::uint32_t>(std::ceil(taken));
    Pcg32 random(hash_keys(key, group + 1));
    const float u = random.uniform();
    for (std::uint32_t e = 0; e < estimates; ++e) {
      float target = (u + static_cast<float>(e)) / static_cast<float>(estimates) * total;
      const Hit& at = met[counting[pick({weights, m}, target)]];
      const glm::vec3 albedo = rays.albedo(at);
      const float scale = total / (static_cast<float>(count * estimates) *
                                   std::max(sum_of(albedo), std::numeric_limits<float>::min()));
      out.E += scale * albedo * irradiance_at(tracer, at, vpls, clamp, random);
    }
  }
  return out;
}

}  // namespace icbench
