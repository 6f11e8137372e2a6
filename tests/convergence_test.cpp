// On diffuse scenes all that compute indirect light converge to path tracing's radiance, and Whitted's to that of light
// which comes straight from a lamp: at the same visible points, in the mean of the picture and of its blocks.
//
// What the mean over many seeds is off by may be kErrors standard errors, and the bias that kMethods states, which
// falls with the cache's accuracy and the cells' size. With four times the virtual lights, rays or paths, and that
// finer, whole pictures have less error.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <memory>
#include <ostream>
#include <string>
#include <string_view>
#include <vector>

#include "core/random.h"
#include "render/irradiance_cache.h"
#include "render/path.h"
#include "render_support.h"
#include "scene/directions.h"
#include "scene/registry.h"
#include "workload/cached_pass.h"
#include "workload/dispatch.h"

namespace icbench {
namespace {

constexpr int kWidth = 24, kHeight = 18, kBlock = 6;
constexpr std::uint64_t kSeeds = 32;
constexpr std::uint32_t kFrame = 2;  // things have moved: temporal instant caching has kept something
constexpr double kErrors = 4.0;

struct Fineness {
  std::uint32_t lights;  // virtual ones, or rays of a gather, or four times the paths from each point
  float a;               // of a cache
  float cell_size;       // pixels
  int guarded_scale;     // of the picture whose pixels limit how near the region of a guarded record may end
};
constexpr Fineness kCoarse{64, 0.8f, 4.0f, 1}, kFine{256, 0.2f, 2.0f, 8};

struct Method {
  std::string_view name;
  double (*bias)(const Fineness&);  // of a block's mean at most, as a share of the picture's
  bool leak_guard = false;
};

double none(const Fineness&) { return 0.0; }
double of_filter(const Fineness&) { return 0.03; }  // as wide however many lights there are
double of_cells(const Fineness& f) { return 0.01 * static_cast<double>(f.cell_size); }
double of_cache(const Fineness& f) { return 0.1 * static_cast<double>(f.a); }

// Without the guard records in the dark, behind something, darken what those in the open make too bright: with it, in a
// picture so small, blocks are only right where regions may end nearer than at the picture's own 1.5 pixels.
constexpr Method kMethods[] = {{"instant_gi", none},
                               {"instant_gi_interleaved", of_filter},
                               {"hash_cells", of_cells},
                               {"irradiance_cache", of_cache},
                               {"irradiance_cache", of_cache, true},
                               {"instant_caching", of_cache},
                               {"temporal_instant_caching", of_cache}};

/// Mean of the channels, over the whole picture first, then over its blocks.
std::vector<double> means_of(const Image& image) {
  const int columns = image.width / kBlock, rows = image.height / kBlock;
  std::vector<double> out(static_cast<std::size_t>(1 + columns * rows), 0.0);
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x) {
      const glm::dvec3 L = image.pixels[static_cast<std::size_t>(y * image.width + x)];
      const double mean = (L.x + L.y + L.z) / 3.0;
      out[0] += mean / static_cast<double>(image.pixels.size());
      out[static_cast<std::size_t>(1 + y / kBlock * columns + x / kBlock)] += mean / (kBlock * kBlock);
    }
  return out;
}

/// Pictures of one thing, one a seed.
struct Pictures {
  std::vector<Estimate> means;  // as means_of
  std::vector<glm::dvec3> mean = std::vector<glm::dvec3>(kWidth * kHeight, glm::dvec3(0.0));

  void add(const Image& image) {
    const std::vector<double> now = means_of(image);
    means.resize(now.size());
    for (std::size_t i = 0; i < now.size(); ++i) means[i].add(now[i]);
    for (std::size_t i = 0; i < mean.size(); ++i)
      mean[i] += glm::dvec3(image.pixels[i]) / static_cast<double>(kSeeds);
  }
};

double square_error(const Image& image, const std::vector<glm::dvec3>& truth) {
  double sum = 0.0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const glm::dvec3 d = glm::dvec3(image.pixels[i]) - truth[i];
    sum += glm::dot(d, d) / 3.0;
  }
  return sum / static_cast<double>(truth.size());
}

struct Diffuse {
  const char* name;
  /// A block may be off by so much of the picture's mean besides, where nothing keeps records from leaking.
  double leak = 0.0;
  /// A block has so many times the picture's mean, and so bias.
  double brightest = 1.0;
  /// So much moves that temporal instant caching makes all anew.
  bool is_made_anew = false;

