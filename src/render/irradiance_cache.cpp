#include "render/irradiance_cache.h"

#include <numbers>
#include <utility>

#include "core/cache.h"

namespace icbench {

namespace {

RecordShapes make_shapes(const PassSetup& s, float a, const RadiusLimits& limits, LeakSuspects suspects) {
  return {RecordShaper(s.interpolation, a, s.rays.scene().bounds, limits, s.height),
          RecordDetails(capacity_for(room_for_records(s.width, s.height, s.samples), s.crew.size()),
                        s.crew.size(), s.leak_guard ? suspects : LeakSuspects::none)};
}

}  // namespace

RecordShapes make_shapes(const PassSetup& s) {
  return make_shapes(s, s.a, radius_limits(s.rays.scene().bounds), LeakSuspects::marked);
}

RecordShapes make_shapes_of_vpls(const PassSetup& s) {
  const float turn = search_reach(s.interpolation, true);
  const RadiusLimits limits = RadiusLimits::for_scene(s.rays.scene().bounds, kMinRadiusOfDiagonal / turn,
                                                      kMaxRadiusOfDiagonal / turn);
  return make_shapes(s, turn * s.a, limits, LeakSuspects::all);
}

namespace {

bool changes_light(const SceneChange& change) noexcept {
  return !change.moved.empty() || change.materials || change.lights;
}

}  // namespace

RecordsThen HemisphereSource::begin_frame(const SceneChange& change, Crew&) {
  return std::exchange(is_full_, false) || changes_light(change) ? RecordsThen::go : RecordsThen::stay;
}

Record HemisphereSource::evaluate(unsigned, Tracer& tracer, const Visible& x, const SampleKey& key) noexcept {
  const GatherResult g = gather(tracer, x.hit, strata_, x.key(key, Purpose::gather));
  return {x.hit.p, x.hit.n, limits_.clamp(g.R), g.E, names_(x, key)};
}

float mean_irradiance(const RayTracer& rays, Crew& crew, int width, int height, std::uint64_t seed) {
  constexpr int kSide = 16;
  const Strata strata = Strata::for_rays(16);
  const CameraView view(rays.scene().camera, width, height);
  struct Probe {
    double light = 0.0, weight = 0.0;
  };
  std::vector<Probe> probes(kSide * kSide);
  crew.for_each(probes.size(), kSide, [&](unsigned, Tracer& tracer, std::size_t i) {
    const auto at = [](std::size_t cell, int size) {
      return (static_cast<float>(cell) + 0.5f) / kSide * static_cast<float>(size);
    };
    const std::uint64_t key = SampleKey{.seed = seed}.of_pixel(static_cast<std::uint32_t>(i), Purpose::probe);
    Pcg32 random(key);
    std::vector<WeightedHit> seen;
    trace_visible(tracer, view.ray(at(i % kSide, width), at(i / kSide, height)), random, seen);
    for (const WeightedHit& x : seen) {
      if (!reflects(rays, x.hit)) continue;
      const float weight = luminance(x.weight);
      probes[i].light += weight * luminance(gather(tracer, x.hit, strata, key).E);
      probes[i].weight += weight;
    }
  });
  Probe sum;  // in their order
  for (const Probe& p : probes) {
    sum.light += p.light;
    sum.weight += p.weight;
  }
  return sum.weight > 0.0 ? static_cast<float>(sum.light / sum.weight) : 0.0f;
}

ShapedHemisphereSource::ShapedHemisphereSource(const PassSetup& s)
    : rays_(s.rays),
      width_(s.width),
      height_(s.height),
      seed_(s.seed),
      strata_(Strata::for_rays(s.gather_rays)),
      names_(s.rays.scene(), s.width, s.height),
      shapes_(make_shapes(s)),
      workers_(s.crew.size()) {}

RecordsThen ShapedHemisphereSource::begin_frame(const SceneChange& change, Crew& crew) {
  shapes_.shaper.look_from(rays_.scene().camera);
  const bool stays = !changes_light(change);
  if (shapes_.shaper.level() == Interpolation::occlusion_hessian && !(stays && knows_light_)) {
    shapes_.shaper.expect(mean_irradiance(rays_, crew, width_, height_, seed_));
    caustics_.find(rays_, crew, seed_);
    knows_light_ = true;
  }
  if (!std::exchange(is_full_, false) && stays) return RecordsThen::stay;
  shapes_.details.clear();
  return RecordsThen::go;
}

Record ShapedHemisphereSource::evaluate(unsigned thread, Tracer& tracer, const Visible& x,
                                        const SampleKey& key) noexcept {
  const RecordShaper& shaper = shapes_.shaper;
  const std::uint64_t of_hit = x.key(key, Purpose::gather);
  if (!has_details()) {
    const GatherResult g = gather(tracer, x.hit, strata_, of_hit);
    return {x.hit.p, x.hit.n, shaper.radius(x.hit.p, g.R), g.E, names_(x, key)};
  }
  Worker& w = workers_[thread];
  // Whether a ray finds a lamp in a mirror or behind glass is chance. Were what it finds to decide how far a record
  // counts, those that found much would count less far than those that found nothing, and pictures would be too dark.
  const bool apart = shaper.level() == Interpolation::occlusion_hessian;
  const GatherResult g =
      gather(tracer, x.hit, strata_, of_hit, w.seen, apart ? FocusedLight::apart : FocusedLight::seen);
  Record record{x.hit.p, x.hit.n, shaper.radius(x.hit.p, g.R), g.E, shapes_.details.draft(thread)};
  if (record.id == RecordDetails::kNone) return record;
  if (extrapolates(shaper.level())) {
    RecordDetail& detail = shapes_.details[record.id];
    w.smooth(w.seen);
    detail.gradients = is_light_known(w.seen) ? gradients_of(w.seen, rays_.epsilon()) : IrradianceGradients{};
    if (is_elliptic(shaper.level())) {
      const Irradiance expected =
          glm::max(g.E - w.seen.apart, 0.0f) + caustics_.irradiance_at(record.p, record.n);
      record.R = shaper.ellipse(record.p, w.seen, g.R, expected, detail,
                                caustics_.distance_to_brighter(record.p, record.n, luminance(expected)));
    } else {
      record.R = shaper.radius(record.p, g.R, g.E, detail.gradients);
    }
    // With occlusion what is extrapolated is limited where it is asked for; here it only has to stay finite.
    restrain(detail.gradients, record.E, apart ? rays_.epsilon() : record.R);
  }
  if (shapes_.details.suspects() == LeakSuspects::marked) {
    const float reach = shaper.reach(record.R);
    LeakMarks marks = leak_marks(w.seen, reach);
    mark_low(marks, tracer, x.hit, w.seen.basis, reach);
    shapes_.details[record.id].marks = marks;
  }
  return record;
}

void ShapedHemisphereSource::settle(unsigned thread, const Record& record, InsertResult result) noexcept {
  if (!has_details()) return;
  if (result == InsertResult::inserted && record.id != RecordDetails::kNone) shapes_.details.keep(thread);
}

void ShapedHemisphereSource::report(PassFigures& figures) const noexcept {
  figures.bytes_beside_cache = figures.bytes_of_details = shapes_.details.bytes();
}

glm::vec3 reflected_radiance(const RayTracer& rays, const Hit& hit, const Irradiance& E) noexcept {
  return rays.albedo(hit) * std::numbers::inv_pi_v<float> * E;
}

}  // namespace icbench
