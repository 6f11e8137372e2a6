// Frames of a scene by any integrator, and what they cost: the work behind `icbench render` and `icbench animate`.
//
// For every sample of a frame: primary hits and direct light, then the integrator's own pass over the stored hits. The
// two are run and timed apart; the integrator's state (cache, virtual lights) lives through all samples and frames.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>

#include "image/image.h"
#include "render/integrators.h"
#include "render/residual.h"
#include "workload/dispatch.h"
#include "workload/team_crew.h"

namespace icbench {

class TraceRecorder;

struct FrameRequest {
  RayTracer& rays;
  ThreadTeam& team;
  const IntegratorEntry& integrator;
  const CacheEntry& cache;  ///< for integrators that use one
  int width = 256, height = 256;
  std::uint32_t spp = 1;            ///< samples per pixel: through the centre if there is one, else jittered
  std::uint32_t light_samples = 1;  ///< estimates of direct light per sample of a pixel
  std::uint32_t gather = 256;       ///< irradiance_cache: rays per record
  std::uint32_t vpls = 256;         ///< integrators by virtual point lights: how many
  float a = 0.2f;                   ///< accuracy of the cache
  Interpolation interpolation = Interpolation::split_sphere;
  TileOrder tiles = TileOrder::morton;
  std::uint64_t seed = 0;
  std::function<void(double)> progress = [](double) {};  ///< told how many tile samples were done
  float cell_size = 8.0f;                                ///< hash_cells: edge of a cell, pixels
  std::uint32_t paths = 1;                               ///< hash_cells: paths from each visible point
  bool deterministic = false;                            ///< cached pictures too depend on no schedule
  bool overture = false;                                 ///< all records are made before the picture is
  std::optional<bool> leak_guard{};                      ///< cached integrators: guards_against_leaks
  float residual_share = 0.0f;  ///< of the pixels, drawn for the residual; 0: none is
  bool keeps_residual = false;  ///< its layer, too
  /// Made before, for the frame that is rendered first: in the cache from the beginning.
  std::vector<Record> records{};
  TraceRecorder* trace = nullptr;  ///< captures what is asked of the cache, if that is not deterministic
};

/// Whether leaks through thin walls are guarded against (render/leak_guard.h). Where that is left open: hemisphere
/// gathers' records but the plain ones of the split sphere, which ends before a high wall at fine accuracies.
bool guards_against_leaks(const FrameRequest& request) noexcept;

/// The cache that a request is met with, for a crew of that size.
CacheConfig cache_config(const FrameRequest& request, unsigned threads);

/// What a frame cost.
struct FrameCost {
  double seconds = 0.0;           ///< wall time of all passes, and of moving the scene to the frame
  double seconds_indirect = 0.0;  ///< of the integrator's own pass, with all that it prepares and merges
  RayCounts rays;
  PassFigures pass;
  unsigned threads = 1;
  std::optional<ResidualFigures> residual;  ///< if it was asked for; its cost is not in the above
  double seconds_residual = 0.0;            ///< wall time
  RayCounts rays_residual;
  std::uint64_t records_taken = 0;  ///< of FrameRequest::records
};

class FrameRenderer {
 public:
  explicit FrameRenderer(const FrameRequest& request);

  /// Renders the scene's frame `frame`, which need not follow the last one. The picture is valid until the next call.
  FrameCost render(std::uint32_t frame);
  const Image& picture() const noexcept { return picture_; }
  /// What the integrator's own pass brought to the frame's last sample.
  const Image& indirect() const noexcept { return indirect_; }
  /// Whether the integrator's records can be kept in a file (IndirectPass::keeps_plain_records).
  bool keeps_plain_records() const noexcept { return pass_->keeps_plain_records(); }
  /// Calls f for every record that the integrator keeps.
  void for_each_record(const std::function<void(const Record&)>& f) const { pass_->for_each_record(f); }
  /// Adds the signed layer that makes the frame's picture unbiased, if it was to be kept.
  void add_residual(Image& to) const {
    if (residual_) residual_->add_to(to);
  }

 private:
  void add_to_residual(const SampleKey& key);

  FrameRequest request_;
  TeamCrew crew_;
  std::vector<Tile> tiles_;
  std::unique_ptr<IndirectPass> pass_;
  PrimaryHits primary_;
  Image direct_, indirect_, picture_;
  std::vector<glm::dvec3> sum_;  // of samples: of millions, floats would lose a hundredth
  std::optional<ResidualEstimator> residual_;
};

/// Memory that the pixels of a frame take while it is made, bytes; records come on top.
std::uint64_t frame_bytes(const FrameRequest& request);

/// Tiles that a frame is made of, times samples: the total that `progress` adds up to.
double frame_work(const FrameRequest& request);

}  // namespace icbench
