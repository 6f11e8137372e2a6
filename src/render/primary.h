// What the pixels of a whole image see, stored, so that what happens there can be run and timed by itself.
//
// A pixel sees one diffuse surface. Behind mirrors and dielectrics it may see several, or none: they are followed as in
// Whitted ray tracing, a dielectric splitting the ray into its reflected and its refracted branch, each with its
// weight. Images of scenes without such surfaces hold hits alone and are passed over without asking.
//
// The tree of a pixel splits down to kSplitDepth bounces and into kMaxVisible leaves at most; beyond that a branch goes
// on in one direction, chosen by the Fresnel term. Branches of weight below kMinWeight are dropped by roulette: those
// that survive have weight kMinWeight. So nothing is lost in the mean over pixels or samples.
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/random.h"
#include "image/image.h"
#include "render/camera.h"
#include "render/ray_tracer.h"
#include "render/sampling.h"
#include "render/tiles.h"

namespace icbench {

inline constexpr std::uint32_t kSplitDepth = 8;
inline constexpr std::uint32_t kMaxVisible = 32;
inline constexpr float kMinWeight = 1.0f / 256.0f;

/// Where in a pixel its ray goes through.
enum class Lens : std::uint8_t {
  centre,   ///< the same hits for every sample and frame
  jittered  ///< uniform in the pixel: the mean over samples is box-filtered
};

/// A diffuse surface as a pixel sees it.
struct WeightedHit {
  Hit hit;
  glm::vec3 weight;  ///< of the radiance that leaves it, in the radiance of the pixel
};

struct Visible;

struct PrimaryHits {
  int width = 0, height = 0;
  /// Of the diffuse surface that counts most, row-major, top row first; missed() if there is none.
  std::vector<Hit> hits;

  // Empty in scenes without specular surfaces, where every weight is 1.
  std::vector<glm::vec3> weights;               ///< of `hits`
  std::vector<std::vector<WeightedHit>> extra;  ///< what else a pixel sees; at most kMaxVisible - 1
  std::vector<std::uint8_t> through;  ///< whether it sees all that in a mirror or through a dielectric

  PrimaryHits() = default;
  /// Room for an image of a scene.
  PrimaryHits(const Scene& scene, int w, int h);

  bool is_plain() const noexcept { return extra.empty(); }  ///< no specular surfaces
  /// Whether the first surface that a pixel's ray meets is specular.
  bool sees_through(std::size_t pixel) const noexcept { return !is_plain() && through[pixel] != 0; }
  std::uint32_t layers() const noexcept;  ///< the most hits that any pixel has, at least 1
  std::size_t count() const noexcept;     ///< hits of all pixels, missed ones included

  /// How many hits the pixel has, at least 1.
  std::uint32_t layers_of(std::uint32_t pixel) const noexcept {
    return is_plain() ? 1 : 1 + static_cast<std::uint32_t>(extra[pixel].size());
  }
  /// The hit of a layer that the pixel has.
  inline Visible at(std::uint32_t pixel, std::uint32_t layer) const noexcept;
};

/// One of the hits of a pixel.
struct Visible {
  const Hit& hit;       ///< missed() where the pixel sees no diffuse surface
  glm::vec3 weight;     ///< of the radiance that leaves it, in the radiance of the pixel
  std::uint32_t pixel;  ///< index
  std::uint32_t layer;  ///< 0 for the pixel's main hit, which comes first; counts the others up from 1

  /// Key of its random numbers.
  std::uint64_t key(const SampleKey& sample, Purpose purpose) const noexcept {
    const std::uint64_t of_pixel = sample.of_pixel(pixel, purpose);
    return layer == 0 ? of_pixel : hash_keys(of_pixel, layer);
  }

  /// Adds the radiance that leaves it to an image, where the main hit overwrites what was there.
  void show(Image& image, const glm::vec3& L) const noexcept {
    glm::vec3& to = image.pixels[pixel];
    to = layer == 0 ? weight * L : to + weight * L;
  }
};

inline Visible PrimaryHits::at(std::uint32_t pixel, std::uint32_t layer) const noexcept {
  if (layer == 0) return {hits[pixel], is_plain() ? glm::vec3(1.0f) : weights[pixel], pixel, 0};
  const WeightedHit& other = extra[pixel][layer - 1];
  return {other.hit, other.weight, pixel, layer};
}

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

/// Calls f(Visible) for everything that a tile sees; `each_pixel(tile, width, g)` sets the order of pixels.
template <class EachPixel, class F>
void for_each_visible(const Tile& tile, const PrimaryHits& primary, EachPixel&& each_pixel, F&& f) {
  if (primary.is_plain()) {
    each_pixel(tile, primary.width, [&](std::uint32_t pixel) { f(primary.at(pixel, 0)); });
    return;
  }
  each_pixel(tile, primary.width, [&](std::uint32_t pixel) {
    for (std::uint32_t layer = 0; layer < primary.layers_of(pixel); ++layer) f(primary.at(pixel, layer));
  });
}

/// Row by row.
template <class F>
void for_each_visible(const Tile& tile, const PrimaryHits& primary, F&& f) {
  for_each_visible(
      tile, primary, [](const Tile& t, int width, auto&& g) { for_each_pixel(t, width, g); }, f);
}

/// From coarse to fine, as for_each_pixel_coarse_to_fine. Neighbours in this order are far apart in memory, so each
/// main hit is asked for while the one before is at work.
template <class F>
void for_each_visible_coarse_to_fine(const Tile& tile, const PrimaryHits& primary, F&& f) {
  const auto one_behind = [&](const Tile& t, int width, auto&& g) {
    std::optional<std::uint32_t> before;
    for_each_pixel_coarse_to_fine(t, width, [&](std::uint32_t pixel) {
      const auto* hit = reinterpret_cast<const std::byte*>(&primary.hits[pixel]);
      __builtin_prefetch(hit);
      __builtin_prefetch(hit + sizeof(Hit) - 1);
      if (before) g(*before);
      before = pixel;
    });
    if (before) g(*before);
  };
  for_each_visible(tile, primary, one_behind, f);
}

/// Whether a hit reflects light diffusely, so that irradiance matters there.
inline bool reflects(const RayTracer& rays, const Hit& hit) noexcept {
  return !hit.missed() && !rays.material(hit).is_specular() && rays.albedo(hit) != glm::vec3(0.0f);
}

/// Ray through a random point of a pixel.
Ray jittered_ray(const CameraView& view, int x, int y, Pcg32& random) noexcept;

/// First hit of one pixel's ray, be it specular.
Hit primary_hit(Tracer& tracer, const CameraView& view, Lens lens, const SampleKey& key, int x, int y,
                std::uint32_t pixel) noexcept;

/// Overwrites `out` with the diffuse surfaces that a ray of unit direction sees, through mirrors and dielectrics; what
/// neither emits towards the ray nor reflects is left out if it is not the first hit. Returns whether the first hit is
/// specular. Out of memory ends the program.
bool trace_visible(Tracer& tracer, const Ray& ray, Pcg32& random, std::vector<WeightedHit>& out) noexcept;

/// Fills a tile of `out`, which has room for this scene. Tiles of one image may be filled at once.
void primary_tile(Tracer& tracer, const CameraView& view, Lens lens, const SampleKey& key, const Tile& tile,
                  PrimaryHits& out) noexcept;

}  // namespace icbench
