// The set of virtual point lights: its paths, slots and samples, and what becomes of them after motion.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <glm/geometric.hpp>
#include <iterator>
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
  const std::size_t bytes = set.bytes();
  Tracer tracer(rays);
  for (std::uint32_t path = 0; path < set.paths(); path += 3) {
    EXPECT_FALSE(retrace(set, tracer, path).any());
    ASSERT_TRUE(same_bits(before, set.vpls()));
  }
  EXPECT_FALSE(trace_all(set, tracer).any());
  EXPECT_EQ(set.bytes(), bytes);
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

// A floor below a lamp, the albedo of whose two halves in each frame is as said: about as many VPLs are left by a path.
Scene floor_of(std::uint32_t frames, std::function<float(float)> left, std::function<float(float)> right) {
  Scene s;
  s.name = "floor";
  s.frames = frames;
  const auto one = s.add_material({.albedo = glm::vec3(0.5f)});
  const auto other = s.add_material({.albedo = glm::vec3(0.5f)});
  s.meshes.push_back(quad("left", {-9, 0, -9}, {0, 0, 18}, {9, 0, 0}, one));
  s.meshes.push_back(quad("right", {0, 0, -9}, {0, 0, 18}, {9, 0, 0}, other));
  s.point_lights.push_back({.p = {0, 2, 0}, .intensity = glm::vec3(1), .cos_inner = 0.9f, .cos_outer = 0.8f});
  s.change_light = [=](float frame, std::span<Material> materials, std::span<PointLight>) {
    materials[one].albedo = glm::vec3(left(frame));
    materials[other].albedo = glm::vec3(right(frame));
  };
  return s;
}

// Guards against: slots that are added while others are free or by the thousand, VPLs that move to other slots, and
// paths that become others' as the room that some left is taken back.
TEST(RenderVpl, SlotsAreUsedAgainHoweverOftenPathsAreTracedAnew) {
  // Lights come and go at once where the halves of a floor change places.
  const Scene swapping = floor_of(
      20, [](float frame) { return frame == 0.0f ? 0.6f : 0.9f; },
      [](float frame) { return frame == 7.0f ? 0.6f : 0.9f; });
  for (const Scene& scene : {room(), swapping}) {
    RayTracer rays(scene);
    VplSet set(rays, {400, 5});
    Tracer tracer(rays);
    const auto slots_by_use = [&](bool used) {
      std::set<std::size_t> out;
      for (std::size_t slot = 0; slot < set.vpls().slots(); ++slot)
        if ((set.vpls()[slot] == Vpl{}) != used) out.insert(slot);
      return out;
    };
    const auto slots_by_path = [&] {
      std::vector<std::vector<std::uint32_t>> out(set.paths());
      for (std::uint32_t path = 0; path < set.paths(); ++path)
        std::ranges::copy_if(set.slots(path), std::back_inserter(out[path]),
                             [](std::uint32_t slot) { return slot != kNoSlot; });
      return out;
    };
    std::map<float, std::vector<std::vector<glm::vec3>>> vertices_in;
    std::map<float, std::vector<std::vector<Vpl>>> vpls_in;
    std::size_t taken = 0;
    for (int round = 0; round < 10; ++round)
      for (const float frame : {0.0f, 7.0f, 19.0f, 7.0f}) {
        rays.go_to(frame);
        const std::set<std::size_t> free = slots_by_use(false);
        const std::size_t slots = set.vpls().slots();
        const auto owned = slots_by_path();
        const bool is_new = set.count() == 0;
        const VplChange change = trace_all(set, tracer);
        if (change.grew) {
          ASSERT_GT(set.count(), slots) << "one was free";
          ASSERT_LT(set.vpls().slots(), set.count() + 2 * VplArrays::kWord)
              << "far more than there is need for";
        }
        const std::set<std::size_t> now_used = slots_by_use(true), now_free = slots_by_use(false);
        ASSERT_EQ(now_used.size(), set.count());
        for (const std::size_t slot : now_used) {
          if (!free.contains(slot) || now_free.empty()) continue;
          ASSERT_LT(slot, *now_free.begin()) << "the lowest come first";
          ++taken;
        }
        const auto owned_now = slots_by_path();
        std::vector<std::vector<glm::vec3>> vertices;
        for (std::uint32_t path = 0; path < set.paths(); ++path) {
          const std::size_t kept = is_new ? 0 : std::min(owned[path].size(), owned_now[path].size());
          ASSERT_TRUE(std::equal(owned[path].begin(), owned[path].begin() + static_cast<std::ptrdiff_t>(kept),
                                 owned_now[path].begin()));
          vertices.emplace_back(set.vertices(path).begin(), set.vertices(path).end());
        }
        ASSERT_EQ(vertices, vertices_in.try_emplace(frame, vertices).first->second) << frame;
        ASSERT_EQ(by_path(set), vpls_in.try_emplace(frame, by_path(set)).first->second) << frame;
      }
    EXPECT_GT(taken, 100u) << scene.name;
  }
}

