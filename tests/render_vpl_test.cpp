// Virtual point lights: the set and its slots, gathers from it, and instant global illumination by them.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <limits>
#include <map>
#include <numeric>
#include <set>
#include <utility>
#include <vector>

#include "render/instant_gi.h"
#include "render/interleaved.h"
#include "render/path.h"
#include "render/vpl.h"
#include "render/vpl_gather.h"
#include "render_support.h"
#include "scene/registry.h"
#include "scene/shapes.h"
#include "trap_invalid.h"

namespace icbench {
namespace {

// Built once.
const RayTracer& cornell_box_rays() {
  static const RayTracer rays(make_scene("cornell_box"));
  return rays;
}

using Bits = std::vector<std::uint64_t>;

VplSet traced_set(const RayTracer& rays, std::uint32_t wanted, std::uint64_t seed) {
  VplSet set(rays, {wanted, seed});
  Tracer tracer(rays);
  trace_all(set, tracer);
  return set;
}

bool same_bits(const VplArrays& a, const VplArrays& b) {
  return a.slots() == b.slots() && std::memcmp(a.of(VplArrays::kPx), b.of(VplArrays::kPx),
                                               VplArrays::kComponents * a.slots() * sizeof(float)) == 0;
}

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

bool same_bits(const glm::vec3& a, const glm::vec3& b) { return std::memcmp(&a, &b, sizeof a) == 0; }

std::vector<Hit> reflecting_hits(const RayTracer& rays, int size) {
  std::vector<Hit> hits;
  for (const Hit& hit : primary_hits(rays, size, size).hits)
    if (reflects(rays, hit)) hits.push_back(hit);
  return hits;
}

template <class F>
glm::dvec3 mean_over(const std::vector<Hit>& hits, F&& f) {
  glm::dvec3 sum(0.0);
  for (std::size_t i = 0; i < hits.size(); ++i) sum += f(hits[i], i);
  return sum / static_cast<double>(hits.size());
}

// A room with a lamp, a mirror, a block that slides, one that turns beside it, and walls that become white.
Scene room() {
  Scene s;
  s.name = "room";
  const auto wall = s.add_material({.albedo = glm::vec3(0.3f, 0.5f, 0.4f)});
  const auto lamp = s.add_material({.emission = glm::vec3(9.0f, 8.0f, 6.0f)});
  const auto glass = s.add_material({.albedo = glm::vec3(0.9f), .surface = Surface::mirror});
  s.meshes.push_back(box("walls", {{-1, 0, -1}, {1, 2, 1}}, wall, true));
  s.meshes.push_back(quad("lamp", {-0.3f, 1.99f, -0.3f}, {0.6f, 0, 0}, {0, 0, 0.6f}, lamp));
  s.meshes.push_back(quad("mirror", {-0.99f, 0.3f, -0.8f}, {0, 1.4f, 0}, {0, 0, 1.6f}, glass));
  s.meshes.push_back(box("slider", {{-0.2f, 0.0f, -0.2f}, {0.2f, 0.7f, 0.2f}}, wall));
  s.meshes.back().pose = [](float frame) {
    return Pose{glm::mat3(1.0f), {0.04f * frame - 0.5f, 0.1f, 0.3f}};
  };
  s.meshes.push_back(icosphere("turner", {0.0f, 0.0f, 0.0f}, 0.25f, 2, wall));
  s.meshes.back().pose = [](float frame) {
    const float c = std::cos(0.1f * frame + 0.3f), n = std::sin(0.1f * frame + 0.3f);
    return Pose{{{c, 0, -n}, {0, 1.2f, 0}, {n, 0, c}}, {0.5f, 1.0f, -0.4f}};
  };
  s.frames = 20;
  s.change_light = [](float frame, std::span<Material> materials, std::span<PointLight>) {
    materials[0].albedo = frame == 19.0f ? glm::vec3(0.95f) : glm::vec3(0.3f, 0.5f, 0.4f);
  };
  s.camera = {.eye = {0.0f, 1.0f, 0.95f}, .target = {-0.2f, 0.8f, 0.0f}, .up = {0, 1, 0}, .fov_y = 1.2f};
  return s;
}

// Guards against: corners that the clamp leaves dark, and light that compensation counts twice.
TEST(RenderVpl, GathersWithCompensationConvergeToPathTracedIrradianceAndClampingAloneIsDarker) {
  for (const bool is_furnace : {true, false}) {
    const RayTracer furnace(make_scene("white_furnace"));
    const RayTracer& rays = is_furnace ? furnace : cornell_box_rays();
    const char* name = is_furnace ? "white_furnace" : "cornell_box";
    const std::vector<Hit> hits = reflecting_hits(rays, 12);
    // A clamp that takes much, so that a compensation at fault shows.
    const float clamp = 0.01f * vpl_clamp(rays.scene().bounds);
    Tracer tracer(rays);
    std::array<Estimate, 3> whole, taken, difference;
    for (std::uint64_t seed = 0; seed < 200; ++seed) {
      const VplSet set = traced_set(rays, 64, seed);
      const glm::dvec3 E = mean_over(
          hits, [&](const Hit& hit, std::size_t) { return gather_vpls(tracer, hit, set.vpls(), clamp); });
      const glm::dvec3 rest = mean_over(hits, [&](const Hit& hit, std::size_t i) {
        return compensate(tracer, hit, set.vpls(), clamp, 6, hash_keys(seed, i)).E;  // a group and a half
      });
      const glm::dvec3 path = mean_over(hits, [&](const Hit& hit, std::size_t i) {
        Pcg32 random(hash_keys(seed, i, 77));
        glm::dvec3 sum(0.0);
        for (int s = 0; s < 4; ++s) sum += sample_irradiance(tracer, hit, Light::indirect, random);
        return sum / 4.0;
      });
      for (int c = 0; c < 3; ++c) {
        whole[c].add(E[c] + rest[c]);
        taken[c].add(rest[c]);
        difference[c].add(E[c] + rest[c] - path[c]);
      }
    }
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(difference[c].mean(), 0.0, 4.0 * difference[c].error()) << name;
      EXPECT_LT(difference[c].error(), 0.02 * whole[c].mean()) << name << ": the test sees nothing";
      EXPECT_GT(taken[c].mean(), 3.0 * 4.0 * difference[c].error()) << name << ": nothing to compensate";
    }
    if (is_furnace) {
      EXPECT_NEAR(whole[0].mean(), kPi * kRho, 4.0 * whole[0].error());
    }
  }
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

TEST(RenderVpl, KeptBitsOfWhichAnyPartIsTracedAnewGiveTheFreshIrradianceBitForBit) {
  for (const bool moves : {false, true}) {
    const RayTracer moving(room());
    const RayTracer& rays = moves ? moving : cornell_box_rays();
    const VplSet set = traced_set(rays, 700, 4);
    const float clamp = vpl_clamp(rays.scene().bounds);
    Tracer tracer(rays);
    Pcg32 random(8);
    for (const Hit& hit : reflecting_hits(rays, 12)) {
      Bits fresh(set.vpls().words()), kept(set.vpls().words());
      trace_visibility(tracer, hit, set.vpls(), fresh);
      const Irradiance E = gather_vpls(tracer, hit, set.vpls(), clamp);
      EXPECT_TRUE(same_bits(irradiance_from(fresh, hit, set.vpls(), clamp), E));
      // From nothing, in pieces of any composition.
      for (const std::uint32_t sparse : {0u, 2u, 5u}) {
        Bits rest(kept.size(), ~std::uint64_t{0});
        for (std::uint64_t& word : kept) word = hash_keys(random(), random());
        while (std::ranges::any_of(rest, [](std::uint64_t w) { return w != 0; })) {
          Bits which = rest;
          for (std::uint64_t& word : which)
            for (std::uint32_t k = 0; k < sparse; ++k)
              if (std::popcount(word) > 3) word &= hash_keys(random(), random());
          trace_visibility(tracer, hit, set.vpls(), which, kept);
          for (std::size_t w = 0; w < rest.size(); ++w) rest[w] &= ~which[w];
        }
        ASSERT_EQ(kept, fresh);
      }
    }
  }
}

// Guards against: light from below a horizon or through a wall, in packets of rays.
TEST(RenderVpl, EveryVplThatABitSaysIsSeenIsSeenByARayOfItsOwn) {
  const RayTracer& rays = cornell_box_rays();
  const VplSet set = traced_set(rays, 200, 6);
  Tracer tracer(rays);
  std::size_t seen = 0, hidden = 0;
  for (const Hit& hit : reflecting_hits(rays, 10)) {
    Bits bits(set.vpls().words());
    trace_visibility(tracer, hit, set.vpls(), bits);
    glm::dvec3 E(0.0);
    for (std::size_t slot = 0; slot < set.vpls().slots(); ++slot) {
      const Vpl vpl = set.vpls()[slot];
      const glm::vec3 d = vpl.p - hit.p, from = rays.leave(hit.p, hit.ng);
      const double here = glm::dot(d, hit.n), there = -glm::dot(d, vpl.n), d2 = glm::dot(d, d);
      const bool faces = here > 0.0 && there > 0.0 && glm::dot(d, hit.ng) > 0.0f;
      const bool sees = faces && !tracer.occluded(Ray{from, 1.0f, rays.leave(vpl.p, vpl.n) - from});
      ASSERT_EQ((bits[slot / 64] >> slot % 64 & 1u) != 0, sees);
      (sees ? seen : hidden) += faces;
      if (sees) E += std::min(here * there / (d2 * d2), 0.5) / kPi * glm::dvec3(vpl.flux);
    }
    const Irradiance sum = gather_vpls(tracer, hit, set.vpls(), 0.5f);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(sum[c], E[c], 1e-5 * E[c] + 1e-9);
  }
  EXPECT_GT(seen, 1000u);
  EXPECT_GT(hidden, 1000u);
}

// With the same VPLs seen, irradiance is a smooth function of the point, but where the clamp begins.
TEST(RenderVpl, GradientsAreTheSlopesOfTheSum) {
  const RayTracer& rays = cornell_box_rays();
  const VplSet set = traced_set(rays, 300, 5);
  const VplArrays& vpls = set.vpls();
  constexpr float kNoClamp = 1e30f;
  Tracer tracer(rays);
  Bits bits(vpls.words());
  int compared = 0;
  for (Hit x : reflecting_hits(rays, 8)) {
    x.p += 0.2f * x.ng;  // off the surface, where no VPL is near
    trace_visibility(tracer, x, vpls, bits);
    IrradianceGradients g;
    const Irradiance whole = irradiance_from(bits, x, vpls, kNoClamp, g);
    ASSERT_TRUE(same_bits(whole, irradiance_from(bits, x, vpls, kNoClamp)));
    const float E = whole.y;
    const auto slope = [&](auto&& change, float h) {
      Hit more = x, less = x;
      change(more, h);
      change(less, -h);
      return (irradiance_from(bits, more, vpls, kNoClamp).y - irradiance_from(bits, less, vpls, kNoClamp).y) /
             (2 * h);
    };
    const Basis basis(x.n);
    for (const glm::vec3& axis : {basis.s, basis.t}) {
      const float moved = slope([&](Hit& at, float h) { at.p += h * axis; }, 2e-3f);
      EXPECT_NEAR(glm::dot(g.translational[1], axis), moved, 0.01f * E + 0.02f * std::abs(moved));
      const float turned = slope([&](Hit& at, float h) { at.n += h * glm::cross(axis, x.n); }, 2e-3f);
      EXPECT_NEAR(glm::dot(g.rotational[1], axis), turned, 2e-3f * E);
    }
    EXPECT_NEAR(glm::dot(g.translational[1], x.n), 0.0f, 1e-5f * E);
    ++compared;
  }
  EXPECT_GE(compared, 30);
}

// Guards against: kept records whose compensation is no more that of a new one.
TEST(RenderVpl, TheRaysThatMetSomethingAreAllThatCompensationNeeds) {
  const RayTracer& rays = cornell_box_rays();
  const VplSet set = traced_set(rays, 300, 5);
  const float clamp = vpl_clamp(rays.scene().bounds);
  Tracer tracer(rays);
  int some = 0;
  for (const Hit& hit : reflecting_hits(rays, 16)) {
    const Compensation all = compensate(tracer, hit, set.vpls(), clamp, 30, 9);
    const Compensation again = compensate(tracer, hit, set.vpls(), clamp, 30, 9, Packing::exact, all.met);
    EXPECT_EQ(again.met, all.met);
    EXPECT_TRUE(same_bits(again.E, all.E));
    some += all.met != 0 && std::popcount(all.met) < 30 ? 1 : 0;
  }
  EXPECT_GT(some, 20);
}

// Guards against: slopes of a sum that is constant, which would make edges of light where the clamp ends.
TEST(RenderVpl, WhereTheClampBoundsAllNothingChanges) {
  const RayTracer& rays = cornell_box_rays();
  const VplSet set = traced_set(rays, 100, 5);
  const Hit x = reflecting_hits(rays, 4).front();
  Tracer tracer(rays);
  Bits bits(set.vpls().words());
  trace_visibility(tracer, x, set.vpls(), bits);
  IrradianceGradients g;
  irradiance_from(bits, x, set.vpls(), 1e-12f, g);
  for (std::size_t c = 0; c < 3; ++c)
    EXPECT_TRUE(g.translational[c] == glm::vec3(0.0f) && g.rotational[c] == glm::vec3(0.0f));
}

// Guards against: 0 / 0 where a virtual light lies at the point itself, and sums and slopes that overflow as it comes
// close.
TEST(RenderVpl, NothingMakesAnIrradianceThatIsNotFinite) {
  const RayTracer& rays = cornell_box_rays();
  Tracer tracer(rays);
  const Hit hit = reflecting_hits(rays, 3)[4];
  const Basis basis(hit.n);
  for (const float flux : {1e-20f, 1.0f, 1e20f, 3e38f}) {
    VplArrays vpls(64);
    std::size_t slot = 0;
    const auto add = [&](const glm::vec3& p, const glm::vec3& n) {
      vpls.set(slot++, {p, n, glm::vec3(flux)});
    };
    add(hit.p, hit.n);  // the point itself
    add(hit.p, -hit.n);
    add(hit.p + 0.3f * basis.s, hit.n);                                     // coplanar
    for (const float d : {1e-30f, 1e-22f, 1e-20f, 1e-12f, 1e-6f, 1e-3f}) {  // ever closer, face to face
      add(hit.p + d * hit.n, -hit.n);
      add(hit.p + d * glm::normalize(hit.n + basis.t), glm::normalize(basis.s - hit.n));
    }
    const Bits all{(std::uint64_t{1} << slot) - 1};
    for (const float clamp : {1e-6f, 4.0f, 4e8f}) {
      Bits bits(1);
      trace_visibility(tracer, hit, vpls, bits);
      for (const Bits& of : {bits, all}) {
        const Irradiance E = irradiance_from(of, hit, vpls, clamp);
        EXPECT_TRUE(is_irradiance(E)) << flux << ' ' << clamp << ' ' << E.x;
        EXPECT_LE(E.x, 1.001f * std::min(kMaxIrradiance, 16.0f * flux * clamp / 3.0f));
        IrradianceGradients g;
        EXPECT_TRUE(same_bits(irradiance_from(of, hit, vpls, clamp, g), E));
        for (std::size_t c = 0; c < 3; ++c)
          EXPECT_TRUE(is_finite(g.translational[c]) && is_finite(g.rotational[c])) << flux << ' ' << clamp;
      }
    }
  }
  EXPECT_EQ(compensate(tracer, hit, VplArrays(), 1.0f, 0, 1).E, glm::vec3(0.0f));
}

// Guards against: divisions by a power or a count that is 0.
TEST(RenderVpl, ADarkSceneHasNoVplsAndAsksNothing) {
  Scene dark = room();
  dark.materials[1].emission = glm::vec3(0.0f);
  dark.materials[1].albedo = glm::vec3(0.5f);
  const RayTracer rays(dark);
  const VplSet set = traced_set(rays, 100, 1);
  EXPECT_EQ(set.count(), 0u);
  EXPECT_TRUE(set.vertices(0).empty());
  Tracer tracer(rays);
  EXPECT_EQ(gather_vpls(tracer, reflecting_hits(rays, 4)[0], set.vpls(), 1.0f), glm::vec3(0.0f));
  EXPECT_EQ(tracer.counts.total(), 0u);
}

Image instant_gi(const RayTracer& rays, const PrimaryHits& primary, const VplSet& set,
                 const VplShading& shading, TileOrder order = TileOrder::scanline, int threads = 1) {
  Image out = blank(primary.width, primary.height);
  for_tiles(rays, primary.width, primary.height, order, threads, [&](Tracer& tracer, const Tile& tile) {
    instant_gi_tile(tracer, primary, set.vpls(), shading, tile, out);
  });
  return out;
}

TEST(RenderInstantGi, PicturesDoNotDependOnThreadsOrTileOrder) {
  const RayTracer& rays = cornell_box_rays();
  const PrimaryHits primary = primary_hits(rays, 40, 40);
  const VplSet set = traced_set(rays, 100, 6);
  const VplShading shading{vpl_clamp(rays.scene().bounds)};
  const Image one = instant_gi(rays, primary, set, shading);
  const Image many = instant_gi(rays, primary, set, shading, TileOrder::random, 5);
  EXPECT_EQ(std::memcmp(one.pixels.data(), many.pixels.data(), one.pixels.size() * sizeof(glm::vec3)), 0);
  EXPECT_EQ(value_error(one, false), "");
}

TEST(RenderInterleaved, TheGroupsTogetherAreTheWholeSet) {
  const RayTracer& rays = cornell_box_rays();
  const VplSet set = traced_set(rays, 300, 6);
  const float clamp = vpl_clamp(rays.scene().bounds);
  Tracer tracer(rays);
  const VplGroups one(set, 1), nine(set, 3), as_many_as_paths(traced_set(rays, 4, 6), 5);
  ASSERT_EQ(nine.size(), 9u);
  EXPECT_LT(as_many_as_paths.size(), 25u);
  for (const Hit& hit : reflecting_hits(rays, 8)) {
    const Irradiance full = gather_vpls(tracer, hit, set.vpls(), clamp);
    EXPECT_TRUE(same_bits(gather_vpls(tracer, hit, one[0], clamp), full));
    glm::dvec3 sum(0.0);
    for (std::size_t k = 0; k < nine.size(); ++k)
      sum += nine.share(k) * gather_vpls(tracer, hit, nine[k], clamp);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(sum[c], full[c], 1e-5 * full[c]);
  }
}

TEST(RenderInterleaved, WithOneGroupAndNoFilterItIsInstantGlobalIllumination) {
  for (const bool specular : {false, true}) {
    const RayTracer mirrored(room());
    const RayTracer& rays = specular ? mirrored : cornell_box_rays();
    PrimaryHits primary(rays.scene(), 24, 24);
    const CameraView view(rays.scene().camera, 24, 24);
    for_tiles(rays, 24, 24, TileOrder::scanline, 1, [&](Tracer& tracer, const Tile& tile) {
      primary_tile(tracer, view, Lens::centre, {}, tile, primary);
    });
    const VplSet set = traced_set(rays, 100, 6);
    const VplShading shading{vpl_clamp(rays.scene().bounds)};
    const VplGroups groups(set, 1);
    std::vector<Irradiance> E(primary.hits.size());
    Image out = blank(24, 24);
    for_tiles(rays, 24, 24, TileOrder::scanline, 1, [&](Tracer& tracer, const Tile& tile) {
      interleaved_tile(tracer, primary, set.vpls(), groups, shading, tile, E, out);
    });
    for (const Tile& tile : make_tiles(24, 24, 7, TileOrder::scanline))
      filter_tile(rays, primary, E, 1, 1.0f, tile, out);
    const Image full = instant_gi(rays, primary, set, shading);
    for (std::size_t i = 0; i < E.size(); ++i)
      EXPECT_LT(glm::distance(out.pixels[i], full.pixels[i]), 1e-6f * glm::length(full.pixels[i]) + 1e-12f);
  }
}

TEST(RenderInterleaved, TheFilterTakesTheMeanOfOneSurfaceAndStopsAtEdges) {
  // A floor and a wall that meet in the middle of the picture.
  Scene s;
  s.name = "corner";
  const auto grey = s.add_material({.albedo = glm::vec3(0.5f)});
  s.meshes.push_back(quad("floor", {-2, 0, 0}, {0, 0, 4}, {4, 0, 0}, grey));
  s.meshes.push_back(quad("wall", {-2, 0, 0}, {4, 0, 0}, {0, 4, 0}, grey));
  s.camera = {.eye = {0.0f, 1.0f, 1.0f}, .target = {0.0f, 0.0f, 0.0f}, .up = {0, 1, 0}, .fov_y = 0.5f};
  const RayTracer rays(s);
  const PrimaryHits primary = primary_hits(rays, 30, 30);
  std::vector<Irradiance> E(primary.hits.size());
  const auto on_floor = [&](std::size_t i) { return primary.hits[i].n.y > 0.5f; };
  for (std::size_t i = 0; i < E.size(); ++i)
    E[i] = glm::vec3((on_floor(i) ? 10.0f : 1.0f) + static_cast<float>(i % 30 % 3 + i / 30 % 3 * 3));
  Image out = make_image(30, 30);
  filter_tile(rays, primary, E, 3, 100.0f, {0, 0, 30, 30}, out);
  std::size_t inside = 0, floor = 0;
  for (std::size_t i = 0; i < E.size(); ++i) {
    const std::size_t x = i % 30, y = i / 30;
    floor += on_floor(i);
    const float base = on_floor(i) ? 10.0f : 1.0f;
    const float filtered = static_cast<float>(kPi) / 0.5f * out.pixels[i].x;
    EXPECT_GE(filtered, base - 1e-4f);
    EXPECT_LE(filtered, base + 8.001f) << "light crossed the edge";
    if (x == 0 || x == 29 || y == 0 || y == 29 || on_floor(i - 30) != on_floor(i + 30)) continue;
    EXPECT_NEAR(filtered, base + 4.0f, 1e-4f) << "the mean of nine groups";
    ++inside;
  }
  EXPECT_GT(floor, 200u);
  EXPECT_LT(floor, 700u);
  EXPECT_GT(inside, 600u);
}

}  // namespace
}  // namespace icbench
