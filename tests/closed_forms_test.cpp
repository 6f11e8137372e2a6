// Every estimator of irradiance against closed forms: the estimators alone, and what the residual says that a cached
// picture lacks. Records through a cache and pictures are in closed_forms_cached_test.cpp.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <glm/geometric.hpp>
#include <iterator>
#include <memory>
#include <numeric>
#include <span>
#include <string>
#include <vector>

#include "any_cache.h"
#include "core/interpolation.h"
#include "judged_estimates.h"
#include "render/irradiance_cache.h"
#include "render/residual.h"
#include "scene/registry.h"
#include "trap_invalid.h"

namespace icbench {
namespace {

TEST(ClosedForms, DirectLightOfASquareIsLamberts) {
  const RayTracer rays(make_scene("lit_floor"));
  std::vector<Known> points;
  for (const glm::vec3 p : {glm::vec3(0.3f, 0, -0.2f), glm::vec3(1.5f, 0, 1)})
    points.push_back({facing(p, {0, 1, 0}), lambert(p, {0, 1, 0}, rectangle(-0.5, 0.5, 1, -0.5, 0.5), 10.0)});
  judge_direct("lit_floor", rays, points);
}

TEST(ClosedForms, DirectLightOfASphereIsThatOfItsCentre) {
  const Scene scene = make_scene("sphere_light");
  const RayTracer rays(scene);
  std::vector<Known> points;
  for (const glm::dvec3 p : {glm::dvec3(0.2, 0, 0), glm::dvec3(-0.8, 0, 1)}) {
    const glm::dvec3 d = glm::dvec3(0, 1, 0) - p;
    const double sphere = kPi * 10.0 * 0.4 * 0.4 / glm::dot(d, d) / glm::length(d);
    points.push_back({facing(p, {0, 1, 0}), lambert(p, {0, 1, 0}, scene.meshes[1], 10.0)});
    EXPECT_NEAR(points.back().E / sphere, 1.0, 0.003) << "the triangles are not that sphere";
  }
  judge_direct("sphere_light", rays, points);
}

TEST(ClosedForms, InABoxOfOneRadianceIrradianceIsPiTimesThat) {
  Scene s;
  s.name = "glowing_box";
  s.add_material({.emission = glm::vec3(3.0f)});
  s.meshes.push_back(box("box", {{-1, -2, -1}, {1, 1, 3}}, 0, true));
  const RayTracer rays(std::move(s));
  const Known points[] = {{facing({0.4f, -0.1f, 0.2f}, {1, 2, 3}), 3.0 * kPi}};
  judge_direct("glowing box", rays, points);
}

TEST(ClosedForms, IndirectLightOfAPlateIsLamberts) {
  const RayTracer rays(lit_plate());
  const Known points[] = {above_plate({0.1f, 0.7f, 0.2f}, {0, -1, 0}),  // parallel
                          above_plate({-1.0f, 0.5f, 0.3f}, {1, 0, 0}),  // at a right angle, over its edge
                          above_plate({0.5f, 0.6f, -0.5f}, {-1, -2, 0.5f})};
  const VplSettings vpls[] = {{512, kInfinity, 0}, {512, 1.0f, 16}};
  judge_indirect("lit plate", rays, points, vpls);
}

TEST(ClosedForms, InASphereIndirectLightIsEven) {
  const Scene scene = make_scene("integrating_sphere");
  double area = 0.0;
  for (const glm::uvec3& t : scene.meshes[0].triangles) {
    const auto& p = scene.meshes[0].positions;
    area += 0.5 * glm::length(glm::cross(glm::dvec3(p[t.y]) - glm::dvec3(p[t.x]),
                                         glm::dvec3(p[t.z]) - glm::dvec3(p[t.x])));
  }
  EXPECT_NEAR(area / (4.0 * kPi), 1.0, 0.003) << "the triangles are not that sphere";
  // Whatever the triangles do at single points, the mean over the area is exact: what is reflected arrives.
  const Known mean[] = {{{}, 4.0 * kPi * 2.0 / area}};  // rho Phi / ((1 - rho) A)
  const RayTracer rays(scene);
  Tracer tracer(rays);
  const auto at_random = [&](Pcg32& random) {
    for (;;) {
      const glm::vec3 d(random.uniform() - 0.5f, random.uniform() - 0.5f, random.uniform() - 0.5f);
      if (glm::dot(d, d) < 0.25f && glm::dot(d, d) > 0.0f)
        return tracer.intersect(Ray{glm::vec3(0.0f), kInfinity, d});
    }
  };
  judge("integrating_sphere, hemisphere gather", mean, kError, [&](std::uint64_t seed, std::span<double> E) {
    Pcg32 random(hash_keys(seed, 4));
    E[0] = by_gather(tracer, at_random(random), seed);
  });
  judge("integrating_sphere, path's indirect light", mean, kError,
        [&](std::uint64_t seed, std::span<double> E) {
          Pcg32 random(hash_keys(seed, 4));
          double sum = 0.0;
          for (int i = 0; i < 1000; ++i)
            sum += sample_irradiance(tracer, at_random(random), Light::indirect, random).y;
          E[0] = sum / 1000.0;
        });
  // Everything is seen under the same G, 1/4: clamped below that, a fifth of all light is compensation's.
  judge("integrating_sphere, VPLs clamped at 0.2", mean, kError,
        [&](std::uint64_t seed, std::span<double> E) {
          Pcg32 random(hash_keys(seed, 4));
          Known points[8];
          for (Known& point : points) point.at = at_random(random);
          double of[8];
          by_vpls(tracer, points, {4096, 0.2f, 16}, seed, of);
          E[0] = std::accumulate(std::begin(of), std::end(of), 0.0) / 8.0;
        });
}

// That path and cache keep it within a tenth of a per cent is in render_path_test.cpp and render_cached_test.cpp; VPLs
// in it are in render_vpl_test.cpp.
TEST(ClosedForms, IndirectLightInAFurnaceIsPiTimesItsAlbedo) {
  const RayTracer rays(make_scene("white_furnace"));
  const Known known[] = {{primary_hits(rays, 3, 3).hits[4], kPi * kRho}};
  judge_indirect("white_furnace", rays, known, {});
}

// What a picture lacks.

// The residual of a picture, at the same hits in every sample of its pixels.
ResidualEstimator residual_of(const RayTracer& rays, const PrimaryHits& primary, const Image& made,
                              float share, const SampleKey& first, std::uint32_t samples = 1,
                              unsigned threads = 1, bool keeps_layer = false) {
  ResidualEstimator out(primary.width, primary.height, share, threads, keeps_layer);
  ThreadCrew crew(rays, threads);
  const auto tiles = make_tiles(primary.width, primary.height, 8, TileOrder::morton);
  for (std::uint32_t s = 0; s < samples; ++s) {
    crew.run(
        [&](unsigned thread, Tracer& tracer) {  // dealt out: were they raced for, one might take them all
          for (std::size_t i = thread; i < tiles.size(); i += threads)
            out.tile(thread, tracer, Light::indirect, primary, first.next_sample(s), tiles[i], made);
        });
    out.end_sample(made);
  }
  return out;
}

/// Makes every record a little too bright.
class BrightSource final : public RecordSource {
 public:
  BrightSource(std::unique_ptr<RecordSource> source, float factor)
      : source_(std::move(source)), factor_(factor) {}
  RecordsThen begin_frame(const SceneChange& change, Crew& crew) override {
    return source_->begin_frame(change, crew);
  }
  Record evaluate(unsigned thread, Tracer& tracer, const Visible& x, const SampleKey& key) noexcept override {
    Record r = source_->evaluate(thread, tracer, x, key);
    r.E *= factor_;
    return r;
  }