// Guards against: room that is lost wherever a path becomes a vertex longer, and slots that are left out where a new
// set ends.
TEST(RenderVpl, PathsThatGrowAndShrinkTakeNoMoreRoomInTime) {
  const auto albedo = [](float frame) { return frame == 1.0f ? 0.9f : 0.6f; };
  RayTracer rays(floor_of(2, albedo, albedo));
  VplSet set = traced_set(rays, 600, 3);
  Tracer tracer(rays);
  rays.go_to(1.0f);
  trace_all(set, tracer);  // more are reflected; all that were are
  for (std::size_t slot = 0; slot < set.vpls().slots(); ++slot)
    ASSERT_EQ(set.vpls()[slot] != Vpl{}, slot < set.count()) << slot;
  std::size_t most = 0;
  for (int frame = 0; frame < 100; ++frame) {
    rays.go_to(static_cast<float>(frame % 2));
    trace_all(set, tracer);
    if (frame < 20) most = std::max(most, set.bytes());
    ASSERT_LE(set.bytes(), most) << frame;
  }
}

// Guards against: fewer virtual lights than were asked for because some frame has a few more, and many more where
// those that the animation begins with are few.
TEST(RenderVpl, AnAnimationsPathsArePlannedForItsFirstFrameUnlessAnotherHasManyMore) {
  constexpr VplParams kParams{.wanted = 1000, .seed = 3};
  const auto planned = [&](std::uint32_t frames, float bright_frame, float albedo) {
    const auto by_frame = [=](float frame) { return frame == bright_frame ? albedo : 0.4f; };
    RayTracer rays(floor_of(frames, by_frame, by_frame));
    const std::uint32_t at_first = plan_paths(rays, kParams);
    const std::uint32_t paths = plan_paths_of_animation(rays, kParams);
    EXPECT_EQ(plan_paths(rays, kParams), at_first) << "the scene is not at the first frame";
    rays.go_to(bright_frame);
    const std::uint32_t when_bright = plan_paths(rays, kParams);
    EXPECT_TRUE(paths == at_first || paths == when_bright);
    return paths == when_bright;
  };
  for (const std::uint32_t frames : {10u, 100u})
    for (const std::uint32_t quarter : {1u, 2u, 3u}) {
      const auto frame = static_cast<float>(quarter * frames / 4);
      EXPECT_TRUE(planned(frames, frame, 0.66f)) << frames << ' ' << frame;
      EXPECT_FALSE(planned(frames, frame, 0.54f)) << frames << ' ' << frame;
      EXPECT_FALSE(planned(frames, frame, 0.1f)) << "fewer are no reason";
    }
  EXPECT_TRUE(planned(100, 0.0f, 0.8f)) << "the first frame itself";
  EXPECT_FALSE(planned(100, 10.0f, 0.9f)) << "other frames are not looked at";
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
