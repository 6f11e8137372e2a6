// Every estimator of irradiance against closed forms, and the scenes that are hard on all of them.
//
// An estimator is run with many seeds until the standard error of its mean is below kError; its mean must then lie
// within four standard errors of the closed form. That this is sharp is part of the verdict: the same samples less or
// more one per cent must be refused. Bias, sqrt(MSE - variance) over the runs, is printed apart from deviation.
//
// Estimators of indirect light do not count lamps, so a plate lit by a far spot light is the emitter that they see.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <glm/geometric.hpp>
#include <iterator>
#include <limits>
#include <numeric>
#include <span>
#include <string>
#include <vector>

#include "any_cache.h"
#include "core/interpolation.h"
#include "render/gather.h"
#include "render/path.h"
#include "render/transport.h"
#include "render/vpl.h"
#include "render/vpl_gather.h"
#include "render_support.h"
#include "scene/registry.h"
#include "scene/shapes.h"

namespace icbench {
namespace {

constexpr double kError = 0.0015;   // of the closed form
constexpr double kRounding = 1e-5;  // of one that does not vary
constexpr float kInfinity = std::numeric_limits<float>::infinity();

using Polygon3 = std::vector<glm::dvec3>;

// Irradiance at p, facing n, of a plane polygon above the horizon that sends radiance L (Lambert 1760, Photometria;
// the contour integral): L/2 sum of angle_i (unit normal of edge i and p) . n.
double lambert(const glm::dvec3& p, const glm::dvec3& n, const Polygon3& polygon, double L) {
  double E = 0.0;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const glm::dvec3 a = glm::normalize(polygon[i] - p),
                     b = glm::normalize(polygon[(i + 1) % polygon.size()] - p), c = glm::cross(a, b);
    E += std::atan2(glm::length(c), glm::dot(a, b)) * glm::dot(glm::normalize(c), n);
  }
  return 0.5 * L * std::abs(E);
}

// The same of a convex body: its triangles that face p do not hide each other.
double lambert(const glm::dvec3& p, const glm::dvec3& n, const Mesh& body, double L) {
  double E = 0.0;
  for (const glm::uvec3& t : body.triangles) {
    const Polygon3 corners = {body.positions[t.x], body.positions[t.y], body.positions[t.z]};
    const glm::dvec3 front = glm::cross(corners[1] - corners[0], corners[2] - corners[0]);
    if (glm::dot(front, p - corners[0]) > 0.0) E += lambert(p, n, corners, L);
  }
  return E;
}

Polygon3 rectangle(double x0, double x1, double y, double z0, double z1) {
  return {{x0, y, z0}, {x1, y, z0}, {x1, y, z1}, {x0, y, z1}};
}

// A point to judge at, in the open or on a surface.
struct Known {
  Hit at;
  double E;  // closed form, W/m^2
};

Hit facing(const glm::vec3& p, const glm::vec3& n) {
  Hit x;
  x.p = p;
  x.n = x.ng = glm::normalize(n);
  return x;
}

// An estimate with what it should be.
class Judged {
 public:
  explicit Judged(double exact) : exact_(exact) {}

  void add(double E) {
    of_.add(E / exact_);
    squares_ += (E / exact_ - 1.0) * (E / exact_ - 1.0);
    ++runs_;
  }
  double error() const { return of_.error(); }
  double variance() const { return of_.error() * of_.error() * (runs_ - 1.0); }
  double bias() const { return std::sqrt(std::max(0.0, squares_ / runs_ - variance())); }

  // Whether it agrees with the closed form, were it `factor` times as large.
  bool agrees(double factor = 1.0) const {
    return std::abs(factor * of_.mean() - 1.0) <= kRounding + 4.0 * factor * of_.error();
  }

  void print(const std::string& name) const {
    std::printf(
        "%-44s %.5g W/m^2: bias %.3f %%, standard error %.3f %%, deviation of a run %.2f %% in %.0f\n",
        name.c_str(), exact_, 100.0 * bias(), 100.0 * error(), 100.0 * std::sqrt(variance()), runs_);
  }