 private:
  std::unique_ptr<RecordSource> source_;
  float factor_;
};

// Indirect light through a cache, the records `factor` times too bright.
Image cached_picture(const RayTracer& rays, const PrimaryHits& primary, std::uint32_t gather_rays, float a,
                     const RadiusLimits& limits, float factor = 1.0f) {
  const auto makers = registered_caches();
  const auto maker = std::find_if(makers.begin(), makers.end(),
                                  [](const AnyCache::Maker& m) { return m.traits.name == "wait_free"; });
  AnyCache cache(*maker, {.bounds = rays.scene().bounds, .a_max = a, .a = a, .capacity = 4096});
  AnyCache::Session session = cache.open_session(0);
  BrightSource source(
      std::make_unique<HemisphereSource>(Strata::for_rays(gather_rays), limits,
                                         RecordNames(rays.scene(), primary.width, primary.height)),
      factor);
  Image out = make_image(primary.width, primary.height);
  Tracer tracer(rays);
  CacheUse use;
  for (const Tile& tile : make_tiles(primary.width, primary.height, 8, TileOrder::morton))
    irradiance_cache_tile(session, source, 0, tracer, primary, {.seed = 7}, tile, out, use);
  EXPECT_GT(use.hits, use.queries / 2) << "hardly anything was interpolated";
  return out;
}

double mean_of(const Image& image, int channel) {
  double sum = 0.0;
  for (const glm::vec3& L : image.pixels) sum += L[channel];
  return sum / static_cast<double>(image.pixels.size());
}

// The picture's mean is off by more than its residual's error allows, and the residual makes it right. `least_bias`: of
// the exact mean.
void expect_mends(const ResidualFigures& f, double exact, double least_bias) {
  for (std::size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(f.cached_rgb[c] + f.rgb[c].mean, exact, 4.0 * f.rgb[c].error);
    EXPECT_GT(std::abs(f.cached_rgb[c] - exact), 8.0 * f.rgb[c].error) << "nothing was amiss";
  }
  EXPECT_NEAR(f.cached + f.all.mean, exact, 4.0 * f.all.error);
  EXPECT_GT(std::abs(f.all.mean), least_bias * exact);
  EXPECT_LT(4.0 * f.all.error, 0.02 * exact) << "too few samples to tell";
}

TEST(Residual, RecordsThatAreTooBrightAreFoundOut) {
  const RayTracer rays(make_scene("white_furnace"));
  const PrimaryHits primary = primary_hits(rays, 24, 24);
  const RadiusLimits limits = RadiusLimits::for_scene(rays.scene().bounds, 0.01f, 0.2f);
  const Image made = cached_picture(rays, primary, 1024, 0.3f, limits, 1.05f);
  const ResidualEstimator found = residual_of(rays, primary, made, 0.5f, {.seed = 3}, 256, 1, true);
  const ResidualFigures f = found.figures();
  expect_mends(f, kRho * kRho, 0.03);
  Image whole = made;
  found.add_to(whole);
  for (int c = 0; c < 3; ++c)
    EXPECT_NEAR(mean_of(whole, c), f.cached_rgb[0] + f.rgb[0].mean, 1e-5) << "the layer is not what was told";
}

TEST(Residual, CoarseInterpolationIsFoundOut) {
  const RayTracer rays(plate_and_wall());
  const PrimaryHits primary = primary_hits(rays, 24, 24);
  const double exact = radiance_of_wall(primary);
  const Image made = cached_picture(rays, primary, 4096, 1.0f, {0.5f, 2.0f});
  expect_mends(residual_of(rays, primary, made, 0.3f, {.seed = 3}, 1500).figures(), exact, 0.04);
}

// Over many seeds, for one picture whose bias differs from pixel to pixel: that alone must not count as error.
TEST(Residual, TheErrorItStatesIsTheErrorItHas) {
  constexpr int kSize = 12, kRuns = 800;
  const double kSpread = 4.0 * std::sqrt(2.0 / kRuns);  // of a variance
  const RayTracer rays(make_scene("white_furnace"));
  const PrimaryHits primary = primary_hits(rays, kSize, kSize);
  Image made = make_image(kSize, kSize);
  double cached = 0.0, in_block = 0.0, square = 0.0;
  for (std::size_t i = 0; i < made.pixels.size(); ++i) {
    const float L = i % 3 == 0 ? 0.5f : 0.1f, truth = kRho * kRho;
    made.pixels[i] = {L, 2.0f * L, L};
    cached += 4.0 / 3.0 * L / (kSize * kSize);
    square += (2.0 * (L - truth) * (L - truth) + (2 * L - truth) * (2 * L - truth)) / (3.0 * kSize * kSize);
    // The block in the upper left corner is 2 pixels wide.
    if (i % kSize < 2 && i / kSize < 2) in_block += 4.0 / 3.0 * L / 4.0;
  }
  for (const float share : {1.0f, 0.3f, 0.05f}) {
    Estimate all, green, block, squares;
    double stated = 0.0, stated_green = 0.0, stated_block = 0.0;
    for (std::uint64_t seed = 0; seed < kRuns; ++seed) {
      const ResidualFigures f = residual_of(rays, primary, made, share, {.seed = seed}).figures();
      ASSERT_EQ(f.edge, 2);
      all.add(f.all.mean);
      green.add(f.rgb[1].mean);
      block.add(f.blocks[0].mean);
      squares.add(f.square.mean);
      stated += f.all.error * f.all.error / kRuns;
      stated_green += f.rgb[1].error * f.rgb[1].error / kRuns;
      stated_block += f.blocks[0].error * f.blocks[0].error / kRuns;
    }
    const auto variance = [&](const Estimate& e) { return e.error() * e.error() * kRuns; };
    EXPECT_NEAR(stated / variance(all), 1.0, kSpread) << share;
    EXPECT_NEAR(stated_green / variance(green), 1.0, kSpread) << share;
    // In four pixels, of which few are drawn, errors are not normal.
    EXPECT_NEAR(stated_block / variance(block), 1.0, share == 1.0f ? kSpread : 2.0 * kSpread) << share;
    EXPECT_NEAR(all.mean(), kRho * kRho - cached, 4.0 * all.error()) << share;
    EXPECT_NEAR(block.mean(), kRho * kRho - in_block, 4.0 * block.error()) << share;
    EXPECT_NEAR(squares.mean(), square, 4.0 * squares.error()) << share;
  }
}

TEST(Residual, WithEveryPixelDrawnThePictureIsPathTraced) {
  for (const char* scene : {"cornell_box", "cornell_specular"}) {
    const RayTracer rays(make_scene(scene));
    const PrimaryHits primary = primary_hits(rays, 16, 16);
    const SampleKey key{.seed = 5};
    Image traced = make_image(16, 16);
    Tracer tracer(rays);
    for_each_visible({0, 0, 16, 16}, primary, [&](const Visible& x) {
      if (!reflects(rays, x.hit)) return;
      Pcg32 random(x.key(key, Purpose::residual));
      Irradiance E(0.0f);
      for (unsigned i = 0; i < ResidualEstimator::kPaths; ++i)
        E += sample_irradiance(tracer, x.hit, Light::indirect, random);
      traced.pixels[x.pixel] +=
          x.weight * reflected_radiance(rays, x.hit, E / float{ResidualEstimator::kPaths});
    });
    for (const float constant : {0.0f, 0.3f}) {
      Image made = make_image(16, 16);
      for_each_visible({0, 0, 16, 16}, primary, [&](const Visible& x) {
        if (reflects(rays, x.hit)) made.pixels[x.pixel] = glm::vec3(constant);
      });
      residual_of(rays, primary, made, 1.0f, key, 1, 1, true).add_to(made);
      for (std::size_t i = 0; i < made.pixels.size(); ++i)
        for (int c = 0; c < 3; ++c)
          ASSERT_NEAR(made.pixels[i][c], traced.pixels[i][c], 1e-5f * (1.0f + traced.pixels[i][c])) << scene;
    }
  }
}

TEST(Residual, ThreadsChangeNoBit) {
  const RayTracer rays(make_scene("cornell_specular"));
  const PrimaryHits primary = primary_hits(rays, 40, 24);
  const Image made = cached_picture(rays, primary, 16, 0.4f, radius_limits(rays.scene().bounds));
  Image layer = make_image(40, 24);
  const ResidualEstimator one = residual_of(rays, primary, made, 0.2f, {.seed = 5}, 3, 1, true);
  one.add_to(layer);
  for (const unsigned threads : {2u, 5u}) {
    Image other = make_image(40, 24);
    const ResidualEstimator many = residual_of(rays, primary, made, 0.2f, {.seed = 5}, 3, threads, true);
    many.add_to(other);
    ASSERT_EQ(std::memcmp(layer.pixels.data(), other.pixels.data(), layer.pixels.size() * sizeof(glm::vec3)),
              0);
    ASSERT_EQ(many.figures().all.mean, one.figures().all.mean);
    ASSERT_EQ(many.figures().square.error, one.figures().square.error);
    ASSERT_EQ(many.figures().blocks[5].error, one.figures().blocks[5].error);
  }
}

}  // namespace
}  // namespace icbench
