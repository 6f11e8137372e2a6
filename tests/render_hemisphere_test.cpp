// Gradients and Hessians of a hemisphere of samples, against finite differences of closed forms, and the regions that
// follow from them.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <functional>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <glm/vec2.hpp>
#include <limits>
#include <numbers>
#include <string>

#include "core/random.h"
#include "judged_estimates.h"
#include "lambert.h"
#include "render/extrapolation.h"
#include "render/hemisphere.h"
#include "render/radiance_smoother.h"
#include "scene/registry.h"

namespace icbench {
namespace {

using Vec = glm::dvec3;

// A lit rectangle in the plane z = height, radiance 1; the rest of that plane is black.
struct Rectangle {
  double x0, x1, y0, y1, height;

  bool holds(double x, double y) const { return x >= x0 && x <= x1 && y >= y0 && y <= y1; }
};

// A black half-plane x < edge at z = height that hides what is above it.
struct Screen {
  double edge = -std::numeric_limits<double>::infinity(), height = 1.0;
};

// Of what the screen leaves of the rectangle: the screen's shadow on the rectangle's plane has a straight edge.
double irradiance(const Rectangle& r, const Screen& s, const Vec& p, const Vec& n = {0, 0, 1}) {
  double x0 = r.x0;
  if (std::isfinite(s.edge)) {
    const double shadow = p.x + (s.edge - p.x) * (r.height - p.z) / (s.height - p.z);
    x0 = std::clamp(shadow, r.x0, r.x1);
  }
  return lambert(p, n,
                 {{x0, r.y0, r.height}, {r.x1, r.y0, r.height}, {r.x1, r.y1, r.height}, {x0, r.y1, r.height}},
                 1.0);
}

/// A hemisphere around n whose sample in direction d is sample_of(d), a direction in each cell.
template <class SampleOf>
Hemisphere hemisphere_around(const glm::vec3& n, Strata strata, SampleOf&& sample_of) {
  Hemisphere out;
  out.strata = strata;
  out.basis = Basis(n);
  Pcg32 random(7);
  for (std::uint32_t m = 0; m < strata.elevations; ++m)
    for (std::uint32_t k = 0; k < strata.azimuths; ++k) {
      const float u = (static_cast<float>(m) + random.uniform()) / static_cast<float>(strata.elevations);
      const float v = (static_cast<float>(k) + random.uniform()) / static_cast<float>(strata.azimuths);
      out.samples.push_back(sample_of(cosine_direction(out.basis, std::min(u, 0.9999f), v)));
    }
  return out;
}

Hemisphere seen_from_origin(const Rectangle& r, const Screen& screen, Strata strata) {
  return hemisphere_around({0, 0, 1}, strata, [&](const glm::vec3& d) -> HemisphereSample {
    const double x_at_screen = d.x / d.z * screen.height;
    const bool hidden = x_at_screen < screen.edge;
    const double t = (hidden ? screen.height : r.height) / d.z;
    const bool lit = !hidden && r.holds(t * d.x, t * d.y);
    return {d, static_cast<float>(t), glm::vec3(lit ? 1.0f : 0.0f), {0, 0, -1}};
  });
}

constexpr double kStep = 1e-3;

glm::dvec2 translated(const Rectangle& r, const Screen& s) {
  const auto slope = [&](const Vec& h) { return (irradiance(r, s, h) - irradiance(r, s, -h)) / (2 * kStep); };
  return {slope({kStep, 0, 0}), slope({0, kStep, 0})};
}

glm::dmat2 bent(const Rectangle& r, const Screen& s) {
  const auto at = [&](double x, double y) { return irradiance(r, s, {x, y, 0}); };
  const double h = kStep, E = at(0, 0);
  const double xx = (at(h, 0) - 2 * E + at(-h, 0)) / (h * h), yy = (at(0, h) - 2 * E + at(0, -h)) / (h * h);
  const double xy = (at(h, h) - at(h, -h) - at(-h, h) + at(-h, -h)) / (4 * h * h);
  return {xx, xy, xy, yy};
}

constexpr Rectangle kLamp{0.3, 1.1, -0.4, 0.6, 1.5};
constexpr Strata kFine{96, 300};

TEST(RenderHemisphere, TranslationalGradient) {
  for (const Screen& screen : {Screen{}, Screen{0.25, 0.75}}) {
    const auto seen = seen_from_origin(kLamp, screen, kFine);
    const IrradianceGradients g = gradients_of(seen, 1e-4f);
    const glm::dvec2 exact = translated(kLamp, screen);
    EXPECT_NEAR(g.translational[0].x, exact.x, 0.05 * glm::length(exact));
    EXPECT_NEAR(g.translational[0].y, exact.y, 0.05 * glm::length(exact));
    EXPECT_EQ(g.translational[0].z, 0.0f);
  }
}

TEST(RenderHemisphere, RotationalGradient) {
  const IrradianceGradients g = gradients_of(seen_from_origin(kLamp, {}, kFine), 1e-4f);
  for (int axis = 0; axis < 2; ++axis) {
    Vec w(0);
    w[axis] = kStep;
    const Vec n(0, 0, 1);
    const double exact = (irradiance(kLamp, {}, Vec(0), n + glm::cross(w, n)) -
                          irradiance(kLamp, {}, Vec(0), n - glm::cross(w, n))) /
                         (2 * kStep);
    EXPECT_NEAR(g.rotational[1][axis], exact, 0.02) << axis;
  }
}

TEST(RenderHemisphere, OcclusionHessian) {
  for (const Screen& screen : {Screen{}, Screen{0.25, 0.75}}) {
    const glm::mat2 H = occlusion_hessian(seen_from_origin(kLamp, screen, kFine), 1e-4f);
    const glm::dmat2 exact = bent(kLamp, screen);
    const double size = std::hypot(exact[0][0], exact[1][1], exact[0][1]);
    EXPECT_NEAR(H[0][0], exact[0][0], 0.15 * size);
    EXPECT_NEAR(H[1][1], exact[1][1], 0.15 * size);
    EXPECT_NEAR(H[0][1], exact[0][1], 0.15 * size);
    EXPECT_NEAR(H[0][1], H[1][0], 1e-4 * size);
  }
}

// Guards against: a speck whose light is taken for that of all around it. A patch sends what its farthest corner does,
// the cap around the normal what the farthest of the first ring does.
TEST(RenderHemisphere, WhatIsNearIsSeenBeforeTheRestAndNotThroughIt) {
  constexpr Strata kCells{6, 20};
  const Hemisphere even = seen_from_origin({-1e6, 1e6, -1e6, 1e6, 1.5}, {}, kCells);
  const auto size_with = [&](std::size_t cell, float farther) {
    Hemisphere seen = even;
    seen.samples[cell].t *= farther;
    seen.samples[cell].L = glm::vec3(5.0f);
    return magnitudes_of(occlusion_hessian(seen, 1e-4f)).large;
  };
  for (std::size_t cell = 0; cell < even.samples.size(); ++cell) {
    EXPECT_EQ(size_with(cell, 0.01f), 0.0f) << cell;
    EXPECT_GT(size_with(cell, 100.0f), 0.0f) << cell;
  }
}

// Guards against: a rule or a limit of the regions that is not what extrapolation.h says.
TEST(RenderHemisphere, EllipsesFollowTheRootOfTheHessianAndEndAtTheirLimits) {
  const Hemisphere seen = seen_from_origin(kLamp, {0.25, 0.75}, kFine);
  const Bounds bounds{glm::vec3(-1.0f), glm::vec3(1.0f)};
  const auto shaper_of = [&](Interpolation level) {
    RecordShaper shaper(level, 0.2f, bounds, RadiusLimits::for_scene(bounds, 0.01f, 0.2f), 10);
    shaper.look_from({.eye = {0, 0, 10}, .target = {0, 0, 0}, .up = {0, 1, 0}, .fov_y = 1.0f});
    return shaper;
  };
  // Of the smaller axis, metres; no gradient.
  const auto reach = [&](const RecordShaper& shaper, float mean, float E) {
    RecordDetail detail;
    const float R = shaper.ellipse(glm::vec3(0.0f), seen, mean, glm::vec3(E), detail);
    EXPECT_NEAR(shaper.reach(R) * detail.inverse_major, kOverlap, 1e-4f);
    const float longest = shaper.level() == Interpolation::occlusion_hessian ? 6.0f : 2.0f;
    EXPECT_LE(detail.inverse_minor, 1.0001f * longest * detail.inverse_major);
    return 1.0f / detail.inverse_minor;
  };
  constexpr float kFar = std::numeric_limits<float>::infinity();
  const float lit = near_surfaces(seen, 1e-4f).distance_of_light;
  const RecordShaper occlusion = shaper_of(Interpolation::occlusion_hessian);
  const RecordShaper geometry = shaper_of(Interpolation::geometric_hessian);
  EXPECT_NEAR(reach(occlusion, kFar, 1.0f) / reach(occlusion, kFar, 1.0f / 64.0f), 2.0f, 1e-3f);
  EXPECT_FLOAT_EQ(reach(geometry, kFar, 1.0f), reach(geometry, kFar, 1.0f / 16.0f))
      << "no matter how much light";
  EXPECT_NEAR(reach(occlusion, 0.0025f / lit, 1.0f), 3.0f * 0.2f * 0.05f, 1e-6f);
  EXPECT_NEAR(reach(occlusion, 0.0f, 1.0f), 0.005f * 0.2f * 2.0f * std::sqrt(3.0f), 1e-6f);
  EXPECT_FLOAT_EQ(reach(geometry, 0.05f, 1.0f), reach(geometry, kFar, 1.0f));
}

TEST(RenderHemisphere, NearSurfacesFaceAcrossWhatGoesOnAlongItself) {
  const Hemisphere seen = {
      .strata = {1, 4},
      .basis = Basis(glm::vec3(0, 0, 1)),
      .samples = {{{1, 0, 0}, 0.5f, glm::vec3(3.0f), {-1, 0, 0}},
                  {{-1, 0, 0}, 0.25f, glm::vec3(0.0f), {0.6f, 0, 0.8f}},
                  {{0, 1, 0}, 4.0f, glm::vec3(1.0f), {0, -1, 0}},
                  {{0, 0, 1}, std::numeric_limits<float>::infinity(), glm::vec3(0.0f), {0, 0, 0}}}};
  const Basis& basis = seen.basis;
  const auto facing = [&](const NearSurfaces& near, const glm::vec3& u) {
    const glm::vec2 flat(glm::dot(u, basis.s), glm::dot(u, basis.t));
    return glm::dot(flat, near.facing * flat);
  };
  const NearSurfaces near = near_surfaces(seen, 0.01f);
  EXPECT_NEAR(facing(near, {1, 0, 0}), 1.0f / 0.5f + 0.36f / 0.25f, 1e-5f);
  EXPECT_NEAR(facing(near, {0, 1, 0}), 1.0f / 4.0f, 1e-5f);
  EXPECT_NEAR(near.distance_of_light, (3.0f + 1.0f) / (3.0f / 0.5f + 1.0f / 4.0f), 1e-5f);
  EXPECT_NEAR(facing(near_surfaces(seen, 1.0f), {1, 0, 0}), 1.36f, 1e-5f) << "distances count as 1 at least";
  Hemisphere dark = seen;
  for (HemisphereSample& s : dark.samples) s.L = glm::vec3(0.0f);
  EXPECT_EQ(near_surfaces(dark, 0.01f).distance_of_light, std::numeric_limits<float>::infinity());
}

// Guards against: as many records in the dark as where the light is, which is what an error relative to each record's
// own irradiance asks for.
TEST(RenderHemisphere, ErrorsAreJudgedByTheMeanOfThePicture) {
  const Hemisphere seen = seen_from_origin(kLamp, {0.25, 0.75}, kFine);
  const Bounds bounds{glm::vec3(-1.0f), glm::vec3(1.0f)};
  RecordShaper shaper(Interpolation::occlusion_hessian, 0.2f, bounds,
                      RadiusLimits::for_scene(bounds, 0.01f, 0.2f), 10);
  shaper.look_from({.eye = {0, 0, 10}, .target = {0, 0, 0}, .up = {0, 1, 0}, .fov_y = 1.0f});
  const auto reach = [&](float of_picture, float mean, float E) {
    shaper.expect(of_picture);
    RecordDetail detail;
    shaper.ellipse(glm::vec3(0.0f), seen, mean, glm::vec3(E), detail);
    return 1.0f / detail.inverse_minor;
  };
  constexpr float kFar = std::numeric_limits<float>::infinity();
  const float known = reach(1.0f, kFar, 1.0f);
  EXPECT_FLOAT_EQ(known, reach(0.0f, kFar, 1.0f)) << "unknown: the record's own";
  EXPECT_FLOAT_EQ(reach(1.0f, kFar, 0.5f), known);
  EXPECT_FLOAT_EQ(reach(1.0f, kFar, 2.0f), known);
  EXPECT_NEAR(reach(1e20f, kFar, 1.0f) / known, 2.0f, 1e-3f) << "the sixth root of 64";
  EXPECT_NEAR(reach(1e-20f, kFar, 1.0f) / known, 0.5f, 1e-3f);
  const float mean = 0.0049f / near_surfaces(seen, 1e-4f).distance_of_light;
  const float near = reach(1.0f, mean, 1.0f);
  EXPECT_FLOAT_EQ(reach(1.0f, mean, 0.1f), near);
  EXPECT_NEAR(reach(1.0f, mean, 2.0f), near / 8.0f, 1e-6f);
  EXPECT_NEAR(reach(1.0f, mean, 1.5f), near / 3.375f, 1e-6f);
  EXPECT_NEAR(reach(1.0f, mean, 1e20f), near / 10.0f, 1e-6f);
}

// Guards against: light that smoothing carries over the edge of what is near, or from one wall to the next.
TEST(RadianceSmoothing, MixesNothingAcrossEdgesAndCorners) {
  // A screen before a lamp; and a corner, whose two sides are as far away as each other.
  const auto before_lamp = [](const glm::vec3& d) -> HemisphereSample {
    const bool hidden = d.x < 0.1f;
    return {d, hidden ? 0.5f : 1.0f, glm::vec3(hidden ? 1.0f : 3.0f), {0, 0, -1}};
  };
  const auto in_corner = [](const glm::vec3& d) -> HemisphereSample {
    const bool left = d.x < 0.0f;
    return {d, 1.0f, glm::vec3(left ? 2.0f : 0.0f), left ? glm::vec3(1, 0, 0) : glm::vec3(0, 0, -1)};
  };
  const auto expect_unchanged = [](const Hemisphere& seen) {
    Hemisphere smooth = seen;
    RadianceSmoother{}(smooth);
    for (std::size_t i = 0; i < seen.samples.size(); ++i)
      for (int c = 0; c < 3; ++c) ASSERT_FLOAT_EQ(smooth.samples[i].L[c], seen.samples[i].L[c]) << i;
  };
  // Narrow rows do not meet themselves on their way round; nothing is seen outdoors.
  for (const Strata strata : {Strata{36, 114}, Strata{2, 5}, Strata{1, 4}, Strata{3, 2}, Strata{1, 1}}) {
    expect_unchanged(hemisphere_around({0, 0, 1}, strata, before_lamp));
    expect_unchanged(hemisphere_around({0, 0, 1}, strata, in_corner));
    expect_unchanged(hemisphere_around({0, 0, 1}, strata, [](const glm::vec3& d) -> HemisphereSample {
      return {d, std::numeric_limits<float>::infinity(), glm::vec3(0.0f), {0, 0, 1}};
    }));
  }
}

TEST(RadianceSmoothing, IsTheMeanOfTheCellsAround) {
  const Strata strata{9, 12};
  Hemisphere seen = hemisphere_around({0, 0, 1}, strata, [](const glm::vec3& d) -> HemisphereSample {
    return {d, 1.0f, glm::vec3(0.0f), {0, 0, -1}};
  });
  seen.samples[4 * 12 + 0].L = {25.0f, 50.0f, 75.0f};
  RadianceSmoother smooth;
  smooth(seen);
  for (std::uint32_t m = 0; m < strata.elevations; ++m)
    for (std::uint32_t n = 0; n < strata.azimuths; ++n) {
      const bool near = m >= 2 && m <= 6 && (n <= 2 || n >= 10);
      const float share = near ? 1.0f : 0.0f;  // a 25th
      EXPECT_NEAR(seen.at(m, n).L.x, share, 1e-5f) << m << ' ' << n;
      EXPECT_NEAR(seen.at(m, n).L.z, 3.0f * share, 1e-5f) << m << ' ' << n;
    }
}

// Rooms whose irradiance is known everywhere: its derivatives, by finite differences, against those of one gather.

// Irradiance in closed form at p, facing n.
using Field = std::function<double(const Vec& p, const Vec& n)>;

// Of green light along the axes of a basis: as the point moves and as its normal turns, and the Hessian.
struct Derivatives {
  glm::dvec2 translational, rotational;
  glm::dmat2 second;
};

Derivatives of_closed_form(const Field& E, const Hit& at) {
  const Basis basis(at.n);
  const Vec p(at.p), n(at.n);
  const Vec axes[] = {Vec(basis.s), Vec(basis.t)};
  Derivatives out;
  const double h = 1e-3;
  for (int i = 0; i < 2; ++i) {
    out.translational[i] = (E(p + h * axes[i], n) - E(p - h * axes[i], n)) / (2 * h);
    const Vec turn = h * glm::cross(axes[i], n);
    out.rotational[i] = (E(p, glm::normalize(n + turn)) - E(p, glm::normalize(n - turn))) / (2 * h);
    for (int k = 0; k < 2; ++k)
      out.second[i][k] = (E(p + h * (axes[i] + axes[k]), n) - E(p + h * (axes[i] - axes[k]), n) -
                          E(p - h * (axes[i] - axes[k]), n) + E(p - h * (axes[i] + axes[k]), n)) /
                         (4 * h * h);
  }
  return out;
}

Derivatives of_gather(const Hemisphere& seen) {
  const IrradianceGradients g = gradients_of(seen, 1e-4f);
  return {{glm::dot(g.translational[1], seen.basis.s), glm::dot(g.translational[1], seen.basis.t)},
          {glm::dot(g.rotational[1], seen.basis.s), glm::dot(g.rotational[1], seen.basis.t)},
          glm::dmat2(occlusion_hessian(seen, 1e-4f))};
}

double size_of(const glm::dmat2& m) { return std::hypot(m[0][0], m[1][1], m[0][1]); }

// Shares of the exact.
struct Misses {
  double translational, rotational, second;
};

Misses misses(const std::string& name, const Derivatives& found, const Derivatives& exact) {
  const auto share = [](const glm::dvec2& a, const glm::dvec2& b) {
    return glm::length(a - b) / glm::length(b);
  };
  const Misses off{share(found.translational, exact.translational), share(found.rotational, exact.rotational),
                   size_of(found.second - exact.second) / size_of(exact.second)};
  std::printf("%-24s off by %.3f (moved), %.3f (turned), %.3f (Hessian)\n", name.c_str(), off.translational,
              off.rotational, off.second);
  return off;
}

// A hemisphere in which L(hit) comes from what each ray meets first.
template <class L>
Hemisphere seen_at(const RayTracer& rays, const Hit& at, Strata strata, L&& radiance) {
  Tracer tracer(rays);
  return hemisphere_around(at.n, strata, [&](const glm::vec3& d) -> HemisphereSample {
    const Hit hit = tracer.intersect(Ray{rays.leave(at.p, at.ng), kInfinity, d});
    return {d, hit.t, hit.missed() ? glm::vec3(0.0f) : radiance(hit), hit.ng};
  });
}

TEST(DerivativesInRooms, OverAPlate) {
  const RayTracer rays(lit_plate());
  Tracer tracer(rays);
  const Field E = [](const Vec& p, const Vec& n) {
    return lambert(p, n, rectangle(-1, 1, 0, -1, 1), kPlateL);
  };
  Hemisphere seen;
  const Known points[] = {above_plate({0.3f, 0.7f, 0.2f}, {0, -1, 0}),  // parallel
                          above_plate({0.5f, 0.6f, -0.5f}, {-1, -4, 0.5f})};
  for (const Known& x : points) {
    EXPECT_NEAR(gather(tracer, x.at, kFine, 5, seen).E.y / x.E, 1.0, 0.005);
    const Misses off = misses("plate", of_gather(seen), of_closed_form(E, x.at));
    EXPECT_LT(off.translational, 0.03);
    EXPECT_LT(off.rotational, 0.02);
    EXPECT_LT(off.second, 0.1);
    RadianceSmoother{}(seen);
    const Misses smoothed = misses("plate, smoothed", of_gather(seen), of_closed_form(E, x.at));
    EXPECT_LT(smoothed.translational, 0.03);
    EXPECT_LT(smoothed.rotational, 0.02);
    EXPECT_LT(smoothed.second, 0.1);
  }
}

// Round things are harder: cells at the edge see the body nearer than it is where it ends from sight, and that place
// moves over the body, which fixed corners know nothing of. The first error vanishes as cells shrink, the second stays.
TEST(DerivativesInRooms, UnderASphere) {
  const RayTracer rays(make_scene("sphere_light"));
  const Field E = [](const Vec& p, const Vec& n) {
    const Vec d = Vec(0, 1, 0) - p;
    return kPi * 10.0 * 0.4 * 0.4 * glm::dot(n, d) / std::pow(glm::length(d), 3);
  };
  for (const glm::vec3 p : {glm::vec3(0.2f, 0, 0), glm::vec3(-0.5f, 0, 0.6f)}) {
    const Hit at = facing(p, {0, 1, 0});
    const auto off = [&](Strata strata) {
      const auto emitted = [&](const Hit& hit) { return rays.material(hit).emission; };
      return misses("sphere", of_gather(seen_at(rays, at, strata, emitted)), of_closed_form(E, at));
    };
    const Misses coarse = off(kFine), fine = off({288, 900});
    EXPECT_LT(fine.translational, 0.08);
    EXPECT_LT(fine.translational, 0.75 * coarse.translational);
    EXPECT_LT(fine.rotational, 0.02);
    EXPECT_LT(fine.second, 0.6);
  }
}

// All is equally bright, near and far, before edges and behind: nothing changes, but for the noise of paths.
TEST(DerivativesInRooms, InAFurnaceAreNone) {
  const RayTracer rays(make_scene("white_furnace"));
  Tracer tracer(rays);
  const Hit at = primary_hits(rays, 3, 3).hits[4];
  struct Estimates {
    Estimate first[4], second[3];

    void add(const Derivatives& d) {
      for (int i = 0; i < 2; ++i) {
        first[i].add(d.translational[i]);
        first[2 + i].add(d.rotational[i]);
        second[i].add(d.second[i][i]);
      }
      second[2].add(d.second[0][1]);
    }
  } plain, smoothed;
  Hemisphere seen;
  RadianceSmoother smooth;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    gather(tracer, at, Strata{16, 50}, seed, seen);
    plain.add(of_gather(seen));
    smooth(seen);
    smoothed.add(of_gather(seen));
  }
  for (const Estimates* of : {&plain, &smoothed}) {
    for (const Estimate& e : of->first) {
      EXPECT_LE(std::abs(e.mean()), 4.0 * e.error());
      EXPECT_LE(e.error(), 0.03 * kPi * kRho) << "too few samples to say anything";  // per metre, per radian
    }
    for (const Estimate& e : of->second) {
      EXPECT_LE(std::abs(e.mean()), 4.0 * e.error());
      EXPECT_LE(e.error(), 0.15 * kPi * kRho) << "too few samples to say anything";  // per square metre
    }
  }
  // What smoothing is for. Gradients have nothing to gain where distances vary as little as here: differences between
  // cells add up to those between ends.
  for (int i = 0; i < 3; ++i) EXPECT_LT(smoothed.second[i].error(), 0.5 * plain.second[i].error());
}

// Along the wall of a sphere irradiance is the same: what moving adds, turning with the wall takes away.
TEST(DerivativesInRooms, AlongAnIntegratingSphereCancel) {
  const RayTracer rays(make_scene("integrating_sphere"));
  Tracer tracer(rays);
  const glm::vec3 down = glm::normalize(glm::vec3(0.36f, -0.8f, 0.48f));
  Hit at = tracer.intersect(Ray{glm::vec3(0.0f), kInfinity, down});
  at.n = -down;                                 // the sphere's, not the triangle's
  const auto reflected = [&](const Hit& hit) {  // rho / pi (I cos / d^2 + E)
    const glm::vec3 d = glm::vec3(0.3f, 0.4f, -0.2f) - hit.p;
    const float d2 = glm::dot(d, d);
    return glm::vec3(static_cast<float>(0.5 / kPi) *
                     (2.0f * glm::dot(hit.ng, d) / (d2 * std::sqrt(d2)) + 2.0f));
  };
  const Derivatives d = of_gather(seen_at(rays, at, kFine, reflected));
  // Going by ds along s turns the normal by -ds / R about t; along t, by ds / R about s.
  const glm::dvec2 turned(d.rotational.y, -d.rotational.x);
  std::printf("integrating sphere: %.4f %.4f W/m^3 moved, %.4f %.4f turned\n", d.translational.x,
              d.translational.y, turned.x, turned.y);
  EXPECT_GT(glm::length(turned), 0.1 * 2.0) << "there is nothing to cancel";
  EXPECT_LT(glm::length(d.translational - turned), 0.05 * glm::length(turned));
}

// Geometry alone cannot know that a plane of one brightness looks the same from everywhere.
TEST(RenderHemisphere, APlaneOfOneBrightnessBendsNothingButByGeometryAlone) {
  Rectangle all_lit{-1e6, 1e6, -1e6, 1e6, 1.5};
  const Eigen2 worst = magnitudes_of(geometric_hessian(seen_from_origin(all_lit, {}, {16, 50}), 1e-4f));
  const Eigen2 real = magnitudes_of(occlusion_hessian(seen_from_origin(all_lit, {}, {16, 50}), 1e-4f));
  EXPECT_GT(worst.small, 0.0f);
  EXPECT_EQ(real.large, 0.0f);
  // Twice as far, a quarter as bent.
  all_lit.height = 3.0;
  const Eigen2 farther = magnitudes_of(geometric_hessian(seen_from_origin(all_lit, {}, {16, 50}), 1e-4f));
  EXPECT_NEAR(worst.large / farther.large, 4.0f, 1e-3f);
}

TEST(RenderHemisphere, EigenvaluesAndTheirAxes) {
  for (const auto& [a, b, d] : {std::array{3.0f, 1.0f, 2.0f},
                                {-5.0f, 0.5f, 1.0f},
                                {0.0f, 0.0f, 0.0f},
                                {1.0f, 0.0f, -1.0f},
                                {2.0f, 0.0f, 2.0f}}) {
    const Eigen2 e = magnitudes_of({a, b, b, d});
    EXPECT_GE(e.large, e.small);
    EXPECT_NEAR(e.large * e.small, std::abs(a * d - b * b), 1e-5f);
    const glm::vec2 image(a * e.axis.x + b * e.axis.y, b * e.axis.x + d * e.axis.y);
    EXPECT_NEAR(glm::length(image), e.large, 1e-5f);
    EXPECT_NEAR(glm::length(e.axis), 1.0f, 1e-6f);
  }
}

// Nothing met, all met at no distance, and light as strong as floats hold.
TEST(RenderHemisphere, NothingMakesADerivativeThatIsNotFinite) {
  const auto finite = [](const Hemisphere& seen) {
    const IrradianceGradients g = gradients_of(seen, 1e-4f);
    const glm::mat2 H = occlusion_hessian(seen, 1e-4f), G = geometric_hessian(seen, 1e-4f);
    bool all = true;
    for (std::size_t c = 0; c < 3; ++c) all &= is_finite(g.translational[c]) && is_finite(g.rotational[c]);
    for (int i = 0; i < 4; ++i) all &= std::isfinite(H[i / 2][i % 2]) && std::isfinite(G[i / 2][i % 2]);
    return all;
  };
  Hemisphere seen = seen_from_origin(kLamp, {}, {8, 25});
  for (const float t : {std::numeric_limits<float>::infinity(), 0.0f, 1e-30f, 1e-5f, 1e10f})
    for (const float L : {0.0f, 1e-30f, 1e20f}) {
      for (std::size_t i = 0; i < seen.samples.size(); ++i) {
        seen.samples[i].t = i % 3 == 0 ? 1.0f : t;
        seen.samples[i].L = glm::vec3(i % 2 == 0 ? L : 0.0f);
      }
      EXPECT_TRUE(finite(seen)) << t << " " << L;
      for (HemisphereSample& s : seen.samples) s.t = t;
      EXPECT_TRUE(finite(seen)) << t << " " << L;
    }
}

}  // namespace
}  // namespace icbench