 private:
  Estimate of_;
  double exact_, squares_ = 0.0, runs_ = 0.0;
};

// run(seed, E) makes an independent estimate for every point.
template <class F>
void judge(const std::string& name, std::span<const Known> points, double error, F&& run) {
  constexpr std::uint64_t kLeastRuns = 32, kMostRuns = 100'000;
  std::vector<Judged> judged;
  for (const Known& known : points) judged.emplace_back(known.E);
  std::vector<double> E(points.size());
  const auto is_open = [&] {
    return std::any_of(judged.begin(), judged.end(), [&](const Judged& j) { return j.error() > error; });
  };
  for (std::uint64_t seed = 0; seed < kLeastRuns || (seed < kMostRuns && is_open()); ++seed) {
    run(seed, std::span<double>(E));
    for (std::size_t i = 0; i < E.size(); ++i) judged[i].add(E[i]);
  }
  for (std::size_t i = 0; i < judged.size(); ++i) {
    const std::string at = points.size() == 1 ? name : name + ", point " + std::to_string(i);
    judged[i].print(at);
    EXPECT_LE(judged[i].error(), error) << at << ": too few samples to say anything";
    EXPECT_TRUE(judged[i].agrees()) << at;
    EXPECT_FALSE(judged[i].agrees(0.99) || judged[i].agrees(1.01)) << at << ": one per cent would pass";
  }
}

// One run of each estimator.

double by_light_samples(Tracer& tracer, const Hit& at, std::uint64_t seed, int samples) {
  Pcg32 random(hash_keys(seed, 1));
  double sum = 0.0;
  for (int i = 0; i < samples; ++i) {
    LightProposal proposal;
    if (propose_light(tracer.shared(), at, 0.0f, random, proposal) && !tracer.occluded(proposal.shadow))
      sum += proposal.E.y;
  }
  return sum / samples;
}

double by_path(Tracer& tracer, const Hit& at, Light light, std::uint64_t seed, int samples) {
  Pcg32 random(hash_keys(seed, 2));
  double sum = 0.0;
  for (int i = 0; i < samples; ++i) sum += sample_irradiance(tracer, at, light, random).y;
  return sum / samples;
}

double by_gather(Tracer& tracer, const Hit& at, std::uint64_t seed) {
  return gather(tracer, at, Strata::for_rays(256), hash_keys(seed, 3)).E.y;
}

struct VplSettings {
  std::uint32_t vpls;
  float clamp;
  std::uint32_t compensation;  // rays
};

void by_vpls(Tracer& tracer, std::span<const Known> points, const VplSettings& v, std::uint64_t seed,
             std::span<double> E) {
  VplSet set(tracer.shared(), {v.vpls, seed});
  trace_all(set, tracer);
  for (std::size_t i = 0; i < E.size(); ++i)
    E[i] = gather_vpls(tracer, points[i].at, set.vpls(), v.clamp).y +
           compensate(tracer, points[i].at, set.vpls(), v.clamp, v.compensation, hash_keys(seed, i)).E.y;
}

void judge_direct(const std::string& scene, const RayTracer& rays, std::span<const Known> points,
                  double error = kError) {
  Tracer tracer(rays);
  judge(scene + ", light samples", points, error, [&](std::uint64_t seed, std::span<double> E) {
    for (std::size_t i = 0; i < E.size(); ++i) E[i] = by_light_samples(tracer, points[i].at, seed, 1000);
  });
  judge(scene + ", path's direct light", points, error, [&](std::uint64_t seed, std::span<double> E) {
    for (std::size_t i = 0; i < E.size(); ++i)
      E[i] = by_path(tracer, points[i].at, Light::direct, seed, 1000);
  });
}

void judge_indirect(const std::string& scene, const RayTracer& rays, std::span<const Known> points,
                    std::span<const VplSettings> vpls, double error = kError) {
  Tracer tracer(rays);
  judge(scene + ", hemisphere gather", points, error, [&](std::uint64_t seed, std::span<double> E) {
    for (std::size_t i = 0; i < E.size(); ++i) E[i] = by_gather(tracer, points[i].at, seed);
  });
  judge(scene + ", path's indirect light", points, error, [&](std::uint64_t seed, std::span<double> E) {
    for (std::size_t i = 0; i < E.size(); ++i)
      E[i] = by_path(tracer, points[i].at, Light::indirect, seed, 1000);
  });
  for (const VplSettings& v : vpls)
    judge(scene + ", VPLs clamped at " + std::to_string(v.clamp), points, error,
          [&](std::uint64_t seed, std::span<double> E) { by_vpls(tracer, points, v, seed, E); });
}

// A plate of 2 m side and albedo 0.5 at the height 0, lit evenly within 0.03 % by a spot light 100 m above it: to what
// is above, it is a square of radiance kPlateL. Points that look at it stand in the open.
constexpr double kPlateL = 0.5 * 20.0 / kPi;

Scene lit_plate() {
  Scene s;
  s.name = "lit_plate";
  const auto white = s.add_material({.albedo = glm::vec3(0.5f)});
  s.meshes.push_back(quad("plate", {-1, 0, -1}, {0, 0, 2}, {2, 0, 0}, white));
  s.point_lights.push_back(
      {.p = {0, 100, 0}, .intensity = glm::vec3(2e5f), .cos_inner = 0.99985f, .cos_outer = 0.9998f});
  s.camera = {.eye = {0, 2, 2}, .target = {0, 0, 0}, .up = {0, 1, 0}, .fov_y = 1.0f};
  return s;
}

Known above_plate(const glm::vec3& p, const glm::vec3& n) {
  const Hit at = facing(p, n);
  return {at, lambert(at.p, at.n, rectangle(-1, 1, 0, -1, 1), kPlateL)};
}

// A square lamp of radiance L that shines down.
void add_lamp(Scene& s, float side, float y, float L) {
  const auto glow = s.add_material({.emission = glm::vec3(L)});
  s.meshes.push_back(quad("lamp", {-0.5f * side, y, -0.5f * side}, {side, 0, 0}, {0, 0, side}, glow));
}

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

// That path and cache keep it within a tenth of a per cent is in render_path_test.cpp and render_cached_test.cpp; VPLs in
// it are in render_vpl_test.cpp.
TEST(ClosedForms, IndirectLightInAFurnaceIsPiTimesItsAlbedo) {
  const RayTracer rays(make_scene("white_furnace"));
  const Known known[] = {{primary_hits(rays, 3, 3).hits[4], kPi * kRho}};
  judge_indirect("white_furnace", rays, known, {});
}

// Records are made and asked for as a renderer does, in the light of the plate. Beside each cache goes a twin whose
// records lie at the same places and hold the closed form, so that its error is interpolation's alone.
TEST(ClosedForms, RecordsAreUnbiasedAndInterpolationErrsWithinTheAccuracy) {
  constexpr int kSide = 20, kRuns = 40;
  const RayTracer rays(lit_plate());
  Tracer tracer(rays);
  const Bounds bounds{{-2, -1, -2}, {2, 1, 2}};
  std::vector<Known> points;
  for (int i = 0; i < kSide * kSide; ++i) {
    const int k = i * 87 % (kSide * kSide);  // all over the place, not row by row
    points.push_back(above_plate(
        {0.1f * static_cast<float>(k % kSide) - 0.95f, 0.6f, 0.1f * static_cast<float>(k / kSide) - 0.95f},
        {0, -1, 0}));
  }
  for (const AnyCache::Maker& maker : registered_caches()) {
    const std::string name(maker.traits.name);
    if (name != "wait_free" && name != "packed_wait_free") continue;
    double errors[2];
    for (const bool fine : {false, true}) {
      const float a = fine ? 0.1f : 0.4f;
      Judged records(1.0);
      Estimate interpolation, whole;
      double interpolation_squares = 0.0, noise_squares = 0.0, asked = 0.0;
      for (std::uint64_t seed = 0; seed < kRuns; ++seed) {
        const CacheConfig config{.bounds = bounds, .a_max = a, .a = a, .capacity = 1024};
        AnyCache cache(maker, config), twin(maker, config);
        AnyCache::Session session = cache.open_session(0), exact = twin.open_session(0);
        std::uint32_t id = 0;
        for (const Known& known : points) {
          const SurfacePoint x{known.at.p, known.at.n};
          if (session.query(x)) continue;
          const GatherResult g = gather(tracer, known.at, Strata::for_rays(256), hash_keys(seed, id));
          records.add(g.E.y / known.E);
          const float R = RadiusLimits{0.05f, 2.0f}.clamp(g.R);
          ASSERT_EQ(session.insert({x.p, x.n, R, g.E, id}), InsertResult::inserted);
          ASSERT_EQ(exact.insert({x.p, x.n, R, Irradiance(static_cast<float>(known.E)), id++}),
                    InsertResult::inserted);
        }
        for (const Known& known : points) {
          const SurfacePoint x{known.at.p, known.at.n};
          const double E = session.query(x).value().y / known.E, of_twin = exact.query(x).value().y / known.E;
          interpolation.add(of_twin - 1.0);
          whole.add(E - 1.0);
          interpolation_squares += (of_twin - 1.0) * (of_twin - 1.0);
          noise_squares += (E - of_twin) * (E - of_twin);
          ++asked;
        }
      }
      const std::string at = name + (fine ? ", a = 0.1" : ", a = 0.4");
      records.print(at + ", inserted records");
      errors[fine] = std::sqrt(interpolation_squares / asked);
      std::printf(
          "%-44s interpolation: bias %.3f %%, RMS %.3f %%; records' noise left: RMS %.3f %%; whole bias %.3f "
          "%%\n",
          at.c_str(), 100.0 * interpolation.mean(), 100.0 * errors[fine],
          100.0 * std::sqrt(noise_squares / asked), 100.0 * whole.mean());
      EXPECT_TRUE(records.agrees()) << at;
      EXPECT_LE(records.error(), 0.0025) << at;
      EXPECT_LT(errors[fine], a) << at << ": more than the accuracy allows";
      EXPECT_GT(errors[fine], 1e-5) << at << ": nothing was interpolated";
    }
    EXPECT_LT(errors[1], 0.5 * errors[0]) << name << ": a finer accuracy does not help";
  }
}

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

// Guards against: shadow rays that miss a narrow gap or slip past its edges.
TEST(HardScenes, ALampBehindASlitShinesAsFarAsItIsSeen) {
  constexpr float kHalf = 0.05f;  // of the slit's width
  Scene s;
  s.name = "slit";
  add_lamp(s, 1.0f, 2.0f, 10.0f);
  const auto black = s.add_material({});
  s.meshes.push_back(quad("left", {-4, 1, -4}, {0, 0, 8}, {4.0f - kHalf, 0, 0}, black));
  s.meshes.push_back(quad("right", {kHalf, 1, -4}, {0, 0, 8}, {4.0f - kHalf, 0, 0}, black));
  const RayTracer rays(std::move(s));
  // From x at height 0 the gap at height 1 shows what lies between 2 (-+kHalf) - x at height 2.
  const glm::dvec3 p(0.35, 0, 0.3);
  const double low = std::max(-0.5, -2.0 * kHalf - p.x), high = std::min(0.5, 2.0 * kHalf - p.x);
  const Known point[] = {
      {facing(p, {0, 1, 0}), lambert(p, {0, 1, 0}, rectangle(low, high, 2, -0.5, 0.5), 10.0)}};
  judge_direct("slit", rays, point);
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

// Guards against: lengths that do not scale with the scene.
TEST(HardScenes, AScaledSceneGivesTheSamePicture) {
  const auto room = [](float scale) {
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
  };
  constexpr int kSize = 24;
  for (const char* name : {"path", "instant_gi"}) {
    const RayTracer one_rays(room(1.0f));
    const Image one = picture(one_rays, find_integrator(name), kSize, 4, {.seed = 3});
    for (const float scale : {1e-4f, 1e4f}) {
      const RayTracer rays(room(scale));
      const Image other = picture(rays, find_integrator(name), kSize, 4, {.seed = 3});
      int alike = 0;
      double mean_one = 0.0, mean_other = 0.0;
      for (std::size_t i = 0; i < one.pixels.size(); ++i) {
        const float difference = glm::distance(one.pixels[i], other.pixels[i]);
        alike += difference <= 1e-3f * glm::length(one.pixels[i]);
        mean_one += one.pixels[i].y;
        mean_other += other.pixels[i].y;
      }
      std::printf("%s, scaled by %g: %d of %d pixels alike, means differ by %.2g\n", name,
                  static_cast<double>(scale), alike, kSize * kSize, mean_other / mean_one - 1.0);
      EXPECT_GE(alike, 0.97 * kSize * kSize)
          << name << ' ' << scale;  // a ray in a hundred may take another side
      EXPECT_NEAR(mean_other / mean_one, 1.0, 0.003) << name << ' ' << scale;
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
      EXPECT_NEAR(sum[c] / E[c], 1.0, 1e-4);  // 6,250 a lane, each rounded by 6e-8 at most
    }
  }
}

}  // namespace
}  // namespace icbench
