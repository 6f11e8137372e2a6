// Estimators of irradiance held to closed forms.
//
// An estimator is run with many seeds until the standard error of its mean is below kError; its mean must then lie
// within four standard errors of the closed form. That this is sharp is part of the verdict: the same samples less or
// more one per cent must be refused. Bias, sqrt(MSE - variance) over the runs, is printed apart from deviation.
//
// Estimators of indirect light do not count lamps, so a plate lit by a far spot light is the emitter that they see.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "lambert.h"
#include "render/gather.h"
#include "render/path.h"
#include "render/transport.h"
#include "render/vpl.h"
#include "render/vpl_compensation.h"
#include "render/vpl_gather.h"
#include "render_support.h"
#include "scene/shapes.h"

namespace icbench {

inline constexpr double kError = 0.0015;   // of the closed form
inline constexpr double kRounding = 1e-5;  // of one that does not vary
inline constexpr float kInfinity = std::numeric_limits<float>::infinity();

// A point to judge at, in the open or on a surface.
struct Known {
  Hit at;
  double E;  // closed form, W/m^2
};

inline Hit facing(const glm::vec3& p, const glm::vec3& n) {
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

inline double by_light_samples(Tracer& tracer, const Hit& at, std::uint64_t seed, int samples) {
  Pcg32 random(hash_keys(seed, 1));
  double sum = 0.0;
  for (int i = 0; i < samples; ++i) {
    LightProposal proposal;
    if (propose_light(tracer.shared(), at, 0.0f, random, proposal) && !tracer.occluded(proposal.shadow))
      sum += proposal.E.y;
  }
  return sum / samples;
}

inline double by_path(Tracer& tracer, const Hit& at, Light light, std::uint64_t seed, int samples) {
  Pcg32 random(hash_keys(seed, 2));
  double sum = 0.0;
  for (int i = 0; i < samples; ++i) sum += sample_irradiance(tracer, at, light, random).y;
  return sum / samples;
}

inline double by_gather(Tracer& tracer, const Hit& at, std::uint64_t seed) {
  return gather(tracer, at, Strata::for_rays(256), hash_keys(seed, 3)).E.y;
}

struct VplSettings {
  std::uint32_t vpls;
  float clamp;
  std::uint32_t compensation;  // rays
};

inline void by_vpls(Tracer& tracer, std::span<const Known> points, const VplSettings& v, std::uint64_t seed,
                    std::span<double> E) {
  VplSet set(tracer.shared(), {v.vpls, seed});
  trace_all(set, tracer);
  for (std::size_t i = 0; i < E.size(); ++i)
    E[i] = gather_vpls(tracer, points[i].at, set.vpls(), v.clamp).y +
           compensate(tracer, points[i].at, set.vpls(), v.clamp, v.compensation, hash_keys(seed, i)).E.y;
}

inline void judge_direct(const std::string& scene, const RayTracer& rays, std::span<const Known> points,
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

inline void judge_indirect(const std::string& scene, const RayTracer& rays, std::span<const Known> points,
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
inline constexpr double kPlateL = 0.5 * 20.0 / kPi;

inline Scene lit_plate() {
  Scene s;
  s.name = "lit_plate";
  const auto white = s.add_material({.albedo = glm::vec3(0.5f)});
  s.meshes.push_back(quad("plate", {-1, 0, -1}, {0, 0, 2}, {2, 0, 0}, white));
  s.point_lights.push_back(
      {.p = {0, 100, 0}, .intensity = glm::vec3(2e5f), .cos_inner = 0.99985f, .cos_outer = 0.9998f});
  s.camera = {.eye = {0, 2, 2}, .target = {0, 0, 0}, .up = {0, 1, 0}, .fov_y = 1.0f};
  return s;
}

inline Known above_plate(const glm::vec3& p, const glm::vec3& n) {
  const Hit at = facing(p, n);
  return {at, lambert(at.p, at.n, rectangle(-1, 1, 0, -1, 1), kPlateL)};
}

// Beside the plate a wall so dark that it does not light it, which fills the picture.
inline constexpr float kWallAlbedo = 1e-3f;

inline Scene plate_and_wall() {
  Scene s = lit_plate();
  const auto dark = s.add_material({.albedo = glm::vec3(kWallAlbedo)});
  s.meshes.push_back(quad("wall", {-1, 0.05f, -1.05f}, {2, 0, 0}, {0, 1.5f, 0}, dark));
  s.camera = {.eye = {0, 0.8f, 3}, .target = {0, 0.8f, -1.05f}, .up = {0, 1, 0}, .fov_y = 0.3f};
  return s;
}

// Mean radiance that the wall reflects in a picture, W/(m^2 sr).
inline double radiance_of_wall(const PrimaryHits& primary) {
  double sum = 0.0;
  for (const Hit& hit : primary.hits) {
    EXPECT_TRUE(!hit.missed() && hit.n.z == 1.0f);
    sum += lambert(hit.p, hit.n, rectangle(-1, 1, 0, -1, 1), kPlateL) * kWallAlbedo / kPi;
  }
  return sum / static_cast<double>(primary.hits.size());
}

// A square lamp of radiance L that shines down.
inline void add_lamp(Scene& s, float side, float y, float L) {
  const auto glow = s.add_material({.emission = glm::vec3(L)});
  s.meshes.push_back(quad("lamp", {-0.5f * side, y, -0.5f * side}, {side, 0, 0}, {0, 0, side}, glow));
}

}  // namespace icbench
