// Gradients and Hessians of a hemisphere of samples, against finite differences of closed forms.
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <glm/vec2.hpp>
#include <limits>
#include <numbers>

#include "core/random.h"
#include "lambert.h"
#include "render/hemisphere.h"

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

Hemisphere seen_from_origin(const Rectangle& r, const Screen& screen, Strata strata) {
  Hemisphere out;
  out.strata = strata;
  out.basis = Basis(glm::vec3(0, 0, 1));
  Pcg32 random(7);
  for (std::uint32_t m = 0; m < strata.elevations; ++m)
    for (std::uint32_t n = 0; n < strata.azimuths; ++n) {
      const float u = (static_cast<float>(m) + random.uniform()) / static_cast<float>(strata.elevations);
      const float v = (static_cast<float>(n) + random.uniform()) / static_cast<float>(strata.azimuths);
      const glm::vec3 d = cosine_direction(out.basis, std::min(u, 0.9999f), v);
      const double x_at_screen = d.x / d.z * screen.height;
      const bool hidden = x_at_screen < screen.edge;
      const double t = (hidden ? screen.height : r.height) / d.z;
      const bool lit = !hidden && r.holds(t * d.x, t * d.y);
      out.samples.push_back({d, static_cast<float>(t), glm::vec3(lit ? 1.0f : 0.0f), {0, 0, -1}});
    }
  return out;
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
