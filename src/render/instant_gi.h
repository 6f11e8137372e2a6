// Instant global illumination (Keller 1997; Wald et al. 2002): at everything that a pixel sees, indirect light is
// gathered from virtual point lights, the same for all pixels.
//
// VPLs are traced anew in every frame. Each visible hit has the clamped sum over all VPLs and, unless switched off, the
// compensation of what the clamp takes. Random numbers of the compensation depend on the seed alone
// (VplShading), and the sum has none. What light sends to a hit straight from a mirror or through glass is missing.
//
// Cost: a shadow ray per hit and VPL above both horizons, and some kPixelCompensation short rays per hit.
#pragma once

#include <cstdint>

#include "render/indirect_pass.h"
#include "render/primary.h"
#include "render/sampling.h"
#include "render/vpl.h"

namespace icbench {

/// Compensation rays of a hit.
inline constexpr std::uint32_t kPixelCompensation = 32;

/// How irradiance is made of VPLs.
struct VplShading {
  float clamp;                                      ///< of the geometric term, 1/m^2 (vpl_clamp)
  std::uint32_t compensation = kPixelCompensation;  ///< rays; 0: what the clamp takes is lost
  std::uint64_t key = 0;  ///< of their random numbers: the same everywhere, as the VPLs are
};

/// How it is made of this set's.
VplShading shading_of(const VplSet& set) noexcept;

/// Indirect irradiance, W/m^2, at a hit that reflects: gathered from `some` of the VPLs, compensated with all.
Irradiance instant_irradiance(Tracer& tracer, const Hit& hit, const VplArrays& some, const VplArrays& all,
                              const VplShading& shading) noexcept;

/// Indirect radiance at the stored hits of a tile.
void instant_gi_tile(Tracer& tracer, const PrimaryHits& primary, const VplArrays& vpls,
                     const VplShading& shading, const Tile& tile, Image& indirect) noexcept;

/// Traces all paths of a set anew, by a crew.
void retrace_all(VplSet& set, Crew& crew);

}  // namespace icbench
