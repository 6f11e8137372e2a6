// Mirrors and dielectrics against closed forms: Fresnel's and Snell's laws, white furnaces, images of lamps.
// Statistical comparisons are in standard errors measured from the samples; seeds are fixed.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <limits>
#include <utility>
#include <vector>

#include "render/gather.h"
#include "render/integrators.h"
#include "render/path.h"
#include "render/specular.h"
#include "render_support.h"
#include "scene/registry.h"
#include "scene/shapes.h"
#include "specular_scenes.h"
#include "trap_invalid.h"

namespace icbench {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

// Normals of a sphere, for smooth shading.
Mesh smooth(Mesh ball, const glm::vec3& centre) {
  for (const glm::vec3& p : ball.positions) ball.normals.push_back(glm::normalize(p - centre));
  return ball;
}

// A closed room of radiance 1 with a glass ball, a bubble, a glass block and a mirror ball in it.
Scene furnace() {
  Scene s = make_scene("white_furnace");
  s.meshes.resize(1);
  const auto glass = s.add_material(kGlass), mirror = s.add_material(kMirror);
  Material bubble = kGlass;
  bubble.ior = 1.0f / 1.5f;
  const auto thin = s.add_material(bubble);
  s.meshes.push_back(icosphere("ball", {-0.4f, 0.9f, -0.3f}, 0.4f, 2, glass));
  s.meshes.push_back(
      smooth(icosphere("smooth bubble", {0.4f, 0.5f, -0.3f}, 0.3f, 1, thin), {0.4f, 0.5f, -0.3f}));
  s.meshes.push_back(
      smooth(icosphere("smooth mirror", {0.3f, 1.4f, -0.5f}, 0.35f, 1, mirror), {0.3f, 1.4f, -0.5f}));
  s.meshes.push_back(box("block", {{-0.3f, 0.2f, 0.0f}, {0.1f, 0.5f, 0.3f}}, glass));
  return s;
}

TEST(RenderFresnel, NormalIncidenceGrazingBrewsterAndReciprocity) {
  for (const float n : {1.5f, 1.0f / 1.5f, 1.0001f, 2.4f, 10.0f, 0.1f}) {
    const double r = (n - 1.0) / (n + 1.0);
    EXPECT_NEAR(fresnel(1.0f, n), r * r, 1e-6) << n;
    EXPECT_EQ(fresnel(0.0f, n), 1.0f) << n;
    EXPECT_GT(fresnel(1e-4f, n), 0.9f) << n;
    for (float cosine = 1.0f; cosine > 0.05f; cosine -= 0.01f) {
      const float sine2 = (1.0f - cosine * cosine) / (n * n);
      if (sine2 > 0.95f) continue;  // next to the critical angle rounding is all there is
      EXPECT_NEAR(fresnel(cosine, n), fresnel(std::sqrt(1.0f - sine2), 1.0f / n), 2e-4f) << n;
    }
  }
  // At Brewster's angle, tan = n, nothing polarised in the plane of incidence is reflected.
  const double n = 1.5, across = (1.0 - n * n) / (1.0 + n * n);
  EXPECT_NEAR(fresnel(static_cast<float>(1.0 / std::sqrt(1.0 + n * n)), 1.5f), 0.5 * across * across, 1e-6);
}

TEST(RenderFresnel, ReflectionIsTotalBeyondTheCriticalAngleOnly) {
  const float eta = 1.0f / 1.5f;
  const float critical = std::sqrt(1.0f - eta * eta);
  EXPECT_EQ(fresnel(critical - 1e-4f, eta), 1.0f);
  EXPECT_EQ(fresnel(0.1f, eta), 1.0f);
  EXPECT_LT(fresnel(critical + 1e-4f, eta), 1.0f);
  EXPECT_LT(fresnel(critical + 0.1f, eta), 0.2f);
}

TEST(RenderFresnel, NothingLeavesTheUnitRange) {
  for (const float eta : {1e-38f, 1e-20f, 1e-3f, 0.9999999f, 1.0000001f, 10.0f, 1e20f, 1e38f})
    for (const float cosine : {0.0f, 1e-38f, 1e-20f, 1e-7f, 0.5f, 0.99999994f, 1.0f}) {
      const float share = fresnel(cosine, eta);
      EXPECT_TRUE(share >= 0.0f && share <= 1.0f) << cosine << " " << eta;
    }
}

// A hit of a surface that faces up.
Hit facing_up(bool front) {
  Hit hit{};
  hit.n = hit.ng = {0, 1, 0};
  hit.material = 0;
  hit.front = front;
  return hit;
}

TEST(RenderSpecular, DirectionsObeySnellAndTheMirror) {
  for (const bool front : {true, false})
    for (float angle = 0.01f; angle < 1.57f; angle += 0.03f) {
      const glm::vec3 d(std::sin(angle) * 0.6f, -std::cos(angle), std::sin(angle) * 0.8f);
      const SpecularSplit split = split_specular(kGlass, facing_up(front), d);
      EXPECT_LT(glm::distance(split.reflected, glm::vec3(d.x, -d.y, d.z)), 1e-6f);
      const float eta = front ? 1.5f : 1.0f / 1.5f;
      EXPECT_EQ(split.reflectance < 1.0f, std::sin(angle) < eta);
      if (split.reflectance == 1.0f) continue;
      const float sine = std::hypot(split.refracted.x, split.refracted.z);
      EXPECT_NEAR(sine * eta, std::sin(angle), 1e-5f);
      EXPECT_LT(split.refracted.y, 0.0f);
      EXPECT_NEAR(split.refracted.x * 0.8f, split.refracted.z * 0.6f, 1e-6f) << "in the plane of incidence";
      EXPECT_FLOAT_EQ(split.through_factor, 1.0f / (eta * eta));
    }
}

TEST(RenderSpecular, AnyNormalAndAnyAngleSendLightToItsSideOfTheSurface) {
  Pcg32 random(1);
  Material near_one = kGlass;
  near_one.ior = 1.0000001f;
  Material extreme = kGlass;
  extreme.ior = 1e-30f;
  for (int i = 0; i < 100'000; ++i) {
    Hit hit = facing_up(random() & 1);
    hit.n = direction_at(Basis(hit.ng), random.uniform(), random.uniform());
    // Every other ray is as good as in the surface, or exactly.
    const float heights[] = {random.uniform(), 1e-7f, 1e-30f, 0.0f};
    const float h = heights[i % 4], flat = std::sqrt(1.0f - h * h),
                phi = 2.0f * static_cast<float>(kPi) * random.uniform();
    const glm::vec3 d(flat * std::cos(phi), -h, flat * std::sin(phi));
    for (const Material& m : {kMirror, kGlass, near_one, extreme}) {
      const SpecularSplit split = split_specular(m, hit, d);
      ASSERT_NEAR(glm::length(split.reflected), 1.0f, 1e-5f);
      ASSERT_TRUE(split.reflected.y > 0.0f || d.y >= -1e-6f);
      ASSERT_TRUE(split.reflectance >= 0.0f && split.reflectance <= 1.0f);
      if (split.reflectance == 1.0f) continue;
      ASSERT_NEAR(glm::length(split.refracted), 1.0f, 1e-5f);
      ASSERT_TRUE(split.refracted.y < 0.0f || d.y >= -1e-6f);
      ASSERT_TRUE(split.through_factor >= 0.0f && std::isfinite(split.through_factor));
    }
  }
}

TEST(RenderSpecular, TheFurnaceStaysWhiteForThePath) {
  const RayTracer rays(furnace());
  constexpr int kSize = 16, kRuns = 40;
  std::vector<Estimate> pixels(kSize * kSize);
  Estimate all;
  for (std::uint32_t run = 0; run < kRuns; ++run) {
    const Image image = picture(rays, find_integrator("path"), kSize, 20, {.seed = 1, .frame = run});
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      pixels[i].add(image.pixels[i].x);
      all.add(image.pixels[i].x);
    }
  }
  for (const Estimate& pixel : pixels) EXPECT_NEAR(pixel.mean(), 1.0, 4.5 * pixel.error());
  EXPECT_NEAR(all.mean(), 1.0, 4.0 * all.error());
  EXPECT_LT(all.error(), 0.002) << "too few samples to say so";
}

