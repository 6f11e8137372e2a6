// The integrators: one entry each, and whole pictures by those that need no cache.
//
// Rendering functions work on one tile in the calling thread; threads, their placement and the order of tiles
// are the caller's. Tiles write disjoint pixels.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "image/image.h"
#include "render/camera.h"
#include "render/ray_tracer.h"
#include "render/sampling.h"
#include "render/tiles.h"

namespace icbench {

/// What a picture is rendered from, shared by all tiles.
struct PictureJob {
  CameraView view;
  std::uint32_t spp = 1;  ///< jittered samples per pixel, >= 1
  SampleKey key{};        ///< of the first sample
};

using PictureTile = void (*)(Tracer& tracer, const PictureJob& job, const Tile& tile,
                             Image& picture) noexcept;

/// Radiance with all light: the reference.
void path_tile(Tracer& tracer, const PictureJob& job, const Tile& tile, Image& picture) noexcept;

/// Emitted and direct light only (RT of Dubla 2012).
void whitted_tile(Tracer& tracer, const PictureJob& job, const Tile& tile, Image& picture) noexcept;

struct IntegratorEntry {
  std::string_view name;
  std::string_view description;
  bool needs_cache;
  PictureTile tile;  ///< null if it needs a cache: then the pass is a template over the cache's session
};

inline constexpr std::array kIntegrators{
    IntegratorEntry{"whitted", "direct light only, by ray tracing", false, whitted_tile},
    IntegratorEntry{"path", "path tracing with next-event estimation: the unbiased reference", false,
                    path_tile},
    IntegratorEntry{"irradiance_cache", "hemisphere gathers, interpolated through a cache", true, nullptr},
};

/// Throws std::runtime_error naming the known integrators if there is none of that name.
const IntegratorEntry& find_integrator(std::string_view name);

}  // namespace icbench
