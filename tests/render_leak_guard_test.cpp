// The guard against leaks: sectors, the marks of a record, and which suspects are asked for.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <limits>
#include <numbers>

#include "render/extrapolation.h"
#include "render/guarded_sum.h"
#include "render/hemisphere.h"
#include "render/leak_guard.h"
#include "render/ray_tracer.h"
#include "scene/registry.h"
#include "scene/shapes.h"

namespace icbench {
namespace {

constexpr double kTwoPi = 2.0 * std::numbers::pi;

std::uint32_t sector_towards(double angle, double length = 1.0) {
  return leak_sector(static_cast<float>(length * std::cos(angle)),
                     static_cast<float>(length * std::sin(angle)));
}

// Guards against: a sector that is left out, or that another overlaps, and so a direction in which no wall is seen.
TEST(LeakSectors, GoAroundOnceEachAboutAsWideAsAnother) {
  constexpr int kSteps = 32'000;
  std::array<int, kLeakSectors> hits{};
  std::uint32_t last = sector_towards(0.0);
  int changes = 0;
  for (int i = 0; i < kSteps; ++i) {
    const std::uint32_t sector = sector_towards(kTwoPi * i / kSteps);
    ASSERT_LT(sector, kLeakSectors);
    ++hits[sector];
    if (sector == last) continue;
    ASSERT_EQ(sector, (last + 1) % kLeakSectors);
    last = sector;
    ++changes;
  }
  EXPECT_GE(changes, static_cast<int>(kLeakSectors) - 1);
  for (const int n : hits) {
    EXPECT_GT(n, 0.7 * kSteps / kLeakSectors);
    EXPECT_LT(n, 1.4 * kSteps / kLeakSectors);
  }
}

TEST(LeakSectors, HaveTheirMiddleInside) {
  for (std::uint32_t i = 0; i < kLeakSectors; ++i) {
    const glm::vec2 to = middle_of_leak_sector(i);
    EXPECT_NEAR(glm::length(to), 1.0f, 1e-6f);
    EXPECT_EQ(leak_sector(to.x, to.y), i);
  }
}

TEST(LeakSectors, AreThereForEveryPairOfNumbers) {
  constexpr float kLargest = std::numeric_limits<float>::max(),
                  kLeast = std::numeric_limits<float>::denorm_min();
  EXPECT_EQ(leak_sector(0.0f, 0.0f), 0u);
  EXPECT_EQ(leak_sector(-0.0f, -0.0f), 0u);
  for (const float x : {0.0f, -0.0f, kLeast, -kLeast, 1.0f, -1.0f, kLargest, -kLargest})
    for (const float y : {0.0f, -0.0f, kLeast, -kLeast, 1.0f, -1.0f, kLargest, -kLargest})
      EXPECT_LT(leak_sector(x, y), kLeakSectors) << x << ' ' << y;
  for (const double length : {1e-30, 1e-3, 1e3, 1e30})
    for (int i = 0; i < 64; ++i) {
      const double angle = kTwoPi * (i + 0.37) / 64.0;
      EXPECT_EQ(sector_towards(angle, length), sector_towards(angle));
    }
}

// What a gather of M x N rays saw that met something low at distance `t` in cell n, and nothing else.
Hemisphere one_low_hit(std::uint32_t M, std::uint32_t N, std::uint32_t n, float t) {
  Hemisphere seen;
  seen.strata = {M, N};
  seen.samples.assign(seen.strata.count(), {seen.basis.n, std::numeric_limits<float>::infinity(), {}, {}});
  const double angle = kTwoPi * (n + 0.5) / N;
  HemisphereSample& hit = seen.samples[n];
  hit.d = 0.8f * (static_cast<float>(std::cos(angle)) * seen.basis.s +
                  static_cast<float>(std::sin(angle)) * seen.basis.t) +
          0.6f * seen.basis.n;
  hit.t = t;
  return seen;
}

// Guards against: a wall that a record does not suspect because its ray went to a neighbouring cell, or because the
// last cell borders on the first.
TEST(LeakMarks, HoldTheCellOfALowRayAndItsNeighboursAllAround) {
  for (const std::uint32_t N : {1u, 2u, 3u, 4u, 7u, 15u, 28u, 57u, 200u})
    for (std::uint32_t n = 0; n < N; ++n) {
      const LeakMarks marks = leak_marks(one_low_hit(2, N, n, 1.0f), 2.0f);
      const auto is_marked = [&](double cell) {
        return (marks.sectors >> sector_towards(kTwoPi * cell / N) & 1u) != 0;
      };
      for (int i = 0; i <= 300; ++i) EXPECT_TRUE(is_marked(n - 1.0 + 0.0099 * i + 0.001)) << n << " of " << N;
      EXPECT_LE(marks.nearest, 0.8f);
      if (N >= 15) {
        EXPECT_FALSE(is_marked(n + 0.5 + 0.5 * N)) << n << " of " << N;
        EXPECT_GT(marks.nearest, 0.7f);
      }
    }
}

TEST(LeakMarks, AreNotOfWhatIsHighOrFar) {
  Hemisphere seen = one_low_hit(2, 28, 5, 1.0f);
  // A flat wall 0.8 m away in one azimuth is nearer in the next.
  EXPECT_EQ(leak_marks(seen, 0.77f).sectors, 0u);
  EXPECT_NE(leak_marks(seen, 0.79f).sectors, 0u);
  EXPECT_NE(leak_marks(seen, 0.81f).sectors, 0u);
  seen.samples[5].d = {0.6f, 0.0f, 0.8f};
  EXPECT_EQ(leak_marks(seen, 2.0f).sectors, 0u);
}

// A floor and, at z = 0.5, a wall as high as `height` and as wide as the floor.
Scene floor_with_wall(float height) {
  Scene s;
  s.name = "floor_with_wall";
  const auto white = s.add_material({.albedo = glm::vec3(0.5f)});
  s.meshes.push_back(quad("floor", {-2, 0, -2}, {0, 0, 4}, {4, 0, 0}, white));
  s.meshes.push_back(quad("wall", {-2, 0, 0.5f}, {4, 0, 0}, {0, height, 0}, white));
  s.camera = {.eye = {0, 1, -2}, .target = {0, 0, 0}, .up = {0, 1, 0}, .fov_y = 1.0f};
  return s;
}

// Guards against: walls over which every ray of a gather passes; marks where nothing stands, each of which costs a ray
// at every query; and rays that take the surface itself for a wall where it is shaded as if it were tilted.
TEST(LowMarks, AreOfWhatRisesByMoreThanTheirRays) {
  const RayTracer low(floor_with_wall(0.02f)), high(floor_with_wall(0.04f));
  const auto marks_of = [](const RayTracer& rays, float reach, const glm::vec3& n, LeakMarks known = {}) {
    Tracer tracer(rays);
    Hit at = tracer.intersect(Ray{{0, 1, 0}, std::numeric_limits<float>::infinity(), {0, -1, 0}});
    EXPECT_FALSE(at.missed());
    at.n = n;
    mark_low(known, tracer, at, Basis(n), reach);
    return known;
  };
  const glm::vec3 up(0, 1, 0);
  for (const glm::vec3& n :
       {up, glm::normalize(glm::vec3(0.3f, 1, -0.2f)), glm::normalize(glm::vec3(1, 0.5f, 0))}) {
    EXPECT_EQ(marks_of(high, 0.49f, n).sectors, 0u) << "nothing is that near";
    EXPECT_EQ(marks_of(low, 0.51f, n).sectors, 0u) << "it is too low to be met";
  }
  const LeakMarks marks = marks_of(high, 0.51f, up);
  const Basis basis(up);
  const auto is_marked = [&](const glm::vec3& d) {
    return (marks.sectors >> leak_sector(glm::dot(d, basis.s), glm::dot(d, basis.t)) & 1u) != 0;
  };
  EXPECT_TRUE(is_marked({0, 0, 1}));
  EXPECT_FALSE(is_marked({0, 0, -1}));
  EXPECT_FALSE(is_marked({1, 0, 0}));
  EXPECT_FALSE(is_marked({-1, 0, 0}));
  EXPECT_LE(marks.nearest, 0.5f);
  EXPECT_GT(marks.nearest, 0.45f);
  // All that lies within reach behind a wall is in a marked sector, as long as it is a twentieth of the reach high.
  const RayTracer higher(floor_with_wall(0.08f));
  for (const float reach : {0.51f, 0.6f, 1.0f, 1.5f}) {
    const LeakMarks far = marks_of(higher, reach, up);
    for (int i = 0; i <= 100; ++i) {
      const float x = (static_cast<float>(i) / 50.0f - 1.0f) * std::sqrt(reach * reach - 0.5001f * 0.5001f);
      const glm::vec3 behind(x, 0.0f, 0.5001f);
      const Record r{glm::vec3(0.0f), up, 1.0f, glm::vec3(1.0f), 0};
      EXPECT_TRUE(is_suspect({behind, up}, r, far)) << "reach " << reach << ", at " << x;
    }
  }
  // What is marked already, but farther, does not hide what is nearer.
  EXPECT_LE(marks_of(high, 0.6f, up, {~0u, 0.55f}).nearest, 0.5f);
  EXPECT_EQ(marks_of(high, 0.6f, up, {~0u, 0.4f}).nearest, 0.4f);
}

// Suspects of which half are behind something, as the guard judges them.
class Suspects : public ::testing::Test {
 protected:
  // From inside the room to its wall, and beyond it.
  static Ray ray(bool is_stopped) {
    const glm::vec3 middle = 0.5f * (rays().scene().bounds.lower + rays().scene().bounds.upper);
    const glm::vec3 size = rays().scene().bounds.upper - rays().scene().bounds.lower;
    return {middle, 1.0f, glm::vec3((is_stopped ? 10.0f : 1e-3f) * size.x, 0.0f, 0.0f)};
  }
  static const RayTracer& rays() {
    static const RayTracer room(make_scene("white_furnace"));
    return room;
  }
  Tracer tracer_{rays()};
  LeakTests tests_;
};

TEST_F(Suspects, CountUnlessSomethingStandsInBetween) {
  CoveredMean sum;
  LeakGuard guard(tracer_, tests_, sum);
  for (int i = 0; i < 40; ++i) guard.add({glm::vec3(i % 2 == 0 ? 1.0f : 5.0f), 1.0f, true}, ray(i % 2 != 0));
  guard.judge();
  EXPECT_EQ(tests_.rays, 40u);
  EXPECT_EQ(tests_.stopped, 20u);
  EXPECT_EQ(sum.weight(), 20.0);
  ASSERT_TRUE(sum.result().has_value());
  EXPECT_EQ(sum.result()->x, 1.0f);
}

// Guards against: light through a wall from a record too faint to be asked for, and records that are left out though
// nothing else counts.
TEST_F(Suspects, AreNotWorthARayWhereOthersCountForFarMore) {
  CoveredMean sum;
  LeakGuard guard(tracer_, tests_, sum);
  const Contribution faint{glm::vec3(7.0f), 1e-3f, true};
  EXPECT_TRUE(guard.is_worth_a_ray(faint)) << "nothing else is there";
  sum.add({glm::vec3(1.0f), 1.0f, false});
  EXPECT_TRUE(guard.is_worth_a_ray(faint)) << "nothing covers the point, so that a new record would be made";
  sum.add({glm::vec3(1.0f), 1.0f, true});
  EXPECT_FALSE(guard.is_worth_a_ray(faint));
  EXPECT_TRUE(guard.is_worth_a_ray({faint.E, 0.1f, true}));
  // Those that became unworthy while they waited are dropped, seen or not.
  guard.add(faint, ray(false));
  guard.add(faint, ray(true));
  guard.add({glm::vec3(1.0f), 0.5f, true}, ray(false));
  guard.judge();
  EXPECT_EQ(tests_.rays, 1u);
  EXPECT_EQ(tests_.stopped, 0u);
  EXPECT_EQ(sum.weight(), 2.5);
  EXPECT_EQ(sum.result()->x, 1.0f);
}

}  // namespace
}  // namespace icbench
