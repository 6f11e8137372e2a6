// The hemisphere gather against the path tracer and closed forms; the recording that its speed is judged by.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "core/interpolation.h"
#include "render/gather.h"
#include "render/path.h"
#include "render_support.h"
#include "scene/registry.h"
#include "scene/shapes.h"

namespace icbench {
namespace {

TEST(RenderGather, StrataCountExactlyAndAreAboutPiTimesAsWideAsHigh) {
  for (const std::uint32_t rays : {1u, 4u, 16u, 64u, 256u, 1024u, 4096u}) {
    const Strata s = Strata::for_rays(rays);
    EXPECT_EQ(s.count(), rays);
    if (rays >= 16) {
      EXPECT_NEAR(s.azimuths / (kPi * s.elevations), 1.0, 0.4) << rays;
    }
  }
  EXPECT_EQ(Strata::for_rays(0).count(), 1u);
  for (std::uint32_t rays = 1; rays < 3000; ++rays)
    ASSERT_NEAR(Strata::for_rays(rays).count(), rays, 0.35 * rays) << rays;
}

TEST(RenderGather, ItsMeanIsThePathsMean) {
  const RayTracer rays(make_scene("cornell_box"));
  const PrimaryHits primary = primary_hits(rays, 9, 9);
  Tracer tracer(rays);
  const Strata strata = Strata::for_rays(64);
  int compared = 0;
  for (std::size_t i = 0; i < primary.hits.size(); i += 4) {
    const Hit& x = primary.hits[i];
    if (!reflects(rays, x)) continue;
    Estimate gathered[3], traced[3];
    Pcg32 random(i);
    for (std::uint64_t k = 0; k < 200; ++k) {
      const Irradiance E = gather(tracer, x, strata, hash_keys(i, k)).E;
      for (int c = 0; c < 3; ++c) gathered[c].add(E[c]);
    }
    for (int k = 0; k < 10'000; ++k) {
      const Irradiance E = sample_irradiance(tracer, x, Light::indirect, random);
      for (int c = 0; c < 3; ++c) traced[c].add(E[c]);
    }
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(gathered[c].mean(), traced[c].mean(),
                  4.0 * std::hypot(gathered[c].error(), traced[c].error()));
    ++compared;
  }
  EXPECT_GE(compared, 10);
}

TEST(RenderGather, StratificationLowersTheVariance) {
  const RayTracer rays(make_scene("cornell_box"));
  const Hit x = primary_hits(rays, 9, 9).hits[4 * 9 + 1];
  Tracer tracer(rays);
  Estimate stratified, plain;
  for (std::uint64_t k = 0; k < 300; ++k) {
    stratified.add(gather(tracer, x, {8, 32}, k).E.x);
    double sum = 0.0;
    for (std::uint64_t i = 0; i < 256; ++i) sum += gather(tracer, x, {1, 1}, hash_keys(k, i)).E.x;
    plain.add(sum / 256.0);
  }
  EXPECT_LT(stratified.error(), 0.9 * plain.error());
}

// A point that looks at everything around it.
Hit free_point(const glm::vec3& p) {
  Hit x;
  x.p = p;
  x.n = x.ng = {0, 1, 0};
  return x;
}

TEST(RenderGather, HarmonicMeanDistanceInsideABallIsItsRadius) {
  Scene s;
  s.add_material({.albedo = glm::vec3(0.5f)});
  s.meshes.push_back(icosphere("ball", {1, 2, 3}, 2.0f, 4, 0));
  const RayTracer rays(std::move(s));
  Tracer tracer(rays);
  const GatherResult g = gather(tracer, free_point({1, 2, 3}), Strata::for_rays(256), 1);
  EXPECT_NEAR(g.R, 2.0f, 0.01f);
  EXPECT_EQ(g.E, glm::vec3(0.0f)) << "there is no light";
}

TEST(RenderGather, APointThatSeesNothingHasTheLargestRadius) {
  const RayTracer rays(make_scene("lit_floor"));
  Tracer tracer(rays);
  const GatherResult g = gather(tracer, free_point({0, 5, 0}), Strata::for_rays(64), 1);
  EXPECT_EQ(g.R, std::numeric_limits<float>::infinity());
  EXPECT_EQ(g.E, glm::vec3(0.0f));
  EXPECT_EQ(g.rays, 64u);
  EXPECT_EQ((RadiusLimits{0.1f, 2.0f}.clamp(g.R)), 2.0f);
}

TEST(RenderGather, RecordedRaysAreTheRaysTraced) {
  const RayTracer rays(make_scene("cornell_box"));
  const PrimaryHits primary = primary_hits(rays, 6, 6);
  std::vector<Hit> points;
  for (const Hit& hit : primary.hits)
    if (reflects(rays, hit)) points.push_back(hit);
  const Strata strata = Strata::for_rays(64);
  const auto log = record_gather_rays(rays, points, strata, 21);
  Tracer tracer(rays);
  EXPECT_EQ(gather_all(tracer, points, strata, 21), log.size());
  std::uint64_t shadow = 0, hit = 0;
  for (const TracedRay& r : log) {
    shadow += r.shadow;
    hit += r.shadow ? tracer.occluded(r.ray) : !tracer.intersect(r.ray).missed();
  }
  EXPECT_GT(shadow, 0u);
  EXPECT_EQ(tracer.counts.occlusion, 2 * shadow);
  EXPECT_EQ(tracer.counts.total(), 2 * log.size());
  EXPECT_EQ(rays.bare_trace(log), hit);
  RecordingTracer recorder(rays);
  EXPECT_EQ(gather(recorder, points[0], strata, 3).E, gather(tracer, points[0], strata, 3).E);
}

}  // namespace
}  // namespace icbench
