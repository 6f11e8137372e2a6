// A whole picture by any integrator, and what it cost: the work behind `icbench render`.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "core/counters.h"
#include "harness/thread_team.h"
#include "image/image.h"
#include "render/integrators.h"
#include "render/irradiance_cache.h"
#include "render/ray_tracer.h"

namespace icbench {

inline constexpr int kPictureTile = 16;  ///< pixels a side

struct PictureRequest {
  const RayTracer& rays;
  ThreadTeam& team;
  const IntegratorEntry& integrator;
  int width = 256, height = 256;
  std::uint32_t spp = 1;       ///< jittered samples per pixel
  std::uint32_t gather = 256;  ///< irradiance_cache: rays per record
  float a = 0.2f;              ///< irradiance_cache: accuracy
  TileOrder tiles = TileOrder::morton;
  std::uint64_t seed = 0;
  std::function<void(double)> progress = [](double) {};  ///< told how many tile samples were done
};

struct PictureOutcome {
  Image picture;
  double seconds = 0.0;           ///< wall time of all passes
  double seconds_indirect = 0.0;  ///< irradiance_cache: of the indirect passes alone, merging included
  RayCounts rays;
  Counts counts;  ///< of the cache
  std::uint64_t records = 0;
};

/// Memory that the pixels of a picture take while it is made, bytes; records come on top.
std::uint64_t picture_bytes(const PictureRequest& request);

/// Tiles that a picture of this size is made of, times samples: the total that `progress` adds up to.
double picture_work(const PictureRequest& request);

/// A picture by an integrator that needs no cache.
PictureOutcome render_plain_picture(const PictureRequest& request);

}  // namespace icbench
