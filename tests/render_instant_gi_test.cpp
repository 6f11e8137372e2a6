// Instant global illumination, with every virtual light at every pixel and by interleaved sampling.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <set>
#include <string_view>
#include <vector>

#include "render/instant_gi.h"
#include "render/integrators.h"
#include "render/interleaved.h"
#include "render/vpl_gather.h"
#include "vpl_support.h"

namespace icbench {
namespace {

Image instant_gi(const RayTracer& rays, const PrimaryHits& primary, const VplSet& set,
                 const VplShading& shading, TileOrder order = TileOrder::scanline, int threads = 1) {
  Image out = blank(primary.width, primary.height);
  for_tiles(rays, primary.width, primary.height, order, threads, [&](Tracer& tracer, const Tile& tile) {
    instant_gi_tile(tracer, primary, set.vpls(), shading, tile, out);
  });
  return out;
}

TEST(RenderInstantGi, PicturesDoNotDependOnThreadsOrTileOrder) {
  const RayTracer& rays = cornell_box_rays();
  const PrimaryHits primary = primary_hits(rays, 40, 40);
  const VplSet set = traced_set(rays, 100, 6);
  const VplShading shading{vpl_clamp(rays.scene().bounds)};
  const Image one = instant_gi(rays, primary, set, shading);
  const Image many = instant_gi(rays, primary, set, shading, TileOrder::random, 5);
  EXPECT_EQ(std::memcmp(one.pixels.data(), many.pixels.data(), one.pixels.size() * sizeof(glm::vec3)), 0);
  EXPECT_EQ(value_error(one, false), "");
}

TEST(RenderInterleaved, TheGroupsTogetherAreTheWholeSet) {
  const RayTracer& rays = cornell_box_rays();
  const VplSet set = traced_set(rays, 300, 6);
  const float clamp = vpl_clamp(rays.scene().bounds);
  Tracer tracer(rays);
  const VplGroups one(set, 1), nine(set, 3), as_many_as_paths(traced_set(rays, 4, 6), 5);
  ASSERT_EQ(nine.size(), 9u);
  EXPECT_LT(as_many_as_paths.size(), 25u);
  for (const Hit& hit : reflecting_hits(rays, 8)) {
    const Irradiance full = gather_vpls(tracer, hit, set.vpls(), clamp);
    EXPECT_TRUE(same_bits(gather_vpls(tracer, hit, one[0], clamp), full));
    glm::dvec3 sum(0.0);
    for (std::size_t k = 0; k < nine.size(); ++k)
      sum += nine.share(k) * gather_vpls(tracer, hit, nine[k], clamp);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(sum[c], full[c], 1e-5 * full[c]);
  }
}

TEST(RenderInterleaved, WithOneGroupAndNoFilterItIsInstantGlobalIllumination) {
  for (const bool specular : {false, true}) {
    const RayTracer mirrored(room());
    const RayTracer& rays = specular ? mirrored : cornell_box_rays();
    PrimaryHits primary(rays.scene(), 24, 24);
    const CameraView view(rays.scene().camera, 24, 24);
    for_tiles(rays, 24, 24, TileOrder::scanline, 1, [&](Tracer& tracer, const Tile& tile) {
      primary_tile(tracer, view, Lens::centre, {}, tile, primary);
    });
    const VplSet set = traced_set(rays, 100, 6);
    const VplShading shading{vpl_clamp(rays.scene().bounds)};
    const VplGroups groups(set, 1);
    std::vector<Irradiance> E(primary.hits.size());
    Image out = blank(24, 24);
    for_tiles(rays, 24, 24, TileOrder::scanline, 1, [&](Tracer& tracer, const Tile& tile) {
      interleaved_tile(tracer, primary, set.vpls(), groups, shading, tile, E, out);
    });
    for (const Tile& tile : make_tiles(24, 24, 7, TileOrder::scanline))
      filter_tile(rays, primary, E, 1, 1.0f, tile, out);
    const Image full = instant_gi(rays, primary, set, shading);
    for (std::size_t i = 0; i < E.size(); ++i)
      EXPECT_LT(glm::distance(out.pixels[i], full.pixels[i]), 1e-6f * glm::length(full.pixels[i]) + 1e-12f);
  }
}

TEST(RenderInterleaved, TheFilterTakesTheMeanOfOneSurfaceAndStopsAtEdges) {
  // A floor and a wall that meet in the middle of the picture.
  Scene s;
  s.name = "corner";
  const auto grey = s.add_material({.albedo = glm::vec3(0.5f)});
  s.meshes.push_back(quad("floor", {-2, 0, 0}, {0, 0, 4}, {4, 0, 0}, grey));
  s.meshes.push_back(quad("wall", {-2, 0, 0}, {4, 0, 0}, {0, 4, 0}, grey));
  s.camera = {.eye = {0.0f, 1.0f, 1.0f}, .target = {0.0f, 0.0f, 0.0f}, .up = {0, 1, 0}, .fov_y = 0.5f};
  const RayTracer rays(s);
  const PrimaryHits primary = primary_hits(rays, 30, 30);
  std::vector<Irradiance> E(primary.hits.size());
  const auto on_floor = [&](std::size_t i) { return primary.hits[i].n.y > 0.5f; };
  for (std::size_t i = 0; i < E.size(); ++i)
    E[i] = glm::vec3((on_floor(i) ? 10.0f : 1.0f) + static_cast<float>(i % 30 % 3 + i / 30 % 3 * 3));
  Image out = make_image(30, 30);
  filter_tile(rays, primary, E, 3, 100.0f, {0, 0, 30, 30}, out);
  std::size_t inside = 0, floor = 0;
  for (std::size_t i = 0; i < E.size(); ++i) {
    const std::size_t x = i % 30, y = i / 30;
    floor += on_floor(i);
    const float base = on_floor(i) ? 10.0f : 1.0f;
    const float filtered = static_cast<float>(kPi) / 0.5f * out.pixels[i].x;
    EXPECT_GE(filtered, base - 1e-4f);
    EXPECT_LE(filtered, base + 8.001f) << "light crossed the edge";
    if (x == 0 || x == 29 || y == 0 || y == 29 || on_floor(i - 30) != on_floor(i + 30)) continue;
    EXPECT_NEAR(filtered, base + 4.0f, 1e-4f) << "the mean of nine groups";
    ++inside;
  }
  EXPECT_GT(floor, 200u);
  EXPECT_LT(floor, 700u);
  EXPECT_GT(inside, 600u);
}

// Guards against: light of the frame before, by groups that were made of it.
TEST(RenderInstantGi, APassShowsEveryFrameAsOneThatBeginsThere) {
  constexpr int kSize = 24;
  constexpr std::uint32_t kPaths = 50;
  for (const std::string_view name : {"instant_gi", "instant_gi_interleaved"}) {
    const auto pass_of = [&](const RayTracer& rays, Crew& crew) {
      PassSetup setup{rays, crew, kSize, kSize};
      setup.vpl_paths = kPaths;
      return find_integrator(name).pass(setup);
    };
    RayTracer rays(room());
    ThreadCrew crew(rays, 1);
    const auto pass = pass_of(rays, crew);
    const auto shown = [&](IndirectPass& by) {
      PrimaryHits primary(rays.scene(), kSize, kSize);
      Image direct = blank(kSize, kSize), out = direct;
      render_sample(by, crew, CameraView(rays.scene().camera, kSize, kSize), Lens::centre, {},
                    make_tiles(kSize, kSize, 8, TileOrder::scanline), primary, direct, out);
      return out;
    };
    Image before = blank(kSize, kSize);
    for (const float frame : {0.0f, 5.0f, 19.0f}) {
      pass->begin_frame(rays.go_to(frame));
      const auto fresh = pass_of(rays, crew);
      fresh->begin_frame({});
      const Image now = shown(*pass), anew = shown(*fresh);
      for (std::size_t i = 0; i < now.pixels.size(); ++i)
        ASSERT_LE(glm::distance(now.pixels[i], anew.pixels[i]), 1e-4f * glm::length(anew.pixels[i]) + 1e-9f)
            << name << ", frame " << frame << ", pixel " << i;
      EXPECT_GT(std::abs(mean_of(now) / mean_of(before) - 1.0), 1e-3) << "nothing changed";
      before = now;
    }
  }
}

// Guards against: blocks of pixels that some group is missing from, at the borders of the picture too.
TEST(RenderInterleaved, EveryBlockOfPixelsHasAllGroups) {
  const VplGroups groups(traced_set(cornell_box_rays(), 300, 6), 3);
  constexpr std::uint32_t kHigh = 11;
  for (const std::uint32_t width : {9u, 10u, 11u})
    for (std::uint32_t y = 0; y + 3 <= kHigh; ++y)
      for (std::uint32_t x = 0; x + 3 <= width; ++x) {
        std::set<const VplArrays*> here;
        for (std::uint32_t i = 0; i < 9; ++i)
          here.insert(&groups.of_pixel((y + i / 3) * width + x + i % 3, static_cast<int>(width)));
        ASSERT_EQ(here.size(), 9u) << width << ": " << x << ' ' << y;
      }
}

// Guards against: the pattern of the groups in mirrors, where no filter takes it out.
TEST(RenderInterleaved, WhatIsSeenInMirrorsIsLitByAllLights) {
  Scene s = room();
  s.materials[2].surface = Surface::dielectric;  // both behind it and in it
  const RayTracer rays(std::move(s));
  PrimaryHits primary(rays.scene(), 16, 16);
  const CameraView view(rays.scene().camera, 16, 16);
  const VplSet set = traced_set(rays, 200, 6);
  const VplShading shading{vpl_clamp(rays.scene().bounds)};
  std::vector<Irradiance> E(primary.hits.size());
  Image by[2] = {blank(16, 16), blank(16, 16)};
  Tracer tracer(rays);
  const Tile tile{0, 0, 16, 16};
  primary_tile(tracer, view, Lens::centre, {}, tile, primary);
  for (const std::uint32_t n : {1u, 3u})
    interleaved_tile(tracer, primary, set.vpls(), VplGroups(set, n), shading, tile, E, by[n / 2]);
  EXPECT_GT(mean_of(by[0]), 0.0);
  for (std::size_t i = 0; i < E.size(); ++i) EXPECT_TRUE(same_bits(by[0].pixels[i], by[1].pixels[i]));
}

// A floor seen from above, beside it a step up, a slope of 34 degrees at an angle to the rows, and a lamp that lies on
// it.
Scene floor_and_more() {
  Scene s;
  s.name = "floor";
  const auto grey = s.add_material({.albedo = glm::vec3(0.5f)});
  const auto lamp = s.add_material({.emission = glm::vec3(1.0f)});
  s.meshes.push_back(quad("floor", {-2, 0, -2}, {0, 0, 4}, {4, 0, 0}, grey));
  s.meshes.push_back(quad("step", {-2, 0.2f, -2}, {0, 0, 4}, {1.8f, 0, 0}, grey));
  s.meshes.push_back(quad("slope", {0.3f, 0, -2}, {0.2f, 0, 4}, {2, 1.35f, 0}, grey));
  s.meshes.push_back(quad("lamp", {0.0f, 5e-4f, -0.2f}, {0, 0, 0.4f}, {0.2f, 0, 0}, lamp));
  s.camera = {.eye = {0.1f, 3.0f, 0.0f}, .target = {0.1f, 0.0f, 0.0f}, .up = {0, 0, -1}, .fov_y = 0.5f};
  return s;
}

TEST(RenderInterleaved, TheFilterStopsAtStepsSlopesLampsAndFarOff) {
  const RayTracer rays(floor_and_more());
  const PrimaryHits primary = primary_hits(rays, 30, 30);
  const auto filtered = [&](const std::vector<Irradiance>& E, float diagonal) {
    Image out = make_image(30, 30);
    filter_tile(rays, primary, E, 3, diagonal, {0, 0, 30, 30}, out);
    return out;
  };
  std::vector<Irradiance> E;
  std::size_t of_step = 0, of_lamp = 0;
  for (const Hit& hit : primary.hits) {
    of_step += hit.p.y == 0.2f;
    of_lamp += !reflects(rays, hit);
    E.emplace_back(!reflects(rays, hit) ? 0.0f : hit.p.y == 0.2f ? 10.0f : 1.0f);
  }
  ASSERT_GT(of_step, 100u);
  ASSERT_GT(of_lamp, 5u);
  const Image apart = filtered(E, 100.0f);
  for (std::size_t i = 0; i < E.size(); ++i)
    EXPECT_NEAR(apart.pixels[i].x, 0.5f / static_cast<float>(kPi) * E[i].x, 1e-5f) << i;

  // Of a block of pixels that has every group once, light of one: who gives, too, takes from it.
  std::array<Image, 9> of_group, alone;
  const auto group_of = [](std::size_t i) { return i / 30 % 3 * 3 + i % 3; };
  for (std::size_t k = 0; k < 9; ++k) {
    for (std::size_t i = 0; i < E.size(); ++i) E[i] = glm::vec3(group_of(i) == k ? 1.0f : 0.0f);
    of_group[k] = filtered(E, 100.0f);
    alone[k] = filtered(E, 1e-3f);
  }
  std::size_t cut = 0;
  for (std::size_t y = 1; y < 29; ++y)
    for (std::size_t x = 1; x < 29; ++x) {
      const std::size_t i = y * 30 + x;
      for (const std::size_t other : {i - 31, i - 30, i - 29, i - 1, i + 1, i + 29, i + 30, i + 31}) {
        if (!reflects(rays, primary.hits[i]) || !reflects(rays, primary.hits[other])) continue;
        const bool takes = of_group[group_of(other)].pixels[i].x > 0.0f;
        EXPECT_EQ(takes, of_group[group_of(i)].pixels[other].x > 0.0f) << i << ' ' << other;
        EXPECT_EQ(alone[group_of(other)].pixels[i].x, 0.0f) << "from farther than a twentieth of the scene";
        cut += !takes;
      }
    }
  EXPECT_GT(cut, 200u);
}

}  // namespace
}  // namespace icbench