TEST(RenderSpecular, TheFurnaceStaysWhiteForTheTreeOfAPixel) {
  const RayTracer rays(furnace());
  constexpr int kSize = 64;
  const CameraView view(rays.scene().camera, kSize, kSize);
  PrimaryHits primary(rays.scene(), kSize, kSize);
  Estimate all;
  std::uint32_t layers = 0;
  for (std::uint32_t run = 0; run < 10; ++run) {
    for_tiles(rays, kSize, kSize, TileOrder::scanline, 2, [&](Tracer& t, const Tile& tile) {
      primary_tile(t, view, Lens::jittered, {.seed = 3, .frame = run}, tile, primary);
    });
    layers = std::max(layers, primary.layers());
    std::vector<double> seen(kSize * kSize, 0.0);  // radiance 1 leaves everything
    for_each_visible({0, 0, kSize, kSize}, primary, [&](const Visible& x) { seen[x.pixel] += x.weight.x; });
    for (const double L : seen) all.add(L);
  }
  EXPECT_NEAR(all.mean(), 1.0, 4.0 * all.error());
  EXPECT_LT(all.error(), 0.0005);
  EXPECT_GT(layers, 4u) << "there is hardly a tree";
  EXPECT_LE(layers, kMaxVisible);
}

TEST(RenderSpecular, TheFurnaceStaysWhiteForTheGatherAndForThePathAtAPoint) {
  const RayTracer rays(furnace());
  Tracer tracer(rays);
  for (const glm::vec3 p :
       {glm::vec3(0.0f, 0.1f, 0.2f), glm::vec3(-0.4f, 0.2f, -0.3f), glm::vec3(0.9f, 1, 0)}) {
    const Hit x = down(tracer, p);
    Estimate gathered, direct, indirect, all;
    Pcg32 random(5);
    for (std::uint64_t k = 0; k < 300; ++k) gathered.add(gather(tracer, x, Strata::for_rays(64), k).E.y);
    for (int i = 0; i < 20'000; ++i) {
      direct.add(sample_irradiance(tracer, x, Light::direct, random).y);
      indirect.add(sample_irradiance(tracer, x, Light::indirect, random).y);
      all.add(sample_irradiance(tracer, x, Light::all, random).y);
    }
    EXPECT_NEAR(all.mean(), kPi, 4.0 * all.error());
    EXPECT_NEAR(direct.mean() + indirect.mean(), kPi, 4.0 * std::hypot(direct.error(), indirect.error()));
    EXPECT_NEAR(direct.mean() + gathered.mean(), kPi, 4.0 * std::hypot(direct.error(), gathered.error()));
    EXPECT_LT(gathered.error(), 0.02);
    EXPECT_LT(direct.mean(), kPi * 0.48) << "what comes through glass is not direct";
  }
}

