// The reference integrator against closed forms. Comparisons are statistical, in standard errors measured
// from the samples themselves; seeds are fixed.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "render/gather.h"
#include "render/integrators.h"
#include "render/irradiance_cache.h"
#include "render/path.h"
#include "render_support.h"
#include "scene/registry.h"

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

// Irradiance of a point from a uniform polygon of radiance L (Lambert 1760): L/2 sum angle_i (cross_i . n).
double lambert(const glm::dvec3& p, const glm::dvec3& n, const std::vector<glm::dvec3>& polygon, double L) {
  double E = 0.0;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const glm::dvec3 a = glm::normalize(polygon[i] - p),
                     b = glm::normalize(polygon[(i + 1) % polygon.size()] - p);
    E += std::acos(glm::dot(a, b)) * glm::dot(glm::normalize(glm::cross(a, b)), n);
  }
  return 0.5 * L * std::abs(E);
}

TEST(RenderPath, DirectLightOfASquareIsLamberts) {
  const RayTracer rays(make_scene("lit_floor"));
  Tracer tracer(rays);
  const std::vector<glm::dvec3> square = {{-0.5, 1, -0.5}, {0.5, 1, -0.5}, {0.5, 1, 0.5}, {-0.5, 1, 0.5}};
  for (const glm::vec3 at : {glm::vec3(0.0f), glm::vec3(0.5f, 0.0f, 0.5f), glm::vec3(3.0f, 0.0f, -1.0f)}) {
    const Hit x =
        tracer.intersect(Ray{at + glm::vec3(0, 0.5f, 0), std::numeric_limits<float>::infinity(), {0, -1, 0}});
    Estimate direct, indirect;
    Pcg32 random(3);
    for (int i = 0; i < 100'000; ++i) {
      direct.add(sample_irradiance(tracer, x, Light::direct, random).x);
      indirect.add(sample_irradiance(tracer, x, Light::indirect, random).x);
    }
    const double E = lambert(at, {0, 1, 0}, square, 10.0);
    EXPECT_NEAR(direct.mean(), E, 4.0 * direct.error());
    EXPECT_LT(direct.error(), 0.005 * E);
    EXPECT_EQ(indirect.mean(), 0.0) << "the light reflects nothing";
  }
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
