// Instant global illumination, with every virtual light at every pixel and by interleaved sampling.
#include <gtest/gtest.h>

#include <cstring>
#include <glm/geometric.hpp>
#include <vector>

#include "render/instant_gi.h"
#include "render/interleaved.h"
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

}  // namespace
}  // namespace icbench