TEST(RenderSpecular, RadianceInsideGlassIsThatOutsideTimesTheIndexSquared) {
  // In equilibrium with the room a diffuse ball inside the glass emits n^2 (1 - albedo).
  Scene s = furnace();
  s.meshes.resize(1);
  const auto inner =
      s.add_material({.albedo = glm::vec3(kRho), .emission = glm::vec3(2.25f * (1.0f - kRho))});
  const glm::vec3 centre(0.0f, 0.8f, -0.2f);
  s.meshes.push_back(icosphere("glass", centre, 0.6f, 3, 1));
  s.meshes.push_back(icosphere("core", centre, 0.35f, 2, inner));
  const RayTracer rays(std::move(s));
  Tracer tracer(rays);
  Estimate seen;
  for (std::uint32_t run = 0; run < 200; ++run) {
    const Image image = picture(rays, find_integrator("path"), 8, 4, {.seed = 7, .frame = run});
    for (const glm::vec3& L : image.pixels) seen.add(L.x);
  }
  EXPECT_NEAR(seen.mean(), 1.0, 4.0 * seen.error());
  EXPECT_LT(seen.error(), 0.01);

  const Hit core = down(tracer, centre + glm::vec3(0.05f, 0.5f, 0.02f));
  ASSERT_EQ(core.material, inner);
  Estimate traced, gathered;
  Pcg32 random(9);
  for (int i = 0; i < 40'000; ++i) traced.add(sample_irradiance(tracer, core, Light::all, random).x);
  for (std::uint64_t k = 0; k < 600; ++k) gathered.add(gather(tracer, core, Strata::for_rays(64), k).E.x);
  EXPECT_NEAR(traced.mean(), 2.25 * kPi, 4.0 * traced.error());
  EXPECT_NEAR(gathered.mean(), 2.25 * kPi, 4.0 * gathered.error()) << "all light in there came through glass";
}

TEST(RenderSpecular, GatherAndPathAgreeAmongLampsMirrorsAndGlass) {
  const RayTracer rays(gallery());
  Tracer tracer(rays);
  for (const glm::vec3 p :
       {glm::vec3(0.0f, 0.1f, 0.0f), glm::vec3(-0.4f, 0.2f, 0.0f), glm::vec3(0.1f, 1, 0.4f)}) {
    const Hit x = down(tracer, p);
    Estimate gathered[3], traced[3];
    Pcg32 random(11);
    for (std::uint64_t k = 0; k < 500; ++k) {
      const Irradiance E = gather(tracer, x, Strata::for_rays(64), k).E;
      for (int c = 0; c < 3; ++c) gathered[c].add(E[c]);
    }
    for (int k = 0; k < 30'000; ++k) {
      const Irradiance E = sample_irradiance(tracer, x, Light::indirect, random);
      for (int c = 0; c < 3; ++c) traced[c].add(E[c]);
    }
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(gathered[c].mean(), traced[c].mean(),
                  4.0 * std::hypot(gathered[c].error(), traced[c].error()));
    EXPECT_LT(traced[1].error(), 0.03 * traced[1].mean());
  }
}

void add_mean(const Image& image, Estimate (&to)[3]) {
  glm::dvec3 sum(0.0);
  for (const glm::vec3& L : image.pixels) sum += L;
  for (int c = 0; c < 3; ++c) to[c].add(sum[c] / static_cast<double>(image.pixels.size()));
}

// Mean radiance of an image's pixels, by run.
template <class F>
void add_runs(const RayTracer& rays, int size, std::uint32_t runs, Estimate (&to)[3], F&& f) {
  for (std::uint32_t run = 0; run < runs; ++run) {
    Image image = blank(size, size);
    for_tiles(rays, size, size, TileOrder::scanline, 2,
              [&](Tracer& t, const Tile& tile) { f(t, tile, SampleKey{.seed = 13, .frame = run}, image); });
    add_mean(image, to);
  }
}

TEST(RenderSpecular, WhittedIsThePathWithDirectLightOnly) {
  const RayTracer rays(gallery());
  constexpr int kSize = 24;
  const CameraView view(rays.scene().camera, kSize, kSize);
  Estimate whitted[3], path[3];
  for (std::uint32_t run = 0; run < 60; ++run)
    add_mean(picture(rays, find_integrator("whitted"), kSize, 1, {.seed = 13, .frame = run}), whitted);
  add_runs(rays, kSize, 120, path, [&](Tracer& t, const Tile& tile, const SampleKey& key, Image& image) {
    for (int y = tile.y0; y < tile.y1; ++y)
      for (int x = tile.x0; x < tile.x1; ++x) {
        const auto pixel = static_cast<std::uint32_t>(y * kSize + x);
        Pcg32 random(hash_keys(key.frame, pixel, 99));
        Ray ray = jittered_ray(view, x, y, random);
        glm::vec3 weight(1.0f);
        std::uint32_t bounces;
        const Hit hit = intersect_beyond_specular(t, ray, random, weight, bounces);
        image.pixels[pixel] = weight * rays.emitted(hit);
        if (reflects(rays, hit))
          image.pixels[pixel] += weight * rays.albedo(hit) * static_cast<float>(1.0 / kPi) *
                                 sample_irradiance(t, hit, Light::direct, random);
      }
  });
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(whitted[c].mean(), path[c].mean(), 4.0 * std::hypot(whitted[c].error(), path[c].error()));
    EXPECT_LT(path[c].error(), 0.02 * path[c].mean());
  }
}

