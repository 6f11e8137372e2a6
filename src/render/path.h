// The reference: unbiased path tracing with next-event estimation, multiple importance sampling and Russian
// roulette.
//
// Paths go on through mirrors and dielectrics, reflected or refracted at random by the Fresnel term; a lamp met by way
// of these counts fully, since no shadow ray could have found it (shadow rays are blocked by glass). Point lights are
// found by shadow rays alone: what they send through glass or by mirrors is lost, though light paths find it
// (render/vpl.h).
//
// No bounce limit and no clamping. Written one ray after the other, apart from the gather's code, which is
// tested against it. Random numbers depend on pixel, sample and frame alone.
#pragma once

#include <cstdint>

#include "core/random.h"
#include "core/types.h"
#include "image/image.h"
#include "render/primary.h"
#include "render/ray_tracer.h"
#include "render/sampling.h"
#include "render/tiles.h"

namespace icbench {

/// Which light an irradiance estimate counts.
enum class Light : std::uint8_t {
  all,      ///< direct and indirect
  direct,   ///< straight from a lamp: the path ends after one ray
  indirect  ///< by way of at least one surface, be it a mirror or glass
};

/// One sample of the irradiance at x, W/m^2. Traces about 2 (1 + albedo + albedo^2 + ...) rays.
Irradiance sample_irradiance(Tracer& tracer, const Hit& x, Light light, Pcg32& random) noexcept;

/// Indirect radiance, W/(m^2 sr), reflected at stored hits: the mean of `spp` samples per hit. Pixels that
/// reflect nothing are 0. This is what a cached pass over the same hits is compared with.
void path_indirect_tile(Tracer& tracer, const PrimaryHits& primary, std::uint32_t spp, const SampleKey& key,
                        const Tile& tile, Image& indirect) noexcept;

/// Emitted and directly reflected radiance at stored hits, from `spp` samples of the lights per hit.
void direct_tile(Tracer& tracer, const PrimaryHits& primary, std::uint32_t spp, const SampleKey& key,
                 const Tile& tile, Image& direct) noexcept;

}  // namespace icbench
