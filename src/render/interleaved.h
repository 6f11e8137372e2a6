// Instant global illumination by interleaved sampling (Wald et al. 2002): the fast rival of caching.
//
// The light paths are cut into n n groups of neighbours in the paths' order, each an estimate of its own. A pixel
// gathers from the VPLs of one group only, and the pixels of every n x n block from all groups. That leaves a pattern,
// which a second pass takes out: a pixel takes the mean irradiance of the n x n pixels around it, of those that lie on
// the same smooth surface nearby (discontinuity buffer). Irradiance is filtered, not radiance, so that textures stay.
// Where all n n pixels take part, every group has, and the mean is that of the full set as far as the groups have
// equally many paths: each is scaled by its own share of them. With 256 VPLs in nine groups that is 0.2 % on average,
// with 1,024 a tenth of it, and no bias.
//
// What a pixel sees besides its main hit, behind mirrors and glass, is lit by all VPLs and is not filtered.
//
// Cost: 1 / (n n) of the shadow rays of instant global illumination; a few nanoseconds per pixel for the filter.
#pragma once

#include <cstdint>
#include <vector>

#include "render/instant_gi.h"
#include "render/primary.h"
#include "render/vpl.h"

namespace icbench {

inline constexpr std::uint32_t kInterleave = 3;  ///< n of the integrator

/// A set's VPLs by group.
class VplGroups {
 public:
  /// n * n groups, or as many as there are paths; n odd.
  VplGroups(const VplSet& set, std::uint32_t n);

  std::uint32_t side() const noexcept { return n_; }
  std::size_t size() const noexcept { return groups_.size(); }

  /// VPLs of group k: flux is scaled so that they estimate all light by themselves.
  const VplArrays& operator[](std::size_t k) const noexcept { return groups_[k]; }
  /// Share of all paths that are in group k.
  float share(std::size_t k) const noexcept { return shares_[k]; }

  const VplArrays& of_pixel(std::uint32_t pixel, int width) const noexcept {
    const std::uint32_t x = pixel % static_cast<std::uint32_t>(width) % n_;
    const std::uint32_t y = pixel / static_cast<std::uint32_t>(width) % n_;
    return groups_[(y * n_ + x) % groups_.size()];
  }

 private:
  std::uint32_t n_;
  std::vector<VplArrays> groups_;
  std::vector<float> shares_;
};

/// First pass over a tile: irradiance at the main hits into `E`, by pixel, 0 where nothing reflects; radiance of
/// all other hits into `indirect`.
void interleaved_tile(Tracer& tracer, const PrimaryHits& primary, const VplArrays& all,
                      const VplGroups& groups, const VplShading& shading, const Tile& tile,
                      std::vector<Irradiance>& E, Image& indirect) noexcept;

/// Second pass, when the first is through with the whole image: adds to `indirect` the radiance of the main hits, of
/// irradiance filtered over n x n pixels; n is odd, 1 filters nothing. `diagonal` is the scene's, metres.
void filter_tile(const RayTracer& rays, const PrimaryHits& primary, const std::vector<Irradiance>& E,
                 std::uint32_t n, float diagonal, const Tile& tile, Image& indirect) noexcept;

}  // namespace icbench