TEST(RenderSpecular, DirectAndIndirectPassesSumUpToThePath) {
  const RayTracer rays(gallery());
  constexpr int kSize = 24;
  const CameraView view(rays.scene().camera, kSize, kSize);
  Estimate passes[3], path[3];
  PrimaryHits primary(rays.scene(), kSize, kSize);
  Image indirect = blank(kSize, kSize);
  add_runs(rays, kSize, 80, passes, [&](Tracer& t, const Tile& tile, const SampleKey& key, Image& image) {
    primary_tile(t, view, Lens::jittered, key, tile, primary);
    direct_tile(t, primary, 1, key, tile, image);
    path_indirect_tile(t, primary, 2, key, tile, indirect);
    for_each_pixel(tile, kSize, [&](std::uint32_t i) { image.pixels[i] += indirect.pixels[i]; });
  });
  for (std::uint32_t run = 0; run < 80; ++run)
    add_mean(picture(rays, find_integrator("path"), kSize, 2, {.seed = 13, .frame = run}), path);
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(passes[c].mean(), path[c].mean(), 4.0 * std::hypot(passes[c].error(), path[c].error()));
    EXPECT_LT(path[c].error(), 0.02 * path[c].mean());
  }
}

// A lamp of radiance (4, 2, 1) over the floor's x < 0, and a pane across x = 0 that is as large as need be.
Scene lamp_and_pane(const Material& pane) {
  Scene s;
  const auto floor = s.add_material({.albedo = glm::vec3(0.5f)});
  const auto lamp = s.add_material({.emission = {4, 2, 1}});
  const auto surface = s.add_material(pane);
  s.meshes.push_back(quad("floor", {-4, 0, -4}, {0, 0, 8}, {4, 0, 0}, floor));
  s.meshes.push_back(quad("lamp", {-2, 2, -0.5f}, {1, 0, 0}, {0, 0, 1}, lamp));
  s.meshes.push_back(quad("pane", {0, 0, -9}, {0, 0, 18}, {0, 18, 0}, surface));
  return s;
}

