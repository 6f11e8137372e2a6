// What records carry through a wall of no thickness that stands between all light and a dark room, and what they do
// not. Records of the lit side are there before the dark side asks, so that whatever could leak does.
//
// Through the wall, from one of its sides to the other, nothing passes. Along a floor that runs on under it records are
// valid on both sides: nothing passes with the guard against leaks; without it light gets as far as the region of a
// record reaches. Before a high wall the harmonic mean distance of a floor is 3 pi / 2 times that to the wall, or less
// where other things are near, so that with an accuracy below 2 / (3 pi) = 0.21 a split sphere ends before the wall,
// unless its radius is the least that records have.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <glm/geometric.hpp>
#include <limits>
#include <string>
#include <vector>

#include "cached_runs.h"
#include "core/random.h"
#include "render_support.h"
#include "scene/shapes.h"
#include "trap_invalid.h"

namespace icbench {
namespace {

// A closed room of 2 m, cut by the plane z = 1; the lamp is where z < 1.
Scene cut_room() {
  Scene s;
  s.name = "cut_room";
  const auto white = s.add_material({.albedo = glm::vec3(0.7f)});
  const auto glow = s.add_material({.emission = glm::vec3(10.0f)});
  s.meshes.push_back(box("walls", {glm::vec3(0.0f), glm::vec3(2.0f)}, white, true));
  s.meshes.push_back(quad("cut", {-0.1f, -0.1f, 1}, {2.2f, 0, 0}, {0, 2.2f, 0}, white));
  s.meshes.push_back(quad("lamp", {0.5f, 1.9f, 0.2f}, {0.7f, 0, 0}, {0, 0, 0.7f}, glow));
  s.camera = {.eye = {1, 1, 1.9f}, .target = {1, 0.5f, 1}, .up = {0, 1, 0}, .fov_y = 1.2f};
  return s;
}

// A room open to the front, lit by way of its back wall. On the right half of its floor lies a flat black box, open to
// the front too, with thin walls; its left wall ends `gap` above the floor. What light there is inside came through
// that.
Scene room_with_box(float gap) {
  constexpr float kLid = 0.08f;
  Scene s;
  s.name = "room_with_box";
  const auto white = s.add_material({.albedo = glm::vec3(0.7f)});
  const auto grey = s.add_material({.albedo = glm::vec3(0.1f)});
  s.meshes.push_back(quad("floor", {-1, 0, -1}, {0, 0, 1}, {2, 0, 0}, white));
  s.meshes.push_back(quad("ceiling", {-1, 1, -1}, {0, 0, 1}, {2, 0, 0}, white));
  s.meshes.push_back(quad("back", {-1, 0, -1}, {2, 0, 0}, {0, 1, 0}, white));
  s.meshes.push_back(quad("left", {-1, 0, -1}, {0, 0, 1}, {0, 1, 0}, white));
  s.meshes.push_back(quad("right", {1, 0, -1}, {0, 0, 1}, {0, 1, 0}, white));
  s.meshes.push_back(quad("lid", {0, kLid, -1}, {0, 0, 1}, {1, 0, 0}, grey));
  s.meshes.push_back(quad("wall", {0, gap, -1}, {0, 0, 1}, {0, kLid - gap, 0}, grey));
  s.point_lights.push_back({.p = {-0.3f, 0.5f, 2},
                            .intensity = glm::vec3(100.0f),
                            .axis = {0, 0, -1},
                            .cos_inner = 0.996f,
                            .cos_outer = 0.995f});
  s.camera = {.eye = {0, 0.3f, 3}, .target = {0, 0, -0.45f}, .up = {0, 1, 0}, .fov_y = 0.02f};
  return s;
}

constexpr int kSide = 32;
constexpr float kInfinity = std::numeric_limits<float>::infinity();

bool is_dark(std::size_t pixel) { return pixel % (2 * kSide) >= kSide; }

// Pixels of two squares: to the left, which is rendered first, what lies in the lit room, to the right in the dark one;
// on the wall that cuts it if `on_cut`, else on floor, ceiling and a side, at all distances from it down to a tenth of
// a millimetre.
PrimaryHits both_sides(const RayTracer& rays, bool on_cut) {
  PrimaryHits primary(rays.scene(), 2 * kSide, kSide);
  Tracer tracer(rays);
  Pcg32 random(3);
  for (std::size_t i = 0; i < primary.hits.size(); ++i) {
    const float side = is_dark(i) ? 1.0f : -1.0f;
    const float away = std::pow(10.0f, -4.0f + 3.8f * random.uniform());
    const float u = 0.3f + 0.8f * random.uniform(), v = random.uniform(), z = 1 + side * away;
    const glm::vec3 from(1, 1, 1 + 0.5f * side);
    const glm::vec3 to = on_cut     ? glm::vec3(u, 0.2f + v, 1)
                         : v < 0.5f ? glm::vec3(u, 0, z)
                         : v < 0.8f ? glm::vec3(u, 2, z)
                                    : glm::vec3(0, u, z);
    primary.hits[i] = tracer.intersect(Ray{from, kInfinity, to - from});
    const Hit& hit = primary.hits[i];
    EXPECT_FALSE(hit.missed());
    EXPECT_GT(side * (on_cut ? hit.n.z : hit.p.z - 1), 0.0f) << "not on the side it should be on";
  }
  return primary;
}

class Walls : public ::testing::TestWithParam<RecordKind> {
 protected:
  static Level level(float a, std::uint32_t gather_rays, bool leak_guard) {
    return {
        .level = GetParam().level, .gather_rays = gather_rays, .a = a, .leak_guard = leak_guard, .vpls = 128};
  }
  // Whether a lit record's region holds the point, wherever its normal looks.
  static bool is_near(const LevelRun& run, float a, const glm::vec3& p) {
    const float widened = GetParam().level == Interpolation::neighbour_clamping ? 1.0f : GetParam().reach();
    return std::any_of(run.records.begin(), run.records.end(), [&](const Record& r) {
      return r.E.y > 0.0f && glm::distance(r.p, p) <= 1.00001f * widened * a * r.R;
    });
  }
};
INSTANTIATE_TEST_SUITE_P(Kinds, Walls, ::testing::ValuesIn(record_kinds()), kind_name);

// Guards against: sheets that shine on their dark side.
TEST_P(Walls, NothingPassesFromOneSideOfASheetToTheOther) {
  const RayTracer rays(cut_room());
  const PrimaryHits primary = both_sides(rays, true);
  for (const float a : {0.2f, 0.6f, 1.0f})
    for (const bool guard : {false, true}) {
      const LevelRun made = run_level(rays, primary, level(a, 64, guard), GetParam().make);
      std::size_t near = 0;
      for (std::size_t i = 0; i < primary.hits.size(); ++i) {
        const float L = made.indirect.pixels[i].y;
        if (!is_dark(i)) {
          ASSERT_GT(L, 0.0f);
          continue;
        }
        ASSERT_EQ(L, 0.0f) << "accuracy " << a;
        near += is_near(made, a, primary.hits[i].p);
      }
      EXPECT_GT(near, primary.hits.size() / 4) << "normals were not what kept light out";
    }
}

// Guards against: light that leaks past the guard, or without it farther than a record is valid.
TEST_P(Walls, AlongAFloorLightPassesAsFarAsRecordsReachAndNoneWithTheGuard) {
  const RayTracer rays(cut_room());
  const PrimaryHits primary = both_sides(rays, false);
  const float diagonal = std::sqrt(12.0f);
  for (const float a : {0.2f, 0.6f, 1.0f})
    for (const std::uint32_t gather_rays : {64u, 256u})
      for (const bool guard : {false, true}) {
        const LevelRun made = run_level(rays, primary, level(a, gather_rays, guard), GetParam().make);
        std::size_t leaks = 0;
        float deepest = 0.0f;
        for (std::size_t i = 0; i < primary.hits.size(); ++i) {
          const glm::vec3& p = primary.hits[i].p;
          if (!is_dark(i) || made.indirect.pixels[i] == glm::vec3(0.0f)) continue;
          ++leaks;
          deepest = std::max(deepest, p.z - 1.0f);
          ASSERT_FALSE(guard) << "accuracy " << a << ", at " << p.x << ' ' << p.y << ' ' << p.z;
          ASSERT_TRUE(is_near(made, a, p));
        }
        std::printf("accuracy %g, %u rays%s: light at %zu points, to %.2g m\n", static_cast<double>(a),
                    gather_rays, guard ? ", guarded" : "", leaks, static_cast<double>(deepest));
        if (guard) continue;
        EXPECT_GT(leaks, 100u) << "there was nothing to guard against";
        if (a == 0.2f && (GetParam().by_vpls() || GetParam().level == Interpolation::split_sphere)) {
          EXPECT_LE(deepest, 1.0001f * a * kMinRadiusOfDiagonal * diagonal);
        }
      }
}

// Guards against: a guard that takes what is nearer than the nearest thing a ray met for near, though no ray went
// straight to the wall.
TEST_P(Walls, TheGuardStopsARecordStraightBehindTheWall) {
  constexpr float kA = 1.0f;
  const RayTracer rays(cut_room());
  ThreadCrew crew(rays, 1);
  Tracer tracer(rays);
  PassSetup setup{rays, crew, 64, 64};
  setup.interpolation = GetParam().level;
  setup.leak_guard = true;
  setup.gather_rays = 64;
  setup.a = kA;
  const auto source = GetParam().make(setup);
  source->begin_frame({}, crew);
  ASSERT_NE(source->shapes(), nullptr);
  std::size_t stopped = 0, leak = 0;
  for (std::uint32_t i = 0; i < 400; ++i) {
    const float away = std::pow(10.0f, -2.0f + 1.4f * static_cast<float>(i) / 400.0f);
    const glm::vec3 from(1, 1, 0.5f), p(0.7f, 0, 1 - away);
    const Hit hit = tracer.intersect(Ray{from, kInfinity, p - from});
    ASSERT_FALSE(hit.missed());
    ListSession session{.bounds = rays.scene().bounds, .a = GetParam().reach() * kA};
    const Record r = source->evaluate(0, tracer, {hit, glm::vec3(1.0f), i, 0}, {});
    ASSERT_EQ(session.insert(r), InsertResult::inserted);
    source->settle(0, r, InsertResult::inserted);
    LeakTests tests;
    for (const float behind : {1e-5f, 1e-4f, 1e-3f}) {
      const SurfacePoint x{{r.p.x, r.p.y, 1 + behind}, r.n};
      const bool is_valid = extrapolates(GetParam().level)
                                ? query_extrapolating(session, *source->shapes(), x).has_value()
                                : session.query(x).has_value();
      if (!is_valid) continue;
      if (query_guarded(session, *source->shapes(), tracer, x, tests))
        ++leak;
      else
        ++stopped;
    }
  }
  EXPECT_EQ(leak, 0u);
  EXPECT_GT(stopped, 100u) << "there was nothing to guard against";
}

// Guards against: records beside a wall that shine through it, and those behind it that darken what is in front.
TEST_P(Walls, TheGuardStopsLeaksThroughTheWallOfALowBox) {
  constexpr float kA = 0.6f;
  for (const float gap : {0.0f, 0.005f}) {
    const RayTracer rays(room_with_box(gap));
    const PrimaryHits primary = primary_hits(rays, 56, 8);
    for (const Hit& hit : primary.hits) ASSERT_TRUE(reflects(rays, hit));
    const Image exact = without_cache(rays, primary, level(kA, 256, false), GetParam().by_vpls());
    double inside[2] = {}, outside[2] = {};  // RMS error, without the guard and with it
    for (const bool guard : {false, true}) {
      const LevelRun made = run_level(rays, primary, level(kA, 256, guard), GetParam().make);
      for (std::size_t i = 0; i < exact.pixels.size(); ++i)
        (primary.hits[i].p.x > 0.0f ? inside : outside)[guard] +=
            std::pow(made.indirect.pixels[i].y - exact.pixels[i].y, 2.0f);
      EXPECT_EQ(made.use.leaks.stopped > 0, guard);
      EXPECT_LE(made.use.leaks.stopped, made.use.leaks.rays);
    }
    for (double* error : {inside, outside})
      for (const bool guard : {false, true})
        error[guard] = std::sqrt(error[guard] / (0.5 * static_cast<double>(exact.pixels.size())));
    std::printf(
        "%s, wall %g m above the floor: RMS error behind it %.2g, %.2g with the guard; before it %.2g, "
        "%.2g\n",
        GetParam().name.c_str(), static_cast<double>(gap), inside[false], inside[true], outside[false],
        outside[true]);
    EXPECT_GT(inside[false], 0.01) << "nothing leaks";
    EXPECT_LE(inside[true], (gap > 0.0f ? 0.35 : 0.0) * inside[false]);
    EXPECT_LT(outside[true], 1.2 * outside[false]);
  }
}

}  // namespace
}  // namespace icbench
