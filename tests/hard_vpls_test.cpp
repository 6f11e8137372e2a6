// Virtual lights that touch a surface, or almost: records that they give to the caches, and what is interpolated from
// those; each with the failure it guards against.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <glm/geometric.hpp>
#include <limits>
#include <string>
#include <vector>

#include "cached_runs.h"
#include "hard_scenes.h"
#include "render/instant_caching.h"
#include "trap_invalid.h"

namespace icbench {
namespace {

constexpr float kDenormal = std::numeric_limits<float>::denorm_min();
constexpr float kDistances[] = {0.0f,   kDenormal, 1e-38f, 1e-30f, 1e-22f, 1e-20f, 1e-15f,
                                1e-10f, 1e-8f,     1e-7f,  1e-6f,  1e-5f,  1e-4f,  1e-3f};  // metres

// Points as far from a virtual light, and how they face it.
struct Approach {
  const char* name;
  Hit at;
};

// `inwards`: a side to which there is room.
std::vector<Approach> approaches(const Vpl& vpl, float distance, const glm::vec3& inwards) {
  const Basis basis(vpl.n);
  const glm::vec3 t = glm::dot(basis.s, inwards) > 0.0f ? basis.s : -basis.s;
  return {{"face to face", facing(vpl.p + distance * vpl.n, -vpl.n)},
          {"facing the same way", facing(vpl.p + distance * vpl.n, vpl.n)},
          // As in a corner: G goes to infinity, and nothing lies between.
          {"at right angles", facing(vpl.p + distance * (vpl.n + t), -t)}};
}

class TouchingVpls : public ::testing::TestWithParam<RecordKind> {};
INSTANTIATE_TEST_SUITE_P(Kinds, TouchingVpls, ::testing::ValuesIn(record_kinds_by_vpls()), kind_name);

double sum_of_flux(const VplArrays& vpls) {
  double sum = 0.0;
  for (std::size_t slot = 0; slot < vpls.slots(); ++slot) sum += vpls[slot].flux.y;
  return sum;
}

// What records with these details answer around one of them: irradiance that is no more than `most`, W/m^2.
template <class Ask>
void expect_bounded_around(const Record& r, double most, const Ask& ask, const std::string& what) {
  const Basis basis(r.n);
  for (const float share : {0.0f, 1e-6f, 0.01f, 0.1f})
    for (const float turn : {0.0f, 1e-4f, 0.1f}) {
      const SurfacePoint x{r.p + share * r.R * basis.s, glm::normalize(r.n + turn * basis.t)};
      const auto E = ask(x);
      ASSERT_TRUE(E.has_value()) << what;
      ASSERT_TRUE(is_irradiance(*E)) << what << ": " << E->x << ' ' << E->y << ' ' << E->z;
      ASSERT_LE(E->y, most) << what << ", moved by " << share << " R";
    }
}

// Guards against: bright spots, infinite or NaN irradiance and gradients of records that lie where a light path ended,
// or within rounding of it, and what spreads from there by interpolation.
TEST_P(TouchingVpls, MakeRecordsThatTheClampBounds) {
  constexpr float kA = 0.2f;
  Scene s = closed_room(2.0f);
  add_lamp_at(s, {0.5f, 1.9f, 0.5f}, 1.0f, 10.0f);
  const RayTracer rays(std::move(s));
  ThreadCrew crew(rays, 1);
  Tracer tracer(rays);
  PassSetup setup{rays, crew, 64, 64};
  setup.vpls = 32;
  setup.a = kA;
  setup.interpolation = GetParam().level;
  const auto source = GetParam().make(setup);
  source->begin_frame({}, crew);
  VplSet set(rays, {setup.vpls, setup.seed});  // those that the source has
  trace_all(set, tracer);
  ASSERT_GT(set.count(), 10u);
  const VplArrays& vpls = set.vpls();
  const float clamp = vpl_clamp(rays.scene().bounds);
  const double clamped = sum_of_flux(vpls) * static_cast<double>(clamp) / kPi;
  std::vector<std::uint64_t> bits(vpls.words());
  int touching = 0, records = 0;
  std::uint32_t pixel = 0;
  for (std::size_t slot = 0; slot < vpls.slots(); ++slot) {
    const Vpl vpl = vpls[slot];
    if (vpl == Vpl{}) continue;
    ListSession session{.bounds = rays.scene().bounds, .a = GetParam().reach() * kA};
    double most = 0.0;
    for (const float distance : kDistances)
      for (const Approach& approach : approaches(vpl, distance, glm::vec3(1.0f) - vpl.p)) {
        Hit at = approach.at;
        at.material = at.mesh = 0;
        const std::string what = std::string(approach.name) + " at " + std::to_string(distance);
        const Record r = source->evaluate(0, tracer, {at, glm::vec3(1.0f), pixel++ % 4096, 0}, {});
        ASSERT_EQ(session.insert(r), InsertResult::inserted) << what;
        source->settle(0, r, InsertResult::inserted);
        ++records;
        const Hit point = record_point(at);
        const double added = std::max(compensate_record(tracer, point, set, clamp).E.y,
                                      compensate_record(tracer, point, set, clamp, Packing::fast).E.y);
        ASSERT_LE(r.E.y, 1.0001 * (clamped + added)) << what;
        most = std::max(most, static_cast<double>(r.E.y));
        trace_visibility(tracer, point, vpls, bits);
        touching += static_cast<int>(bits[slot / 64] >> slot % 64 & 1u);
        if (RecordShapes* shapes = source->shapes()) {
          const RecordDetail& detail = shapes->details[r.id];
          for (std::size_t c = 0; c < 3; ++c)
            ASSERT_TRUE(is_finite(detail.gradients.translational[c]) &&
                        is_finite(detail.gradients.rotational[c]))
                << what;
        }
      }
    // The gradients let irradiance change by a share of the accuracy with which records are asked for, each.
    most *= 1.0 + 2.0 * static_cast<double>(session.a);
    const auto ask = [&](const SurfacePoint& x) {
      return source->shapes() ? query_extrapolating(session, *source->shapes(), x) : session.query(x);
    };
    for (const Record& r : session.records) expect_bounded_around(r, most, ask, "between them");
  }
  std::printf("%d records, of which %d see the light that they touch\n", records, touching);
  EXPECT_GT(touching, records / 20) << "there was nothing to guard against";
}

// Guards against: the same where no rounding of places keeps the point from the light, at every distance that floats
// can hold, and fluxes from next to nothing to their largest.
TEST(TouchingVplsInTheOpen, SendWhatTheClampLetsThroughFromAnyDistance) {
  constexpr float kA = 0.2f;
  Scene s;
  s.name = "open";
  const auto grey = s.add_material({.albedo = glm::vec3(0.5f)});
  s.meshes.push_back(quad("floor", {-1, -1, -1}, {0, 0, 2}, {2, 0, 0}, grey));
  add_lamp(s, 1.0f, 1.0f, 1.0f);
  s.camera = {.eye = {0, 0.5f, 0.5f}, .target = {0, -1, 0}, .up = {0, 1, 0}, .fov_y = 1.0f};
  const RayTracer rays(std::move(s));
  const Bounds& bounds = rays.scene().bounds;
  ThreadCrew crew(rays, 1);
  Tracer tracer(rays);
  PassSetup setup{rays, crew, 64, 64};
  setup.a = kA;
  setup.interpolation = Interpolation::gradients;
  RecordShapes shapes = make_shapes_of_vpls(setup);
  const RadiusRays radius(bounds, radius_limits(bounds));
  const float clamp = vpl_clamp(bounds);
  const Hit origin = facing({0, 0, 0}, {0, 1, 0});
  for (const float flux : {1e-30f, 1e-7f, 1.0f, 1e20f, 3e38f}) {
    VplArrays all(64);
    std::size_t slots = 0;
    const auto judge_record = [&](const VplArrays& vpls, bool is_bounded, const std::string& what) {
      IrradianceGradients gradients;
      const Irradiance E = gather_vpls(tracer, origin, vpls, clamp, Packing::fast, gradients);
      ASSERT_EQ(gather_vpls(tracer, origin, vpls, clamp, Packing::fast), E) << what;
      const double most =
          std::min(sum_of_flux(vpls) * static_cast<double>(clamp) / kPi, static_cast<double>(kMaxIrradiance));
      ASSERT_LE(E.y, 1.0001 * most) << what;
      if (is_bounded) {
        ASSERT_GE(E.y, 0.9999 * most) << what;
        for (std::size_t c = 0; c < 3; ++c) ASSERT_EQ(gradients.translational[c], glm::vec3(0.0f)) << what;
      }
      DistanceCodes distances;
      radius.trace(tracer, origin, RadiusRays::kAll, distances);
      for (const Interpolation level : {Interpolation::split_sphere, Interpolation::gradients}) {
        shapes.details.clear();
        const std::uint32_t id = shapes.details.draft(0);
        Record r{origin.p, origin.n, radius.radius(distances), E, id};
        if (extrapolates(level)) r.R = shapes.shaper.shape_of_vpls(r.R, E, gradients, shapes.details[id]);
        ListSession session{.bounds = bounds, .a = search_reach(level, true) * kA};
        ASSERT_EQ(session.insert(r), InsertResult::inserted) << what;
        const auto ask = [&](const SurfacePoint& x) {
          return extrapolates(level) ? query_extrapolating(session, shapes, x) : session.query(x);
        };
        expect_bounded_around(r, (1.0 + 2.0 * static_cast<double>(session.a)) * static_cast<double>(E.y), ask,
                              what);
      }
    };
    for (const float distance : kDistances)
      for (const glm::vec3& n : {glm::vec3(0, -1, 0), glm::vec3(0, 1, 0), glm::vec3(1, 0, 0)}) {
        // Above the point, or askew where its normal is at right angles to the point's.
        const glm::vec3 p = n.x > 0.0f ? glm::vec3(-distance, distance, 0) : glm::vec3(0, distance, 0);
        const Vpl vpl{p, n, glm::vec3(flux)};
        all.set(slots++, vpl);
        VplArrays one(1);
        one.set(0, vpl);
        // Nearer than that |d|^4 is no normal number, and less comes through.
        const bool is_bounded = n.y < 1.0f && distance >= 1e-8f;
        judge_record(one, is_bounded, std::to_string(flux) + " W at " + std::to_string(distance));
      }
    ASSERT_LE(slots, all.slots());
    judge_record(all, false, "all of them");
  }
}

}  // namespace
}  // namespace icbench