TEST(RenderSpecular, AMirrorShowsTheLampTimesItsReflectance) {
  Material mirror = kMirror;
  mirror.albedo = {0.9f, 0.5f, 0.25f};
  Scene s = lamp_and_pane(mirror);
  // The mirror image of the lamp is about (1.5, 2, 0).
  s.camera = {.eye = {-1.5f, 0.5f, 0}, .target = {1.5f, 2, 0}, .up = {0, 0, 1}, .fov_y = 0.05f};
  const RayTracer rays(std::move(s));
  for (const char* integrator : {"path", "whitted"}) {
    const Image image = picture(rays, find_integrator(integrator), 4, 3, {});
    for (const glm::vec3& L : image.pixels)
      EXPECT_LT(glm::distance(L, glm::vec3(4.0f * 0.9f, 2.0f * 0.5f, 0.25f)), 1e-5f);
  }
  const PrimaryHits primary = primary_hits(rays, 4, 4);
  Image direct = blank(4, 4);
  Tracer tracer(rays);
  direct_tile(tracer, primary, 1, {}, {0, 0, 4, 4}, direct);
  for (const glm::vec3& L : direct.pixels) EXPECT_LT(glm::distance(L, glm::vec3(3.6f, 1.0f, 0.25f)), 1e-5f);
}

