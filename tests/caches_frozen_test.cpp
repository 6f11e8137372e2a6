// A frozen cache answers as a live one: the same records with the same weights at every point.
#include "cache_contract.h"
#include "caches/packed_frozen.h"

namespace icbench {
namespace {

using Shown = std::vector<std::pair<std::uint32_t, float>>;

Shown shown_by(const PackedFrozen& frozen, const SurfacePoint& x) {
  Shown out;
  frozen.visit(x, [&](const Record& r, float weight) {
    EXPECT_TRUE(is_intact(r));
    out.emplace_back(r.id, weight);
  });
  std::sort(out.begin(), out.end());
  return out;
}

CacheConfig config_for(float a, float a_max) {
  CacheConfig c;
  c.a = a;
  c.a_max = a_max;
  return c;
}

/// Compares with the definition at `queries` points, half of them beside a record. Returns how many were shown.
std::size_t compare(const std::vector<Record>& records, const CacheConfig& config, int queries) {
  const PackedFrozen frozen(config, records);
  Pcg32 random(5);
  std::size_t count = 0;
  for (int i = 0; i < queries; ++i) {
    SurfacePoint x = random_surface_point(random);
    if (!records.empty() && random.below(2) == 0) {
      const Record& r = records[random.below(static_cast<std::uint32_t>(records.size()))];
      x = {r.p, r.n};
    }
    Shown expected;
    for (const Record& r : records) {
      const float weight = split_sphere_weight(x, r, config.a);
      if (weight > 0.0f) expected.emplace_back(r.id, weight);
    }
    std::sort(expected.begin(), expected.end());
    EXPECT_EQ(shown_by(frozen, x), expected) << "query " << i;
    EXPECT_EQ(frozen.query(x).has_value(), !expected.empty());
    count += expected.size();
  }
  return count;
}

TEST(Frozen, ShowsWhatIsValidWithItsWeight) {
  for (const std::uint32_t n : {1u, 30u, 3000u}) {
    const std::size_t shown = compare(random_records(n, n), config_for(0.3f, 0.4f), 500);
    EXPECT_GT(shown, 500u / 3) << n;
  }
}

TEST(Frozen, HoldsRecordsOfAnySizeAndManyOnASpot) {
  Pcg32 random(3);
  std::vector<Record> records = random_records(500, 2);
  for (std::uint32_t i = 0; i < 300; ++i) {
    const SurfacePoint x = random_surface_point(random);
    records.push_back(make_record(1000 + i, x.p, x.n, std::exp2(10.0f - 25.0f * random.uniform())));
  }
  for (std::uint32_t i = 0; i < 500; ++i)
    records.push_back(make_record(2000 + i, records[7].p, records[7].n, 0.1f));
  EXPECT_GT(compare(records, config_for(0.4f, 0.4f), 300), 300u * 100);
}

TEST(Frozen, AnEmptyCacheAnswersNothing) { EXPECT_EQ(compare({}, config_for(0.3f, 0.4f), 20), 0u); }

// Guards against: a copy of each in every cell of the grid.
TEST(Frozen, RecordsThatReachFarTakeLittleMemory) {
  for (const float R : {0.2f, 10.0f}) {
    std::vector<Record> records = random_records(4000, 3);
    for (Record& r : records) r.R = R;
    const PackedFrozen frozen(config_for(0.3f, 0.5f), records);
    EXPECT_LT(frozen.memory_bytes(), 4000u * 1000u) << R;
    EXPECT_GT(compare(records, config_for(0.3f, 0.5f), 20), 20u * 5) << R;
  }
}

// Guards against: one leaf for all, where the first cells that are split gain nothing.
TEST(Frozen, RecordsOnASpotAmidWideBoundsAreToldApart) {
  std::vector<Record> records = random_records(3000, 4);
  for (Record& r : records) {
    r.p = 0.5f + 0.01f * (r.p - 0.5f);
    r.R *= 0.01f;
  }
  const PackedFrozen frozen(config_for(0.3f, 0.4f), records);
  std::size_t shown = 0;
  for (const Record& r : records) {
    Shown expected;
    for (const Record& other : records) {
      const float weight = split_sphere_weight({r.p, r.n}, other, 0.3f);
      if (weight > 0.0f) expected.emplace_back(other.id, weight);
    }
    std::sort(expected.begin(), expected.end());
    ASSERT_EQ(shown_by(frozen, {r.p, r.n}), expected);
    shown += expected.size();
  }
  EXPECT_GE(shown, 3000u);
}

TEST(Frozen, RefusesAConfigurationThatCachesRefuse) {
  EXPECT_THROW(PackedFrozen(config_for(0.5f, 0.1f), {}), std::runtime_error);
}

// Sums of an Interpolator may be added to behind its back, those of others may not.
TEST(Frozen, VisitorsAreCalledWhateverMembersTheyHave) {
  static_assert(std::is_final_v<Interpolator>);
  struct WithSums {
    WeightedSums& sums() noexcept { return sum; }
    void operator()(const Record&, float) noexcept { ++calls; }
    WeightedSums sum{};
    int calls = 0;
  };
  const std::vector<Record> records = random_records(300, 2);
  const PackedFrozen frozen(config_for(0.3f, 0.4f), records);
  const SurfacePoint x{records[0].p, records[0].n};
  WithSums visitor;
  frozen.visit(x, visitor);
  EXPECT_EQ(visitor.calls, static_cast<int>(shown_by(frozen, x).size()));
  EXPECT_GT(visitor.calls, 0);
}

TEST(Frozen, AsksForAskablePointsOnly) {
  const std::vector<Record> records = {make_record(0, glm::vec3(0.5f, 0.5f, 0.0f), {0, 0, 1}, 10.0f)};
  const PackedFrozen frozen(config_for(0.3f, 0.4f), records);
  EXPECT_TRUE(frozen.query({{0.5f, 0.5f, 0.0f}, {0, 0, 1}}));
  EXPECT_FALSE(frozen.query({{0.5f, 0.5f, -0.1f}, {0, 0, 1}}));
  EXPECT_FALSE(frozen.query({{0.5f, 0.5f, 0.0f}, {0, 0, 2}}));
}

}  // namespace
}  // namespace icbench
