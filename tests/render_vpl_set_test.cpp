// The set of virtual point lights: its paths, slots and samples, and what becomes of them after motion.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <map>
#include <numeric>
#include <set>
#include <utility>
#include <vector>

#include "render/instant_gi.h"
#include "render/vpl.h"
#include "render/vpl_compensation.h"
#include "render/vpl_gather.h"
#include "vpl_support.h"

namespace icbench {
namespace {

using Bits = std::vector<std::uint64_t>;

bool same_samples(const VplArrays& a, const VplArrays& b) {
  return a.samples() == b.samples() &&
         std::memcmp(a.sample_of(VplArrays::kPx, 0), b.sample_of(VplArrays::kPx, 0),
                     a.samples() * VplArrays::kComponents * VplArrays::kWord * sizeof(float)) == 0;
}

// The VPL at a place of a sample.
Vpl sampled(const VplArrays& vpls, std::size_t sample, std::size_t i) {
  const auto get = [&](VplArrays::Component c) { return vpls.sample_of(c, sample)[i]; };
  return {{get(VplArrays::kPx), get(VplArrays::kPy), get(VplArrays::kPz)},
          {get(VplArrays::kNx), get(VplArrays::kNy), get(VplArrays::kNz)},
          {get(VplArrays::kRed), get(VplArrays::kGreen), get(VplArrays::kBlue)}};
}

// One path anew, in the calling thread.
VplChange retrace(VplSet& set, Tracer& tracer, std::uint32_t path) {
  VplUpdate update(set, {path});
  update.trace(tracer, 0);
  return update.commit();
}

TEST(RenderVpl, ASetHasAboutAsManyVplsAsWantedEachInASlotOfItsPath) {
  const RayTracer rays(room());
  for (const std::uint32_t wanted : {1u, 64u, 1000u}) {
    const VplSet set = traced_set(rays, wanted, 3);
    EXPECT_NEAR(static_cast<double>(set.count()), wanted, 6.0 * std::sqrt(wanted));
    std::set<std::uint32_t> taken;
    for (std::uint32_t path = 0; path < set.paths(); ++path) {
      const auto vertices = set.vertices(path);
      const auto slots = set.slots(path);
      ASSERT_EQ(vertices.size(), slots.size());
      ASSERT_GE(vertices.size(), 2u) << "a start and an end";
      EXPECT_EQ(slots[0], kNoSlot) << "the lamp itself is direct light";
      for (std::size_t v = 0; v < slots.size(); ++v) {
        if (slots[v] == kNoSlot) continue;
        ASSERT_TRUE(taken.insert(slots[v]).second);
        const Vpl vpl = set.vpls()[slots[v]];
        EXPECT_TRUE(same_bits(vpl.p, vertices[v]));
        EXPECT_TRUE(is_unit(vpl.n));
      }
    }
    EXPECT_EQ(taken.size(), set.count());
    for (std::size_t slot = 0; slot < set.vpls().slots(); ++slot)
      EXPECT_EQ(set.vpls()[slot] == Vpl{}, !taken.contains(static_cast<std::uint32_t>(slot)));
  }
}

// Guards against: words of slots from all over the scene, of which none can be left out.
TEST(RenderVpl, ANewSetsNeighboursFaceAlikeAndLieClose) {
  const VplSet set = traced_set(cornell_box_rays(), 1000, 3);
  const auto facing = [](const Vpl& v) {
    const glm::vec3 n = glm::abs(v.n);
    const int axis = n.x >= n.y && n.x >= n.z ? 0 : n.y >= n.z ? 1 : 2;
    return 2 * axis + (v.n[axis] > 0.0f ? 1 : 0);
  };
  int turns = 0;
  double beside = 0.0, anywhere = 0.0;
  const std::size_t count = set.count();
  for (std::size_t slot = 0; slot + 1 < count; ++slot) {
    const Vpl a = set.vpls()[slot], b = set.vpls()[slot + 1], c = set.vpls()[(slot + count / 2) % count];
    turns += facing(a) != facing(b) ? 1 : 0;
    beside += glm::distance(a.p, b.p);
    anywhere += glm::distance(a.p, c.p);
  }
  EXPECT_LE(turns, 5);
  EXPECT_LT(beside, 0.25 * anywhere);
}

TEST(RenderVpl, SamplesAreTheVplsInTheOrderOfThePathsAndNothingAfterThem) {
  const VplSet set = traced_set(cornell_box_rays(), 200, 4);
  const VplArrays& vpls = set.vpls();
  std::size_t n = 0;
  for (std::uint32_t path = 0; path < set.paths(); ++path)
    for (const std::uint32_t slot : set.slots(path)) {
      if (slot == kNoSlot) continue;
      ASSERT_LT(n, vpls.samples() * VplArrays::kWord);
      EXPECT_EQ(sampled(vpls, n / VplArrays::kWord, n % VplArrays::kWord), vpls[slot]);
      ++n;
    }
  ASSERT_EQ(n, set.count());
  ASSERT_EQ(vpls.samples(), (n + VplArrays::kWord - 1) / VplArrays::kWord);
  for (; n < vpls.samples() * VplArrays::kWord; ++n)
    EXPECT_EQ(sampled(vpls, n / VplArrays::kWord, n % VplArrays::kWord), Vpl{});
}

TEST(RenderVpl, GrowingKeepsSlotsAndSamples) {
  VplArrays vpls(200);
  for (std::size_t slot = 0; slot < 200; ++slot)
    vpls.set(slot, {glm::vec3(static_cast<float>(slot)),
                    {0.0f, 1.0f, 0.0f},
                    glm::vec3(1.0f + static_cast<float>(slot))});
  const std::uint32_t some[] = {199, 7};
  vpls.arrange_samples(some);
  vpls.grow(vpls.slots() + 1);
  ASSERT_EQ(vpls.words(), 5u);
  EXPECT_EQ(vpls[199].p.x, 199.0f);
  ASSERT_EQ(vpls.samples(), 1u);
  EXPECT_EQ(sampled(vpls, 0, 0), vpls[199]);
  EXPECT_EQ(sampled(vpls, 0, 1), vpls[7]);
}

TEST(RenderVpl, PathsFollowMirrorsWithoutLeavingAVplThere) {
  const RayTracer rays(room());
  const VplSet set = traced_set(rays, 2000, 1);
  const auto on_mirror = [](const glm::vec3& p) { return std::abs(p.x + 0.99f) < 1e-5f; };
  int bounces = 0;
  for (std::uint32_t path = 0; path < set.paths(); ++path)
    for (std::size_t v = 0; v < set.vertices(path).size(); ++v)
      if (on_mirror(set.vertices(path)[v]) && std::abs(set.vertices(path)[v].z) < 0.8f &&
          std::abs(set.vertices(path)[v].y - 1.0f) < 0.7f) {
        ++bounces;
        EXPECT_EQ(set.slots(path)[v], kNoSlot);
        EXPECT_LT(v + 1, set.vertices(path).size()) << "the path ended there";
      }
  EXPECT_GT(bounces, 50);
}

TEST(RenderVpl, APathDependsOnItsIndexAloneNotOnThreadsOrChunksOrTheNumberOfPaths) {
  const RayTracer& rays = cornell_box_rays();
  const VplSet one = traced_set(rays, 512, 9), fewer = traced_set(rays, 64, 9),
               other = traced_set(rays, 512, 10);
  VplSet many(rays, {512, 9});
  ThreadCrew crew(rays, 5);
  retrace_all(many, crew);
  EXPECT_TRUE(same_bits(one.vpls(), many.vpls()));
  EXPECT_FALSE(same_bits(one.vpls(), other.vpls())) << "the seed is ignored";
  ASSERT_LT(fewer.paths(), one.paths());
  for (std::uint32_t path = 0; path < fewer.paths(); ++path)
    EXPECT_TRUE(std::ranges::equal(one.vertices(path), fewer.vertices(path)));

  // Path by path in another order: other slots, the same VPLs on every path.
  VplSet shuffled(rays, {512, 9});
  Tracer tracer(rays);
  for (std::uint32_t path = shuffled.paths(); path-- > 0;) retrace(shuffled, tracer, path);
  for (std::uint32_t path = 0; path < one.paths(); ++path) {
    ASSERT_TRUE(std::ranges::equal(one.vertices(path), shuffled.vertices(path)));
    for (std::size_t v = 0; v < one.slots(path).size(); ++v) {
      ASSERT_EQ(one.slots(path)[v] == kNoSlot, shuffled.slots(path)[v] == kNoSlot);
      if (one.slots(path)[v] == kNoSlot) continue;
      EXPECT_EQ(one.vpls()[one.slots(path)[v]], shuffled.vpls()[shuffled.slots(path)[v]]);
    }
  }
}

TEST(RenderVpl, RetracingAPathThatNothingCutsChangesNothing) {
  const RayTracer& rays = cornell_box_rays();
  VplSet set = traced_set(rays, 300, 2);
  const VplArrays before = set.vpls();
  Tracer tracer(rays);
  for (std::uint32_t path = 0; path < set.paths(); path += 3) {
    EXPECT_FALSE(retrace(set, tracer, path).any());
    ASSERT_TRUE(same_bits(before, set.vpls()));
  }
  EXPECT_FALSE(trace_all(set, tracer).any());
}

// VPLs by path and vertex, whatever slots they have.
std::vector<std::vector<Vpl>> by_path(const VplSet& set) {
  std::vector<std::vector<Vpl>> out(set.paths());
  for (std::uint32_t path = 0; path < set.paths(); ++path)
    for (const std::uint32_t slot : set.slots(path))
      if (slot != kNoSlot) out[path].push_back(set.vpls()[slot]);
  return out;
}

TEST(RenderVpl, AfterMotionTheSetIsThatOfAFreshStartAndReportsExactlyTheSlotsThatChanged) {
  RayTracer rays(room());
  VplSet set = traced_set(rays, 400, 5);
  const std::uint32_t paths = set.paths();
  const auto start = by_path(set);
  Tracer tracer(rays);
  std::size_t moved = 0, slots = set.vpls().slots();
  bool grew = false;
  for (const float frame : {1.0f, 2.0f, 7.0f, 19.0f, 3.0f, 0.0f}) {
    rays.go_to(frame);
    const VplArrays before = set.vpls();
    const VplChange change = trace_all(set, tracer);
    ASSERT_EQ(change.changed.size(), set.vpls().words());
    EXPECT_EQ(change.grew, set.vpls().slots() > slots);
    grew |= change.grew;
    slots = set.vpls().slots();
    for (std::size_t slot = 0; slot < slots; ++slot) {
      const Vpl then = slot < before.slots() ? before[slot] : Vpl{}, now = set.vpls()[slot];
      const auto bit = [&](const Bits& of) { return (of[slot / 64] >> slot % 64 & 1u) != 0; };
      ASSERT_EQ(bit(change.changed), !(then == now));
      ASSERT_EQ(bit(change.moved), !(then.p == now.p && then.n == now.n));
      moved += bit(change.moved);
    }
    ASSERT_EQ(set.paths(), paths);
    // Slots tell what went before; samples, and what is estimated from them, do not.
    RayTracer others(room());
    VplSet fresh(others, {400, 5});
    others.go_to(frame);
    Tracer other(others);
    trace_all(fresh, other);
    ASSERT_TRUE(same_samples(set.vpls(), fresh.vpls()));
    for (const Hit& hit : reflecting_hits(rays, 4))
      ASSERT_TRUE(same_bits(compensate(tracer, hit, set.vpls(), 4.0f, 32, 1).E,
                            compensate(other, hit, fresh.vpls(), 4.0f, 32, 1).E));
    if (frame == 0.0f) {
      EXPECT_EQ(by_path(set), start) << "back at the start";
    }
  }
  EXPECT_GT(moved, 100u);
  EXPECT_TRUE(grew) << "white walls reflect more light than there was room for";
  std::size_t count = 0;
  for (const auto& vpls : start) count += vpls.size();
  EXPECT_EQ(set.count(), count) << "slots leak";
}

// Guards against: light that a surface loses or gains for being shaded as if it were tilted.
TEST(RenderVpl, ATiltedShadingNormalReflectsByItsCosine) {
  const auto reflected = [](float tilt) {
    Scene s;
    s.name = "floor";
    const auto grey = s.add_material({.albedo = glm::vec3(0.9f)});
    s.meshes.push_back(quad("floor", {-1, 0, -1}, {0, 0, 2}, {2, 0, 0}, grey));
    s.meshes.back().normals.assign(s.meshes.back().positions.size(), {std::sin(tilt), std::cos(tilt), 0.0f});
    s.point_lights.push_back(
        {.p = {0, 2, 0}, .intensity = glm::vec3(1), .cos_inner = 0.999f, .cos_outer = 0.998f});
    const RayTracer rays(std::move(s));
    const VplSet set = traced_set(rays, 4000, 1);
    glm::dvec3 flux(0.0);
    for (std::size_t slot = 0; slot < set.vpls().slots(); ++slot) flux += set.vpls()[slot].flux;
    return flux.y;
  };
  EXPECT_NEAR(reflected(1.0f) / reflected(0.0f), std::cos(1.0), 0.02);
}

}  // namespace
}  // namespace icbench