TEST(RenderSpecular, AMirrorLightsTheFloorAsTheLampBehindItWould) {
  Material mirror = kMirror;
  mirror.albedo = {0.9f, 0.5f, 0.25f};
  const RayTracer rays(lamp_and_pane(mirror));
  Tracer tracer(rays);
  const glm::dvec3 at(-0.5, 0, 0.25);
  const std::vector<glm::dvec3> image = {{2, 2, -0.5}, {1, 2, -0.5}, {1, 2, 0.5}, {2, 2, 0.5}};
  double E = 0.0;  // Lambert's polygon formula
  for (std::size_t i = 0; i < 4; ++i) {
    const glm::dvec3 a = glm::normalize(image[i] - at), b = glm::normalize(image[(i + 1) % 4] - at);
    E += 0.5 * std::acos(glm::dot(a, b)) * glm::normalize(glm::cross(a, b)).y;
  }
  E = std::abs(E);
  const Hit x = down(tracer, glm::vec3(at) + glm::vec3(0, 0.5f, 0));
  Estimate traced[3], gathered[3];
  Pcg32 random(15);
  for (int i = 0; i < 100'000; ++i) {
    const Irradiance e = sample_irradiance(tracer, x, Light::indirect, random);
    for (int c = 0; c < 3; ++c) traced[c].add(e[c]);
  }
  for (std::uint64_t k = 0; k < 2000; ++k) {
    const Irradiance e = gather(tracer, x, Strata::for_rays(64), k).E;
    for (int c = 0; c < 3; ++c) gathered[c].add(e[c]);
  }
  const double reflected[] = {4 * 0.9, 2 * 0.5, 0.25};
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(traced[c].mean(), E * reflected[c], 4.0 * traced[c].error());
    EXPECT_NEAR(gathered[c].mean(), E * reflected[c], 4.0 * gathered[c].error());
    EXPECT_LT(gathered[c].error(), 0.02 * E * reflected[c]);
  }
  // Half of what is seen at 0.1 m from an endless wall is the wall: 1 / R = 2 / (3 pi 0.1).
  EXPECT_NEAR(gather(tracer, down(tracer, {-0.1f, 0.5f, 3}), Strata::for_rays(4096), 1).R, 0.15 * kPi, 0.01)
      << "records near a mirror are small";
}

TEST(RenderSpecular, ASlabOfGlassShowsAndReflectsWhatFresnelLeaves) {
  // At normal incidence a slab lets (1 - F) / (1 + F) through, all orders taken together.
  Scene s;
  const auto lamp = s.add_material({.emission = glm::vec3(1.0f)});
  const auto glass = s.add_material(kGlass);
  s.meshes.push_back(quad("lamp", {-9, -9, -5}, {18, 0, 0}, {0, 18, 0}, lamp));
  s.meshes.push_back(box("slab", {{-1, -1, -0.1f}, {1, 1, 0.1f}}, glass));
  s.camera = {.eye = {0, 0, 3}, .target = {0, 0, 0}, .up = {0, 1, 0}, .fov_y = 0.02f};
  const RayTracer rays(std::move(s));
  const double F = 0.04;
  for (const char* integrator : {"path", "whitted"}) {
    const Image image = picture(rays, find_integrator(integrator), 32, 4, {});
    Estimate seen;
    for (const glm::vec3& L : image.pixels) seen.add(L.x);
    EXPECT_NEAR(seen.mean(), (1.0 - F) / (1.0 + F), 4.0 * seen.error() + 1e-4);
    EXPECT_LT(seen.error(), 2e-4) << "a tree has next to no noise";
  }
}

