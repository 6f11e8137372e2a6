#include "render/instant_caching.h"

#include "render/instant_gi.h"
#include "render/integrators.h"

namespace icbench {

Hit record_point(const glm::vec3& p, PackedNormal n, PackedNormal ng) noexcept {
  Hit point{};
  point.p = p;
  point.n = n.unpack();
  point.ng = ng.unpack();
  return point;
}

std::unique_ptr<RecordShapes> shapes_beside_cache(const PassSetup& s) {
  if (!extrapolates(s.interpolation) && !s.leak_guard) return nullptr;
  return std::unique_ptr<RecordShapes>(new RecordShapes(make_shapes_of_vpls(s)));
}

VplChange update_vpls(VplUpdate& update, Crew& crew) {
  crew.for_each(update.chunks(), 1,
                [&](unsigned, Tracer& tracer, std::size_t chunk) { update.trace(tracer, chunk); });
  return update.commit();
}

InstantCachingSource::InstantCachingSource(const PassSetup& s)
    : vpls_(s.rays, {s.vpls, s.seed, s.vpl_paths}),
      radius_(s.rays.scene().bounds, radius_limits(s.rays.scene().bounds)),
      clamp_(vpl_clamp(s.rays.scene().bounds)),
      names_(s.rays.scene(), s.width, s.height),
      extrapolated_(extrapolates(s.interpolation)),
      shapes_(shapes_beside_cache(s)) {}

RecordsThen InstantCachingSource::begin_frame(const SceneChange&, Crew& crew) {
  retrace_all(vpls_, crew);
  if (extrapolated_) shapes_->details.clear();
  return RecordsThen::go;
}

Record InstantCachingSource::evaluate(unsigned thread, Tracer& tracer, const Visible& x,
                                      const SampleKey& key) noexcept {
  const Hit point = record_point(x.hit);
  DistanceCodes distances;
  radius_.trace(tracer, point, RadiusRays::kAll, distances);
  const Irradiance added = compensate_record(tracer, point, vpls_, clamp_, Packing::fast).E;
  const float R = radius_.radius(distances);
  if (!extrapolated_) {
    const Irradiance E = gather_vpls(tracer, point, vpls_.vpls(), clamp_, Packing::fast) + added;
    return {point.p, point.n, R, E, names_(x, key)};
  }
  IrradianceGradients gradients;
  const Irradiance E = gather_vpls(tracer, point, vpls_.vpls(), clamp_, Packing::fast, gradients) + added;
  const std::uint32_t id = shapes_->details.draft(thread);
  RecordDetail thrown_away;
  RecordDetail& detail = id == RecordDetails::kNone ? thrown_away : shapes_->details[id];
  return {point.p, point.n, shapes_->shaper.shape_of_vpls(R, E, gradients, detail), E, id};
}

void InstantCachingSource::settle(unsigned thread, const Record& record, InsertResult result) noexcept {
  if (extrapolated_ && result == InsertResult::inserted && record.id != RecordDetails::kNone)
    shapes_->details.keep(thread);
}

void InstantCachingSource::report(PassFigures& figures) const noexcept {
  figures.light_paths = figures.light_paths_retraced = vpls_.paths();
  figures.vpls_in_use = vpls_.count();
  if (extrapolated_) figures.bytes_beside_cache = figures.bytes_of_details = shapes_->details.bytes();
}

std::unique_ptr<RecordSource> make_instant_caching(const PassSetup& setup) {
  return std::make_unique<InstantCachingSource>(setup);
}

}  // namespace icbench
