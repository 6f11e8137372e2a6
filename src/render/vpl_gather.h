// Gathering irradiance from virtual point lights at a surface point.
//
// VPL j with flux F_j sends E_j = V_j F_j / pi min(G_j, clamp), G_j = cos cos_j / d^2, to a point; V_j is 1 where
// nothing lies between. G is unbounded where a VPL lies close to the point, and the clamp takes the spots away that
// this would make. What it takes from the light of close surfaces is added back by compensate()
// (render/vpl_compensation.h); both together are unbiased, but for caustics on what is so near.
//
// Visibility and sum are two functions: trace_visibility() gives a bit per slot, irradiance_from() sums over the set
// bits in one fixed order. Each bit is a function of its shadow ray alone (Packing::exact), never of the rays traced
// with it, and the sum is a function of the bits, the point and the VPLs: kept bits of which any subset was
// traced anew give the irradiance of a fresh evaluation bit for bit. A VPL below the horizon of either side needs no
// ray and has bit 0. What stands still and what moves can be asked apart: the "and" has the bits of asking
// all, as long as packing is exact.
//
// Costs: a shadow ray per slot above both horizons; about a nanosecond a slot beside them.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/types.h"
#include "render/hemisphere.h"
#include "render/ray_tracer.h"
#include "render/vpl.h"

namespace icbench {

/// The clamp of a scene as a share of its diagonal: G is bounded where two facing surfaces are this far apart.
inline constexpr float kClampShare = 0.05f;

/// Bound on G, 1/m^2: 1 / (kClampShare diagonal)^2.
float vpl_clamp(const Bounds& bounds) noexcept;

/// Sets bits[w] for all words, a bit per slot: 1 if nothing of these shapes lies between the point and the VPL in slot
/// 64 w + i. bits.size() is vpls.words().
void trace_visibility(Tracer& tracer, const Hit& hit, const VplArrays& vpls, std::span<std::uint64_t> bits,
                      Packing packing = Packing::exact, Shapes shapes = Shapes::all) noexcept;

/// The same for the slots in `which` alone; other bits stay as they are. With fast packing the answers are a function
/// of all that is asked together.
void trace_visibility(Tracer& tracer, const Hit& hit, const VplArrays& vpls,
                      std::span<const std::uint64_t> which, std::span<std::uint64_t> bits,
                      Packing packing = Packing::exact, Shapes shapes = Shapes::all) noexcept;

/// How many of the VPLs in `which` lie above both horizons: the shadow rays that trace_visibility takes for them.
std::uint64_t count_facing(const Hit& hit, const VplArrays& vpls,
                           std::span<const std::uint64_t> which) noexcept;

/// Irradiance, W/m^2, from the VPLs whose bit is set, of which each lies above both horizons. Finite.
Irradiance irradiance_from(std::span<const std::uint64_t> bits, const Hit& hit, const VplArrays& vpls,
                           float clamp) noexcept;

/// The very same, and how it changes as the point moves in its tangent plane and as its normal turns, with each VPL
/// seen or hidden as it is: true but at the edges of shadows, where irradiance jumps. A VPL that the clamp bounds, or
/// whose light changes by more than 10^31 W/m^3, counts as constant. Finite.
Irradiance irradiance_from(std::span<const std::uint64_t> bits, const Hit& hit, const VplArrays& vpls,
                           float clamp, IrradianceGradients& gradients) noexcept;

/// Irradiance from all VPLs: trace_visibility and irradiance_from in one, word by word, and bit for bit the same. With
/// fast packing faster (render/occluders.h), and the same but where a shadow ray brushes an edge within rounding.
Irradiance gather_vpls(Tracer& tracer, const Hit& hit, const VplArrays& vpls, float clamp,
                       Packing packing = Packing::exact) noexcept;

/// The same with gradients.
Irradiance gather_vpls(Tracer& tracer, const Hit& hit, const VplArrays& vpls, float clamp, Packing packing,
                       IrradianceGradients& gradients) noexcept;

/// The shadow rays that gather_vpls traces at these points, for RayTracer::bare_occluded: how fast the same rays go
/// without any of the work around them.
std::vector<TracedRay> record_vpl_rays(const RayTracer& rays, std::span<const Hit> points,
                                       const VplArrays& vpls);

}  // namespace icbench
