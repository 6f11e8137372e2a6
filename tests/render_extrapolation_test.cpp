// What records bring to a point by the details that they carry: where one counts, for how much and with what
// irradiance.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "cached_runs.h"
#include "core/interpolation.h"
#include "render/extrapolation.h"
#include "render_support.h"
#include "scene/registry.h"

namespace icbench {
namespace {

// For records made by hand in a cube of 2 m.
RecordShapes shapes_in_a_cube(Interpolation level, float a, std::uint32_t records) {
  const Bounds bounds{glm::vec3(-1.0f), glm::vec3(1.0f)};
  return {RecordShaper(level, a, bounds, RadiusLimits::for_scene(bounds, 0.01f, 0.2f), 10),
          RecordDetails(records, 1)};
}

// Guards against: a rule of one level that is applied at another, gradients of one channel that change another, and
// light that extrapolation makes negative.
TEST(RenderExtrapolation, WithoutEllipsesGradientsAddToIrradianceAndWeightsEndWithTheSearch) {
  constexpr float kA = 0.4f;
  for (const Interpolation level : {Interpolation::gradients, Interpolation::neighbour_clamping}) {
    RecordShapes shapes = shapes_in_a_cube(level, kA, 1);
    RecordDetail& detail = shapes.details[shapes.details.draft(0)];
    const glm::vec3 E(1.0f, 2.0f, 3.0f);
    const Record r{{0.1f, 0.2f, 0.3f}, {0, 0, 1}, 1.0f, E, 0};
    const float sine = 0.28f, turn = std::sqrt(1.0f - 0.96f);
    const SurfacePoint x{r.p + glm::vec3(0.05f, -0.1f, 0.0f), {sine, 0, 0.96f}};
    const float weight = split_sphere_weight(x, r, kA);
    ASSERT_NEAR(weight, 1.0f / (std::sqrt(0.0125f) + turn), 1e-3f);
    detail.gradients.translational = {glm::vec3(2, 0, 0), glm::vec3(0, 3, 0), glm::vec3(0, 0, 0)};
    detail.gradients.rotational = {glm::vec3(0, 0, 0), glm::vec3(0, 1, 0), glm::vec3(5, 0.5f, 0)};
    const Contribution c = Extrapolator(shapes, x).of(r, weight);
    EXPECT_FLOAT_EQ(c.w, weight - 1.0f / kA);
    EXPECT_TRUE(c.covers);
    EXPECT_NEAR(c.E.x, 1.0f + 2.0f * 0.05f, 1e-6f);
    EXPECT_NEAR(c.E.y, 2.0f - 3.0f * 0.1f + sine, 1e-6f) << "a turn about y is towards x";
    EXPECT_NEAR(c.E.z, 3.0f + 0.5f * sine, 1e-6f);
    detail.gradients.translational = {glm::vec3(-30, 0, 0), glm::vec3(1e30f, 0, 0), glm::vec3(1e38f, 0, 0)};
    const Irradiance limited = Extrapolator(shapes, x).of(r, weight).E;
    EXPECT_EQ(limited.x, 0.0f);
    EXPECT_FLOAT_EQ(limited.y / 1e28f, 5.0f);
    EXPECT_EQ(limited.z, kMaxIrradiance);
    const Contribution none = Extrapolator(shapes, x).of(r, 0.999f / kA);
    EXPECT_EQ(none.w, 0.0f) << "where neighbours alone are looked for";
    EXPECT_FALSE(none.covers);
  }
}

// Guards against: records of one side of a sheet that light the other, and what counts without an ellipse as if it had
// one.
TEST(RenderExtrapolation, AtLevelsWithEllipsesRecordsCountOnTheirOwnSideAndWithoutDetailsByTheSphere) {
  constexpr float kA = 0.5f;
  for (const Interpolation level : {Interpolation::geometric_hessian, Interpolation::occlusion_hessian}) {
    RecordShapes shapes = shapes_in_a_cube(level, kA, 1);
    const std::uint32_t id = shapes.details.draft(0);
    shapes.details[id] = {
        .gradients = {}, .major = {1, 0, 0}, .inverse_major = 1.0f, .inverse_minor = 1.0f, .marks = {}};
    const auto given = [&](std::uint32_t of, const SurfacePoint& x, float weight) {
      return Extrapolator(shapes, x).of({glm::vec3(0.0f), {0, 0, 1}, 1.0f, glm::vec3(3.0f), of}, weight);
    };
    for (const std::uint32_t of : {id, RecordDetails::kNone}) {
      const Contribution over = given(of, {glm::vec3(0.0f), {1, 0, -0.01f}}, 1e3f);
      EXPECT_EQ(over.w, 0.0f);
      EXPECT_FALSE(over.covers);
    }
    const SurfacePoint beside{{0.3f, 0, 0}, {0, 0, 1}};
    const auto weight = [](float e) { return (1.0f - e / kOverlap) / (e * e * e * e + 0.5f); };
    EXPECT_NEAR(given(id, beside, 1e3f).w, weight(0.3f), 1e-5f) << "whatever the sphere says";
    const float by_search = (1.0f - 0.5f / (search_reach(level) * kA)) / (0.3f * 0.3f * 0.3f * 0.3f + 0.5f);
    EXPECT_NEAR(given(id, beside, 2.0f).w, std::min(weight(0.3f), by_search), 1e-5f);
    for (const float error : {0.3f, 0.9f}) {
      const Contribution c = given(RecordDetails::kNone, beside, 1.0f / (kA * error));
      EXPECT_NEAR(c.w, weight(error), 1e-5f);
      EXPECT_TRUE(c.covers);
      EXPECT_EQ(c.E, glm::vec3(3.0f));
    }
  }
}

// Where neighbours are looked for, a cache answers farther out than records are valid.
TEST(RenderExtrapolation, ARecordWithoutDetailsCountsNoFartherThanItsAccuracy) {
  for (const Interpolation level : {Interpolation::neighbour_clamping, Interpolation::occlusion_hessian}) {
    constexpr float kA = 0.2f;
    const RecordShapes shapes = shapes_in_a_cube(level, kA, 1);
    const Record r{glm::vec3(0.0f), {0, 0, 1}, 1.0f, glm::vec3(3.0f), RecordDetails::kNone};
    for (const float distance : {0.0f, 0.19f, 0.21f, 0.39f}) {
      Extrapolator sum(shapes, {{distance, 0, 0}, r.n});
      sum(r, 1.0f / std::max(distance, kMinError));
      ASSERT_EQ(sum.result().has_value(), distance < kA) << distance;
      if (sum.result()) {
        EXPECT_FLOAT_EQ(sum.result()->x, 3.0f);  // 3 w / w
      }
    }
  }
}

// Guards against: slats, books or mouldings that face the same way a little before or behind one another sharing their
// light.
TEST(RenderExtrapolation, APointOffTheSurfaceOfARecordIsFarAway) {
  for (const Interpolation level : {Interpolation::geometric_hessian, Interpolation::occlusion_hessian}) {
    constexpr float kA = 0.5f;
    RecordShapes shapes = shapes_in_a_cube(level, kA, 1);
    const std::uint32_t id = shapes.details.draft(0);
    shapes.details[id] = {
        .gradients = {}, .major = {1, 0, 0}, .inverse_major = 1.0f, .inverse_minor = 1.0f, .marks = {}};
    const Record r{glm::vec3(0.0f), {0, 0, 1}, 1.0f / kA, glm::vec3(3.0f), id};
    const auto error_at = [&](const glm::vec3& p, const glm::vec3& n) {
      return Extrapolator(shapes, {p, n}).error_of(r);
    };
    EXPECT_NEAR(error_at({0.3f, 0.4f, 0}, r.n), 0.5f, 1e-6f);
    for (const float side : {-1.0f, 1.0f}) {
      EXPECT_NEAR(error_at({0.3f, 0, 0.4f * side}, r.n), 0.5f + 2.0f * 0.4f, 1e-6f);
      // On a sphere or in a bowl that the record touches, no more than the distance and the turn count.
      constexpr float kTurn = 0.2f, kRadius = 2.0f;
      const glm::vec3 n(std::sin(kTurn), 0, std::cos(kTurn));
      const float chord = 2.0f * kRadius * std::sin(0.5f * kTurn);
      const float turn = std::sqrt(1.0f - std::cos(kTurn)) / (kA * search_reach(level));
      EXPECT_NEAR(error_at(side * kRadius * (n - r.n), n), chord + turn, 1e-4f);
    }
  }
}

// Guards against: pictures of one-sided extrapolation, where only the record that was made first counts; and against
// records that count so far away that no new ones are made.
TEST(RenderExtrapolation, RecordsOverlapButWhatNoneCoversIsAMiss) {
  constexpr float kA = 0.5f;
  const float reach = search_reach(Interpolation::occlusion_hessian) * kA;
  RecordShapes shapes = shapes_in_a_cube(Interpolation::occlusion_hessian, kA, 2);
  const auto record_at = [&](float x, float E) {
    const std::uint32_t id = shapes.details.draft(0);
    shapes.details.keep(0);
    shapes.details[id] = {
        .gradients = {}, .major = {1, 0, 0}, .inverse_major = 10.0f, .inverse_minor = 10.0f, .marks = {}};
    return Record{{x, 0, 0}, {0, 0, 1}, kOverlap * 0.1f / reach, glm::vec3(E), id};
  };
  const Record left = record_at(0.0f, 1.0f), right = record_at(0.25f, 2.0f);
  const auto mean_at = [&](float x) {
    const SurfacePoint at{{x, 0, 0}, left.n};
    Extrapolator sum(shapes, at);
    for (const Record& r : {left, right})
      if (const float w = split_sphere_weight(at, r, reach); w > 0.0f) sum(r, w);
    return sum.result();
  };
  const auto weight = [](float e) { return (1.0f - e / kOverlap) / (e * e * e * e + 0.5f); };
  ASSERT_TRUE(mean_at(0.05f).has_value());
  EXPECT_NEAR(mean_at(0.05f)->x, (weight(0.5f) + 2.0f * weight(2.0f)) / (weight(0.5f) + weight(2.0f)), 1e-5f);
  EXPECT_FALSE(mean_at(0.125f).has_value()) << "a distance of 1.25 ellipses from either";
  EXPECT_NEAR(mean_at(-0.03f)->x, 1.0f + weight(2.8f) / (weight(0.3f) + weight(2.8f)), 1e-5f);
  EXPECT_FLOAT_EQ(mean_at(-0.09f)->x, 1.0f) << "3.4 ellipses from the one on the right";
}

// Guards against: light that jumps on curved surfaces, where the search ends before a record's weight is 0.
TEST(RenderExtrapolation, WeightsFallToNothingOnCurvedSurfacesToo) {
  for (const Interpolation level : {Interpolation::geometric_hessian, Interpolation::occlusion_hessian})
    for (const float radius : {1.0f, 0.1f, 0.05f, 0.02f}) {  // of a cylinder; the ellipse's is 0.05
      constexpr float kA = 0.2f, kStep = 1e-3f;
      RecordShapes shapes = shapes_in_a_cube(level, kA, 1);
      const std::uint32_t id = shapes.details.draft(0);
      shapes.details[id] = {
          .gradients = {}, .major = {1, 0, 0}, .inverse_major = 20.0f, .inverse_minor = 20.0f, .marks = {}};
      const float reach = search_reach(level) * kA;
      const Record r{{0, 0, radius}, {0, 0, 1}, kOverlap * 0.05f / reach, glm::vec3(1.0f), id};
      float before = 0.0f, most = 0.0f;
      for (float angle = 0.0f; angle < 1.5f; angle += kStep) {
        const glm::vec3 n(std::sin(angle), 0.0f, std::cos(angle));
        const SurfacePoint x{radius * n, n};
        const float found = split_sphere_weight(x, r, reach);
        const float w = found > 0.0f ? std::max(Extrapolator(shapes, x).of(r, found).w, 0.0f) : 0.0f;
        if (angle > 0.0f) {
          EXPECT_LT(std::fabs(w - before), 0.1f) << name_of(level) << ", radius " << radius;
        }
        most = std::max(most, w);
        before = w;
      }
      EXPECT_GT(most, 1.0f);
      EXPECT_EQ(before, 0.0f);
    }
}

// Guards against: slats lit by what their neighbours' records could only guess at, and points given by one steep
// gradient that is noise.
TEST(RenderExtrapolation, WithOcclusionChangesAreJudgedByTheMeanOfThePicture) {
  constexpr float kA = 0.5f;
  RecordShapes shapes = shapes_in_a_cube(Interpolation::occlusion_hessian, kA, 1);
  RecordDetail& detail = shapes.details[shapes.details.draft(0)];
  detail = {.gradients = {}, .major = {1, 0, 0}, .inverse_major = 1.0f, .inverse_minor = 1.0f, .marks = {}};
  const auto given_at = [&](float E, const SurfacePoint& x) {
    return Extrapolator(shapes, x).of({glm::vec3(0.0f), {0, 0, 1}, 1.0f / kA, glm::vec3(E), 0}, 1.0f);
  };
  const auto slope = [&](float by_place, float by_normal) {
    detail.gradients.translational.fill({by_place, 0, 0});
    detail.gradients.rotational.fill({0, by_normal, 0});
  };
  const SurfacePoint beside{{0.5f, 0, 0}, {0, 0, 1}};
  shapes.shaper.expect(4.0f);
  slope(2.0f, 0.0f);
  EXPECT_FLOAT_EQ(given_at(3.0f, beside).E.x, 3.5f) << "1 is halved where the mean is four times as much";
  EXPECT_FLOAT_EQ(given_at(3.0f, {{-0.5f, 0, 0}, {0, 0, 1}}).E.x, 2.5f);
  slope(0.002f, 0.0f);
  EXPECT_NEAR(given_at(3.0f, beside).E.x, 3.001f, 2e-6f) << "what is small counts in full";
  slope(1e20f, 0.0f);
  EXPECT_FLOAT_EQ(given_at(3.0f, beside).E.x, 4.0f) << "and never more than a quarter of the mean";

  const auto covers = [&](float E, const SurfacePoint& x) { return given_at(E, x).covers; };
  const float most = 1.1f * kA * 4.0f;  // of a change that is foreseen
  slope(1.98f * most, 0.0f);
  EXPECT_TRUE(covers(3.0f, beside));
  slope(-1.98f * most, 0.0f);
  EXPECT_TRUE(covers(3.0f, beside));
  slope(2.02f * most, 0.0f);
  EXPECT_FALSE(covers(3.0f, beside));
  EXPECT_TRUE(covers(4.5f, beside)) << "a brighter record is judged by itself";
  EXPECT_GT(given_at(3.0f, beside).w, 0.0f) << "it counts where others cover";
  const float sine = 0.2f;
  const SurfacePoint turned{beside.p, {sine, 0, std::sqrt(1.0f - sine * sine)}};
  slope(-most, 0.51f * most / sine);
  EXPECT_FALSE(covers(3.0f, turned)) << "the two are added whatever their signs";
  slope(-most, 0.49f * most / sine);
  EXPECT_TRUE(covers(3.0f, turned));
  EXPECT_NEAR(given_at(3.0f, turned).E.x, 3.0f - 0.5f * most / (1.0f + 0.5f * most) + 0.49f * most, 1e-4f);

  shapes.shaper.expect(0.0f);  // unknown
  slope(2.0f, 0.0f);
  EXPECT_FLOAT_EQ(given_at(4.0f, beside).E.x, 4.5f) << "the record's own";
  slope(0.0f, 0.0f);
  EXPECT_TRUE(covers(0.0f, beside)) << "in the dark nothing changes";
}

// Guards against: a bunny covered with records whose gradients already know what its turning normals do.
TEST(RenderExtrapolation, NormalsTurnFartherWhereVirtualLightsGaveTheRecord) {
  constexpr float kA = 0.1f;
  const Bounds bounds{glm::vec3(-1.0f), glm::vec3(1.0f)};
  const float asked = search_reach(Interpolation::gradients, true) * kA;
  RecordShapes shapes{RecordShaper(Interpolation::gradients, asked, bounds,
                                   RadiusLimits::for_scene(bounds, 0.001f, 0.5f), 10),
                      RecordDetails(1, 1)};
  const std::uint32_t id = shapes.details.draft(0);
  const glm::vec3 E(1.0f);
  const float R = shapes.shaper.shape_of_vpls(1.0f, E, {}, shapes.details[id]);
  const Record r{glm::vec3(0.0f), {0, 0, 1}, R, E, id};
  const auto is_valid = [&](float distance, float turn) {  // |d| / R, and the root of 1 minus the cosine
    const float cosine = 1.0f - turn * turn;
    const SurfacePoint x{{0, distance, 0}, {std::sqrt(1.0f - cosine * cosine), 0, cosine}};
    const float weight = split_sphere_weight(x, r, asked);
    return weight > 0.0f && Extrapolator(shapes, x).of(r, weight).w > 0.0f;
  };
  EXPECT_TRUE(is_valid(0.99f * kA, 0.0f));
  EXPECT_FALSE(is_valid(1.01f * kA, 0.0f)) << "places count as they do without";
  EXPECT_TRUE(is_valid(0.0f, 2.99f * kA));
  EXPECT_FALSE(is_valid(0.0f, 3.01f * kA));
  EXPECT_TRUE(is_valid(0.49f * kA, 1.5f * kA));
  EXPECT_FALSE(is_valid(0.51f * kA, 1.5f * kA));
}

// Guards against: records that count three times as far as others because there was no room for their gradients.
TEST(RenderExtrapolation, RecordsOfVirtualLightsReachNoFartherWhereThereIsNoRoomForTheirDetails) {
  const RayTracer rays(make_scene("cornell_box"));
  ThreadCrew crew(rays, 1);
  const PrimaryHits primary = primary_hits(rays, 4, 4);
  const Visible x = primary.at(5, 0);
  ASSERT_TRUE(reflects(rays, x.hit));
  for (const RecordKind& kind : record_kinds_by_vpls()) {
    if (!extrapolates(kind.level)) continue;
    PassSetup setup{rays, crew, 4, 4};
    setup.vpls = 16;
    setup.interpolation = kind.level;
    const auto source = kind.make(setup);
    source->begin_frame({}, crew);
    Tracer tracer(rays);
    std::uint32_t made = 0;
    const Record first = source->evaluate(0, tracer, x, {});
    for (Record r = first; r.id != RecordDetails::kNone; ++made) {
      ASSERT_EQ(r.R, first.R) << kind.name;
      ASSERT_LT(made, 1u << 16) << "there is always room";
      source->settle(0, r, InsertResult::inserted);
      r = source->evaluate(0, tracer, x, {});
    }
    EXPECT_GT(made, 16u);
    EXPECT_EQ(source->evaluate(0, tracer, x, {}).R, first.R) << kind.name;
  }
}

}  // namespace
}  // namespace icbench
