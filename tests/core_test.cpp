// Weights, validity, radius limits, random numbers and octree addressing.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "core/arena.h"
#include "core/cache.h"
#include "core/octree.h"
#include "core/random.h"

namespace icbench {
namespace {

constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

glm::vec3 random_unit(Pcg32& rng) {
  const float z = 2.0f * rng.uniform() - 1.0f;
  const float phi = 6.2831853f * rng.uniform();
  const float r = std::sqrt(std::max(0.0f, 1.0f - z * z));
  return {r * std::cos(phi), r * std::sin(phi), z};
}

glm::vec3 random_point(Pcg32& rng) { return {rng.uniform(), rng.uniform(), rng.uniform()}; }

Record record_at(glm::vec3 p, glm::vec3 n, float R) { return {p, n, R, glm::vec3(1.0f), 0}; }

TEST(SplitSphereWeight, FollowsWardsFormula) {
  // d/R = 0.5 and 60 degrees between the normals: error 0.5 + sqrt(0.5).
  const Record r = record_at({0, 0, 0}, {0, 0, 1}, 2.0f);
  const SurfacePoint x{{0, -1, 0}, {0, std::sqrt(0.75f), 0.5f}};
  EXPECT_NEAR(split_sphere_error(x, r), 0.5f + std::sqrt(0.5f), 1e-6f);
  // The point is bent towards the record's side, so it does not lie in front.
  EXPECT_NEAR(split_sphere_weight({{0, 1, 0}, x.n}, r, 2.0f), 1.0f / (0.5f + std::sqrt(0.5f)), 1e-5f);
}

TEST(SplitSphereWeight, IsFiniteAtTheRecordItself) {
  const Record r = record_at({0.3f, 0.3f, 0.3f}, {0, 1, 0}, 0.1f);
  EXPECT_EQ(split_sphere_weight({r.p, r.n}, r, 0.5f), 1.0f / kMinError);
}

TEST(SplitSphereWeight, SurvivesNormalsWhoseDotExceedsOne) {
  Pcg32 rng(7);
  int above_one = 0;
  for (int i = 0; i < 10000; ++i) {
    const glm::vec3 n = glm::normalize(random_unit(rng));
    above_one += glm::dot(n, n) > 1.0f;
    const float weight = split_sphere_weight({{0, 0, 0}, n}, record_at({0, 0, 0}, n, 1.0f), 0.5f);
    ASSERT_TRUE(std::isfinite(weight) && weight > 0.0f);
  }
  EXPECT_GT(above_one, 100) << "the case this guards against did not occur";
}

TEST(SplitSphereWeight, KeepsCoplanarRecordsOnAnyPlane) {
  // Without the tolerance, rounding puts about half of the coplanar points slightly in front.
  Pcg32 rng(11);
  int would_be_lost = 0;
  for (int i = 0; i < 20000; ++i) {
    const glm::vec3 n = random_unit(rng);
    const glm::vec3 t = glm::normalize(glm::cross(n, random_unit(rng)));
    const glm::vec3 p = 5.0f * random_point(rng);
    const float R = 0.01f + rng.uniform();
    const SurfacePoint x{p + 0.3f * R * t, n};
    const Record r = record_at(p, n, R);
    would_be_lost += glm::dot(x.p - r.p, x.n + r.n) < 0.0f;
    ASSERT_GT(split_sphere_weight(x, r, 0.5f), 0.0f);
  }
  EXPECT_GT(would_be_lost, 1000) << "the case this guards against did not occur";
}

TEST(SplitSphereWeight, RejectsRecordsInFront) {
  const Record behind_a_step = record_at({0, 0, 0.2f}, {0, 0, 1}, 1.0f);
  EXPECT_EQ(split_sphere_weight({{0.1f, 0, 0}, {0, 0, 1}}, behind_a_step, 0.9f), 0.0f);
}

TEST(SplitSphereWeight, IsZeroForOppositeNormalsAndForNaN) {
  const Record r = record_at({0, 0, 0}, {0, 0, 1}, 1.0f);
  EXPECT_EQ(split_sphere_weight({{0, 0, 0}, {0, 0, -1}}, r, 1.0f), 0.0f);
  EXPECT_EQ(split_sphere_weight({{kNaN, 0, 0}, {0, 0, 1}}, r, 1.0f), 0.0f);
}

// Guards against a quick rejection that disagrees with the formula by rounding, underflow or overflow: points along a
// record's border, and lengths from where squares vanish to where they are infinite.
TEST(SplitSphereWeight, QuickRejectionNeverTakesAValidRecord) {
  Pcg32 rng(7);
  int valid = 0, rejected = 0;
  for (int i = 0; i < 300000; ++i) {
    const float a = 0.002f + 3.0f * rng.uniform();
    const float R = std::pow(10.0f, 57.0f * rng.uniform() - 37.0f);
    const glm::vec3 n = random_unit(rng);
    const bool close = (i & 1) != 0;
    const float share = close ? 1.0f + 2e-6f * (rng.uniform() - 0.5f) : 3.0f * rng.uniform();
    const SurfacePoint x{share * a * R * random_unit(rng), n};
    const Record r = record_at({0, 0, 0}, n, R);
    const float weight = split_sphere_weight(x, r, a);
    ASSERT_EQ(weight, likely_split_sphere_weight(x, r, a)) << "R " << R << ", a " << a << ", share " << share;
    valid += weight > 0.0f;
    rejected += is_surely_too_far(x, r, a);
  }
  EXPECT_GT(valid, 30000);
  EXPECT_GT(rejected, 30000);
}

TEST(Interpolator, AnswersNothingExactlyWithoutRecords) {
  Interpolator none;
  EXPECT_FALSE(none.result().has_value());
  Interpolator dark;
  dark({{}, {}, 1.0f, glm::vec3(0.0f), 0}, 2.0f);
  ASSERT_TRUE(dark.result().has_value());
  EXPECT_EQ(*dark.result(), glm::vec3(0.0f));
}

TEST(Interpolator, StaysFiniteFromTinyToHuge) {
  for (const float E : {1e-30f, 1e-20f, 1.0f, 1e20f, kMaxIrradiance}) {
    Interpolator sum;
    for (int i = 0; i < 16; ++i) sum({{}, {}, 1.0f, glm::vec3(E), 0}, 1.0f / kMinError);
    ASSERT_TRUE(sum.result().has_value());
    EXPECT_NEAR(sum.result()->x / E, 1.0f, 1e-5f) << E;
  }
}

// A million records on one spot: sums of floats overflow at the largest irradiance, and lose 2 % at 0.1.
TEST(Interpolator, AMillionEqualRecordsAreAsOne) {
  for (const float E : {1e-20f, 0.1f, 1.0f / 3.0f, kMaxIrradiance}) {
    for (const float weight : {1.0f / 0.7f, 1.0f / kMinError}) {
      Interpolator sum;
      for (int i = 0; i < 1'000'000; ++i) sum({{}, {}, 1.0f, glm::vec3(E), 0}, weight);
      ASSERT_TRUE(sum.result().has_value());
      EXPECT_NEAR(sum.result()->x / E, 1.0f, 2.5e-7f) << E << " of weight " << weight;
      EXPECT_TRUE(is_irradiance(*sum.result())) << E << " of weight " << weight;
    }
  }
}

TEST(RadiusLimits, ClampAlsoWhatIsNotANumber) {
  const RadiusLimits limits{0.1f, 2.0f};
  EXPECT_EQ(limits.clamp(0.0f), 0.1f);
  EXPECT_EQ(limits.clamp(-1.0f), 0.1f);
  EXPECT_EQ(limits.clamp(1.0f), 1.0f);
  EXPECT_EQ(limits.clamp(kInf), 2.0f);
  EXPECT_EQ(limits.clamp(kNaN), 2.0f);
}

// Guards against: squares of sides that overflow or vanish in single precision.
TEST(RadiusLimits, AreSharesOfTheDiagonalOfScenesOfAnySize) {
  for (const float size : {1e-30f, 1e-20f, 1e-3f, 1.0f, 1e7f, 1e20f, 1e30f}) {
    const RadiusLimits limits = RadiusLimits::for_scene({glm::vec3(0.0f), glm::vec3(size)}, 0.001f, 0.5f);
    EXPECT_NEAR(limits.min / (0.001f * std::sqrt(3.0f) * size), 1.0f, 1e-6f) << size;
    EXPECT_NEAR(limits.max / (0.5f * std::sqrt(3.0f) * size), 1.0f, 1e-6f) << size;
  }
  const RadiusLimits of_a_point = RadiusLimits::for_scene({glm::vec3(2.0f), glm::vec3(2.0f)}, 0.001f, 0.5f);
  EXPECT_EQ(of_a_point.min, 2.0f * kMinRadiusShare);
  EXPECT_EQ(of_a_point.max, of_a_point.min);
}

TEST(Storable, RefusesWhatIsNotFiniteOrNotUnitOrOutside) {
  const Bounds b{{0, 0, 0}, {1, 1, 1}};
  const Record good = record_at({0.5f, 0.5f, 0.5f}, {0, 0, 1}, 0.1f);
  EXPECT_TRUE(is_storable(good, b));
  for (const float bad : {kNaN, kInf, -kInf}) {
    Record r = good;
    r.p.y = bad;
    EXPECT_FALSE(is_storable(r, b));
    r = good;
    r.n.x = bad;
    EXPECT_FALSE(is_storable(r, b));
    r = good;
    r.E.z = bad;
    EXPECT_FALSE(is_storable(r, b));
    r = good;
    r.R = bad;
    EXPECT_FALSE(is_storable(r, b));
  }
  Record r = good;
  r.R = 0.0f;
  EXPECT_FALSE(is_storable(r, b));
  r = good;
  r.n = {0, 0, 0};
  EXPECT_FALSE(is_storable(r, b));
  r = good;
  r.p.x = 1.0001f;
  EXPECT_FALSE(is_storable(r, b));
  r.p.x = 1.0f;
  EXPECT_TRUE(is_storable(r, b)) << "points on the bounds belong to them";
}

TEST(Octree, LevelFitsTheRecord) {
  const OctreeAddressing octree({{0, 0, 0}, {8, 8, 8}});
  for (const float extent : {1e-6f, 0.001f, 0.01f, 0.1f, 0.5f, 0.9f, 1.0f, 2.0f, 3.9f}) {
    const int level = octree.level_for(extent);
    const float side = 8.0f / static_cast<float>(1 << level);
    EXPECT_GE(side, 2.0f * extent);
    if (level < kMaxLevel) {
      EXPECT_LT(side, 4.0f * extent);
    }
  }
  EXPECT_EQ(octree.level_for(100.0f), 0);
  EXPECT_EQ(octree.level_for(1e-40f), kMaxLevel);
}

/// Whether a query at x visits the cell in which a record at p with this extent is stored.
bool reaches(const OctreeAddressing& octree, glm::vec3 x, glm::vec3 p, float extent) {
  const GridPoint stored = octree.quantise(p);
  const WardNeighbourhood neighbourhood(octree.quantise(x));
  const int level = octree.level_for(extent);
  for (int l = 0; l < level; ++l) {
    const int shift = kMaxLevel - l;
    const unsigned allowed =
        neighbourhood.children(l, stored.x >> shift, stored.y >> shift, stored.z >> shift);
    if ((allowed & (1u << OctreeAddressing::octant(stored, l))) == 0) return false;
  }
  return true;
}

TEST(Octree, QueryReachesEveryRecordWhoseExtentHoldsThePoint) {
  Pcg32 rng(3);
  for (const Bounds b : {Bounds{{0, 0, 0}, {1, 1, 1}}, Bounds{{-1e4f, 3, 7}, {1e4f, 5, 1e3f}},
                         Bounds{{1e6f, 1e6f, 1e6f}, {1.0001e6f, 1.0001e6f, 1.0001e6f}},
                         Bounds{{0, 0, 0}, {1e-9f, 1e-9f, 1e-9f}}}) {
    const OctreeAddressing octree(b);
    const glm::vec3 size = b.upper - b.lower;
    const float side = std::max({size.x, size.y, size.z});
    for (int i = 0; i < 100000; ++i) {
      const glm::vec3 p = b.lower + size * random_point(rng);
      const float extent = side * std::pow(2.0f, -24.0f * rng.uniform());
      const glm::vec3 x = glm::clamp(p + extent * random_unit(rng), b.lower, b.upper);
      const glm::vec3 d = x - p;
      if (std::sqrt(glm::dot(d, d)) > extent) continue;  // rounded out of the sphere
      ASSERT_TRUE(reaches(octree, x, p, extent)) << "extent " << extent << " at trial " << i;
    }
  }
}

TEST(Octree, QueryVisitsAboutEightCellsALevel) {
  // The bound on a query's steps: 8 a level away from the finest levels.
  Pcg32 rng(5);
  const OctreeAddressing octree({{0, 0, 0}, {1, 1, 1}});
  constexpr int kLevel = 10;
  for (int i = 0; i < 200; ++i) {
    const WardNeighbourhood neighbourhood(octree.quantise(random_point(rng)));
    std::set<std::array<int, 3>> cells{{0, 0, 0}};
    for (int l = 0; l < kLevel; ++l) {
      std::set<std::array<int, 3>> next;
      for (const auto& [cx, cy, cz] : cells) {
        const unsigned mask = neighbourhood.children(l, cx, cy, cz);
        for (int c = 0; c < 8; ++c) {
          if (mask & (1u << c)) next.insert({2 * cx + (c & 1), 2 * cy + ((c >> 1) & 1), 2 * cz + (c >> 2)});
        }
      }
      cells = next;
      ASSERT_LE(cells.size(), 27u);
    }
  }
}

TEST(Octree, PointBoundsAreUsable) {
  const OctreeAddressing octree({{2, 2, 2}, {2, 2, 2}});
  const GridPoint u = octree.quantise({2, 2, 2});
  EXPECT_EQ(u.x, 0);
  EXPECT_TRUE(reaches(octree, {2, 2, 2}, {2, 2, 2}, 1e-3f));
}

TEST(Arena, HandsOutAllUnitsAndNoneBeyondAndZeroAgain) {
  // A page each: what lies beyond is somebody else's.
  constexpr std::size_t kUnit = 4096;
  Arena<StdSync, kUnit> arena(3);
  for (int round = 0; round < 2; ++round) {
    for (UnitIndex i = 1; i <= 3; ++i) {
      ASSERT_EQ(arena.take(1), i);
      auto* const unit = static_cast<unsigned char*>(arena.at(i));
      EXPECT_EQ(std::count(unit, unit + kUnit, 0), kUnit) << "unit " << i << ", round " << round;
      std::fill_n(unit, kUnit, 0xff);
    }
    EXPECT_EQ(arena.take(1), 0u);
    EXPECT_EQ(arena.end(), 4u);
    EXPECT_EQ(arena.left(), 0u);
    arena.reset();
    EXPECT_EQ(arena.take(4), 0u) << "more than there are";
  }
}

TEST(Random, StreamsDependOnTheKeyAlone) {
  Pcg32 a(42), b(42), c(43);
  int equal = 0;
  for (int i = 0; i < 1000; ++i) {
    const auto x = a();
    ASSERT_EQ(x, b());
    equal += x == c();
  }
  EXPECT_LT(equal, 3);
}

TEST(Random, UniformStaysBelowOneAndAveragesOneHalf) {
  Pcg32 rng(9);
  double sum = 0.0;
  for (int i = 0; i < 100000; ++i) {
    const float u = rng.uniform();
    ASSERT_TRUE(u >= 0.0f && u < 1.0f);
    sum += u;
  }
  EXPECT_NEAR(sum / 100000, 0.5, 4.0 * std::sqrt(1.0 / 12.0 / 100000));
}

TEST(Config, EveryMistakeGetsItsLine) {
  CacheConfig good;
  EXPECT_EQ(config_error(good), nullptr);
  auto bad = [&](auto&& change) {
    CacheConfig c;
    change(c);
    return config_error(c) != nullptr;
  };
  EXPECT_TRUE(bad([](CacheConfig& c) { c.bounds.lower.x = kNaN; }));
  EXPECT_TRUE(bad([](CacheConfig& c) { c.bounds.lower.x = 2.0f; }));
  EXPECT_TRUE(bad([](CacheConfig& c) { c.a = 0.0f; }));
  EXPECT_TRUE(bad([](CacheConfig& c) { c.a = kNaN; }));
  EXPECT_TRUE(bad([](CacheConfig& c) { c.a = 0.6f; }));
  EXPECT_TRUE(bad([](CacheConfig& c) { c.capacity = 0; }));
  EXPECT_TRUE(bad([](CacheConfig& c) { c.max_sessions = 0; }));
  EXPECT_TRUE(bad([](CacheConfig& c) { c.max_sessions = 8193; }));
}

TEST(Config, CapacityIsForAllRecordsOrTheGreatest) {
  EXPECT_EQ(capacity_for(1000, 8), 1000 + 8 * kTicketBatch);
  for (const std::uint64_t records :
       {std::uint64_t{kMaxCapacity}, std::uint64_t{UINT32_MAX}, UINT64_MAX - 8, UINT64_MAX})
    EXPECT_EQ(capacity_for(records, 8), kMaxCapacity) << records;
}

}  // namespace
}  // namespace icbench
