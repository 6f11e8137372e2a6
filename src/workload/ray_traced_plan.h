// A ray-traced workload: stored primary hits of a scene, the indirect light that a cache has to bring there,
// and the path-traced reference it is judged by.
#pragma once

#include <cstdint>
#include <memory>

#include "core/cache.h"
#include "image/image.h"
#include "render/irradiance_cache.h"
#include "render/path.h"
#include "workload/spec.h"
#include "workload/trial.h"

namespace icbench {

/// Indirect radiance at primary hits by path tracing, with its own error.
struct Reference {
  Image indirect;
  Image half_difference;  ///< of the two independent halves whose mean `indirect` is, by pixel
  /// Expected relMSE of the reference itself against the truth, from two independent halves.
  double relmse = 0.0;
  double rmse = 0.0;  ///< likewise, W/(m^2 sr)
  std::uint32_t spp = 0;
  double scaled_relmse = 0.0;             ///< likewise as relmse, of pictures scaled to mean luminance 1
  double rmse_irradiance = 0.0;           ///< as rmse, of irradiance_of the pictures, W/m^2
  double scaled_relmse_irradiance = 0.0;  ///< as scaled_relmse, of irradiance_of the pictures
};

/// Irradiance, W/m^2, of the diffuse surfaces at primary hits, from the radiance that they reflect, W/(m^2 sr): pi over
/// albedo times it in each channel. 0 where a channel reflects nothing, and where the first surface seen is none or
/// specular.
Image irradiance_of(const RayTracer& rays, const PrimaryHits& primary, const Image& reflected);

/// Primary hits through the pixel centres, by all processors.
PrimaryHits centre_hits(const RayTracer& rays, int width, int height);

/// Path traces `spp` samples (at least 2) at each hit, by all processors. Deterministic by seed.
Reference make_reference(const RayTracer& rays, const PrimaryHits& primary, std::uint32_t spp,
                         std::uint64_t seed);

class RayTracedPlan {
 public:
  /// `rays`, `primary` and `reference` are shared by all workloads of one scene and size, and outlive the
  /// plan.
  RayTracedPlan(const WorkloadSpec& spec, const RayTracer& rays, const PrimaryHits& primary,
                const Reference& reference, std::uint64_t seed);

  const WorkloadSpec& spec() const noexcept { return spec_; }
  const RayTracer& rays() const noexcept { return *rays_; }
  const PrimaryHits& primary() const noexcept { return *primary_; }
  const Reference& reference() const noexcept { return *reference_; }
  const std::vector<Tile>& tiles() const noexcept { return tiles_; }

  /// Records by hemisphere gathers; named after their hits.
  std::unique_ptr<RecordSource> source() const;
  CacheConfig config(unsigned threads) const;
  std::uint64_t records_of_one_thread(std::uint64_t seed) const;

  /// Fills in rmse, relmse and mean_ratio of an indirect image against the reference.
  void judge(const Image& indirect, TrialOutcome& out) const;

 private:
  WorkloadSpec spec_;
  const RayTracer* rays_;
  const PrimaryHits* primary_;
  const Reference* reference_;
  std::vector<Tile> tiles_;
};

/// The workload's light paths at the stored hits, by a method that uses no cache: each pixel's alone (path tracing), or
/// shared by all pixels of a cell (hash cells).
TrialOutcome run_uncached_trial(const RayTracedPlan& plan, const TrialSetup& setup);

}  // namespace icbench
