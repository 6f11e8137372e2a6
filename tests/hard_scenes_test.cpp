// Scenes that are hard on every estimator, each with the failure it guards against.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <fstream>
#include <functional>
#include <glm/geometric.hpp>
#include <string>
#include <vector>

#include "cached_runs.h"
#include "judged_estimates.h"
#include "scene/import_scene.h"
#include "scene/registry.h"
#include "temporary_folder.h"
#include "trap_invalid.h"

namespace icbench {
namespace {

// Guards against: densities that overflow, and offsets that step over the lamp.
TEST(HardScenes, ALampTooSmallToHaveAnAreaShinesAsAPoint) {
  constexpr double kSide = 1e-4, kL = 1e8;
  Scene s;
  s.name = "speck";
  add_lamp(s, static_cast<float>(kSide), 1.0f, static_cast<float>(kL));
  const auto grey = s.add_material({.albedo = glm::vec3(0.5f)});
  s.meshes.push_back(quad("floor", {-4, 0, -4}, {0, 0, 8}, {8, 0, 0}, grey));
  const RayTracer rays(std::move(s));
  std::vector<Known> points;
  for (const glm::dvec3 p : {glm::dvec3(0.0), glm::dvec3(1, 0, -2)}) {
    const double d2 = glm::dot(p, p) + 1.0;
    points.push_back({facing(p, {0, 1, 0}), kL * kSide * kSide / (d2 * d2)});
  }
  judge_direct("speck of light", rays, points);
}

// Guards against: shadow rays that miss a narrow gap or slip past its edges, be it one of a millimetre in a hall of 100
// m.
TEST(HardScenes, ALampBehindASlitShinesAsFarAsItIsSeen) {
  struct Slit {
    const char* name;
    float half;  // of its width
    float lamp;  // side
    float hall;  // side
  };
  for (const Slit& slit :
       {Slit{"slit", 0.05f, 1.0f, 8.0f}, Slit{"slit of a millimetre", 5e-4f, 3e-3f, 100.0f}}) {
    Scene s;
    s.name = "slit";
    add_lamp(s, slit.lamp, 2.0f, 10.0f / (slit.lamp * slit.lamp));
    const auto black = s.add_material({});
    const float far = 0.5f * slit.hall;
    s.meshes.push_back(quad("floor", {-far, -1, -far}, {0, 0, slit.hall}, {slit.hall, 0, 0}, black));
    s.meshes.push_back(quad("left", {-slit.half, 1, -4}, {0, 0, 8}, {-4, 0, 0}, black));
    s.meshes.push_back(quad("right", {slit.half, 1, -4}, {0, 0, 8}, {4, 0, 0}, black));
    const RayTracer rays(std::move(s));
    // From x at height 0 the gap at height 1 shows what lies between 2 (-+half) - x at height 2.
    const double side = static_cast<double>(slit.lamp), gap = 2.0 * static_cast<double>(slit.half);
    const float x = 0.35f * slit.lamp;
    const glm::dvec3 p(x, 0, 0.3);
    const double low = std::max(-0.5 * side, -gap - p.x), high = std::min(0.5 * side, gap - p.x);
    const Known point[] = {
        {facing(p, {0, 1, 0}),
         lambert(p, {0, 1, 0}, rectangle(low, high, 2, -0.5 * side, 0.5 * side), 10.0 / (side * side))}};
    judge_direct(slit.name, rays, point);
  }
}

// Guards against: hits whose normal or offset depends on how flat they are looked at.
TEST(HardScenes, GrazingViewsSeeTheSameLight) {
  const RayTracer rays(make_scene("lit_floor"));
  Tracer tracer(rays);
  for (const float slope : {1e-2f, 1e-4f}) {
    const Known ratio[] = {{{}, 1.0}};
    judge("views at a slope of " + std::to_string(slope), ratio, kError,
          [&](std::uint64_t seed, std::span<double> out) {
            Pcg32 random(hash_keys(seed, 9));
            const float turn = 6.2831853f * random.uniform();
            const glm::vec3 target(0.6f * random.uniform(), 0.0f, 0.6f * random.uniform());
            const glm::vec3 d(std::cos(turn), -slope, std::sin(turn));
            const Hit x = tracer.intersect(Ray{target - d, kInfinity, d});
            ASSERT_FALSE(x.missed());
            ASSERT_GT(x.ng.y, 0.99f);
            const double E = lambert(x.p, {0, 1, 0}, rectangle(-0.5, 0.5, 1, -0.5, 0.5), 10.0);
            out[0] = by_path(tracer, x, Light::direct, seed, 1000) / E;
          });
  }
}

// Guards against: light counted twice, and holes where triangles have no normal.
TEST(HardScenes, DoubledNeedleAndCollapsedTrianglesReflectAsThePlateTheyCover) {
  Scene s = lit_plate();
  Mesh& plate = s.meshes[0];
  const Mesh whole = plate;
  // A fan of 100 needles round one corner, over the other two edges.
  plate.positions = {{-1, 0, -1}};
  plate.triangles.clear();
  for (int i = 0; i <= 100; ++i) {
    const float t = static_cast<float>(i % 50) / 25.0f - 1.0f;
    plate.positions.push_back(i == 100 ? glm::vec3(1, 0, -1)
                              : i < 50 ? glm::vec3(t, 0, 1)
                                       : glm::vec3(1, 0, -t));
  }
  for (std::uint32_t i = 1; i <= 100; ++i) {
    plate.triangles.push_back({0, i, i + 1});
    plate.triangles.push_back({0, i, i + 1});  // twice
    plate.triangles.push_back({i, i + 1, 0});  // and once more
    plate.triangles.push_back({0, i, i});      // a line
    plate.triangles.push_back({i, i, i});      // a point
  }
  s.meshes.push_back(whole);
  const RayTracer rays(std::move(s));
  EXPECT_EQ(rays.scene().dropped_triangles, 200u);
  const Known points[] = {above_plate({0.1f, 0.7f, 0.2f}, {0, -1, 0})};
  const VplSettings vpls[] = {{512, 1.0f, 16}};
  judge_indirect("fan of needles", rays, points, vpls);
}

// A box with a ball in it, all lengths times `scale`.
Scene scaled_room(float scale) {
  Scene s;
  s.name = "room";
  const auto wall = s.add_material({.albedo = {0.7f, 0.5f, 0.3f}});
  s.meshes.push_back(box("walls", {{-10, 0, -10}, {10, 20, 10}}, wall, true));
  s.meshes.push_back(icosphere("ball", {3, 6, -2}, 4.0f, 2, wall));
  add_lamp(s, 6.0f, 19.0f, 10.0f);
  s.camera = {.eye = {1, 12, 9}, .target = {0, 7, -3}, .up = {0, 1, 0}, .fov_y = 1.0f};
  for (Mesh& mesh : s.meshes)
    for (glm::vec3& p : mesh.positions) p *= scale;
  s.camera.eye *= scale;
  s.camera.target *= scale;
  return s;
}

// Whether two pictures are the same but for pixels whose rays took another side, at most `others` of all.
void expect_alike(const Image& one, const Image& other, double others, const std::string& what) {
  std::size_t alike = 0;
  double mean_one = 0.0, mean_other = 0.0;
  for (std::size_t i = 0; i < one.pixels.size(); ++i) {
    alike += glm::distance(one.pixels[i], other.pixels[i]) <= 1e-3f * glm::length(one.pixels[i]);
    mean_one += one.pixels[i].y;
    mean_other += other.pixels[i].y;
  }
  std::printf("%s: %zu of %zu pixels alike, means differ by %.2g\n", what.c_str(), alike, one.pixels.size(),
              mean_other / mean_one - 1.0);
  EXPECT_GE(static_cast<double>(alike), (1.0 - others) * static_cast<double>(one.pixels.size())) << what;
  EXPECT_NEAR(mean_other / mean_one, 1.0, 0.1 * others) << what;
}

// Guards against: lengths that do not scale with the scene.
TEST(HardScenes, AScaledSceneGivesTheSamePicture) {
  constexpr int kSize = 24;
  for (const char* name : {"path", "instant_gi"}) {
    const RayTracer rays(scaled_room(1.0f));
    const Image one = picture(rays, find_integrator(name), kSize, 4, {.seed = 3});
    for (const float scale : {1e-4f, 1e4f}) {
      const RayTracer scaled(scaled_room(scale));
      expect_alike(one, picture(scaled, find_integrator(name), kSize, 4, {.seed = 3}), 0.03,
                   std::string(name) + ", scaled by " + std::to_string(scale));
    }
  }
}

// Guards against: offsets that carry rays through a wall, and VPLs or compensation that shine through it.
TEST(HardScenes, NoLightPassesAThinWall) {
  for (const float thickness : {0.0f, 4e-5f}) {
    Scene s;
    s.name = "two_rooms";
    const auto wall = s.add_material({.albedo = glm::vec3(0.7f)});
    s.meshes.push_back(box("walls", {{-1, 0, -1}, {1, 1, 1}}, wall, true));
    const float x = 0.5f * thickness;
    if (thickness > 0.0f)
      s.meshes.push_back(box("partition", {{-x, -0.1f, -1.1f}, {x, 1.1f, 1.1f}}, wall));
    else
      s.meshes.push_back(quad("partition", {0, -0.1f, -1.1f}, {0, 0, 2.2f}, {0, 1.2f, 0}, wall));
    const auto glow = s.add_material({.emission = glm::vec3(1e6f)});
    s.meshes.push_back(quad("lamp", {-0.8f, 0.99f, -0.5f}, {0.6f, 0, 0}, {0, 0, 1}, glow));
    const RayTracer rays(std::move(s));
    Tracer tracer(rays);
    VplSet set(rays, {256, 1});
    trace_all(set, tracer);
    ASSERT_GT(set.count(), 100u);
    Pcg32 random(5);
    const float clamp = 0.01f * vpl_clamp(rays.scene().bounds);
    const auto light_at = [&](const Hit& at, std::uint64_t key) {
      double E = gather(tracer, at, Strata::for_rays(64), key).E.y +
                 gather_vpls(tracer, at, set.vpls(), clamp).y +
                 compensate(tracer, at, set.vpls(), clamp, 16, key).E.y;
      for (int k = 0; k < 8; ++k) E += sample_irradiance(tracer, at, Light::all, random).y;
      return E;
    };
    for (std::uint64_t i = 0; i < 300; ++i) {
      // Every third ray goes to where the partition meets the floor.
      const glm::vec3 from(0.5f, 0.5f, 0.0f);
      const float u = random.uniform(), v = random.uniform(), w = random.uniform();
      glm::vec3 d(2.0f * u - 1.0f, 2.0f * v - 1.0f, 2.0f * w - 1.0f);
      if (i % 3 == 0) d = glm::vec3(x + 3e-5f, 0, 2.0f * v - 1.0f) - from;
      const Hit dark = tracer.intersect(Ray{from, kInfinity, d});
      ASSERT_FALSE(dark.missed());
      ASSERT_EQ(light_at(dark, i), 0.0)
          << dark.p.x << ' ' << dark.p.y << ' ' << dark.p.z << ", " << thickness;
      const Hit lit = tracer.intersect(Ray{from * glm::vec3(-1, 1, 1), kInfinity, d * glm::vec3(-1, 1, 1)});
      ASSERT_GT(light_at(lit, i), 0.0);
    }
  }
}

// Guards against: sums, densities or alias tables that lose a lamp of 1e-20 beside one of 1e20.
TEST(HardScenes, RoomsOfRadiance1em20And1e20KeepTheirLight) {
  Scene s;
  s.name = "dim_and_bright";
  std::vector<Known> points;
  for (const float L : {1e-20f, 1e20f}) {
    const float x = L < 1.0f ? -2.0f : 2.0f;
    const auto wall = s.add_material({.albedo = glm::vec3(0.5f), .emission = glm::vec3(0.5f * L)});
    s.meshes.push_back(box("room", {{x - 1, 0, -1}, {x + 1, 2, 1}}, wall, true));
    points.push_back({facing({x + 0.2f, 0, 0.1f}, {0, 1, 0}), 0.5 * kPi * static_cast<double>(L)});
  }
  const RayTracer rays(std::move(s));
  judge_indirect("1e-20 and 1e20", rays, points, {});
  Tracer tracer(rays);
  double E[2];
  by_vpls(tracer, points, {64, vpl_clamp(rays.scene().bounds), 4}, 1, E);
  for (const double e : E) EXPECT_TRUE(std::isfinite(e) && e >= 0.0);
}

// Guards against: float sums that stagnate, of irradiance and of its gradients.
TEST(HardScenes, SumsOverAHundredThousandVplsAreThoseOfDoubles) {
  constexpr std::size_t kVpls = 100'000;
  constexpr double kClamp = 0.5;
  const Hit at = facing({0, 0, 0}, {0, 1, 0});
  const glm::dvec3 n(at.n);
  for (const bool equal : {true, false}) {
    VplArrays vpls(kVpls);
    std::vector<std::uint64_t> bits(vpls.words());
    Pcg32 random(7);
    glm::dvec3 E(0.0);
    // By channel: of translational and rotational gradients, and of the magnitudes of all that is added up for them.
    glm::dvec3 moved[3]{}, turned[3]{}, moves[3]{}, turns[3]{};
    std::size_t sloping = 0;
    for (std::size_t i = 0; i < kVpls; ++i) {
      const float u = random.uniform(), v = random.uniform();
      const float size = equal ? 1.0f : std::exp(20.0f * random.uniform() - 10.0f);
      const glm::vec3 d =
          equal ? glm::normalize(glm::vec3(0.3f, 1, -0.2f)) : cosine_direction(Basis(at.n), 0.9f * u, v);
      const Vpl vpl{(1.0f + v) * d, -d, size * glm::vec3(1.0f, 0.1f, 0.003f)};
      vpls.set(i, vpl);
      bits[i / 64] |= std::uint64_t{1} << i % 64;
      const glm::dvec3 to(vpl.p), flux(vpl.flux), from(vpl.n);
      const double d2 = glm::dot(to, to), there = -glm::dot(to, from), G = to.y * there / (d2 * d2);
      E += std::min(G, kClamp) / kPi * flux;
      ASSERT_GT(std::abs(G / kClamp - 1.0), 1e-7) << "rounding decides whether the clamp bounds it";
      if (G < kClamp) {
        ++sloping;
        const glm::dvec3 parts[] = {to.y / (d2 * d2) * from, 4.0 * G / d2 * to, -there / (d2 * d2) * n};
        const glm::dvec3 turn = there / (d2 * d2) * to;
        for (int c = 0; c < 3; ++c) {
          for (const glm::dvec3& part : parts) {
            moved[c] += flux[c] / kPi * part;
            moves[c] += flux[c] / kPi * glm::abs(part);
          }
          turned[c] += flux[c] / kPi * glm::cross(n, turn);
          turns[c] += flux[c] / kPi * glm::abs(glm::cross(n, turn));
        }
      }
    }
    EXPECT_GT(sloping, kVpls / 4);
    IrradianceGradients gradients;
    const Irradiance sum = irradiance_from(bits, at, vpls, static_cast<float>(kClamp));
    ASSERT_EQ(irradiance_from(bits, at, vpls, static_cast<float>(kClamp), gradients), sum);
    for (int c = 0; c < 3; ++c) {
      std::printf("100,000 VPLs, %s: float over double less 1: %.2g\n", equal ? "equal" : "unequal",
                  sum[c] / E[c] - 1.0);
      // Sums of n numbers that are not negative err by at most n u of themselves, u = 2^-24 (Higham 2002, 4.2): here
      // 6,250 in each of 16 lanes, four more for these, and some ten roundings a term. Roundings cancel for the most
      // part.
      constexpr double kBound = (kVpls / 16 + 4 + 10) / 16'777'216.0;
      static_assert(kBound < 4e-4);
      EXPECT_NEAR(sum[c] / E[c], 1.0, kBound);
      // Numbers of both signs err by that of the sum of their magnitudes: four at once, so 1,563 in each lane, two
      // more for these four, 16 lanes, and some 20 roundings a term.
      constexpr double kBoundOfSlopes = (kVpls / 64 + 1 + 2 + 16 + 20) / 16'777'216.0;
      static_assert(kBoundOfSlopes < 1e-4);
      moved[c] -= glm::dot(moved[c], n) * n;
      const auto channel = static_cast<std::size_t>(c);
      double worst = 0.0;
      for (int axis = 0; axis < 3; ++axis) {
        const double of_moved = std::abs(gradients.translational[channel][axis] - moved[c][axis]);
        const double of_turned = std::abs(gradients.rotational[channel][axis] - turned[c][axis]);
        EXPECT_LE(of_moved, kBoundOfSlopes * moves[c][axis]) << "axis " << axis;
        EXPECT_LE(of_turned, kBoundOfSlopes * turns[c][axis]) << "axis " << axis;
        if (axis != 1) worst = std::max({worst, of_moved / moves[c][axis], of_turned / turns[c][axis]});
      }
      std::printf("and of its gradients: error at most %.2g of the magnitudes\n", worst);
    }
  }
}

// A scene file, moved; 1 m, 12 decimals.
std::string radiance_room(double offset) {
  const auto polygon = [&](const char* material, std::initializer_list<glm::dvec3> corners) {
    std::string text = std::string(material) + " polygon p\n0 0 " + std::to_string(3 * corners.size());
    for (const glm::dvec3& c : corners) {
      char line[100];
      std::snprintf(line, sizeof line, "\n%.12g %.12g %.12g", c.x + offset, c.y + offset, c.z + offset);
      text += line;
    }
    return text + "\n";
  };
  char view[200];
  std::snprintf(view, sizeof view, "# view -vtv -vp %.12g %.12g %.12g -vd 0 1 -0.3 -vu 0 0 1 -vh 60 -vv 60\n",
                offset + 0.5, offset + 0.05, offset + 0.6);
  return std::string(view) + "void plastic grey 0 0 5 .6 .5 .4 0 0\nvoid light lamp 0 0 3 9 9 9\n" +
         polygon("grey", {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}) +
         polygon("grey", {{0, 0, 1}, {0, 1, 1}, {1, 1, 1}, {1, 0, 1}}) +
         polygon("grey", {{0, 1, 0}, {1, 1, 0}, {1, 1, 1}, {0, 1, 1}}) +
         polygon("grey", {{0, 0, 0}, {0, 1, 0}, {0, 1, 1}, {0, 0, 1}}) +
         polygon("grey", {{1, 0, 0}, {1, 0, 1}, {1, 1, 1}, {1, 1, 0}}) +
         polygon("grey", {{0.3, 0.6, 0}, {0.7, 0.6, 0}, {0.7, 0.6, 0.4}, {0.3, 0.6, 0.4}}) +
         polygon("lamp", {{0.4, 0.4, 0.99}, {0.4, 0.6, 0.99}, {0.6, 0.6, 0.99}, {0.6, 0.4, 0.99}});
}

Scene import_room(double offset) {
  const TemporaryFolder folder;
  std::ofstream(folder / "room.rad") << radiance_room(offset);
  ImportedScene imported = import_scene(folder / "room.rad");
  const auto told = std::count_if(imported.notes.begin(), imported.notes.end(), [](const std::string& note) {
    return note.find("far from its origin") != std::string::npos;
  });
  EXPECT_EQ(told, offset > 100.0 ? 1 : 0);
  return std::move(imported.scene);
}

// Scenes on which nothing may go wrong, whoever renders them.
struct HardScene {
  const char* name;
  std::function<Scene()> make;
  double
      tolerance;  // of a cached picture's mean, against a gather in every pixel, both of which are noisy; < 0: lamps
                  // are drawn by power, and what the dim one sends is left to chance
  double tolerance_by_vpls;  // of one by virtual lights, against the same in every pixel: no noise
};

Scene closed_room(float side) {
  Scene s;
  s.name = "closed_room";
  const auto wall = s.add_material({.albedo = glm::vec3(0.6f)});
  s.meshes.push_back(box("walls", {{0, 0, 0}, glm::vec3(side)}, wall, true));
  s.camera = {.eye = side * glm::vec3(0.5f, 0.5f, 0.9f),
              .target = side * glm::vec3(0.5f, 0.2f, 0.0f),
              .up = {0, 1, 0},
              .fov_y = 1.2f};
  return s;
}

void add_lamp_at(Scene& s, const glm::vec3& p, float side, float L) {
  const auto glow = s.add_material({.emission = glm::vec3(L)});
  s.meshes.push_back(quad("lamp", p, {side, 0, 0}, {0, 0, side}, glow));
}

// A lamp of a tenth of a millimetre.
Scene speck() {
  Scene s = closed_room(2.0f);
  add_lamp_at(s, {1, 1.8f, 1}, 1e-4f, 1e8f);
  return s;
}

// Light through a slit of 2 cm in a ceiling below the lamp.
Scene slit() {
  Scene s = closed_room(2.0f);
  s.meshes.push_back(quad("left", {0, 1.5f, 0}, {0, 0, 2}, {0.99f, 0, 0}, 0));
  s.meshes.push_back(quad("right", {1.01f, 1.5f, 0}, {0, 0, 2}, {0.99f, 0, 0}, 0));
  add_lamp_at(s, {0.5f, 1.9f, 0.5f}, 1.0f, 100.0f);
  return s;
}

// The floor from a tenth of a millimetre above it.
Scene grazing() {
  Scene s = closed_room(2.0f);
  add_lamp_at(s, {0.5f, 1.9f, 0.5f}, 1.0f, 1.0f);
  s.camera.eye = {1, 1e-4f, 1.9f};
  s.camera.target = {1, 0, 0.5f};
  s.camera.fov_y = 0.002f;
  return s;
}

// A millimetre from the edges in which three walls meet, of which none has a distance to the next.
Scene corner_of_walls() {
  Scene s = closed_room(2.0f);
  add_lamp_at(s, {0.5f, 1.9f, 0.5f}, 1.0f, 1.0f);
  s.camera.eye = {2e-3f, 2e-3f, 2e-3f};
  s.camera.target = glm::vec3(0.0f);
  return s;
}

// A floor of needles, twice, with triangles that are lines and points.
Scene needles() {
  Scene s = closed_room(2.0f);
  add_lamp_at(s, {0.5f, 1.9f, 0.5f}, 1.0f, 1.0f);
  Mesh fan;
  fan.name = "fan";
  fan.positions = {{0, 0.1f, 0}};
  for (int i = 0; i <= 200; ++i) fan.positions.push_back({0.01f * static_cast<float>(i), 0.1f, 2});
  for (std::uint32_t i = 1; i <= 200; ++i)
    for (const glm::uvec3 t :
         {glm::uvec3(0, i, i + 1), glm::uvec3(0, i + 1, i), glm::uvec3(0, i, i), glm::uvec3(i, i, i)})
      fan.triangles.push_back(t);
  s.meshes.push_back(fan);
  s.meshes.push_back(fan);
  return s;
}

// In a hall of 100 m a rug that lies a millimetre above the floor.
Scene hall() {
  Scene s = closed_room(100.0f);
  add_lamp_at(s, {25, 99, 25}, 50.0f, 1.0f);
  s.meshes.push_back(quad("rug", {40, 1e-3f, 40}, {0, 0, 20}, {20, 0, 0}, 0));
  return s;
}

// Patches that shine with 1e-20 and 1e20.
Scene dim_and_bright() {
  Scene s = closed_room(2.0f);
  add_lamp_at(s, {0.2f, 1.9f, 0.2f}, 0.5f, 1e-20f);
  add_lamp_at(s, {1.2f, 1.9f, 0.2f}, 0.5f, 1e20f);
  s.meshes.push_back(quad("partition", {1, 0, 0}, {0, 0, 2}, {0, 2, 0}, 0));
  s.camera.eye = {0.9f, 1, 1.9f};
  return s;
}

// Light of which a hundredth is no normal number any more.
Scene denormal_light() {
  Scene s = closed_room(2.0f);
  add_lamp_at(s, {0.5f, 1.9f, 0.5f}, 1.0f, 1e-36f);
  return s;
}

// The power of the lamp itself is no normal number, and its inverse none at all.
Scene denormal_lamp() {
  Scene s = closed_room(2.0f);
  add_lamp_at(s, {0.5f, 1.9f, 0.5f}, 1.0f, 1e-42f);
  return s;
}

Scene dark() { return closed_room(2.0f); }

const HardScene kHardScenes[] = {{"speck", speck, 0.1, 0.05},
                                 {"slit", slit, 0.25, 0.05},
                                 {"grazing", grazing, 0.1, 0.05},
                                 {"corner", corner_of_walls, 0.1, 0.05},
                                 {"needles", needles, 0.1, 0.05},
                                 {"hall", hall, 0.1, 0.05},
                                 {"dim_and_bright", dim_and_bright, -1.0, -1.0},
                                 {"denormal_light", denormal_light, 0.1, 0.05},
                                 {"denormal_lamp", denormal_lamp, -1.0, -1.0},
                                 {"tiny", [] { return scaled_room(1e-4f); }, 0.1, 0.05},
                                 {"huge", [] { return scaled_room(1e4f); }, 0.1, 0.05},
                                 {"far_file", [] { return import_room(1e6); }, 0.1, 0.05},
                                 {"dark", dark, 0.0, 0.0}};

void expect_an_image(const Image& image, const std::string& what) {
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    const glm::vec3& L = image.pixels[i];
    ASSERT_TRUE(is_finite(L) && L.x >= 0.0f && L.y >= 0.0f && L.z >= 0.0f)
        << what << ", pixel " << i << ": " << L.x << ' ' << L.y << ' ' << L.z;
  }
}

double mean_of(const Image& image) {
  double sum = 0.0;
  for (const glm::vec3& L : image.pixels) sum += L.y;
  return sum / static_cast<double>(image.pixels.size());
}

// Guards against: any NaN, infinity or negative value in any integrator's picture.
TEST(HardScenes, EveryIntegratorMakesAnImageOfThem) {
  for (const HardScene& hard : kHardScenes) {
    const RayTracer rays(hard.make());
    for (const IntegratorEntry& integrator : kIntegrators)
      if (!integrator.needs_cache())
        expect_an_image(picture(rays, integrator, 10, 2, {.seed = 2}, TileOrder::scanline, 2),
                        std::string(hard.name) + ", " + std::string(integrator.name));
  }
}

// Indirect light at these hits without a cache: by the virtual lights that the records of run_level() have, or by a
// gather of so many rays in every pixel.
Image without_cache(const RayTracer& rays, const PrimaryHits& primary, const Level& level, bool by_vpls) {
  Image out = blank(primary.width, primary.height);
  Tracer tracer(rays);
  if (by_vpls) {
    ThreadCrew crew(rays, 1);
    PassSetup setup{rays, crew, primary.width, primary.height};
    setup.vpls = level.vpls;
    const auto pass = make_instant_gi(setup);
    pass->begin_frame({});
    for (const Tile& tile : make_tiles(primary.width, primary.height, 8, TileOrder::morton))
      pass->tile(0, tracer, primary, {}, tile, out);
    return out;
  }
  for (std::size_t i = 0; i < out.pixels.size(); ++i) {
    const Hit& hit = primary.hits[i];
    out.pixels[i] =
        reflects(rays, hit)
            ? reflected_radiance(rays, hit, gather(tracer, hit, Strata::for_rays(level.gather_rays), i).E)
            : glm::vec3(0.0f);
  }
  return out;
}

// Records of every integrator that makes some, at each level of interpolation.
class HardRecords : public ::testing::TestWithParam<RecordKind> {
 protected:
  static Level level(bool leak_guard = false) {
    return {.level = GetParam().level, .leak_guard = leak_guard};
  }
  static LevelRun run(const RayTracer& rays, const PrimaryHits& primary, const Level& level) {
    return run_level(rays, primary, level, GetParam().make);
  }
  // Whether there is a guard against leaks to be had.
  static std::vector<bool> guards() {
    return GetParam().by_vpls() ? std::vector{false} : std::vector{false, true};
  }
};
INSTANTIATE_TEST_SUITE_P(Kinds, HardRecords, ::testing::ValuesIn(record_kinds()), kind_name);

// Guards against: any NaN, infinity or negative value in a cached picture, and light that gets lost or comes about.
TEST_P(HardRecords, CachedPicturesAreImagesOfTheRightBrightness) {
  constexpr int kSize = 14;
  for (const HardScene& hard : kHardScenes) {
    const RayTracer rays(hard.make());
    const PrimaryHits primary = primary_hits(rays, kSize, kSize);
    Level fine = level();
    fine.gather_rays = 256;
    const Image anew = without_cache(rays, primary, fine, GetParam().by_vpls());
    const double tolerance = GetParam().by_vpls() ? hard.tolerance_by_vpls : hard.tolerance;
    for (const bool guard : guards()) {
      const std::string what = std::string(hard.name) + (guard ? ", guarded" : "");
      fine.leak_guard = guard;
      const LevelRun made = run(rays, primary, fine);
      expect_an_image(made.indirect, what);
      EXPECT_EQ(made.use.rejected, 0u) << what;
      if (tolerance > 0.0) {
        ASSERT_GT(mean_of(anew), 0.0) << what;
        std::printf("%s: %.4f\n", what.c_str(), mean_of(made.indirect) / mean_of(anew));
        EXPECT_NEAR(mean_of(made.indirect) / mean_of(anew), 1.0, tolerance) << what;
      } else if (tolerance == 0.0) {
        EXPECT_EQ(mean_of(made.indirect), 0.0) << what;
      }
    }
  }
}

// Guards against: radii and gradients whose unit is not that of the scene.
TEST_P(HardRecords, AScaledSceneGivesTheSamePicture) {
  constexpr int kSize = 20;
  const RayTracer rays(scaled_room(1.0f));
  const LevelRun one = run(rays, primary_hits(rays, kSize, kSize), level());
  for (const float scale : {1e-4f, 1e4f}) {
    const RayTracer scaled(scaled_room(scale));
    const LevelRun other = run(scaled, primary_hits(scaled, kSize, kSize), level());
    expect_alike(one.indirect, other.indirect, 0.1, "scaled by " + std::to_string(scale));
  }
}

// Guards against: coordinates of a file that lose their places as they become floats.
TEST_P(HardRecords, AFileAMillionMetresAwayGivesTheSamePicture) {
  constexpr int kSize = 20;
  const RayTracer near(import_room(0.0)), far(import_room(1e6));
  const LevelRun one = run(near, primary_hits(near, kSize, kSize), level());
  const LevelRun other = run(far, primary_hits(far, kSize, kSize), level());
  expect_alike(one.indirect, other.indirect, 0.1, "moved by 1e6 m");
}

// Guards against: offsets as wide as a gap, which carry rays through what lies above it.
TEST_P(HardRecords, UnderARugAMillimetreAboveTheFloorOfAHallItIsDark) {
  const RayTracer rays(hall());
  Tracer tracer(rays);
  double brightness[2];
  for (const bool beside : {false, true}) {
    PrimaryHits primary = primary_hits(rays, 6, 6);
    for (std::size_t i = 0; i < primary.hits.size(); ++i) {
      // From 1 m before the rug, half a millimetre high, to the floor: some metres under it, or before it.
      const float z = beside ? 39.5f : 45.0f + static_cast<float>(i) / 10.0f;
      const glm::vec3 from(45.0f + static_cast<float>(i) / 10.0f, 5e-4f, 39);
      const Hit hit = tracer.intersect(Ray{from, kInfinity, {0, -5e-4f / (z - 39.0f), 1}});
      ASSERT_FALSE(hit.missed());
      ASSERT_NEAR(hit.p.z, z, 0.1f);
      primary.hits[i] = hit;
    }
    const Image made = run(rays, primary, level()).indirect;
    expect_an_image(made, "rug");
    brightness[beside] = mean_of(made);
    if (!beside) continue;
    Level fine = level();
    fine.gather_rays = 1024;
    const Image anew = without_cache(rays, primary, fine, GetParam().by_vpls());
    EXPECT_NEAR(brightness[true] / mean_of(anew), 1.0, 0.1);
  }
  EXPECT_LT(brightness[false], 1e-4 * brightness[true]);
}

// Guards against: records that are not valid where they were made, or whose answer there is not their own irradiance;
// weights that jump where normals are equal, equal but for rounding, or opposite; sheets of paper with a lit side that
// shines through, at whatever accuracy.
TEST_P(HardRecords, ARecordAnswersAtItsOwnPointWhateverRoundingDoesToTheNormal) {
  const RayTracer rays(scaled_room(1.0f));
  ThreadCrew crew(rays, 1);
  const PrimaryHits primary = primary_hits(rays, 10, 10);
  for (const float a : {0.05f, 0.2f, 1.0f})
    for (const bool guard : guards()) {
      PassSetup setup{rays, crew, 10, 10};
      setup.gather_rays = setup.vpls = 64;
      setup.interpolation = GetParam().level;
      setup.leak_guard = guard;
      setup.a = a;
      const auto source = GetParam().make(setup);
      source->begin_frame({}, crew);
      Tracer tracer(rays);
      for_each_visible({0, 0, 10, 10}, primary, [&](const Visible& x) {
        if (!reflects(rays, x.hit)) return;
        ListSession session{.bounds = rays.scene().bounds, .a = GetParam().reach() * a};
        const Record r = source->evaluate(0, tracer, x, {});
        ASSERT_EQ(session.insert(r), InsertResult::inserted);
        source->settle(0, r, InsertResult::inserted);
        LeakTests tests;
        const auto ask = [&](const SurfacePoint& at) {
          const RecordShapes* shapes = source->shapes();
          return !shapes ? session.query(at)
                 : guard ? query_guarded(session, *shapes, tracer, at, tests)
                         : query_extrapolating(session, *shapes, at);
        };
        glm::vec3 rounded = r.n;
        for (int axis = 0; axis < 3; ++axis) rounded[axis] = std::nextafter(rounded[axis], 2.0f);
        for (const glm::vec3& n : {r.n, rounded, glm::normalize(rounded)}) {
          const auto E = ask({r.p, n});
          ASSERT_TRUE(E.has_value());
          for (int c = 0; c < 3; ++c) ASSERT_NEAR((*E)[c], r.E[c], 1e-4f * r.E[c]);
        }
        ASSERT_FALSE(ask({r.p, -r.n}).has_value()) << "accuracy " << a;
        EXPECT_EQ(tests.rays, 0u);
      });
    }
}

// Guards against: radii, gradients and marks that explode as the distance to the next surface goes to 0. In the furnace
// what a point there should say is known.
TEST_P(HardRecords, EdgesAndCornersOfTheFurnaceAreAsBrightAsTheRest) {
  const RayTracer rays(make_scene("white_furnace"));
  const Bounds& bounds = rays.scene().bounds;
  const glm::vec3 centre = rays.scene().camera.eye;
  Tracer tracer(rays);
  PrimaryHits primary = primary_hits(rays, 8, 6);
  // Towards a corner, an edge and the middle of an edge, nearer and nearer; then the very same.
  for (std::size_t i = 0; i < primary.hits.size(); ++i) {
    const float share = i % 8 == 7 ? 0.0f : std::pow(0.1f, static_cast<float>(i % 8));
    glm::vec3 target = bounds.upper;
    target.y += share * (centre.y - bounds.upper.y);
    if (i / 8 % 2 == 1) target.x = centre.x;
    if (i / 8 >= 4) target.z += share * (centre.z - bounds.upper.z);
    const Hit hit = tracer.intersect(Ray{centre, kInfinity, target - centre});
    if (!hit.missed()) primary.hits[i] = hit;
  }
  // Records by virtual lights all err alike, by the same lights: they are told apart by seeds.
  const bool by_vpls = GetParam().by_vpls();
  for (const bool guard : guards()) {
    Level fine = level(guard);
    fine.gather_rays = 1024;
    fine.vpls = 256;
    Estimate of_records, of_pictures;
    for (fine.seed = 0; fine.seed < (by_vpls ? 128u : 1u); ++fine.seed) {
      const LevelRun made = run(rays, primary, fine);
      expect_an_image(made.indirect, "edges");
      of_pictures.add(mean_of(made.indirect) / (kRho * kRho));
      for (const Record& r : made.records) {
        EXPECT_TRUE(is_storable(r, bounds));
        of_records.add(r.E.x / (kPi * kRho));
        if (!by_vpls) {
          EXPECT_NEAR(r.E.x / (kPi * kRho), 1.0, 0.2);
        }
      }
    }
    const double error = by_vpls ? of_pictures.error() : of_records.error();
    std::printf("corner of the furnace: %.4f, standard error %.4f\n", of_pictures.mean(), error);
    EXPECT_NEAR(of_pictures.mean(), 1.0, (by_vpls ? 4.0 : 5.0) * error);
    EXPECT_LT(error, 0.02);
  }
}

// Guards against: floats whose range ends where two rooms differ by 40 orders of magnitude.
TEST_P(HardRecords, RoomsOfRadiance1em20And1e20KeepTheirLight) {
  Scene s;
  s.name = "dim_and_bright_rooms";
  for (const float L : {1e-20f, 1e20f}) {
    const float x = L < 1.0f ? -2.0f : 2.0f;
    const auto wall = s.add_material({.albedo = glm::vec3(0.5f), .emission = glm::vec3(0.5f * L)});
    s.meshes.push_back(box("room", {{x - 1, 0, -1}, {x + 1, 2, 1}}, wall, true));
  }
  s.camera = {.eye = {-2, 1, 0.9f}, .target = {-2, 0.5f, 0}, .up = {0, 1, 0}, .fov_y = 1.0f};
  const RayTracer rays(std::move(s));
  PrimaryHits primary = primary_hits(rays, 12, 12);
  for (std::size_t i = 0; i < primary.hits.size(); i += 2) {  // every other pixel looks into the bright room
    primary.hits[i].p.x += 4.0f;
    primary.hits[i].material = 1;
  }
  Level fine = level();
  fine.gather_rays = fine.vpls = 1024;
  const LevelRun made = run(rays, primary, fine);
  expect_an_image(made.indirect, "rooms");
  Estimate ratio[2];
  for (std::size_t i = 0; i < primary.hits.size(); ++i)
    ratio[i % 2].add(made.indirect.pixels[i].y / (0.5 * 0.5 * (i % 2 == 1 ? 1e-20 : 1e20)));
  EXPECT_NEAR(ratio[0].mean(), 1.0, 0.05);
  // Virtual lights go by power, and what the dim room has of them is left to chance.
  EXPECT_NEAR(ratio[1].mean(), GetParam().by_vpls() ? 0.5 : 1.0, GetParam().by_vpls() ? 0.55 : 0.05);
}

// Guards against: weighted sums of what many extrapolate that overflow, stagnate or, where rays of the guard wait for
// each other, lose some.
TEST_P(HardRecords, TenThousandOnOneSpotExtrapolateAsOneDoes) {
  if (!extrapolates(GetParam().level)) GTEST_SKIP() << "tests/caches_hard_cases_test.cpp has these";
  constexpr std::uint32_t kRecords = 10'000;
  const RayTracer rays(scaled_room(1.0f));
  ThreadCrew crew(rays, 1);
  Tracer tracer(rays);
  const Hit hit = facing({0, 0, 0}, {0, 1, 0});
  for (const bool guard : guards()) {
    PassSetup setup{rays, crew, 200, 100};
    setup.leak_guard = guard;
    setup.interpolation = GetParam().level;
    RecordShapes shapes = GetParam().by_vpls() ? make_shapes_of_vpls(setup) : make_shapes(setup);
    for (const float E : {kMaxIrradiance, 1.0f, 1e-30f}) {
      constexpr float kR = 1.0f;
      ListSession many{.bounds = rays.scene().bounds, .a = GetParam().reach() * setup.a};
      ListSession one = many;
      shapes.details.clear();
      for (std::uint32_t i = 0; i < kRecords; ++i) {
        const std::uint32_t id = shapes.details.draft(0);
        ASSERT_NE(id, RecordDetails::kNone);
        RecordDetail& detail = shapes.details[id];
        detail = {
            .gradients = {}, .major = {1, 0, 0}, .inverse_major = 4.0f / kR, .inverse_minor = 5.0f / kR};
        for (glm::vec3& g : detail.gradients.translational) g = {-0.5f * E / kR, 0, 0};
        for (glm::vec3& g : detail.gradients.rotational) g = {0, 0, 0.5f * E};
        if (guard) shapes.details.marks(id) = kMarkedEverywhere;
        const Record r{hit.p, hit.n, kR, Irradiance(E), id};
        ASSERT_EQ(many.insert(r), InsertResult::inserted);
        if (i == 0) {
          ASSERT_EQ(one.insert(r), InsertResult::inserted);
        }
        shapes.details.keep(0);
      }
      LeakTests tests;
      const auto ask = [&](ListSession& session, const SurfacePoint& x) {
        return guard ? query_guarded(session, shapes, tracer, x, tests)
                     : query_extrapolating(session, shapes, x);
      };
      for (const SurfacePoint& x :
           {SurfacePoint{hit.p, hit.n}, SurfacePoint{{0.1f * kR, 0, 0}, hit.n},
            SurfacePoint{{-0.1f * kR, 0, 0.02f * kR}, glm::normalize(glm::vec3(0.02f, 1, 0.01f))}}) {
        const auto whole = ask(many, x), alone = ask(one, x);
        ASSERT_TRUE(whole.has_value() && alone.has_value());
        ASSERT_TRUE(is_irradiance(*whole));
        // Sums of n terms of one sign err by at most n u of themselves, u = 2^-24; so does that of the weights.
        for (int c = 0; c < 3; ++c)
          EXPECT_NEAR((*whole)[c] / (*alone)[c], 1.0f, 2.0f * kRecords * 0x1p-24f) << E << " at " << x.p.x;
      }
      EXPECT_EQ(tests.rays, guard ? 2 * (kRecords + 1) : 0u);
      EXPECT_EQ(tests.stopped, 0u);
    }
  }
}

// Guards against: a trap that is off, in the thread of a test or in those that it starts, or stays off after a library
// was called; nobody would see the traps of all other tests find nothing.
TEST(HardScenesDeathTest, AnInvalidOperationEndsTheProgram) {
  if (!kCanTrapInvalid) GTEST_SKIP() << "this build cannot trap";
  const auto divide = [] {
    const volatile float zero = 0.0f;
    const volatile float nan = zero / zero;
    static_cast<void>(nan);
  };
  const auto compare = [] {
    const volatile float nan = std::numeric_limits<float>::quiet_NaN();
    const volatile bool less = nan < 1.0f;
    static_cast<void>(less);
  };
  const RayTracer rays(lit_plate());
  {
    const LibraryCall call;
    divide();
  }
  EXPECT_DEATH(divide(), "");
  EXPECT_DEATH(compare(), "");
  EXPECT_DEATH(ThreadCrew(rays, 2).run([&](unsigned, Tracer&) { divide(); }), "");
  Tracer tracer(rays);
  EXPECT_FALSE(tracer.intersect(Ray{{0, 1, 0}, kInfinity, {0, -1, 0}}).missed());
  EXPECT_DEATH(divide(), "");
}

}  // namespace
}  // namespace icbench