  friend void PrintTo(const Diffuse& scene, std::ostream* out) { *out << scene.name; }
};

/// The means differ by no more than chance and a bias, of the picture and of blocks, as shares of the picture's.
void expect_same_means(const Pictures& mine, const Pictures& truth, double bias, double of_blocks) {
  const double L = truth.means[0].mean();
  for (std::size_t i = 0; i < mine.means.size(); ++i) {
    const double error = std::hypot(mine.means[i].error(), truth.means[i].error());
    EXPECT_NEAR(mine.means[i].mean() / L, truth.means[i].mean() / L,
                kErrors * error / L + (i == 0 ? bias : of_blocks))
        << (i == 0 ? "whole picture" : "block " + std::to_string(i));
  }
}

class DiffuseScene : public ::testing::TestWithParam<Diffuse> {
 protected:
  DiffuseScene() : rays(make_scene(GetParam().name)), crew(rays, 1) { at_frame(); }

  void SetUp() override {
    for (const Material& m : rays.scene().materials) ASSERT_FALSE(m.is_specular());
    ASSERT_TRUE(rays.scene().point_lights.empty());
  }

  SceneChange at_frame(std::uint32_t frame = kFrame) { return rays.go_to(static_cast<float>(frame)); }

  /// One a seed, by f(tracer, primary, tile, seed, out) for each tile of kFrame.
  template <class F>
  Pictures pictures(F&& f) {
    at_frame();
    const PrimaryHits primary = primary_hits(rays, kWidth, kHeight);
    Pictures out;
    for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
      Image image = blank(kWidth, kHeight);
      for_tiles(rays, kWidth, kHeight, TileOrder::scanline, 1,
                [&](Tracer& tracer, const Tile& tile) { f(tracer, primary, tile, seed, image); });
      out.add(image);
    }
    return out;
  }

  struct Rendered {
    Image indirect;
    PassFigures figures;
  };

  /// The picture of indirect light in kFrame, by one thread; of temporal instant caching after the frames before it.
  Rendered render(const Method& method, const Fineness& f, std::uint64_t seed) {
    const IntegratorEntry& integrator = find_integrator(method.name);
    const int scale = method.leak_guard ? f.guarded_scale : 1;
    PassSetup setup{rays, crew, scale * kWidth, scale * kHeight};
    setup.vpls = setup.gather_rays = f.lights;
    setup.paths = f.lights / 4;
    setup.a = f.a;
    setup.interpolation = Interpolation::gradients;
    setup.leak_guard = method.leak_guard;
    setup.cell_size = f.cell_size;
    setup.seed = seed;
    const std::uint32_t first = integrator.name == "temporal_instant_caching" ? 0 : kFrame;
    at_frame(first);
    std::unique_ptr<IndirectPass> pass;
    if (integrator.needs_cache()) {
      CachedPassSetup cached;
      cached.cache.bounds = rays.scene().bounds;
      cached.cache.a = cached.cache.a_max = search_reach(setup.interpolation, integrator.uses_vpls) * f.a;
      cached.cache.capacity = capacity_for(4 * kWidth * kHeight, 1);
      pass = find_cache("sequential").pass(cached, integrator.source(setup), crew);
    } else {
      pass = integrator.pass(setup);
    }
    Rendered out{blank(kWidth, kHeight), {}};
    for (std::uint32_t frame = first; frame <= kFrame; ++frame) {
      pass->begin_frame(at_frame(frame));
      const PrimaryHits primary = primary_hits(rays, kWidth, kHeight);
      const SampleKey key{seed, frame, 0};
      pass->begin_sample(primary, key);
      crew.run([&](unsigned t, Tracer& tracer) {
        for (const Tile& tile : make_tiles(kWidth, kHeight, 8, TileOrder::morton))
          pass->tile(t, tracer, primary, key, tile, out.indirect);
      });
      pass->end_sample(primary, out.indirect);
    }
    out.figures = pass->figures();
    return out;
  }

  RayTracer rays;
  ThreadCrew crew;
};

