// The lanes of the packed octree: vectors of every width keep what scalar code keeps, nothing valid is turned away, and
// lanes that are not published are not touched.
#include <sys/mman.h>
#include <unistd.h>

#include "cache_contract.h"
#include "caches/packed_filter.h"
#include "caches/packed_reach.h"

namespace icbench {
namespace {

constexpr std::uint32_t kChunkSizes[] = {8, 16, 40};

/// Lanes with random bits, of which a random part is published, and queries among them.
class RandomStrips {
 public:
  explicit RandomStrips(std::uint64_t seed) : random_(seed) {
    for (std::uint32_t& word : words_) word = random_();
    // Reaches in which distance matters, and some that are too large to be expressed.
    for (std::uint32_t size : kChunkSizes) {
      for (std::uint32_t i = 0; i < size; ++i) {
        std::uint32_t& shape = words_[size + i];
        const std::uint32_t code = random_.below(8) == 0 ? 0xff : random_.below(0xa0);
        shape = (shape & 0xffffff) | code << 24;
      }
    }
    const SurfacePoint x = random_surface_point(random_);
    query = make_lane_query(x.n, 0.2f + 1.2f * random_.uniform(), 1.4f);
    for (LanePoint& at : points_) {
      const auto place = [&] { return 384.0f + 256.0f * random_.uniform(); };
      at = {place(), place(), place(), 1.0f + 2.0f * random_.uniform()};
    }
    for (int i = 0; i < 12; ++i) {
      const std::uint32_t size = kChunkSizes[random_.below(3)];
      const std::uint32_t begin = size < 40 ? 0 : 16 * random_.below(3);
      const std::uint32_t lanes = std::min(kStripLanes, size - begin);
      const std::uint32_t bits = random_.below(3) == 0 ? ~0u : random_();
      strips.push_back({words_ + begin, &points_[random_.below(4)], size, bits & ((1u << lanes) - 1)});
    }
  }

  LaneQuery query;
  std::vector<LaneStrip> strips;

 private:
  Pcg32 random_;
  alignas(64) std::uint32_t words_[3 * 40 + kStripLanes];
  LanePoint points_[4];
};

std::vector<UnitIndex> kept_by(LaneFilter filter, const LaneQuery& query,
                               const std::vector<LaneStrip>& strips) {
  std::vector<UnitIndex> out(strips.size() * kStripLanes + kStripLanes);
  out.resize(filter(query, strips.data(), static_cast<std::uint32_t>(strips.size()), out.data()));
  return out;
}

TEST(Lanes, EveryWidthKeepsWhatScalarCodeKeeps) {
  const auto filters = lane_filters();
  ASSERT_FALSE(filters.empty());
  std::size_t kept = 0, published = 0;
  for (std::uint64_t seed = 0; seed < 3000; ++seed) {
    const RandomStrips lanes(seed);
    const auto expected = kept_by(filter_lanes_scalar, lanes.query, lanes.strips);
    for (const NamedLaneFilter& f : filters)
      ASSERT_EQ(kept_by(f.filter, lanes.query, lanes.strips), expected) << f.name << ", seed " << seed;
    ASSERT_EQ(kept_by(SimdLanes::best(), lanes.query, lanes.strips), expected) << "seed " << seed;
    kept += expected.size();
    for (const LaneStrip& s : lanes.strips) published += static_cast<std::size_t>(std::popcount(s.bits));
  }
  EXPECT_GT(kept, published / 50) << "hardly a lane is kept";
  EXPECT_LT(kept, published / 2) << "hardly a lane is turned away";
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
        // In a cell of the record's own level, and in one below, the query's.
        for (int level = reach.level(); level <= std::min(reach.level() + 1, kPackedLevels); ++level) {
          const int shift = kMaxLevel - level;
          const PackedCell cell{u.x >> shift, u.y >> shift, u.z >> shift, level};
          const Lane lane = make_lane(reach.p(), reach.n(), reach.reach(), cell.corner(), level);
          const bool is_valid = split_sphere_weight(x, r, a) > 0.0f;
          const bool is_kept = keeps(make_lane_query(x.n, a, a_max),
                                     make_lane_point(addressing.to_grid(x.p), cell.corner(), level), lane);
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
  const LaneQuery query = make_lane_query({0, 0, 1}, 0.3f, 0.3f);
  const LanePoint at{500, 500, 500, 1.0f};
  auto filters = lane_filters();
  filters.push_back({"scalar", filter_lanes_scalar});
  for (const NamedLaneFilter& f : filters) {
    for (std::uint32_t missing = 1; missing < kStripLanes; ++missing) {
      const std::uint32_t there = kStripLanes - missing;
      std::vector<UnitIndex> expected;
      // The first lanes' places lie in a page that cannot be read.
      auto* first = reinterpret_cast<std::uint32_t*>(memory + page) - missing;
      for (std::uint32_t i = missing; i < 3 * kStripLanes; ++i) first[i] = 0;
      for (std::uint32_t i = missing; i < kStripLanes; ++i) {
        first[kStripLanes + i] = kReachAlways << 24 | 127u << 16;
        first[2 * kStripLanes + i] = i;
        expected.push_back(i);
      }
      EXPECT_EQ(kept_by(f.filter, query, {{first, &at, kStripLanes, 0xffffu << missing & 0xffffu}}), expected)
          << f.name;
      // The last lanes' indices do.
      expected.clear();
      auto* last = reinterpret_cast<std::uint32_t*>(memory + 2 * page) - 2 * kStripLanes - there;
      for (std::uint32_t i = 0; i < there; ++i) {
        last[i] = 0;
        last[kStripLanes + i] = kReachAlways << 24 | 127u << 16;
        last[2 * kStripLanes + i] = i;
        expected.push_back(i);
      }
      EXPECT_EQ(kept_by(f.filter, query, {{last, &at, kStripLanes, 0xffffu >> missing}}), expected) << f.name;
    }
  }
  ::munmap(memory, 3 * page);
}

}  // namespace
}  // namespace icbench
