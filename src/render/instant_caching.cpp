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
      names_(s.rays.scene(), s.width, s.height) {}

RecordsThen InstantCachingSource::begin_frame(const SceneChange&, Crew& crew) {
  retrace_all(vpls_, crew);
  return RecordsThen::go;
}

Record InstantCachingSource::evaluate(unsigned, Tracer& tracer, const Visible& x,
                                      const SampleKey& key) noexcept {
  const Hit point = record_point(x.hit);
  DistanceCodes distances;
  radius_.trace(tracer, point, RadiusRays::kAll, distances);
  const Irradiance E = gather_vpls(tracer, point, vpls_.vpls(), clamp_, Packing::fast) +
                       compensate_record(tracer, point, vpls_, clamp_, Packing::fast).E;
  return {point.p, point.n, radius_.radius(distances), E, names_(x, key)};
}

void InstantCachingSource::report(PassFigures& figures) const noexcept {
  figures.light_paths = figures.light_paths_retraced = vpls_.paths();
  figures.vpls_in_use = vpls_.count();
}

std::unique_ptr<RecordSource> make_instant_caching(const PassSetup& setup) {
  return std::make_unique<InstantCachingSource>(setup);
}

}  // namespace icbench
