// Instant caching (Dubla 2012, 6.2): records whose irradiance is gathered from virtual point lights (VPLs) by shadow
// rays, as instant global illumination does at every pixel.
//
// How a record is evaluated serves temporal instant caching too: both make the same records of the same VPLs, but that
// records which are not kept have their rays traced in the faster packing. Everything about a record follows from its
// point: irradiance is the gather's sum in fixed order, with compensation by rays that are the same everywhere; the
// radius follows from a few fixed rays.
#pragma once

#include <cstdint>
#include <memory>

#include "render/indirect_pass.h"
#include "render/irradiance_cache.h"
#include "render/packed_normal.h"
#include "render/radius_rays.h"
#include "render/record_source.h"
#include "render/vpl_compensation.h"
#include "render/vpl_gather.h"

namespace icbench {

/// Compensation rays of a record: a bit of RecordTable's for each.
inline constexpr std::uint32_t kRecordCompensation = 32;

/// The point at which a record is made, as it is evaluated: with normals that 32 bits can hold.
Hit record_point(const glm::vec3& p, PackedNormal n, PackedNormal ng) noexcept;
inline Hit record_point(const Hit& hit) noexcept {
  return record_point(hit.p, PackedNormal::pack(hit.n), PackedNormal::pack(hit.ng));
}

/// What the clamp takes at a record, from the set's virtual lights; clamp: vpl_clamp.
inline Compensation compensate_record(Tracer& tracer, const Hit& point, const VplSet& vpls, float clamp,
                                      Packing packing = Packing::exact,
                                      std::uint64_t which = ~std::uint64_t{0}) noexcept {
  return compensate(tracer, point, vpls.vpls(), clamp, kRecordCompensation, compensation_key(vpls.seed()),
                    packing, which);
}

/// What a pass has to know of its records beside what the cache holds; null where there is nothing to extrapolate by
/// and no guard against leaks.
std::unique_ptr<RecordShapes> shapes_beside_cache(const PassSetup& setup);

/// Traces paths of a set anew, by a crew.
VplChange update_vpls(VplUpdate& update, Crew& crew);

/// Static instant caching: in every frame VPLs are traced anew and records made anew. Ids are those of
/// RecordNames, or, where records are extrapolated, of RecordDetails.
class InstantCachingSource final : public RecordSource {
 public:
  explicit InstantCachingSource(const PassSetup& setup);

  RecordsThen begin_frame(const SceneChange& change, Crew& crew) override;
  Record evaluate(unsigned thread, Tracer& tracer, const Visible& x, const SampleKey& key) noexcept override;
  void settle(unsigned thread, const Record& record, InsertResult result) noexcept override;
  RecordShapes* shapes() noexcept override { return shapes_.get(); }
  bool makes_plain_records() noexcept override { return !extrapolated_; }
  void report(PassFigures& figures) const noexcept override;

 private:
  VplSet vpls_;
  RadiusRays radius_;
  float clamp_;
  RecordNames names_;
  bool extrapolated_;                     // records have details in shapes_
  std::unique_ptr<RecordShapes> shapes_;  // shapes_beside_cache
};

}  // namespace icbench
