// The thesis's animations as rows see them: how many virtual point lights they take, and what the thesis measured.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string_view>
#include <vector>

#include "rows/row.h"

namespace icbench {

/// A scene whose pictures are judged, and its virtual lights; the accuracy of caches is the scene's own.
struct Setting {
  std::string_view scene;
  /// Where IGI's visible error levels off (bench/tables --choose-vpls), or 8,192 where that is not known yet
  /// (bench/MEASURED.md).
  std::uint32_t vpls;
};

/// Of the caches.
float accuracy_of(const Setting& setting);

struct Animation {
  Setting setting;
  /// To be reached, indirect time: Dubla 2012, table 6.4, or 25 where that is asked for.
  double igi_over_tic;
  double ic_over_tic;  ///< the same, of static instant caching
};

inline constexpr std::array kAnimations{
    Animation{{"cornell_box", 16384}, 25.0, 3.0}, Animation{{"wobble", 8192}, 12.33, 3.0},
    Animation{{"desk", 8192}, 25.0, 3.0},         Animation{{"bunnies_1", 16384}, 18.67, 4.0},
    Animation{{"bunnies_2", 16384}, 13.75, 3.25}, Animation{{"bunnies_4", 16384}, 11.0, 2.6},
    Animation{{"bunnies_9", 16384}, 6.33, 1.33},  Animation{{"conference", 16384}, 25.0, 3.4},
    Animation{{"sibenik", 8192}, 25.0, 8.4},
};

/// The animations' scenes, and the thesis's others, whose pictures are judged.
inline std::vector<Setting> judged_scenes() {
  std::vector<Setting> out;
  for (const Animation& a : kAnimations) out.push_back(a.setting);
  for (const Setting& still :
       {Setting{"cornell_specular", 8192}, Setting{"cornell_indirect", 8192}, Setting{"office", 8192}})
    out.push_back(still);
  return out;
}

/// Pixels of the pictures at which the rows are measured.
inline constexpr int kAnimationWidth = 512, kAnimationHeight = 384;

/// Indirect time of a frame by an integrator over that by temporal instant caching. A sample is one frame of the
/// animation, rendered by both; of the first, in which temporal instant caching has nothing to keep, none is taken.
std::unique_ptr<Experiment> over_temporal(const Machine& machine, std::string_view integrator,
                                          const Animation& animation);

/// The reverse: that by temporal instant caching over that by the integrator.
std::unique_ptr<Experiment> temporal_over(const Machine& machine, std::string_view integrator,
                                          const Animation& animation);

/// Estimates of direct light that a pixel gets where pictures are judged, as `icbench render` takes: with fewer, noise
/// that both pictures share hides what tells them apart.
inline constexpr std::uint32_t kJudgedLightSamples = 16;

/// Percentage of pixels that a human tells apart (HDR-VDP, P > 75 %) between the last frame of a few by temporal
/// instant caching and by instant global illumination with the same virtual lights. A sample is one seed.
std::unique_ptr<Experiment> temporal_visible(const Machine& machine, const Setting& setting);

/// Bytes that temporal instant caching keeps of a record beside the cache and the gradients, which instant caching
/// keeps as well, over 64 and a bit a virtual light.
std::unique_ptr<Experiment> temporal_memory(const Machine& machine);

}  // namespace icbench
