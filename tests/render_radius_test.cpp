// How far records are valid: the limits that the levels of interpolation set to radii and ellipses, and those to what
// gradients may promise.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <limits>
#include <string>
#include <vector>

#include "cached_runs.h"
#include "core/random.h"
#include "render/extrapolation.h"
#include "render/hemisphere.h"
#include "render/radius_rays.h"
#include "render_support.h"
#include "scene/directions.h"
#include "temporal_scenes.h"

namespace icbench {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kA = 0.2f;
constexpr int kHeight = 100;
const Bounds kRoom{glm::vec3(-10.0f), glm::vec3(10.0f)};
const float kDiagonal = std::sqrt(1200.0f);
constexpr RadiusLimits kLimits{0.05f, 8.0f};
const Camera kCamera{.eye = {0, 1, 0}, .target = {0, 1, -1}, .up = {0, 1, 0}, .fov_y = 1.0f};

constexpr Interpolation kOnScreen[] = {Interpolation::bounded, Interpolation::gradients,
                                       Interpolation::neighbour_clamping};

RecordShaper shaper_of(Interpolation level, const Camera& camera = kCamera, int height = kHeight) {
  RecordShaper shaper(level, kA, kRoom, kLimits, height);
  shaper.look_from(camera);
  return shaper;
}

// What a pixel covers at p, metres.
float pixel_at(const glm::vec3& p, const Camera& camera = kCamera, int height = kHeight) {
  return 2.0f * std::tan(0.5f * camera.fov_y) * glm::distance(p, camera.eye) / static_cast<float>(height);
}

glm::vec3 in_front(float distance) { return kCamera.eye + glm::vec3(0, 0, -distance); }

// Guards against: records as small as dust far away, or so large nearby that all detail is lost.
TEST(RadiusOnTheScreen, ReachesFromThreeHalvesOfAPixelToTwentyPixels) {
  for (const Interpolation level : kOnScreen) {
    const RecordShaper shaper = shaper_of(level);
    for (const float distance : {5.0f, 12.0f}) {
      const glm::vec3 p = in_front(distance);
      EXPECT_NEAR(kA * shaper.radius(p, 0.0f), 1.5f * pixel_at(p), 1e-5f);
      EXPECT_NEAR(kA * shaper.radius(p, kInfinity), std::min(20.0f * pixel_at(p), kA * kLimits.max), 1e-5f);
      const float between = 5.0f * pixel_at(p) / kA;
      EXPECT_FLOAT_EQ(shaper.radius(p, between), between);
    }
    // What is seen from very near or far leaves the scene's own limits, too.
    const float near = shaper.radius(in_front(0.01f), 0.0f), far = shaper.radius(in_front(500.0f), 0.0f);
    EXPECT_FLOAT_EQ(near, kLimits.min);
    EXPECT_NEAR(kA * far / pixel_at(in_front(500.0f)), 1.5f, 1e-4f);
    EXPECT_GT(far, kLimits.max) << "a pixel is the least that matters";
    EXPECT_FLOAT_EQ(shaper.radius(in_front(500.0f), kInfinity), far);
  }
  const RecordShaper free = shaper_of(Interpolation::split_sphere);
  for (const float distance : {0.0f, 5.0f, 500.0f}) {
    EXPECT_EQ(free.radius(in_front(distance), 0.0f), kLimits.min);
    EXPECT_EQ(free.radius(in_front(distance), kInfinity), kLimits.max);
  }
}

TEST(RadiusOnTheScreen, AtTheCameraItselfIsTheLeastThereIs) {
  for (const Interpolation level : kOnScreen)
    for (const float mean : {0.0f, 1.0f, kInfinity})
      EXPECT_EQ(shaper_of(level).radius(kCamera.eye, mean), kLimits.min);
}

// Guards against: limits that stay where the first frame's camera was.
TEST(RadiusOnTheScreen, FollowsTheCameraAndTheSizeOfTheImage) {
  Camera moved = kCamera, wide = kCamera;
  moved.eye = {3, 1, -4};
  wide.fov_y = 2.0f;
  const glm::vec3 p = in_front(5.0f);
  for (const Interpolation level : kOnScreen) {
    RecordShaper shaper = shaper_of(level);
    for (const Camera& camera : {moved, wide, kCamera}) {
      shaper.look_from(camera);
      EXPECT_NEAR(kA * shaper.radius(p, 0.0f), 1.5f * pixel_at(p, camera), 1e-5f);
    }
    EXPECT_NEAR(kA * shaper_of(level, kCamera, 4 * kHeight).radius(p, 0.0f), 1.5f * pixel_at(p) / 4.0f,
                1e-5f);
  }
}

// Irradiance E whose luminance has a gradient of that length.
IrradianceGradients sloping(float slope) {
  IrradianceGradients g;
  for (glm::vec3& channel : g.translational) channel = {0.6f * slope, -0.8f * slope, 0};  // no 0 * infinity
  for (glm::vec3& channel : g.rotational) channel = {1e3f * slope, 0, 0};
  return g;
}

// Guards against: extrapolation so far that nothing, or twice the light, would be left.
TEST(RadiusByGradients, IsAtMostWhereIrradianceWouldHaveChangedByItself) {
  const glm::vec3 p = in_front(5.0f);  // R from 0.41 to 5.46 m by the screen
  for (const Interpolation level : {Interpolation::gradients, Interpolation::neighbour_clamping}) {
    const RecordShaper shaper = shaper_of(level);
    for (const float E : {1e-20f, 1.0f, 1e20f}) {
      EXPECT_FLOAT_EQ(shaper.radius(p, 4.0f, glm::vec3(E), sloping(E / 2.5f)), 2.5f);
      EXPECT_FLOAT_EQ(shaper.radius(p, 2.0f, glm::vec3(E), sloping(E / 2.5f)), 2.0f) << "what is near";
      EXPECT_FLOAT_EQ(shaper.radius(p, 4.0f, glm::vec3(E), sloping(1e6f * E)), shaper.radius(p, 0.0f));
    }
    EXPECT_FLOAT_EQ(shaper.radius(p, 4.0f, glm::vec3(1.0f), {}), 4.0f) << "nothing changes";
    EXPECT_FLOAT_EQ(shaper.radius(p, 4.0f, glm::vec3(0.0f), sloping(1.0f)), 4.0f) << "there is no light";
    // What counts is the luminance, so channels that change against each other are as one that stays.
    IrradianceGradients green;
    green.translational[1] = {0, 0, 0.5f};
    EXPECT_FLOAT_EQ(shaper.radius(p, 4.0f, glm::vec3(1.0f), green), 2.0f / 0.7152f);
    green.translational[0] = {0, 0, -0.5f * 0.7152f / 0.2126f};
    EXPECT_GT(shaper.radius(p, 4.0f, glm::vec3(1.0f), green), 3.999f);
  }
}

TEST(RadiusByGradients, BoundsRecordsOfVirtualLightsWhereverTheCameraIs) {
  const RecordShaper shaper = shaper_of(Interpolation::gradients);
  const auto R_of = [&](float R, float E, float slope) {
    RecordDetail detail;
    const float out = shaper.shape_of_vpls(R, glm::vec3(E), sloping(slope), detail);
    EXPECT_EQ(detail.R, out);
    EXPECT_LE(glm::length(detail.gradients.translational[1]) * kTurnOfVpls * out, 1.00001f * E);
    EXPECT_LE(glm::length(detail.gradients.rotational[1]), 2.00001f * E);
    return out;
  };
  EXPECT_FLOAT_EQ(R_of(6.0f, 2.0f, 0.0f), 6.0f / kTurnOfVpls);
  EXPECT_FLOAT_EQ(R_of(6.0f, 2.0f, 0.5f), 4.0f / kTurnOfVpls);
  EXPECT_FLOAT_EQ(R_of(6.0f, 2.0f, 1e6f), kLimits.min);
  EXPECT_FLOAT_EQ(R_of(kInfinity, 2.0f, 0.0f), kLimits.max);
}

// Guards against: rays that the surface itself is in the way of, counted as if they saw far.
TEST(RadiusByRays, RaysThatWereNotTracedDoNotCount) {
  const RadiusRays radius(kRoom, kLimits);
  const RayTracer rays(animated_room({}));
  Tracer tracer(rays);
  Hit hit{};
  hit.n = {0, 1, 0};
  hit.ng = -hit.n;
  DistanceCodes none, codes;
  radius.trace(tracer, hit, RadiusRays::kAll, none);
  EXPECT_EQ(tracer.counts.total(), 0u);
  codes.fill(120);
  const float R = radius.radius(codes);
  ASSERT_LT(kLimits.min, R);
  ASSERT_LT(R, kLimits.max);
  std::copy_n(none.begin(), 9, codes.begin());
  EXPECT_FLOAT_EQ(radius.radius(codes), R);
}

bool is_zero(const IrradianceGradients& g) {
  const auto none = [](const glm::vec3& v) { return v == glm::vec3(0.0f); };
  return std::all_of(g.translational.begin(), g.translational.end(), none) &&
         std::all_of(g.rotational.begin(), g.rotational.end(), none);
}

// Guards against: a few paths that found much light promising more than a record can hold.
TEST(RestrainedGradients, ChangeAChannelByAShareOfItselfAndKeepTheirDirection) {
  constexpr float kR = 0.5f;
  const glm::vec3 E(1.0f, 20.0f, 300.0f);
  const glm::vec3 along = glm::normalize(glm::vec3(1, -2, 0.5f));
  IrradianceGradients g;
  g.translational = {1e3f * along, 39.9f * along, 601.0f * along};  // at most 2, 40, 600
  g.rotational = {1.9f * along, 1e3f * along, 601.0f * along};      // likewise: twice E
  const IrradianceGradients before = g;
  restrain(g, E, kR);
  const auto expect_limited = [&](const glm::vec3& v, float length) {
    EXPECT_NEAR(glm::length(v) / length, 1.0f, 1e-5f);
    EXPECT_NEAR(glm::dot(v, along) / length, 1.0f, 1e-5f) << "it points elsewhere";
  };
  expect_limited(g.translational[0], 2.0f);
  EXPECT_EQ(g.translational[1], before.translational[1]);
  expect_limited(g.translational[2], 600.0f);
  EXPECT_EQ(g.rotational[0], before.rotational[0]);
  expect_limited(g.rotational[1], 40.0f);
  expect_limited(g.rotational[2], 600.0f);
}

TEST(RestrainedGradients, AreNoneWhereThereIsNoLightAndFiniteWhatever) {
  constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
  constexpr float kMost = std::numeric_limits<float>::max();
  IrradianceGradients none;
  restrain(none, glm::vec3(1.0f), 0.5f);
  EXPECT_TRUE(is_zero(none));
  for (const float slope : {1.0f, kMost, kInfinity, kNaN}) {
    IrradianceGradients dark = sloping(slope);
    restrain(dark, glm::vec3(0.0f), 0.5f);
    EXPECT_TRUE(is_zero(dark)) << slope;
  }
  for (const float slope : {1e-38f, 1e10f, 1e25f, kMost, kInfinity, kNaN})
    for (const float E : {1e-38f, 1e-20f, 1.0f, 1e20f, kMaxIrradiance})
      for (const float R : {1e-4f, 1.0f, 1e4f}) {
        IrradianceGradients g = sloping(slope);
        restrain(g, glm::vec3(E), R);
        for (std::size_t c = 0; c < 3; ++c) {
          ASSERT_TRUE(is_finite(g.translational[c]) && is_finite(g.rotational[c])) << slope << ' ' << E;
          // Lengths in double precision: squares of these numbers are not floats.
          ASSERT_LE(glm::length(glm::dvec3(g.translational[c])), 1.00001 * E / R) << slope;
          ASSERT_LE(glm::length(glm::dvec3(g.rotational[c])), 2.00001 * E) << slope;
        }
      }
}

// A ceiling 2 m above, dark; or lit, and hidden where x < 0.05 by a black shelf, endless along y, 0.3 m above. Basis
// along the axes.
Hemisphere below(bool lit, Strata strata = {48, 150}) {
  Hemisphere out;
  out.strata = strata;
  out.basis = Basis(glm::vec3(0, 0, 1));
  for (std::uint32_t m = 0; m < strata.elevations; ++m)
    for (std::uint32_t n = 0; n < strata.azimuths; ++n) {
      const glm::vec3 d =
          cosine_direction(out.basis, (static_cast<float>(m) + 0.5f) / static_cast<float>(strata.elevations),
                           (static_cast<float>(n) + 0.5f) / static_cast<float>(strata.azimuths));
      const bool hidden = lit && 0.3f * d.x / d.z < 0.05f;
      out.samples.push_back(
          {d, (hidden ? 0.3f : 2.0f) / d.z, glm::vec3(lit && !hidden ? 1.0f : 0.0f), {0, 0, -1}});
    }
  return out;
}

// The same light from everywhere, far away: nothing but limits ends a record.
Hemisphere even_light() {
  Hemisphere out = below(false);
  for (HemisphereSample& sample : out.samples) {
    sample.L = glm::vec3(1.0f);
    sample.t *= 1e9f;
  }
  return out;
}

struct Ellipse {
  float R, large, small;  // metres
  glm::vec3 major;
};

Ellipse ellipse_of(const RecordShaper& shaper, const glm::vec3& p, const Hemisphere& seen, float mean,
                   float E, const IrradianceGradients& gradients = {}) {
  RecordDetail detail;
  detail.gradients = gradients;
  const float R = shaper.ellipse(p, seen, mean, glm::vec3(E), detail);
  return {R, 1.0f / detail.inverse_major, 1.0f / detail.inverse_minor, detail.major};
}

constexpr Interpolation kElliptic[] = {Interpolation::geometric_hessian, Interpolation::occlusion_hessian};
constexpr float least_share(Interpolation level) {
  return level == Interpolation::geometric_hessian ? 0.01f : 0.005f;
}

// Guards against: needles, and ellipses turned by a right angle.
TEST(Ellipses, LieAlongAnEdge) {
  const Hemisphere seen = below(true);
  const Ellipse e =
      ellipse_of(shaper_of(Interpolation::occlusion_hessian), in_front(9.0f), seen, kInfinity, 0.01f);
  EXPECT_GT(e.small, 1.5f * least_share(Interpolation::occlusion_hessian) * kA * kDiagonal);
  EXPECT_FLOAT_EQ(e.large, 1.5f * e.small) << "along the edge nothing changes at all";
  EXPECT_NEAR(std::abs(e.major.y), 1.0f, 1e-3f);
  EXPECT_NEAR(glm::length(e.major), 1.0f, 1e-5f);
}

TEST(Ellipses, ReachAFifthOfTheDiagonalAtMost) {
  const glm::vec3 far_away = in_front(1e3f);
  for (const Interpolation level : kElliptic) {
    const Ellipse e = ellipse_of(shaper_of(level), far_away, even_light(), kInfinity, 1.0f);
    EXPECT_FLOAT_EQ(e.large, 0.2f * kDiagonal);
    EXPECT_FLOAT_EQ(e.small, e.large);
    EXPECT_FLOAT_EQ(e.R, kOverlap * e.large / (search_reach(level) * kA)) << "the sphere around it";
  }
}

TEST(Ellipses, HaveALeastReachHoweverIrradianceBends) {
  for (const Interpolation level : kElliptic) {
    Hemisphere bright = below(true);
    for (HemisphereSample& s : bright.samples) {
      s.L *= 1e20f;
      s.t = 1e-6f;  // by geometry light does not count
    }
    const Ellipse e = ellipse_of(shaper_of(level), in_front(9.0f), bright, kInfinity, 1e-6f);
    EXPECT_FLOAT_EQ(e.small, least_share(level) * kA * kDiagonal);
    EXPECT_LE(e.large, 2.00001f * e.small);
  }
}

// Guards against: a record for each pixel of a slat, which the noise of its Hessian gives no direction.
TEST(Ellipses, LieAlongWhatIsNearWithOcclusion) {
  const auto by = [&](const glm::vec3& facing, float aside, float mean = kInfinity) {
    Hemisphere seen = below(true);
    for (std::size_t i = 0; i < seen.samples.size(); ++i)
      seen.samples[i].ng = i % 2 == 0 ? facing : glm::vec3(-facing.y, facing.x, 0) * aside;
    return ellipse_of(shaper_of(Interpolation::occlusion_hessian), in_front(9.0f), seen, mean, 0.01f);
  };
  const auto slope = [](const Ellipse& e) { return std::abs(e.major.x / e.major.y); };
  Ellipse e = by({0.6f, 0.8f, 0}, 0.5f);
  EXPECT_NEAR(slope(e), 4.0f / 3.0f, 0.01f) << "across the edge, where the Hessian would have it along";
  e = by({1, 0, 0}, 0.5f);
  EXPECT_NEAR(slope(e), 0.0f, 0.01f);
  EXPECT_NEAR(e.large / e.small, 1.5f / 0.5f, 0.03f);
  e = by({1, 0, 0}, 0.0f, 1e-6f);
  EXPECT_NEAR(e.large / e.small, 6.0f, 0.01f) << "at most";
  e = by({0, 1, 0}, 0.0f);
  EXPECT_NEAR(e.large / e.small, 1.0f, 0.2f) << "the Hessian has the last word along the ellipse, too";
}

// Guards against: ellipses over half the picture nearby. By geometry alone they need no such limit.
TEST(Ellipses, ReachTwentyPixelsAtMostWithOcclusion) {
  const Hemisphere even = even_light();
  RecordShaper shaper = shaper_of(Interpolation::occlusion_hessian);
  for (const float distance : {5.0f, 12.0f}) {
    const glm::vec3 p = in_front(distance);
    const Ellipse e = ellipse_of(shaper, p, even, kInfinity, 1.0f);
    EXPECT_NEAR(e.large, 20.0f * pixel_at(p), 1e-5f);
    EXPECT_NEAR(e.small, 20.0f * pixel_at(p), 1e-5f);
    EXPECT_FLOAT_EQ(ellipse_of(shaper_of(Interpolation::geometric_hessian), p, even, kInfinity, 1.0f).large,
                    0.2f * kDiagonal);
  }
  EXPECT_FLOAT_EQ(ellipse_of(shaper, kCamera.eye, even, kInfinity, 1.0f).large, 0.005f * kA * kDiagonal);
  Camera moved = kCamera;
  moved.eye.x = 2.0f;
  shaper.look_from(moved);
  EXPECT_NEAR(ellipse_of(shaper, kCamera.eye, even, kInfinity, 1.0f).large,
              20.0f * pixel_at(kCamera.eye, moved), 1e-5f);
}

// Guards against: records valid to where their own gradients deny them.
TEST(Ellipses, EndWhereIrradianceChangesByItsShare) {
  const Hemisphere even = even_light();
  const glm::vec3 far_away = in_front(1e3f);
  const IrradianceGradients slope = sloping(1.0f / 4.0f);
  EXPECT_FLOAT_EQ(
      ellipse_of(shaper_of(Interpolation::geometric_hessian), far_away, even, kInfinity, 1.0f, slope).large,
      4.0f * kA);
  RecordShaper shaper = shaper_of(Interpolation::occlusion_hessian);
  const auto along_x = [&](float share) {
    IrradianceGradients along;
    along.translational.fill({share, 0, 0});
    const Ellipse e = ellipse_of(shaper, far_away, even, kInfinity, 1.0f, along);
    const bool is_major = std::abs(e.major.x) > 0.5f;
    EXPECT_NEAR(std::abs(e.major.x), is_major ? 1.0f : 0.0f, 1e-3f);
    return (is_major ? e.large : e.small) / kDiagonal;
  };
  const float steep = 0.7f / (0.125f * kDiagonal);
  EXPECT_NEAR(along_x(steep), 0.125f, 1e-4f);
  EXPECT_NEAR(along_x(0.25f * steep), 0.2f, 1e-4f);
  shaper.expect(1.5f);
  EXPECT_NEAR(along_x(steep), 1.5f * 0.125f, 1e-4f) << "of the mean";
  shaper.expect(0.5f);
  EXPECT_NEAR(along_x(steep), 0.125f, 1e-4f) << "of the record";
}

// Guards against: Hessians that are noise.
TEST(Ellipses, AreCirclesByTheMeanDistanceWhereThereAreFewCells) {
  const glm::vec3 far_away = in_front(1e3f);
  for (const Interpolation level : kElliptic) {
    const RecordShaper shaper = shaper_of(level);
    const auto circle = [&](float mean) {
      const Ellipse e = ellipse_of(shaper, far_away, below(true, {4, 12}), mean, 1.0f);
      EXPECT_EQ(e.small, e.large);
      return e.large;
    };
    EXPECT_FLOAT_EQ(circle(3.0f), kA * 3.0f);
    EXPECT_FLOAT_EQ(circle(kInfinity), kA * kLimits.max);
    EXPECT_FLOAT_EQ(circle(0.0f), std::max(kA * kLimits.min, least_share(level) * kA * kDiagonal));
    const auto by_hessian = [&](float mean) {
      return ellipse_of(shaper, far_away, below(true, {12, 38}), mean, 1.0f).small;
    };
    EXPECT_EQ(by_hessian(3.0f), by_hessian(4.0f));
  }
}

// k equal ones of n samples tell their mean to sqrt(1 / k - 1 / n) of it: 0.1495 with 38 of 252, 0.1519 with 37.
TEST(KnownLight, IsThatOfManySamples) {
  Hemisphere seen = below(false, {9, 28});
  EXPECT_FALSE(is_light_known(seen)) << "of none";
  for (const float L : {1e-20f, 1.0f, 1e20f}) {
    for (std::size_t i = 0; i < seen.samples.size(); ++i) seen.samples[i].L = glm::vec3(i < 38 ? L : 0.0f);
    EXPECT_TRUE(is_light_known(seen)) << L;
    seen.samples[37].L = glm::vec3(0.0f);
    EXPECT_FALSE(is_light_known(seen)) << L;
  }
}

// Guards against: pictures too dark where few samples find light: those of a record that found none would say that it
// holds for ever, those of a lucky one that it ends at once.
TEST(Ellipses, DoNotGoByWhatFewSamplesFound) {
  const Hemisphere lit = below(true, {9, 28});
  Hemisphere dark = lit, lucky = lit;
  for (std::size_t i = 0; i < lit.samples.size(); ++i) {
    dark.samples[i].L = glm::vec3(0.0f);
    lucky.samples[i].L = glm::vec3(i == 100 ? 50.0f : 0.0f);
  }
  constexpr float kMean = 3.0f;
  const auto axes = [&](Interpolation level, const Hemisphere& seen, float E) {
    const Ellipse e = ellipse_of(shaper_of(level), in_front(1e3f), seen, kMean, E);
    return glm::vec2(e.large, e.small);
  };
  const glm::vec2 by_geometry = axes(Interpolation::geometric_hessian, lit, 1.0f), circle(kA * kMean);
  EXPECT_GT(glm::distance(by_geometry, circle), 0.01f);
  EXPECT_GT(glm::distance(axes(Interpolation::occlusion_hessian, lit, 1.0f), circle), 0.01f);
  for (const auto& [seen, E] : {std::pair(&dark, 0.0f), std::pair(&lucky, 0.6f)}) {
    EXPECT_EQ(axes(Interpolation::geometric_hessian, *seen, E), by_geometry);
    EXPECT_LT(glm::distance(axes(Interpolation::occlusion_hessian, *seen, E), circle), 1e-5f);
  }
}

// Records as they are made in a room, by so few rays that their gradients are noise: all limits at once.
class MadeRecords : public ::testing::TestWithParam<InterpolationEntry> {};
INSTANTIATE_TEST_SUITE_P(Levels, MadeRecords, ::testing::ValuesIn(kInterpolations), level_name);

TEST_P(MadeRecords, KeepToAllLimits) {
  constexpr int kSize = 48;
  const RayTracer rays(animated_room({}));
  const PrimaryHits primary = primary_hits(rays, kSize, kSize);
  const Camera& camera = rays.scene().camera;
  const float diagonal = glm::distance(rays.scene().bounds.lower, rays.scene().bounds.upper);
  ThreadCrew crew(rays, 1);
  PassSetup setup{rays, crew, kSize, kSize};
  setup.gather_rays = 64;
  setup.a = kA;
  const Interpolation level = setup.interpolation = GetParam().level;
  const bool is_softened = level == Interpolation::occlusion_hessian;  // where points ask, not beforehand
  const auto source = make_irradiance_cache(setup);
  source->begin_frame({}, crew);
  setup.interpolation = Interpolation::bounded;  // the same radii, but for what gradients do
  const auto without_gradients = make_irradiance_cache(setup);
  without_gradients->begin_frame({}, crew);
  Tracer tracer(rays);
  const RadiusLimits limits = radius_limits(rays.scene().bounds);
  std::size_t on_screen_limit = 0, by_gradient = 0, restrained = 0, stretched = 0;
  for (std::uint32_t pixel = 0; pixel < primary.hits.size(); pixel += 7) {
    const Visible x = primary.at(pixel, 0);
    if (!reflects(rays, x.hit)) continue;
    const Record r = source->evaluate(0, tracer, x, {});
    const float pixels = pixel_at(r.p, camera, kSize);
    if (!is_elliptic(level)) {
      ASSERT_GE(r.R, limits.min);
      if (level == Interpolation::split_sphere) {
        ASSERT_LE(r.R, limits.max);
      } else {
        const float least = std::max(1.5f * pixels / kA, limits.min);
        ASSERT_GE(r.R, 0.99999f * least);
        ASSERT_LE(r.R, 1.00001f * std::max(least, 20.0f * pixels / kA));
        on_screen_limit += r.R < 1.00001f * least;
      }
    }
    if (!extrapolates(level)) continue;
    const RecordDetail& detail = (*source->shapes()).details[r.id];
    for (std::size_t c = 0; c < 3; ++c) {
      const float E = r.E[static_cast<int>(c)];
      const float change =
          glm::length(detail.gradients.translational[c]) * (is_softened ? rays.epsilon() : r.R);
      ASSERT_LE(change, 1.00001f * E);
      ASSERT_LE(glm::length(detail.gradients.rotational[c]), 2.00001f * E);
      restrained += change > 0.99999f * E;
    }
    if (!is_elliptic(level)) {
      const float R = without_gradients->evaluate(0, tracer, x, {}).R;
      ASSERT_LE(r.R, R);
      by_gradient += r.R < 0.9f * R;
    } else {
      const float large = 1.0f / detail.inverse_major, small = 1.0f / detail.inverse_minor;
      ASSERT_LE(large, (level == Interpolation::occlusion_hessian ? 6.00001f : 2.00001f) * small);
      ASSERT_LE(small, 1.00001f * large);
      ASSERT_GE(small, 0.99999f * least_share(level) * kA * diagonal);
      ASSERT_LE(large, 0.20001f * diagonal);
      if (level == Interpolation::occlusion_hessian) {
        ASSERT_LE(large, 20.0001f * pixels);
      }
      ASSERT_NEAR(glm::length(detail.major), 1.0f, 1e-4f);
      ASSERT_NEAR(glm::dot(detail.major, r.n), 0.0f, 1e-4f) << "not in the tangent plane";
      ASSERT_NEAR(kOverlap * large / (search_reach(level) * kA) / r.R, 1.0f, 1e-5f);
      stretched += large > 1.05f * small;
    }
    source->settle(0, r, InsertResult::inserted);
  }
  EXPECT_EQ(on_screen_limit > 0, level != Interpolation::split_sphere && !is_elliptic(level));
  EXPECT_EQ(by_gradient > 0, extrapolates(level) && !is_elliptic(level));
  EXPECT_EQ(restrained > 0, extrapolates(level) && !is_softened) << "no gradient was so steep";
  EXPECT_EQ(stretched > 0, is_elliptic(level));
}

}  // namespace
}  // namespace icbench
