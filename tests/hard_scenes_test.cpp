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

// Guards against: float sums that stagnate.
TEST(HardScenes, SumsOverAHundredThousandVplsAreThoseOfDoubles) {
  constexpr std::size_t kVpls = 100'000;
  const Hit at = facing({0, 0, 0}, {0, 1, 0});
  for (const bool equal : {true, false}) {
    VplArrays vpls(kVpls);
    std::vector<std::uint64_t> bits(vpls.words());
    Pcg32 random(7);
    glm::dvec3 E(0.0);
    for (std::size_t i = 0; i < kVpls; ++i) {
      const float u = random.uniform(), v = random.uniform();
      const float size = equal ? 1.0f : std::exp(20.0f * random.uniform() - 10.0f);
      const glm::vec3 d = equal ? glm::vec3(0, 1, 0) : cosine_direction(Basis(at.n), 0.9f * u, v);
      const Vpl vpl{(1.0f + v) * d, -d, size * glm::vec3(1.0f, 0.1f, 0.003f)};
      vpls.set(i, vpl);
      bits[i / 64] |= std::uint64_t{1} << i % 64;
      const glm::dvec3 to(vpl.p);
      const double d2 = glm::dot(to, to);
      E += std::min(to.y * -glm::dot(to, glm::dvec3(vpl.n)) / (d2 * d2), 0.5) / kPi * glm::dvec3(vpl.flux);
    }
    const Irradiance sum = irradiance_from(bits, at, vpls, 0.5f);
    for (int c = 0; c < 3; ++c) {
      std::printf("100,000 VPLs, %s: float over double less 1: %.2g\n", equal ? "equal" : "unequal",
                  sum[c] / E[c] - 1.0);
      // Sums of n numbers that are not negative err by at most n u of themselves, u = 2^-24 (Higham 2002, 4.2): here
      // 6,250 in each of 16 lanes, four more for these, and some ten roundings a term. Roundings cancel for the most
      // part.
      constexpr double kBound = (kVpls / 16 + 4 + 10) / 16'777'216.0;
      static_assert(kBound < 4e-4);
      EXPECT_NEAR(sum[c] / E[c], 1.0, kBound);
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

const HardScene kHardScenes[] = {{"speck", speck, 0.1},
                                 {"slit", slit, 0.25},
                                 {"grazing", grazing, 0.1},
                                 {"corner", corner_of_walls, 0.1},
                                 {"needles", needles, 0.1},
                                 {"hall", hall, 0.1},
                                 {"dim_and_bright", dim_and_bright, -1.0},
                                 {"denormal_light", denormal_light, 0.1},
                                 {"denormal_lamp", denormal_lamp, -1.0},
                                 {"tiny", [] { return scaled_room(1e-4f); }, 0.1},
                                 {"huge", [] { return scaled_room(1e4f); }, 0.1},
                                 {"far_file", [] { return import_room(1e6); }, 0.1},
                                 {"dark", dark, 0.0}};

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

// At each level of interpolation.
class HardLevels : public ::testing::TestWithParam<InterpolationEntry> {
 protected:
  static Level level(bool leak_guard = false) {
    return {.level = GetParam().level, .leak_guard = leak_guard};
  }
};
INSTANTIATE_TEST_SUITE_P(Levels, HardLevels, ::testing::ValuesIn(kInterpolations), level_name);

// Guards against: any NaN, infinity or negative value in a cached picture, and light that gets lost or comes about.
TEST_P(HardLevels, CachedPicturesAreImagesOfTheRightBrightness) {
  constexpr int kSize = 14;
  constexpr std::uint32_t kRays = 256;
  for (const HardScene& hard : kHardScenes) {
    const RayTracer rays(hard.make());
    const PrimaryHits primary = primary_hits(rays, kSize, kSize);
    Image anew = blank(kSize, kSize);
    Tracer tracer(rays);
    for (std::size_t i = 0; i < anew.pixels.size(); ++i) {
      const Hit& hit = primary.hits[i];
      anew.pixels[i] = reflects(rays, hit)
                           ? reflected_radiance(rays, hit, gather(tracer, hit, Strata::for_rays(kRays), i).E)
                           : glm::vec3(0.0f);
    }
    for (const bool guard : {false, true}) {
      const std::string what = std::string(hard.name) + (guard ? ", guarded" : "");
      Level fine = level(guard);
      fine.gather_rays = kRays;
      const LevelRun made = run_level(rays, primary, fine);
      expect_an_image(made.indirect, what);
      EXPECT_EQ(made.use.rejected, 0u) << what;
      if (hard.tolerance > 0.0) {
        EXPECT_NEAR(mean_of(made.indirect) / mean_of(anew), 1.0, hard.tolerance) << what;
      } else if (hard.tolerance == 0.0) {
        EXPECT_EQ(mean_of(made.indirect), 0.0) << what;
      }
    }
    if (!is_for_vpls(GetParam().level)) continue;
    for (const MakeSource make : {make_instant_caching, make_temporal_instant_caching}) {
      const LevelRun made = run_level(rays, primary, level(), make);
      expect_an_image(made.indirect, std::string(hard.name) + ", by VPLs");
      EXPECT_EQ(made.use.rejected, 0u) << hard.name;
    }
  }
}

// Guards against: radii and gradients whose unit is not that of the scene.
TEST_P(HardLevels, AScaledSceneGivesTheSamePicture) {
  constexpr int kSize = 20;
  const RayTracer rays(scaled_room(1.0f));
  const LevelRun one = run_level(rays, primary_hits(rays, kSize, kSize), level());
  for (const float scale : {1e-4f, 1e4f}) {
    const RayTracer scaled(scaled_room(scale));
    const LevelRun other = run_level(scaled, primary_hits(scaled, kSize, kSize), level());
    expect_alike(one.indirect, other.indirect, 0.1, "scaled by " + std::to_string(scale));
  }
}

// Guards against: coordinates of a file that lose their places as they become floats.
TEST_P(HardLevels, AFileAMillionMetresAwayGivesTheSamePicture) {
  constexpr int kSize = 20;
  const RayTracer near(import_room(0.0)), far(import_room(1e6));
  const LevelRun one = run_level(near, primary_hits(near, kSize, kSize), level());
  const LevelRun other = run_level(far, primary_hits(far, kSize, kSize), level());
  expect_alike(one.indirect, other.indirect, 0.1, "moved by 1e6 m");
}

// Guards against: offsets as wide as a gap, which carry rays through what lies above it.
TEST_P(HardLevels, UnderARugAMillimetreAboveTheFloorOfAHallItIsDark) {
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
    const Image made = run_level(rays, primary, level()).indirect;
    expect_an_image(made, "rug");
    brightness[beside] = mean_of(made);
  }
  EXPECT_LT(brightness[false], 1e-4 * brightness[true]);
}

// Guards against: light that records carry through a wall which stands between the camera and all light.
TEST_P(HardLevels, BehindAWallEveryPixelIsBlack) {
  Scene s = closed_room(2.0f);
  s.meshes.push_back(quad("wall", {-0.1f, -0.1f, 1.0f}, {2.2f, 0, 0}, {0, 2.2f, 0}, 0));
  add_lamp_at(s, {0.5f, 1.9f, 0.2f}, 0.7f, 1e6f);
  const RayTracer rays(std::move(s));
  const PrimaryHits primary = primary_hits(rays, 14, 14);
  for (const bool guard : {false, true})
    for (const glm::vec3& L : run_level(rays, primary, level(guard)).indirect.pixels)
      ASSERT_EQ(L, glm::vec3(0.0f));
}

// Guards against: records that are not valid where they were made, or whose answer there is not their own irradiance;
// weights that jump where normals are equal, equal but for rounding, or opposite.
TEST_P(HardLevels, ARecordAnswersAtItsOwnPointWhateverRoundingDoesToTheNormal) {
  const RayTracer rays(scaled_room(1.0f));
  ThreadCrew crew(rays, 1);
  const PrimaryHits primary = primary_hits(rays, 10, 10);
  for (const bool guard : {false, true}) {
    PassSetup setup{rays, crew, 10, 10};
    setup.gather_rays = 64;
    setup.interpolation = GetParam().level;
    setup.leak_guard = guard;
    const auto source = make_irradiance_cache(setup);
    source->begin_frame({}, crew);
    Tracer tracer(rays);
    for_each_visible({0, 0, 10, 10}, primary, [&](const Visible& x) {
      if (!reflects(rays, x.hit)) return;
      ListSession session{.bounds = rays.scene().bounds, .a = search_reach(GetParam().level) * setup.a};
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
      ASSERT_FALSE(ask({r.p, -r.n}).has_value());
      EXPECT_EQ(tests.rays, 0u);
    });
  }
}

// Guards against: radii, gradients and marks that explode as the distance to the next surface goes to 0. In the furnace
// what a point there should say is known.
TEST_P(HardLevels, EdgesAndCornersOfTheFurnaceAreAsBrightAsTheRest) {
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
  for (const bool guard : {false, true}) {
    Level fine = level(guard);
    fine.gather_rays = 1024;
    const LevelRun made = run_level(rays, primary, fine);
    Estimate records;
    for (const Record& r : made.records) {
      EXPECT_TRUE(is_storable(r, bounds));
      EXPECT_NEAR(r.E.x / (kPi * kRho), 1.0, 0.2);
      records.add(r.E.x / (kPi * kRho));
    }
    expect_an_image(made.indirect, "edges");
    EXPECT_NEAR(mean_of(made.indirect) / (kRho * kRho), 1.0, 5.0 * records.error());
    EXPECT_LT(records.error(), 0.02);
  }
}

// Guards against: floats whose range ends where two rooms differ by 40 orders of magnitude.
TEST_P(HardLevels, RoomsOfRadiance1em20And1e20KeepTheirLight) {
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
  fine.gather_rays = 1024;
  const LevelRun made = run_level(rays, primary, fine);
  expect_an_image(made.indirect, "rooms");
  Estimate ratio[2];
  for (std::size_t i = 0; i < primary.hits.size(); ++i)
    ratio[i % 2].add(made.indirect.pixels[i].y / (0.5 * 0.5 * (i % 2 == 1 ? 1e-20 : 1e20)));
  for (const Estimate& room : ratio) EXPECT_NEAR(room.mean(), 1.0, 0.05);
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
