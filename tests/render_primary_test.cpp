// What a pixel sees: its first diffuse hit, and by way of mirrors and glass others.
#include <gtest/gtest.h>

#include <algorithm>
#include <glm/geometric.hpp>
#include <utility>
#include <vector>

#include "render/path.h"
#include "render/primary.h"
#include "render_support.h"
#include "scene/registry.h"
#include "scene/shapes.h"
#include "specular_scenes.h"

namespace icbench {
namespace {

TEST(RenderPrimary, APlainSceneHoldsHitsAlone) {
  const RayTracer rays(make_scene("white_furnace"));
  const PrimaryHits primary = primary_hits(rays, 20, 20);
  EXPECT_TRUE(primary.is_plain());
  EXPECT_TRUE(primary.weights.empty() && primary.extra.empty());
  EXPECT_EQ(primary.layers(), 1u);
  EXPECT_EQ(primary.count(), primary.hits.size());
  std::vector<int> visits(400);
  for_each_visible({0, 0, 20, 20}, primary, [&](const Visible& x) {
    ++visits[x.pixel];
    EXPECT_EQ(x.weight, glm::vec3(1.0f));
    EXPECT_EQ(x.layer, 0u);
    EXPECT_EQ(&x.hit, &primary.hits[x.pixel]);
  });
  EXPECT_EQ(visits, std::vector<int>(400, 1));
}

TEST(RenderPrimary, TheMainHitCountsMostAndComesFirst) {
  const RayTracer rays(gallery());
  const PrimaryHits primary = primary_hits(rays, 40, 40);
  ASSERT_FALSE(primary.is_plain());
  std::size_t visited = 0, behind_glass = 0;
  std::uint32_t layers = 0;
  float main = 0.0f;
  const auto check = [&](const Visible& x) {
    ++visited;
    layers = std::max(layers, x.layer + 1);
    if (x.layer == 0)
      main = x.weight.y;
    else
      EXPECT_LE(x.weight.y, 1.12f * main) << "tinted by 1, 1 or 0.9";
    behind_glass += x.layer > 0;
    if (!x.hit.missed()) {
      EXPECT_FALSE(rays.material(x.hit).is_specular());
    }
  };
  for_each_visible({0, 0, 40, 40}, primary, check);
  EXPECT_EQ(visited, primary.count());
  EXPECT_EQ(layers, primary.layers());
  EXPECT_GT(behind_glass, 100u);
  for_each_visible_coarse_to_fine({0, 0, 40, 40}, primary, check);
  EXPECT_EQ(visited, 2 * primary.count());
}

TEST(RenderPrimary, HitsDependNeitherOnThreadsNorOnTilesNorOnWhatWasThereBefore) {
  const RayTracer rays(gallery());
  constexpr int kSize = 40;
  const CameraView view(rays.scene().camera, kSize, kSize);
  PrimaryHits one(rays.scene(), kSize, kSize), many = one;
  Tracer tracer(rays);
  primary_tile(tracer, view, Lens::jittered, {.seed = 1}, {0, 0, kSize, kSize}, one);
  for (const std::uint64_t seed : {2u, 1u})
    for_tiles(rays, kSize, kSize, TileOrder::random, 5, [&](Tracer& t, const Tile& tile) {
      primary_tile(t, view, Lens::jittered, {.seed = seed}, tile, many);
    });
  const auto seen_in = [](const PrimaryHits& primary) {
    std::vector<std::pair<glm::vec3, glm::vec3>> out;
    for_each_visible({0, 0, kSize, kSize}, primary, [&](const Visible& x) {
      if (!x.hit.missed()) out.emplace_back(x.hit.p, x.weight);
    });
    return out;
  };
  EXPECT_EQ(seen_in(one), seen_in(many));
  // Through the centre, whatever the sample.
  primary_tile(tracer, view, Lens::centre, {.seed = 1}, {0, 0, kSize, kSize}, one);
  primary_tile(tracer, view, Lens::centre, {.seed = 2, .frame = 3}, {0, 0, kSize, kSize}, many);
  for (std::size_t i = 0; i < one.hits.size(); ++i) {
    ASSERT_EQ(one.weights[i], many.weights[i]);
    ASSERT_EQ(one.extra[i].size(), many.extra[i].size());
  }
}

TEST(RenderPrimary, APixelThatSeesNothingDiffuseIsMissed) {
  Scene s;
  const auto mirror = s.add_material(kMirror), glass = s.add_material(kGlass);
  const auto white = s.add_material({.albedo = glm::vec3(0.5f)});
  s.meshes.push_back(quad("mirror", {-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, mirror));
  s.meshes.push_back(quad("pane", {-1, -1, 5}, {2, 0, 0}, {0, 2, 0}, glass));
  s.meshes.push_back(quad("behind it", {-3, -3, 6}, {6, 0, 0}, {0, 6, 0}, white));
  s.meshes.push_back(quad("before it", {-3, -3, 3}, {6, 0, 0}, {0, 6, 0}, white));
  const Camera at_mirror{.eye = {0, 0, 2}, .target = {0, 0, 0}, .up = {0, 1, 0}, .fov_y = 1.5f};
  const Camera at_glass{.eye = {0, 0, 4}, .target = {0, 0, 6}, .up = {0, 1, 0}, .fov_y = 0.5f};
  const Camera away{.eye = {0, 0, 7}, .target = {0, 0, 9}, .up = {0, 1, 0}, .fov_y = 0.5f};
  const RayTracer rays(std::move(s));
  Tracer tracer(rays);
  PrimaryHits primary(rays.scene(), 9, 9);
  Image image = blank(9, 9);
  const Tile whole{0, 0, 9, 9};
  for (const Camera& camera : {at_mirror, away}) {
    primary_tile(tracer, CameraView(at_glass, 9, 9), Lens::centre, {}, whole, primary);
    EXPECT_EQ(primary.count(), 2u * 81u);
    primary_tile(tracer, CameraView(camera, 9, 9), Lens::centre, {}, whole, primary);
    if (camera == away) {
      EXPECT_EQ(primary.count(), 81u) << "what was there before";
    }
    for_each_visible(whole, primary,
                     [&](const Visible& x) { EXPECT_TRUE(x.hit.missed() || camera != away); });
    direct_tile(tracer, primary, 1, {}, whole, image);
    for (const glm::vec3& L : image.pixels) EXPECT_EQ(L, glm::vec3(0.0f)) << "there is no light";
  }
}

TEST(RenderPrimary, ATreeOfMoreBranchesThanAPixelHoldsLosesNothing) {
  // Among panes that reflect some two fifths at a glancing 80 degrees.
  Scene s;
  const auto white = s.add_material({.albedo = glm::vec3(0.5f)});
  const auto glass = s.add_material(kGlass);
  s.meshes.push_back(box("room", {{-9, -9, -9}, {9, 9, 9}}, white, true));
  for (const float z : {-0.35f, -0.15f, 0.05f, 0.25f})
    s.meshes.push_back(box("pane", {{-8, -8, z}, {8, 8, z + 0.1f}}, glass));
  s.camera = {.eye = {-6, 0, 0}, .target = {-5, 0, 0.18f}, .up = {0, 1, 0}, .fov_y = 0.01f};
  const RayTracer rays(std::move(s));
  const PrimaryHits primary = primary_hits(rays, 48, 48);
  EXPECT_EQ(primary.layers(), kMaxVisible);
  std::vector<double> seen(48 * 48, 0.0);
  for_each_visible({0, 0, 48, 48}, primary, [&](const Visible& x) { seen[x.pixel] += x.weight.x; });
  Estimate all;
  for (const double L : seen) all.add(L);
  EXPECT_NEAR(all.mean(), 1.0, 4.0 * all.error());
  EXPECT_LT(all.error(), 0.02);
}

}  // namespace
}  // namespace icbench
