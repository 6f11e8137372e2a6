// The lanes of the packed octree: vectors of every width keep what scalar code keeps, nothing valid is turned away, and
// lanes that are not published are not touched.
#include <sys/mman.h>
#include <unistd.h>

#include <cfenv>

#include "cache_contract.h"
#include "caches/packed_filter.h"
#include "caches/packed_reach.h"

namespace icbench {
namespace {

/// Lanes with random bits, of which a random part is published, and queries among them.
class RandomLanes {
 public:
  explicit RandomLanes(std::uint64_t seed) : random_(seed) {
    for (std::uint32_t& word : words_) {
      // Reaches in which distance matters, and some that are too large to be expressed.
      const std::uint32_t code = random_.below(8) == 0 ? kReachAlways : random_.below(kReachAlways);
      word = (random_() << kReachBits) | code;
    }
    share = 0.2f + 0.8f * random_.uniform();
    // As in cells, or as in frozen runs.
    if (random_.below(2) == 0)
      layout = {kStripWords, kStripLanes};
    else
      layout = {kStripLanes, kCellLanes};
    for (int i = 0; i < 5; ++i) {
      const auto place = [&] { return kPlaceOrigin + 192.0f + 128.0f * random_.uniform(); };
      const std::uint32_t *first = words_ + 4 * random_.below(40), *more = words_ + 4 * random_.below(40);
      std::uint64_t mask = std::uint64_t{random_()} << 32 | random_();
      if (random_.below(3) == 0) mask = ~std::uint64_t{0};
      runs.push_back({first,
                      more,
                      mask >> random_.below(64),
                      {place(), place(), place(), 1.0f + 2.0f * random_.uniform()}});
    }
    runs.push_back({words_, words_, 0, runs[0].at});
  }

  float share;
  LaneLayout layout;
  std::vector<LaneRun> runs;

