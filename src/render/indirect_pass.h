// One integrator at work: the pass over stored primary hits that everything which renders goes through.
//
// Per frame: begin_frame once; then for each sample of the pixels begin_sample, the tiles in any number of threads,
// end_sample. All of it together is the integrator's own time (`seconds_indirect`); primary rays and, where
// light() says so, direct light are traced by others. Dispatch is per frame and tile, never per operation.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <span>

#include "image/image.h"
#include "render/crew.h"
#include "render/extrapolation.h"
#include "render/path.h"
#include "render/primary.h"
#include "render/record_source.h"
#include "render/sampling.h"
#include "render/tiles.h"

namespace icbench {

/// What an integrator is set up with. Outlives it.
struct PassSetup {
  const RayTracer& rays;
  Crew& crew;
  int width = 0, height = 0;
  std::uint32_t gather_rays = 256;  ///< of a hemisphere gather
  std::uint32_t vpls = 256;         ///< virtual point lights
  float a = 0.2f;                   ///< accuracy of the cache
  Interpolation interpolation = Interpolation::split_sphere;
  std::uint64_t seed = 0;
  float cell_size = 8.0f;       ///< of hash cells, pixels
  std::uint32_t paths = 1;      ///< traced from each visible point, for integrators that say so
  bool leak_guard = false;      ///< of cached records (render/leak_guard.h)
  std::uint32_t vpl_paths = 0;  ///< that leave the VPLs; 0: planned for the scene as it stands (render/vpl.h)
  std::uint32_t samples = 1;    ///< primary samples of a pixel
};

/// How many records of a picture there is room for, in the cache and beside it: two a pixel, since mirrors and glass
/// show it more than one point. Samples beside the first make records of their own where the accuracy is fine, but the
/// larger the picture, the fewer; for them there is room up to two million.
inline std::uint64_t room_for_records(int width, int height, std::uint32_t samples) noexcept {
  constexpr std::uint64_t kOfSamples = 1 << 21;
  const std::uint64_t of_pixels =
      2ull * static_cast<std::uint64_t>(width) * static_cast<std::uint64_t>(height);
  return std::max(of_pixels, std::min(of_pixels * samples, kOfSamples));
}

class IndirectPass {
 public:
  virtual ~IndirectPass() = default;

  /// Which reflected light the pass brings: indirect, all of it (then no direct light is traced besides), or only
  /// direct (then the pass brings nothing).
  virtual Light light() const noexcept { return Light::indirect; }

  /// Quiescent, once per frame; `change` is what RayTracer::go_to altered since the last call.
  virtual void begin_frame(const SceneChange& change) = 0;

  /// Quiescent. Primary hits are there.
  virtual void begin_sample(const PrimaryHits&, const SampleKey&) {}

  /// Reflected radiance, W/(m^2 sr), at the hits of a tile, by one thread of the crew. Pixels that reflect
  /// nothing are 0.
  virtual void tile(unsigned thread, Tracer& tracer, const PrimaryHits& primary, const SampleKey& key,
                    const Tile& tile, Image& out) noexcept = 0;

  /// Quiescent: finishes what the tiles of a sample began.
  virtual void end_sample(const PrimaryHits&, Image& /*out*/) {}

  /// Whether it keeps records that can be taken to another pass, and back (RecordSource::makes_plain_records).
  virtual bool keeps_plain_records() const noexcept { return false; }
  /// Takes such records, of the frame that was begun, and returns how many it kept. Quiescent, before the first sample.
  virtual std::uint64_t take_records(std::span<const Record> /*records*/) { return 0; }

  /// Calls f for every record it keeps. Quiescent.
  virtual void for_each_record(const std::function<void(const Record&)>& /*f*/) const {}

  /// Of the frame that was begun last.
  virtual PassFigures figures() const { return {}; }
};

/// What goes before a pass: primary hits of a tile, and the radiance they emit and, unless the pass brings all light,
/// reflect directly, as the mean of `light_samples` estimates (>= 1).
void visible_tile(Tracer& tracer, Light light_of_pass, const CameraView& view, Lens lens,
                  const SampleKey& key, std::uint32_t light_samples, const Tile& tile, PrimaryHits& primary,
                  Image& direct) noexcept;

}  // namespace icbench
