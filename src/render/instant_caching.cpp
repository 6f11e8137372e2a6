#include "render/instant_caching.h"

#include <bit>

#include "core/random.h"
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

VplChange update_vpls(VplUpdate& update, Crew& crew) {
  crew.for_each(update.chunks(), 1,
                [&](unsigned, Tracer& tracer, std::size_t chunk) { update.trace(tracer, chunk); });
  return update.commit();
}

InstantCachingSource::InstantCachingSource(const PassSetup& s)
    : vpls_(s.rays, {s.vpls, s.seed}),
      radius_(s.rays.scene().bounds, radius_limits(s.rays.scene().bounds)),
      clamp_(vpl_clamp(s.rays.scene().bounds)),
      names_(s.rays.scene(), s.width, s.height),
      shapes_(extrapolates(s.interpolation) ? new RecordShapes(make_shapes_of_vpls(s)) : nullptr) {}

RecordsThen InstantCachingSource::begin_frame(const SceneChange&, Crew& crew) {
  retrace_all(vpls_, crew);
  if (shapes_) shapes_->details.clear();
  return RecordsThen::go;
}

Record InstantCachingSource::evaluate(unsigned thread, Tracer& tracer, const Visible& x,
                                      const SampleKey& key) noexcept {
  const Hit point = record_point(x.hit);
  DistanceCodes distances;
  radius_.trace(tracer, point, RadiusRays::kAll, distances);
  const Irradiance added = compensate_record(tracer, point, vpls_, clamp_, Packing::fast).E;
  const float R = radius_.radius(distances);
  if (!shapes_) {
    const Irradiance E = gather_vpls(tracer, point, vpls_.vpls(), clamp_, Packing::fast) + added;
    return {point.p, point.n, R, E, names_(x, key)};
  }
  IrradianceGradients gradients;
  const Irradiance E = gather_vpls(tracer, point, vpls_.vpls(), clamp_, Packing::fast, gradients) + added;
  const std::uint32_t id = shapes_->details.draft(thread);
  if (id == RecordDetails::kNone) return {point.p, point.n, R, E, id};
  return {point.p, point.n, shapes_->shaper.shape_of_vpls(R, E, gradients, shapes_->details[id]), E, id};
}

void InstantCachingSource::settle(unsigned thread, const Record& record, InsertResult result) noexcept {
  if (shapes_ && result == InsertResult::inserted && record.id != RecordDetails::kNone)
    shapes_->details.keep(thread);
}

void InstantCachingSource::report(PassFigures& figures) const noexcept {
  figures.light_paths = figures.light_paths_retraced = vpls_.paths();
  figures.vpls_in_use = vpls_.count();
  if (shapes_) figures.bytes_beside_cache = figures.bytes_of_details = shapes_->details.bytes();
}

std::unique_ptr<RecordSource> make_instant_caching(const PassSetup& setup) {
  return std::make_unique<InstantCachingSource>(setup);
}

}  // namespace icbench