 private:
  Pcg32 random_;
  alignas(64) std::uint32_t words_[4 * 40 + kCellStrips * kStripWords];
};

std::vector<UnitIndex> kept_by(const LaneKernels& kernels, float share, LaneLayout layout,
                               const std::vector<LaneRun>& runs) {
  std::vector<UnitIndex> out(runs.size() * kCellLanes + kStripLanes);
  out.resize(kernels.filter(share, layout, runs.data(), static_cast<std::uint32_t>(runs.size()), out.data()));
  return out;
}

TEST(Lanes, EveryWidthKeepsWhatScalarCodeKeeps) {
  const auto all = lane_kernels();
  ASSERT_FALSE(all.empty());
  std::size_t kept = 0, published = 0;
  for (std::uint64_t seed = 0; seed < 3000; ++seed) {
    const RandomLanes lanes(seed);
    const auto by = [&](const LaneKernels& kernels) {
      return kept_by(kernels, lanes.share, lanes.layout, lanes.runs);
    };
    const auto expected = by(ScalarLanes::best());
    for (const NamedLaneKernels& k : all) ASSERT_EQ(by(k.kernels), expected) << k.name << ", seed " << seed;
    ASSERT_EQ(by(SimdLanes::best()), expected) << "seed " << seed;
    kept += expected.size();
    for (const LaneRun& run : lanes.runs) published += static_cast<std::size_t>(std::popcount(run.mask));
  }
  EXPECT_GT(kept, published / 50) << "hardly a lane is kept";
  EXPECT_LT(kept, published / 2) << "hardly a lane is turned away";
}

TEST(Lanes, EveryWidthWeighsAndAddsAsTheDefinitionDoes) {
  Pcg32 random(2);
  // Of all sorts: the products of some with themselves are more than 1.
  const auto direction = [&] {
    const glm::vec3 v(random.uniform() - 0.5f, random.uniform() - 0.5f, random.uniform() + 0.1f);
    return (random.below(2) == 0 ? 1.0f : -1.0f) * glm::normalize(v);
  };
  std::size_t valid = 0, weighed = 0;
  for (int i = 0; i < 3000; ++i) {
    const float scale = std::exp2(40.0f * random.uniform() - 20.0f), a = 0.05f + random.uniform();
    const SurfacePoint x{scale * direction(), direction()};
    std::vector<Record> records;
    for (std::uint32_t k = 0; k < 1 + random.below(kWeighed); ++k) {
      // One in four where the query is, half of these with its normal.
      const bool is_there = random.below(4) == 0;
      const glm::vec3 p = is_there ? x.p : x.p + scale * 0.2f * random.uniform() * direction();
      const glm::vec3 n = random.below(2) == 0 ? x.n : glm::normalize(x.n + 0.5f * direction());
      records.push_back(make_record(k, p, n, scale * random.uniform() + 1e-3f * scale));
      records.back().E = {random.uniform(), 1e20f * random.uniform(), 1e-20f * random.uniform()};
      // As a float a signalling NaN: what is no float must not be reckoned with.
      records.back().id = 0x7fa00000u + k;
    }
    glm::vec4 halves[2] = {glm::vec4(0.0f), glm::vec4(0.0f)};
    for (std::size_t k = 0; k < records.size(); ++k)
      halves[k / kSummed] += split_sphere_weight(x, records[k], a) * glm::vec4(records[k].E, 1.0f);
    const glm::vec4 expected_sums = halves[0] + halves[1];
    std::vector<const Record*> pointers;
    for (const Record& r : records) pointers.push_back(&r);
    const auto n = static_cast<std::uint32_t>(records.size());
    pointers.resize(n + kWeighed, pointers[0]);
    auto all = lane_kernels();
    all.push_back({"scalar", ScalarLanes::best()});
    all.push_back({"best", SimdLanes::best()});
    for (const NamedLaneKernels& k : all) {
      std::vector<float> weights(n + kWeighed);
      k.kernels.weigh(x, a, pointers.data(), n, weights.data());
      for (std::uint32_t j = 0; j < n; ++j) {
        const float expected = split_sphere_weight(x, records[j], a);
        ASSERT_EQ(std::bit_cast<std::uint32_t>(weights[j]), std::bit_cast<std::uint32_t>(expected)) << k.name;
        valid += expected > 0.0f;
        ++weighed;
      }
      std::feclearexcept(FE_INVALID);
      const WeightedSums before{1.0, 1e30, 0.0, 2.0};
      WeightedSums sums = before;
      const std::uint32_t added = k.kernels.add(x, a, pointers.data(), n, sums);
      ASSERT_EQ(std::fetestexcept(FE_INVALID), 0) << k.name;
      ASSERT_EQ(added, std::count_if(weights.begin(), weights.begin() + n, [](float w) { return w > 0.0f; }))
          << k.name;
      for (std::size_t c = 0; c < sums.size(); ++c)
        ASSERT_EQ(sums[c], before[c] + static_cast<double>(expected_sums[static_cast<int>(c)])) << k.name;
    }
  }
  EXPECT_GT(valid, weighed / 10);
  EXPECT_LT(valid, weighed - weighed / 10);
}

TEST(Lanes, EveryWidthTakesWhatLiesJustNotTooFarBehind) {
  const SurfacePoint x{{0, 0, 0}, {0, 0, 1}};
  const Record just = make_record(0, {0, 0, kInFrontTolerance}, {0, 0, 1}, 1.0f);
  const Record beyond = make_record(1, {0, 0, std::nextafter(kInFrontTolerance, 1.0f)}, {0, 0, 1}, 1.0f);
  ASSERT_GT(split_sphere_weight(x, just, 0.5f), 0.0f);
  ASSERT_EQ(split_sphere_weight(x, beyond, 0.5f), 0.0f);
  std::array<const Record*, 2 * kWeighed> pointers;
  for (std::size_t i = 0; i < pointers.size(); ++i) pointers[i] = i % 2 == 0 ? &just : &beyond;
  for (const NamedLaneKernels& k : lane_kernels()) {
    std::array<float, kWeighed> weights;
    k.kernels.weigh(x, 0.5f, pointers.data(), kWeighed, weights.data());
    for (std::size_t i = 0; i < weights.size(); ++i)
      EXPECT_EQ(weights[i], split_sphere_weight(x, *pointers[i], 0.5f)) << k.name;
  }
}

TEST(Lanes, NoValidRecordIsTurnedAwayAndFewOthersAreKept) {
  Pcg32 random(1);
  std::size_t valid = 0, kept = 0;
  for (const float a_max : {0.002f, 0.05f, 0.3f, 1.0f, 10.0f}) {
    for (const float scale : {1.0f, 1e-6f, 1e5f}) {
      const OctreeAddressing addressing({glm::vec3(-0.5f * scale), glm::vec3(0.5f * scale)});
      for (int i = 0; i < 20'000; ++i) {
        const auto direction = [&] {
          for (;;) {
            const glm::vec3 v(random.uniform() - 0.5f, random.uniform() - 0.5f, random.uniform() - 0.5f);
            if (glm::dot(v, v) > 0.01f && glm::dot(v, v) < 0.25f) return glm::normalize(v);
          }
        };
        const glm::vec3 p = scale * (glm::vec3(random.uniform(), random.uniform(), random.uniform()) - 0.5f);
        const Record r =
            make_record(0, p, direction(), scale * std::exp2(2.0f - 12.0f * random.uniform()) / a_max);
        const float a = a_max * (random.below(2) == 0 ? 1.0f : 0.3f + 0.7f * random.uniform());
        if (a < kMinAccuracy) continue;
        // At the edge of validity, more often than not: the place fixes how far the normal may turn.
        const float far = random.uniform();
        const SurfacePoint x{
            r.p + direction() * (far * a * r.R),
            glm::normalize(r.n + direction() * (1.6f * random.uniform() * (1.0f - far) * a))};
        if (!is_askable(x, {glm::vec3(-0.5f * scale), glm::vec3(0.5f * scale)}) || !is_unit(r.n)) continue;
        const PackedReach reach(addressing, r, a_max);
        const GridPoint u = addressing.quantise(x.p);
        // In a cell of the record's own level, in those above where it may be a guest, and in one below, the query's.
        for (int level = std::max(reach.level() - 2, 0); level <= std::min(reach.level() + 1, kPackedLevels);
             ++level) {
          const int shift = kMaxLevel - level;
          const PackedCell cell{u.x >> shift, u.y >> shift, u.z >> shift, level};
          const std::uint32_t lane = make_lane(reach.p(), reach.reach(), cell.corner(), level);
          const bool is_valid = split_sphere_weight(x, r, a) > 0.0f;
          const bool is_kept =
              keeps(make_lane_share(a, a_max), make_lane_point(addressing.to_grid(x.p), u, level), lane);
          if (is_valid) {
            ASSERT_TRUE(reach.touches(cell))
                << "a_max " << a_max << ", scale " << scale << ", level " << level;
            ASSERT_TRUE(is_kept) << "a_max " << a_max << ", scale " << scale << ", level " << level;
          }
          if (a_max == 0.3f && scale == 1.0f) {
            valid += is_valid;
            kept += is_kept;
          }
        }
      }
    }
  }
  EXPECT_GT(valid, 5000u);
  EXPECT_LT(kept, 2 * valid);
}

TEST(Lanes, WhatIsNotPublishedIsNotTouched) {
  const auto page = static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
  auto* memory = static_cast<std::byte*>(
      ::mmap(nullptr, 3 * page, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0));
  ASSERT_NE(memory, MAP_FAILED);
  ASSERT_EQ(::mprotect(memory, page, PROT_NONE), 0);
  ASSERT_EQ(::mprotect(memory + 2 * page, page, PROT_NONE), 0);
  constexpr float kPlace = kPlaceOrigin + 250.0f;
  const LanePoint at{kPlace, kPlace, kPlace, 1.0f};
  constexpr std::uint32_t kKept = kReachAlways;
  constexpr LaneLayout kLayout{kStripWords, kStripLanes};
  auto all = lane_kernels();
  all.push_back({"scalar", ScalarLanes::best()});
  for (const NamedLaneKernels& k : all) {
    for (std::uint32_t missing = 1; missing < kStripLanes; ++missing) {
      const std::uint32_t there = kStripLanes - missing;
      std::vector<UnitIndex> expected;
      // The first lanes' places lie in a page that cannot be read.
      auto* first = reinterpret_cast<std::uint32_t*>(memory + page) - missing;
      for (std::uint32_t i = missing; i < kStripLanes; ++i) {
        first[i] = kKept;
        first[kStripLanes + i] = i;
        expected.push_back(i);
      }
      EXPECT_EQ(kept_by(k.kernels, 1.0f, kLayout, {{first, nullptr, kStripMask << missing & kStripMask, at}}),
                expected)
          << k.name;
      // The last lanes' indices do.
      expected.clear();
      auto* last = reinterpret_cast<std::uint32_t*>(memory + 2 * page) - kStripLanes - there;
      for (std::uint32_t i = 0; i < there; ++i) {
        last[i] = kKept;
        last[kStripLanes + i] = i;
        expected.push_back(i);
      }
      EXPECT_EQ(kept_by(k.kernels, 1.0f, kLayout, {{last, nullptr, kStripMask >> missing, at}}), expected)
          << k.name;
      // The same of a second strip, of which alone lanes are published; nothing of the first can be read.
      const auto* none = reinterpret_cast<const std::uint32_t*>(memory);
      EXPECT_EQ(kept_by(k.kernels, 1.0f, kLayout, {{none, last, kStripMask >> missing << kStripLanes, at}}),
                expected)
          << k.name;
    }
  }
  ::munmap(memory, 3 * page);
}

}  // namespace
}  // namespace icbench