TEST(RenderSpecular, GlassBlocksShadowRaysAndLetsLightThroughAllTheSame) {
  Scene s = make_scene("lit_floor");
  s.materials[0].albedo = glm::vec3(0.0f);
  const RayTracer open(s);
  const auto glass = s.add_material(kGlass);
  s.meshes.push_back(box("slab", {{-3, 0.5f, -3}, {3, 0.505f, 3}}, glass));
  const RayTracer glazed(std::move(s));
  Tracer through_air(open), through_glass(glazed);
  const Hit x = down(through_air, {0, 0.3f, 0});
  Estimate without, with;
  Pcg32 random(17);
  for (int i = 0; i < 200'000; ++i) {
    without.add(sample_irradiance(through_air, x, Light::direct, random).x);
    with.add(sample_irradiance(through_glass, x, Light::indirect, random).x);
    ASSERT_EQ(sample_irradiance(through_glass, x, Light::direct, random), glm::vec3(0.0f));
  }
  // (1 - F) / (1 + F) is 0.923 at normal incidence and 0.906 at 45 degrees, where the lamp ends.
  EXPECT_LT(with.error(), 0.005 * with.mean());
  EXPECT_NEAR(with.mean() / without.mean(), 0.917, 0.008 + 4.0 * with.error() / with.mean());
}

TEST(RenderSpecular, LightTrappedAmongMirrorsComesToAnEnd) {
  Scene s;
  const auto mirror = s.add_material(kMirror), glass = s.add_material(kGlass);
  const auto lamp = s.add_material({.emission = glm::vec3(1.0f)});
  s.meshes.push_back(box("room", {{-1, -1, -1}, {1, 1, 1}}, mirror, true));
  s.meshes.push_back(icosphere("ball", {0, 0, -0.5f}, 0.3f, 1, glass));
  s.meshes.push_back(quad("lamp", {-0.1f, 0.9f, 0.5f}, {0.2f, 0, 0}, {0, 0, 0.2f}, lamp));
  s.camera = {.eye = {0, 0, 0.9f}, .target = {0, 0, 0}, .up = {0, 1, 0}, .fov_y = 1.0f};
  const RayTracer rays(std::move(s));
  for (const char* integrator : {"path", "whitted"}) {
    const Image image = picture(rays, find_integrator(integrator), 16, 4, {});
    for (const glm::vec3& L : image.pixels) ASSERT_TRUE(is_finite(L) && L.x >= 0.0f);
  }
  EXPECT_LE(primary_hits(rays, 16, 16).layers(), kMaxVisible);
}

TEST(RenderSpecular, RaysAlongAFaceOfGlassYieldNumbers) {
  const RayTracer rays(furnace());
  Tracer tracer(rays);
  Pcg32 random(19);
  std::vector<WeightedHit> seen;
  const Bounds block{{-0.3f, 0.2f, 0.0f}, {0.1f, 0.5f, 0.3f}};
  for (int i = 0; i < 20'000; ++i) {
    // In the plane of the block's top, and along its edges.
    const float phi = 6.2831853f * random.uniform();
    glm::vec3 d(std::cos(phi), 0.0f, std::sin(phi));
    glm::vec3 through(block.lower.x, block.upper.y, block.lower.z);
    if (i % 2) through = {0.4f * random.uniform() - 0.3f, 0.5f, 0.3f * random.uniform()};
    if (i % 3 == 0) d = {1, 0, 0};
    trace_visible(tracer, {through - 0.5f * d, kInfinity, d}, random, seen);
    for (const WeightedHit& s : seen) {
      ASSERT_TRUE(is_finite(s.weight) && is_finite(s.hit.p) && is_finite(s.hit.n));
      ASSERT_LE(s.weight.x, 1.01f);
    }
  }
}

}  // namespace
}  // namespace icbench
