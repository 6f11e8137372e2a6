// Primary hits of a whole image, stored, so that what happens at them can be run and timed by itself.
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "render/camera.h"
#include "render/ray_tracer.h"
#include "render/sampling.h"
#include "render/tiles.h"

namespace icbench {

/// Where in a pixel its ray goes through.
enum class Lens : std::uint8_t {
  centre,   ///< the same hits for every sample and frame
  jittered  ///< uniform in the pixel: the mean over samples is box-filtered
};

struct PrimaryHits {
  int width = 0, height = 0;
  std::vector<Hit> hits;  ///< row-major, top row first; missed() where nothing was hit

  PrimaryHits() = default;
  PrimaryHits(int w, int h)
      : width(w), height(h), hits(static_cast<std::size_t>(w) * static_cast<std::size_t>(h)) {}
};

/// Calls f(pixel index) for every pixel of a tile, row by row.
template <class F>
void for_each_pixel(const Tile& tile, int width, F&& f) {
  for (int y = tile.y0; y < tile.y1; ++y)
    for (int x = tile.x0; x < tile.x1; ++x)
      f(static_cast<std::uint32_t>(y) * static_cast<std::uint32_t>(width) + static_cast<std::uint32_t>(x));
}

/// Calls f(pixel index) for every pixel of a tile, from coarse to fine and the middle first: in bit-reversed Z-order.
/// A record made at a pixel then serves pixels on all sides of it. Row by row it would serve those to the right and
/// below only, and wherever irradiance slopes, the picture would come out too dark or too bright as a whole.
template <class F>
void for_each_pixel_coarse_to_fine(const Tile& tile, int width, F&& f) {
  const auto w = static_cast<unsigned>(tile.x1 - tile.x0), h = static_cast<unsigned>(tile.y1 - tile.y0);
  const auto bits = static_cast<unsigned>(std::bit_width(std::max(w, h) - 1u));
  const unsigned side = 1u << bits;
  for (unsigned i = 0; i < side * side; ++i) {
    unsigned x = side / 2, y = side / 2;
    for (unsigned b = 0; b < bits; ++b) {
      x += ((i >> (2 * b)) & 1u) << (bits - 1 - b);
      y += ((i >> (2 * b + 1)) & 1u) << (bits - 1 - b);
    }
    x &= side - 1;
    y &= side - 1;
    if (x < w && y < h) {
      f((static_cast<std::uint32_t>(tile.y0) + y) * static_cast<std::uint32_t>(width) +
        static_cast<std::uint32_t>(tile.x0) + x);
    }
  }
}

/// Whether a hit reflects any light, so that irradiance matters there.
inline bool reflects(const RayTracer& rays, const Hit& hit) noexcept {
  return !hit.missed() && rays.albedo(hit) != glm::vec3(0.0f);
}

/// First hit of one pixel's ray.
Hit primary_hit(Tracer& tracer, const CameraView& view, Lens lens, const SampleKey& key, int x, int y,
                std::uint32_t pixel) noexcept;

/// Fills a tile of `out`.
void primary_tile(Tracer& tracer, const CameraView& view, Lens lens, const SampleKey& key, const Tile& tile,
                  PrimaryHits& out) noexcept;

}  // namespace icbench
