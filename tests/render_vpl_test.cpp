// Gathers from virtual point lights: against path tracing, their kept bits, gradients and compensation.
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

#include "lambert.h"
#include "render/path.h"
#include "render/vpl.h"
#include "render/vpl_compensation.h"
#include "render/vpl_gather.h"
#include "scene/room.h"
#include "trap_invalid.h"
#include "vpl_support.h"

namespace icbench {
namespace {

using Bits = std::vector<std::uint64_t>;

template <class F>
glm::dvec3 mean_over(const std::vector<Hit>& hits, F&& f) {
  glm::dvec3 sum(0.0);
  for (std::size_t i = 0; i < hits.size(); ++i) sum += f(hits[i], i);
  return sum / static_cast<double>(hits.size());
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

// Guards against: few estimates where much hangs on them, as between the slats of blinds, which all err alike then.
TEST(RenderVpl, WhereTheClampTakesAllEachRayOfCompensationHasAnEstimate) {
  const RayTracer& rays = cornell_box_rays();
  const VplSet set = traced_set(rays, 300, 5);
  Tracer tracer(rays);
  double error_of_one = 0.0, error_of_four = 0.0;
  for (const Hit& hit : reflecting_hits(rays, 4)) {
    Estimate one, four;  // rays
    for (std::uint64_t key = 0; key < 2'000; ++key) {
      one.add(compensate(tracer, hit, set.vpls(), 1e-6f, 1, key).E.y);
      four.add(compensate(tracer, hit, set.vpls(), 1e-6f, 4, key).E.y);
    }
    error_of_one += one.error();
    error_of_four += four.error();
  }
  EXPECT_LT(error_of_four, 0.6 * error_of_one) << "by four estimates it is half";
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

// Where the clamp takes all, compensation is path tracing: guards against a wrong weight at its later surfaces.
TEST(RenderVpl, WhereTheClampTakesAllCompensationIsTheIndirectLight) {
  const RayTracer rays(make_scene("white_furnace"));
  Tracer tracer(rays);
  const Hit hit = reflecting_hits(rays, 4)[5];
  Estimate E;
  for (std::uint64_t key = 0; key < 10'000; ++key)
    E.add(compensate(tracer, hit, VplArrays(), 1e-8f, 4, key).E.y);
  EXPECT_LT(E.error(), 0.01 * kPi * kRho);
  EXPECT_NEAR(E.mean(), kPi * kRho, 4.0 * E.error());
}

// Guards against: light of a lamp that rays of compensation do not reach, weighted as if they did.
TEST(RenderVpl, CompensationHasAllTheLightOfALampBeyondItsReach) {
  constexpr float kClamp = 4.0f, kWall = 0.1f, kAlbedo = 0.5f;
  Scene s;
  s.name = "wall";
  const auto grey = s.add_material({.albedo = glm::vec3(kAlbedo)});
  const auto lamp = s.add_material({.emission = glm::vec3(1.0f)});
  s.meshes.push_back(quad("wall", {kWall, 0, -5}, {0, 0, 10}, {0, 5, 0}, grey));  // faces -x
  s.meshes.push_back(quad("lamp", {-0.9f, 0, -3}, {0, 6, 0}, {0, 0, 6}, lamp));   // faces it
  const RayTracer rays(s);
  Tracer tracer(rays);
  ASSERT_LT(compensation_reach(kClamp), kWall + 0.9f);
  const Polygon3 shines = {{-0.9, 0, -3}, {-0.9, 6, -3}, {-0.9, 6, 3}, {-0.9, 0, 3}};
  Hit point{};
  point.n = point.ng = {0, 1, 0};
  Estimate compensated, expected;
  Pcg32 random(3);
  for (std::uint64_t key = 0; key < 20'000; ++key) {
    compensated.add(compensate(tracer, point, VplArrays(), kClamp, 4, key).E.y);
    const float u = random.uniform(), v = random.uniform();
    const glm::vec3 d = cosine_direction(Basis(point.n), u, v);
    const double t = d.x > 0.0f ? kWall / d.x : 1e9, G = d.y * d.x / (t * t);
    expected.add(G > kClamp ? kAlbedo * (1.0 - kClamp / G) *
                                  lambert({kWall, t * d.y, t * d.z}, {-1, 0, 0}, shines, 1.0)
                            : 0.0);
  }
  const double error = std::hypot(compensated.error(), expected.error());
  EXPECT_LT(error, 0.03 * expected.mean());
  EXPECT_NEAR(compensated.mean(), expected.mean(), 4.0 * error);
}

// Guards against: lamps that shine to the back.
TEST(RenderVpl, CompensationFindsNoLightBehindALamp) {
  // A plate above a floor, and beside both a lamp that turns its back on them.
  Scene s;
  s.name = "gap";
  const auto grey = s.add_material({.albedo = glm::vec3(0.5f)});
  const auto lamp = s.add_material({.emission = glm::vec3(1.0f)});
  s.meshes.push_back(quad("floor", {-1, 0, -1}, {0, 0, 2}, {2, 0, 0}, grey));
  s.meshes.push_back(quad("plate", {-1, 0.2f, -1}, {1, 0, 0}, {0, 0, 2}, grey));
  s.meshes.push_back(quad("lamp", {0.1f, 0, -1}, {0, 1, 0}, {0, 0, 2}, lamp));
  const RayTracer rays(s);
  Tracer tracer(rays);
  Hit point{};
  point.p = {-0.1f, 0, 0};
  point.n = point.ng = {0, 1, 0};
  std::uint64_t met = 0;
  for (std::uint64_t key = 0; key < 200; ++key) {
    const Compensation out = compensate(tracer, point, VplArrays(), 4.0f, 32, key);
    met |= out.met;
    EXPECT_EQ(out.E, glm::vec3(0.0f));
  }
  EXPECT_NE(met, 0u);
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

// Guards against: light paths that end in the very surface that their light lies in, by rounding or a hair behind it,
// though direct light passes there.
TEST(RenderVpl, APointLightInTheCeilingSendsItsLightIntoTheRoom) {
  const glm::vec3 n = glm::normalize(glm::vec3(0.3f, 0.2f, 0.9f));
  const Basis basis(n);
  const glm::mat3 tilt(basis.s, basis.t, n);
  for (const float above : {-0.05f, 0.0f, 1e-6f}) {
    Scene s;
    const auto grey = s.add_material({.albedo = glm::vec3(0.6f)});
    add_room(s, {{-1, 0, -1}, {1, 2, 1}}, {grey, grey, grey, grey, grey, grey});
    for (Mesh& mesh : s.meshes)
      for (glm::vec3& p : mesh.positions) p = tilt * p;
    const glm::vec3 light = tilt * glm::vec3(0.1f, 2.0f + above, 0.2f);
    s.point_lights.push_back({.p = light, .intensity = glm::vec3(1)});
    const RayTracer rays(std::move(s));
    const VplSet set = traced_set(rays, 200, 1);
    std::uint32_t across = 0;  // to another side of the room
    for (std::uint32_t path = 0; path < set.paths(); ++path) {
      const float way = glm::distance(set.vertices(path)[1], light);
      across += way > 0.1f && way < 4.0f;
    }
    // The others go up, where nothing is, or end close by in the ceiling; of a hair, about a quarter of epsilon, what
    // goes down less steeply than that does not get past it, as direct light does not.
    EXPECT_GE(across, set.paths() / 3) << above;
  }
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

}  // namespace
}  // namespace icbench