TEST_P(DiffuseScene, IndirectLightConvergesToThatOfPathTracing) {
  const Pictures truth =
      pictures([](Tracer& tracer, const PrimaryHits& primary, const Tile& tile, std::uint64_t seed,
                  Image& out) { path_indirect_tile(tracer, primary, 64, {.seed = 1000 + seed}, tile, out); });
  const double L = truth.means[0].mean();
  for (const Method& method : kMethods) {
    SCOPED_TRACE(std::string(method.name) + (method.leak_guard ? ", guarded" : ""));
    const IntegratorEntry& integrator = find_integrator(method.name);
    double rms[2];
    for (const bool is_fine : {false, true}) {
      SCOPED_TRACE(is_fine ? "fine" : "coarse");
      const Fineness& fineness = is_fine ? kFine : kCoarse;
      Pictures mine;
      PassFigures last;
      double square = 0.0;
      for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
        const Rendered rendered = render(method, fineness, seed);
        mine.add(rendered.indirect);
        square += square_error(rendered.indirect, truth.mean) / kSeeds;
        last = rendered.figures;
      }
      rms[is_fine] = std::sqrt(square);
      const bool may_leak = method.name == "irradiance_cache" && !method.leak_guard;
      const double bias = method.bias(fineness);
      expect_same_means(mine, truth, bias, bias * GetParam().brightest + (may_leak ? GetParam().leak : 0.0));
      if (is_fine) {
        EXPECT_LT(mine.means[0].error(), 0.03 * L) << "too few samples to say so";
      } else if (integrator.needs_cache()) {
        EXPECT_GT(last.use.hits, last.use.queries / 3) << "hardly anything was interpolated";
      }
      if (method.name == "temporal_instant_caching") {
        EXPECT_EQ(last.records_kept + last.records_updated == 0, GetParam().is_made_anew);
      }
    }
    EXPECT_LT(rms[true], 0.8 * rms[false]);
  }
}

TEST_P(DiffuseScene, WhittedShowsTheLightThatComesStraightFromLamps) {
  const IntegratorEntry& integrator = find_integrator("whitted");
  const auto pass = integrator.pass({rays, crew, kWidth, kHeight});
  const CameraView view(rays.scene().camera, kWidth, kHeight);
  PrimaryHits own(rays.scene(), kWidth, kHeight);
  Image indirect = blank(kWidth, kHeight);
  const Pictures whitted = pictures([&](Tracer& tracer, const PrimaryHits& primary, const Tile& tile,
                                        std::uint64_t seed, Image& out) {
    visible_tile(tracer, pass->light(), view, Lens::centre, {.seed = seed}, 64, tile, own, out);
    pass->tile(0, tracer, primary, {.seed = seed}, tile, indirect);
    for_each_pixel(tile, kWidth, [&](std::uint32_t pixel) { out.pixels[pixel] += indirect.pixels[pixel]; });
  });
  // Paths of one segment that find lamps by chance alone.
  const Pictures paths = pictures(
      [&](Tracer& tracer, const PrimaryHits& primary, const Tile& tile, std::uint64_t seed, Image& out) {
        constexpr int kPaths = 256;
        for_each_pixel(tile, kWidth, [&](std::uint32_t pixel) {
          const Hit& x = primary.hits[pixel];
          out.pixels[pixel] = rays.emitted(x);
          if (!reflects(rays, x)) return;
          Pcg32 random(hash_keys(seed, pixel, 99));
          const Basis basis(x.n);
          Irradiance E(0.0f);
          for (int i = 0; i < kPaths; ++i) {
            const float elevation = random.uniform();
            const glm::vec3 d = cosine_direction(basis, elevation, random.uniform());
            if (glm::dot(d, x.ng) <= 0.0f) continue;
            E += rays.emitted(
                tracer.intersect(Ray{rays.leave(x.p, x.ng), std::numeric_limits<float>::infinity(), d}));
          }
          out.pixels[pixel] += reflected_radiance(rays, x, E * static_cast<float>(kPi / kPaths));
        });
      });
  expect_same_means(whitted, paths, 0.0, 0.0);
  EXPECT_LT(paths.means[0].error(), 0.01 * paths.means[0].mean()) << "too few paths to say so";
}

// The other rooms of bunnies are like these. Under Conference's table it is dark.
INSTANTIATE_TEST_SUITE_P(Suite, DiffuseScene,
                         ::testing::Values(Diffuse{"cornell_box"}, Diffuse{"wobble"},
                                           Diffuse{"desk", 0.0, 1.5}, Diffuse{"bunnies_1"},
                                           Diffuse{"bunnies_9", 0.0, 1.0, true}, Diffuse{"conference", 0.08},
                                           Diffuse{"sibenik"}, Diffuse{"cornell_indirect", 0.0, 1.8},
                                           Diffuse{"office", 0.0, 2.1}),
                         [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace icbench
