// Virtual point lights: the set and its slots, gathers from it, and that a shadow ray's answer is its own.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <numeric>
#include <vector>

#include "render/path.h"
#include "render/vpl.h"
#include "render/vpl_gather.h"
#include "render_support.h"
#include "scene/registry.h"
#include "scene/shapes.h"

namespace icbench {
namespace {

VplSet traced_set(const RayTracer& rays, std::uint32_t wanted, std::uint64_t seed) {
  VplSet set(rays, {wanted, seed});
  Tracer tracer(rays);
  trace_all(set, tracer);
  return set;
}

bool same(const VplArrays& a, const VplArrays& b) {
  return a.slots() == b.slots() && std::memcmp(a.of(VplArrays::kPx), b.of(VplArrays::kPx),
                                               VplArrays::kComponents * a.slots() * sizeof(float)) == 0;
}

// Mean irradiance over some hits of an image.
template <class F>
glm::dvec3 mean_over(const std::vector<Hit>& hits, F&& f) {
  glm::dvec3 sum(0.0);
  for (std::size_t i = 0; i < hits.size(); ++i) sum += f(hits[i], i);
  return sum / static_cast<double>(hits.size());
}

std::vector<Hit> reflecting_hits(const RayTracer& rays, int size) {
  std::vector<Hit> hits;
  for (const Hit& hit : primary_hits(rays, size, size).hits)
    if (reflects(rays, hit)) hits.push_back(hit);
  return hits;
}

TEST(RenderVpl, CompensatedGatherConvergesToPathTracedIrradianceAndClampingAloneIsDarker) {
  for (const char* name : {"white_furnace", "cornell_box"}) {
    const RayTracer rays(make_scene(name));
    const std::vector<Hit> hits = reflecting_hits(rays, 12);
    // A clamp that takes much, so that a compensation at fault shows.
    const float clamp = 0.3f * vpl_clamp(rays.scene().bounds);
    Tracer tracer(rays);
    Estimate gathered[3], clamped[3], difference[3];
    for (std::uint64_t seed = 0; seed < 150; ++seed) {
      const VplSet set = traced_set(rays, 64, seed);
      const glm::dvec3 E = mean_over(
          hits, [&](const Hit& hit, std::size_t) { return gather_vpls(tracer, hit, set.vpls(), clamp); });
      const glm::dvec3 rest = mean_over(hits, [&](const Hit& hit, std::size_t i) {
        return compensate(tracer, hit, clamp, 4, hash_keys(seed, i)).E;
      });
      const glm::dvec3 path = mean_over(hits, [&](const Hit& hit, std::size_t i) {
        Pcg32 random(hash_keys(seed, i, 77));
        glm::dvec3 sum(0.0);
        for (int s = 0; s < 8; ++s) sum += sample_irradiance(tracer, hit, Light::indirect, random);
        return sum / 8.0;
      });
      for (int c = 0; c < 3; ++c) {
        gathered[c].add(E[c] + rest[c]);
        clamped[c].add(E[c]);
        difference[c].add(E[c] + rest[c] - path[c]);
      }
    }
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(difference[c].mean(), 0.0, 4.0 * difference[c].error()) << name;
      EXPECT_LT(difference[c].error(), 0.015 * gathered[c].mean()) << name << ": the test sees nothing";
      EXPECT_LT(clamped[c].mean(), gathered[c].mean() - 10.0 * difference[c].error()) << name;
    }
    if (std::string(name) == "white_furnace")
      EXPECT_NEAR(gathered[0].mean(), kPi * kRho, 4.0 * gathered[0].error());
  }
}

}  // namespace
}  // namespace icbench
