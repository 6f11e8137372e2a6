#include "render/caustics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <iterator>
#include <limits>
#include <numbers>

#include "core/random.h"
#include "render/hemisphere.h"
#include "render/sampling.h"
#include "render/specular.h"

namespace icbench {
namespace {

constexpr std::size_t kGrain = 64;

// Particles whose landing places, together, tell an irradiance: few, so that narrow caustics are not blurred.
constexpr std::size_t kNearest = 8;

bool faces_alike(const glm::vec3& a, const glm::vec3& b) noexcept { return glm::dot(a, b) > 0.7f; }

}  // namespace

void Caustics::find(const RayTracer& rays, Crew& crew, std::uint64_t seed) {
  landings_.clear();
  if (!rays.scene().has_specular() || rays.scene().lights.empty()) return;
  land(rays, crew, seed);
  std::vector<float> irradiance(landings_.size());
  crew.for_each(landings_.size(), 16, [&](unsigned, Tracer&, std::size_t i) {
    irradiance[i] = irradiance_at(landings_[i].p, landings_[i].n);
  });
  for (std::size_t i = 0; i < landings_.size(); ++i) landings_[i].irradiance = irradiance[i];
  std::stable_sort(landings_.begin(), landings_.end(),
                   [](const Landing& a, const Landing& b) { return a.irradiance > b.irradiance; });
}

// Keeps those that came by way of a specular surface, in the order of the particles.
void Caustics::land(const RayTracer& rays, Crew& crew, std::uint64_t seed) {
  std::vector<Landing> landed(kParticles);
  crew.for_each(kParticles, kGrain, [&](unsigned, Tracer& tracer, std::size_t i) {
    Pcg32 random(SampleKey{.seed = seed}.of_pixel(static_cast<std::uint32_t>(i), Purpose::caustic));
    std::array<float, 5> u;
    for (float& x : u) x = random.uniform();
    const EmittedRay start = rays.scene().lights.emit(u[0], u[1], u[2], u[3], u[4]);
    if (!start.on_surface) return;  // no ray of a record meets a point light
    Ray ray{rays.leave(start.p, start.n), std::numeric_limits<float>::infinity(), start.d};
    glm::vec3 weight(1.0f);
    std::uint32_t bounces;
    const Hit hit = intersect_beyond_specular<Carries::flux>(tracer, ray, random, weight, bounces);
    if (hit.missed() || bounces == 0) return;
    landed[i] = {hit.p, hit.ng, luminance(weight * start.power) / static_cast<float>(kParticles)};
  });
  std::copy_if(landed.begin(), landed.end(), std::back_inserter(landings_),
               [](const Landing& l) { return l.flux > 0.0f; });
}

// By the flux within the distance of the kNearest'th landing; 0 where there are not so many. At a landing that one is
// among them, so that seven particles count where six should: a sixth too bright. Places are taken for brighter rather
// than for darker that way, and records cut; without it they put out 12 % of a narrow caustic's light instead of 5 %
// (tests/render_caustics_test.cpp).
float Caustics::irradiance_at(const glm::vec3& p, const glm::vec3& n) const noexcept {
  struct Near {
    float square, flux;
  };
  std::array<Near, kNearest> nearest;
  nearest.fill({std::numeric_limits<float>::infinity(), 0.0f});
  for (const Landing& other : landings_) {
    const glm::vec3 d = other.p - p;
    const float square = glm::dot(d, d);
    if (!(square < nearest.back().square) || !faces_alike(n, other.n)) continue;
    std::size_t i = kNearest - 1;
    for (; i > 0 && nearest[i - 1].square > square; --i) nearest[i] = nearest[i - 1];
    nearest[i] = {square, other.flux};
  }
  const float square = nearest.back().square;
  if (!std::isfinite(square)) return 0.0f;
  // The farthest lies on the edge of the disc and does not count.
  float flux = 0.0f;
  for (std::size_t i = 0; i + 1 < kNearest; ++i) flux += nearest[i].flux;
  return flux / (std::numbers::pi_v<float> * std::max(square, std::numeric_limits<float>::min()));
}

float Caustics::distance_to_brighter(const glm::vec3& p, const glm::vec3& n,
                                     float irradiance) const noexcept {
  float least = std::numeric_limits<float>::infinity();
  for (const Landing& l : landings_) {
    if (!(l.irradiance > irradiance)) break;
    const glm::vec3 d = l.p - p;
    if (faces_alike(n, l.n)) least = std::min(least, glm::dot(d, d));
  }
  return std::sqrt(least);
}

}  // namespace icbench
