// The reference integrator against closed forms. Comparisons are statistical, in standard errors measured
// from the samples themselves; seeds are fixed.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "lambert.h"
#include "render/gather.h"
#include "render/hash_cells.h"
#include "render/integrators.h"
#include "render/irradiance_cache.h"
#include "render/path.h"
#include "render_support.h"
#include "scene/registry.h"
#include "scene/shapes.h"
#include "specular_scenes.h"

namespace icbench {
namespace {

TEST(RenderPath, TheFurnaceIsWhiteInEveryPixel) {
  const RayTracer rays(make_scene("white_furnace"));
  constexpr int kSize = 16, kRuns = 100;
  std::vector<Estimate> pixels(kSize * kSize);
  Estimate all;
  for (std::uint32_t run = 0; run < kRuns; ++run) {
    const Image image = picture(rays, find_integrator("path"), kSize, 40, {.seed = 1, .frame = run});
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      pixels[i].add(image.pixels[i].x);
      all.add(image.pixels[i].x);
    }
  }
  for (const Estimate& pixel : pixels) EXPECT_NEAR(pixel.mean(), 1.0, 4.5 * pixel.error());
  EXPECT_NEAR(all.mean(), 1.0, 0.001);
  EXPECT_LT(all.error(), 0.0004) << "too few samples to say so";
}

// Guards against: roulette that ends paths among white walls too often, and makes up for it by ever larger weights.
TEST(RenderPath, AlmostWhiteWallsKeepLightAndWeightsBounded) {
  constexpr float kWhite = 0.99f;
  Scene s;
  s.name = "white_room";
  const auto wall = s.add_material({.albedo = glm::vec3(kWhite), .emission = glm::vec3(1.0f - kWhite)});
  s.meshes.push_back(box("room", {glm::vec3(-1.0f), glm::vec3(1.0f)}, wall, true));
  s.camera = {.eye = {0, 0, 0.9f}, .target = {0, 0, 0}, .up = {0, 1, 0}, .fov_y = 1.0f};
  const RayTracer rays(std::move(s));
  const Hit x = primary_hits(rays, 1, 1).hits.front();
  Tracer tracer(rays);
  Pcg32 random(1);
  Estimate estimate;
  double most = 0.0;
  for (int i = 0; i < 20'000; ++i) {
    const double E = sample_irradiance(tracer, x, Light::all, random).y;
    estimate.add(E);
    most = std::max(most, E);
  }
  EXPECT_NEAR(estimate.mean(), kPi, 4.0 * estimate.error());
  EXPECT_LT(estimate.error(), 0.01 * kPi);
  EXPECT_LT(most, 30.0 * kPi);  // of paths that end with one chance in a hundred
}

TEST(RenderPath, IrradianceInTheFurnaceSplitsIntoDirectAndIndirect) {
  const RayTracer rays(make_scene("white_furnace"));
  const PrimaryHits primary = primary_hits(rays, 3, 3);
  Tracer tracer(rays);
  const std::pair<Light, double> expected[] = {
      {Light::all, kPi}, {Light::direct, kPi * (1.0 - kRho)}, {Light::indirect, kPi * kRho}};
  for (const auto& [light, E] : expected)
    for (const Hit& x : primary.hits) {
      Estimate estimate;
      Pcg32 random(static_cast<std::uint64_t>(light));
      for (int i = 0; i < 20'000; ++i) estimate.add(sample_irradiance(tracer, x, light, random).y);
      EXPECT_NEAR(estimate.mean(), E, 4.0 * estimate.error());
      EXPECT_LT(estimate.error(), 0.01 * E);
    }
}

TEST(RenderPath, DirectLightOfASquareIsLamberts) {
  const RayTracer rays(make_scene("lit_floor"));
  Tracer tracer(rays);
  for (const glm::vec3 at : {glm::vec3(0.0f), glm::vec3(0.5f, 0.0f, 0.5f), glm::vec3(3.0f, 0.0f, -1.0f)}) {
    const Hit x =
        tracer.intersect(Ray{at + glm::vec3(0, 0.5f, 0), std::numeric_limits<float>::infinity(), {0, -1, 0}});
    Estimate direct, indirect;
    Pcg32 random(3);
    for (int i = 0; i < 100'000; ++i) {
      direct.add(sample_irradiance(tracer, x, Light::direct, random).x);
      indirect.add(sample_irradiance(tracer, x, Light::indirect, random).x);
    }
    const double E = lambert(at, {0, 1, 0}, rectangle(-0.5, 0.5, 1, -0.5, 0.5), 10.0);
    EXPECT_NEAR(direct.mean(), E, 4.0 * direct.error());
    EXPECT_LT(direct.error(), 0.005 * E);
    EXPECT_EQ(indirect.mean(), 0.0) << "the light reflects nothing";
  }
}

TEST(RenderPath, ALampSendsNothingToItsBack) {
  Scene s;
  s.name = "lamp";
  const auto grey = s.add_material({.albedo = glm::vec3(0.5f)});
  const auto lamp = s.add_material({.emission = glm::vec3(1.0f)});
  s.meshes.push_back(quad("floor", {-2, 0, -2}, {0, 0, 4}, {4, 0, 0}, grey));
  s.meshes.push_back(box("block", {{0.5f, 0.0f, -1.0f}, {1.0f, 0.5f, 1.0f}}, grey));
  s.meshes.push_back(quad("lamp", {-2, 1, -2}, {0, 0, 4}, {4, 0, 0}, lamp));  // faces up
  const RayTracer rays(s);
  Tracer tracer(rays);
  const Hit x = down(tracer, {0.0f, 0.1f, 0.0f});
  Pcg32 random(3);
  for (const Light light : {Light::all, Light::direct, Light::indirect})
    for (int i = 0; i < 500; ++i) EXPECT_EQ(sample_irradiance(tracer, x, light, random), glm::vec3(0.0f));
  EXPECT_EQ(gather(tracer, x, Strata::for_rays(256), 1).E, glm::vec3(0.0f));
}

// The furnace with a grey texture of value 188 on its white walls, or with walls of that grey.
Scene grey_furnace(bool textured) {
  Scene s = make_scene("white_furnace");
  Texture grey{"grey", 1, 1, {188, 188, 188}};
  const float albedo = grey({0.5f, 0.5f}).x;
  if (!textured) {
    s.materials[0].albedo = glm::vec3(albedo);
    return s;
  }
  s.materials[0].albedo = glm::vec3(1.0f);
  s.materials[0].texture = 0;
  s.textures.push_back(std::move(grey));
  for (Mesh& mesh : s.meshes) mesh.uvs.assign(mesh.positions.size(), glm::vec2(0.3f));
  return s;
}

TEST(RenderPath, ATextureOfOneColourIsThatAlbedo) {
  Image images[2][2];
  double gathered[2];
  for (const bool textured : {false, true}) {
    const RayTracer rays(grey_furnace(textured));
    Tracer tracer(rays);
    for (const bool whitted : {false, true})
      images[textured][whitted] = picture(rays, find_integrator(whitted ? "whitted" : "path"), 12, 16, {});
    const Hit x = primary_hits(rays, 3, 3).hits[4];
    gathered[textured] = gather(tracer, x, Strata::for_rays(256), 1).E.x;
    const glm::vec3 reflected = reflected_radiance(rays, x, Irradiance(1.0f));
    EXPECT_NEAR(reflected.x, rays.albedo(x).x / kPi, 1e-6);
    EXPECT_LT(rays.albedo(x).x, 0.6f) << "not the texture's";
  }
  EXPECT_NEAR(gathered[true], gathered[false], 1e-4 * gathered[false]);
  for (const bool whitted : {false, true})
    for (std::size_t i = 0; i < 144; ++i)
      EXPECT_NEAR(images[true][whitted].pixels[i].x, images[false][whitted].pixels[i].x, 1e-4) << whitted;
}

TEST(RenderPath, PicturesDoNotDependOnThreadsOrTileOrder) {
  const RayTracer rays(make_scene("cornell_box"));
  constexpr int kSize = 40;
  const IntegratorEntry& path = find_integrator("path");
  const Image one = picture(rays, path, kSize, 2, {.seed = 9});
  const Image many = picture(rays, path, kSize, 2, {.seed = 9}, TileOrder::random, 5);
  const Image other = picture(rays, path, kSize, 2, {.seed = 10});
  const std::size_t bytes = one.pixels.size() * sizeof(glm::vec3);
  EXPECT_EQ(std::memcmp(one.pixels.data(), many.pixels.data(), bytes), 0);
  EXPECT_NE(std::memcmp(one.pixels.data(), other.pixels.data(), bytes), 0) << "the seed is ignored";
}

// Indirect radiance at the centres of pixels by hash cells, with the figures of the pass.
struct CellsRun {
  Image image;
  PassFigures figures;
};
constexpr std::size_t kRoomForAll = 0;
CellsRun run_cells(const RayTracer& rays, int size, const SampleKey& key, std::uint32_t paths,
                   float cell_size, unsigned threads = 1, std::size_t cells = 1 << 13) {
  ThreadCrew crew(rays, threads);
  PassSetup setup{rays, crew, size, size};
  setup.paths = paths;
  setup.cell_size = cell_size;
  const auto pass = cells == kRoomForAll ? make_hash_cells(setup) : make_hash_cells(setup, cells);
  const PrimaryHits primary = primary_hits(rays, size, size);
  const auto tiles = make_tiles(size, size, 8, TileOrder::random, threads);
  CellsRun run{blank(size, size), {}};
  pass->begin_frame({});
  for (std::uint32_t sample = 0; sample < 2; ++sample) {  // the second starts from what the first has left
    const SampleKey now{key.seed, key.frame, key.sample + sample};
    pass->begin_sample(primary, now);
    crew.for_each(tiles.size(), 1, [&](unsigned t, Tracer& tracer, std::size_t i) {
      pass->tile(t, tracer, primary, now, tiles[i], run.image);
    });
    pass->end_sample(primary, run.image);
  }
  run.figures = pass->figures();
  return run;
}

// The samples of the above, unshared.
Image run_paths(const RayTracer& rays, int size, const SampleKey& key, std::uint32_t paths) {
  const PrimaryHits primary = primary_hits(rays, size, size);
  Image image = blank(size, size);
  const SampleKey last{key.seed, key.frame, (key.sample + 1) * paths};
  for_tiles(rays, size, size, TileOrder::scanline, 1, [&](Tracer& tracer, const Tile& tile) {
    path_indirect_tile(tracer, primary, paths, last, tile, image);
  });
  return image;
}

bool are_equal(const Image& a, const Image& b) {
  return std::memcmp(a.pixels.data(), b.pixels.data(), a.pixels.size() * sizeof(glm::vec3)) == 0;
}

TEST(RenderHashCells, SharingKeepsTheLightAndTakesTheNoise) {
  const RayTracer rays(make_scene("white_furnace"));  // of one albedo, so that the mean radiance is kept
  constexpr int kSize = 32;
  const Image shared = run_cells(rays, kSize, {.seed = 3}, 2, 8.0f).image;
  const Image own = run_paths(rays, kSize, {.seed = 3}, 2);
  Estimate with, without;
  for (std::size_t i = 0; i < own.pixels.size(); ++i) {
    with.add(shared.pixels[i].y);
    without.add(own.pixels[i].y);
  }
  EXPECT_NEAR(with.mean(), without.mean(), 1e-6);
  EXPECT_LT(with.error(), 0.5 * without.error());
}

TEST(RenderHashCells, MeanIsThatOfPathTracing) {
  const RayTracer rays(make_scene("cornell_box"));
  Estimate difference, cells;
  for (std::uint64_t run = 0; run < 40; ++run) {
    double sum[2] = {0.0, 0.0};
    for (const glm::vec3& L : run_cells(rays, 24, {.seed = 2 * run}, 2, 8.0f).image.pixels) sum[0] += L.y;
    for (const glm::vec3& L : run_paths(rays, 24, {.seed = 2 * run + 1}, 2).pixels) sum[1] += L.y;
    difference.add(sum[0] - sum[1]);
    cells.add(sum[0]);
  }
  EXPECT_NEAR(difference.mean(), 0.0, 4.0 * difference.error());
  EXPECT_LT(difference.error(), 0.02 * cells.mean()) << "too few samples to say so";
}

TEST(RenderHashCells, PicturesDoNotDependOnThreads) {
  for (const char* scene : {"cornell_box", "cornell_specular"}) {
    const RayTracer rays(make_scene(scene));
    const CellsRun one = run_cells(rays, 48, {.seed = 9}, 1, 6.0f);
    EXPECT_EQ(one.figures.use.full, 0u);
    EXPECT_GT(one.figures.use.hits, one.figures.use.inserts) << "hardly anything was shared";
    for (const unsigned threads : {2u, 8u}) {
      const CellsRun many = run_cells(rays, 48, {.seed = 9}, 1, 6.0f, threads);
      EXPECT_TRUE(are_equal(one.image, many.image)) << scene;
      EXPECT_EQ(many.figures.records, one.figures.records);
    }
    EXPECT_FALSE(are_equal(one.image, run_cells(rays, 48, {.seed = 10}, 1, 6.0f).image));
  }
}

// A pixel sees more points through six panes than it has cells by count of pixels.
TEST(RenderHashCells, HasRoomForAllThatIsSeenThroughGlass) {
  Scene scene = gallery();
  const auto glass = scene.add_material(kGlass);
  for (int i = 0; i < 6; ++i) {
    const float z = 0.8f - 0.1f * static_cast<float>(i);
    scene.meshes.push_back(box("pane", {{-0.9f, 0.1f, z - 0.02f}, {0.9f, 1.9f, z}}, glass));
  }
  const RayTracer rays(std::move(scene));
  const CellsRun one = run_cells(rays, 48, {.seed = 9}, 1, 1.0f, 1, kRoomForAll);
  EXPECT_GT(one.figures.use.inserts, 2u * 4u * 48u * 48u) << "there is not enough to see";
  for (const unsigned threads : {1u, 3u}) {
    const CellsRun many = run_cells(rays, 48, {.seed = 9}, 1, 1.0f, threads, kRoomForAll);
    EXPECT_EQ(many.figures.use.full, 0u);
    EXPECT_TRUE(are_equal(one.image, many.image));
  }
}

TEST(RenderHashCells, WhoFindsNoRoomKeepsItsOwnSample) {
  const RayTracer rays(make_scene("cornell_box"));
  const Image own = run_paths(rays, 24, {.seed = 4}, 3);
  const CellsRun run = run_cells(rays, 24, {.seed = 4}, 3, 4.0f, 3, 1);
  const CacheUse& use = run.figures.use;
  EXPECT_EQ(use.inserts, 2u) << "one for each sample";
  EXPECT_EQ(use.queries, use.inserts + use.hits + use.full);
  EXPECT_GT(use.full, use.queries / 2);
  std::size_t shared = 0;
  for (std::size_t i = 0; i < own.pixels.size(); ++i) shared += run.image.pixels[i] != own.pixels[i];
  EXPECT_LE(shared, use.inserts + use.hits);
}

TEST(RenderHashCells, LightMayBeOfAnyBrightness) {
  const RayTracer usual(make_scene("cornell_box"));
  const Image image = run_cells(usual, 24, {.seed = 6}, 1, 6.0f).image;
  for (const int exponent : {-60, 60}) {
    Scene s = make_scene("cornell_box");
    for (Material& m : s.materials) m.emission *= std::ldexp(1.0f, exponent);
    const RayTracer rays(std::move(s));
    const Image scaled = run_cells(rays, 24, {.seed = 6}, 1, 6.0f).image;
    for (std::size_t i = 0; i < image.pixels.size(); ++i)
      ASSERT_EQ(scaled.pixels[i], image.pixels[i] * std::ldexp(1.0f, exponent)) << exponent;
  }
}

TEST(RenderHashCells, ThreadsAgreeOnCellsAndLoseNothing) {
  constexpr std::uint64_t kFingerprints = 96, kRounds = 200;
  CellTable table(100);
  ASSERT_EQ(table.size(), 128u);
  std::vector<std::vector<std::uint32_t>> cells(8);
  std::atomic<std::uint64_t> claimed{0};
  {
    std::vector<std::jthread> team;
    for (std::uint64_t t = 0; t < cells.size(); ++t)
      team.emplace_back([&, t] {
        for (std::uint64_t i = 0; i < kFingerprints * kRounds; ++i) {
          const std::uint64_t which = (i * 7 + t * 11) % kFingerprints;
          const CellTable::Found found = table.find_or_claim(1000 * which + 1);
          ASSERT_NE(found.cell, CellTable::kNone);
          claimed += found.is_new;
          table.add(found.cell, {static_cast<std::int64_t>(which), 1, -1, 1});
          if (i < kFingerprints) cells[t].push_back(found.cell);
        }
      });
  }
  EXPECT_EQ(claimed, kFingerprints);
  for (std::uint64_t which = 0; which < kFingerprints; ++which) {
    const CellTable::Found found = table.find_or_claim(1000 * which + 1);
    EXPECT_FALSE(found.is_new);
    const CellSum sum = table.sum(found.cell);
    EXPECT_EQ(sum.points, cells.size() * kRounds);
    EXPECT_EQ(sum.r, static_cast<std::int64_t>(which * sum.points));
    EXPECT_EQ(sum.g, -sum.b);
  }
  while (table.find_or_claim(claimed += 1'000'000).cell != CellTable::kNone) {
  }
  const std::uint32_t first = table.find_or_claim(1).cell;
  EXPECT_EQ(table.find_or_claim(77).cell, CellTable::kNone) << "more cells than there are";
  table.sweep(first);
  EXPECT_TRUE(table.find_or_claim(77).is_new);
  EXPECT_EQ(table.sum(first).points, 0u);
}

TEST(RenderIntegrators, NoPixelIsNegativeOrNotFinite) {
  for (const SceneEntry& scene : kScenes) {
    const RayTracer rays(make_scene(scene.name));
    constexpr int kSize = 24;
    for (const IntegratorEntry& integrator : kIntegrators) {
      if (integrator.needs_cache()) continue;
      const Image image = picture(rays, integrator, kSize, 4, {}, TileOrder::morton, 2);
      float brightest = 0.0f;
      for (const glm::vec3& L : image.pixels) {
        ASSERT_TRUE(is_finite(L) && L.x >= 0.0f && L.y >= 0.0f && L.z >= 0.0f) << integrator.name;
        brightest = std::max(brightest, L.y);
      }
      EXPECT_GT(brightest, 0.1f) << integrator.name << " sees nothing of " << scene.name;
    }
  }
}

TEST(RenderIntegrators, AnUnknownNameIsAnsweredWithTheKnownOnes) {
  EXPECT_EQ(find_integrator("path").name, "path");
  try {
    find_integrator("pathtracer");
    FAIL() << "accepted";
  } catch (const std::runtime_error& e) {
    EXPECT_NE(std::string(e.what()).find("whitted"), std::string::npos);
  }
}

}  // namespace
}  // namespace icbench
