// What cached pictures cost and how far they are from the truth, scene by scene.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string_view>

#include "render/extrapolation.h"
#include "rows/row.h"

namespace icbench {

/// The thesis's scenes without mirrors and glass.
inline constexpr std::array<std::string_view, 11> kDiffuseScenes{
    "cornell_box", "wobble",     "desk",    "bunnies_1",        "bunnies_2", "bunnies_4",
    "bunnies_9",   "conference", "sibenik", "cornell_indirect", "office"};

/// How a picture is made whose price in --deterministic is asked for.
struct DeterministicFrame {
  std::string_view integrator;
  std::string_view interpolation;
  std::uint32_t spp;  ///< samples a pixel; with more than one, queries take the time and not the records

  int width() const noexcept { return spp > 1 ? 256 : 512; }
  int height() const noexcept { return width() / 4 * 3; }
  /// Virtual point lights of instant caching.
  static constexpr std::uint32_t kVpls = 1024;
};

/// Indirect time of a cached picture, deterministic, over that of one left to itself. A sample is a frame of either.
std::unique_ptr<Experiment> deterministic_over_free(const Machine& machine, std::string_view scene,
                                                    const DeterministicFrame& which);

/// Where a picture is judged: everywhere, or where normals are along an axis, as on walls and boxes, not on what is
/// curved.
enum class Hits : std::uint8_t { all, along_axes };

/// Records that the occlusion Hessian needs over those that the split sphere needs for the same root-mean-square error
/// of irradiance against path tracing, the reference's own error taken out; of both, those at such hits. A sample is
/// one seed. Needs no quiet.
std::unique_ptr<Experiment> records_at_equal_error(const Machine& machine, std::string_view scene,
                                                   Hits which);

/// What the same figure would be if someone who knows every error mended pictures of the occlusion Hessian: its records
/// and, for one record each, the worst pixels, until the split sphere's error is reached; at that accuracy of a few
/// where these are fewest together. No bound: a record may mend its neighbours, too. A sample is one seed. Needs no
/// quiet.
std::unique_ptr<Experiment> records_mended(const Machine& machine, std::string_view scene);

/// Relative mean squared error of the best cached picture that takes no longer than path tracing with `spp` samples,
/// over that of the latter; the reference's own taken out of both. A sample is one seed.
std::unique_ptr<Experiment> error_at_equal_time(const Machine& machine, std::string_view scene,
                                                std::uint32_t spp);

/// How far the mean of cached pictures lies from path tracing's, as a share of it; at the scene's own accuracy. A
/// sample is the mean of four seeds. Needs no quiet.
std::unique_ptr<Experiment> mean_off(const Machine& machine, std::string_view scene, Interpolation level);

/// Mean of a cached picture of the white furnace over albedo^2, the truth. A sample is one seed.
std::unique_ptr<Experiment> furnace_mean(const Machine& machine);

inline constexpr float kBlockAccuracy = 0.04f;

/// Root-mean-square error of the means of 4 x 4 pixels of a cached Cornell box, 256 rays a record at kBlockAccuracy, as
/// a share of the picture's mean, direct light included. A sample is one seed. Needs no quiet.
std::unique_ptr<Experiment> block_error(const Machine& machine);

}  // namespace icbench
