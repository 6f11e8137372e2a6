// What the clamp takes from the light of virtual point lights, estimated by rays (Kollig & Keller 2004, "Illumination
// in the presence of weak singularities").
//
// VPL j sends min(G_j, clamp) of its flux instead of G_j (render/vpl_gather.h). So light of close surfaces is missing;
// rays with the cosine's density that look no farther than the clamp can matter bring it back, each surface met
// counting with weight max(0, G - clamp) / G. The light that arrives there is estimated at some of the surfaces that a
// few rays met, as many as their weights come to, rounded up, drawn by what they count: from the lamps, from one of the
// VPLs, and by compensation in turn. With the clamped sum this is unbiased, but for what mirrors and glass throw on
// surfaces so near, which VPLs carry on: of that the clamp's share stays lost. Rays that look for lamps in mirrors find
// them so seldom that they brought it back as spots.
#pragma once

#include <cstdint>

#include "core/random.h"
#include "core/types.h"
#include "render/ray_tracer.h"
#include "render/vpl.h"

namespace icbench {

struct Compensation {
  Irradiance E{0.0f};     ///< what the clamp took, W/m^2: unbiased estimate
  std::uint64_t met = 0;  ///< the rays, a bit each, that met a surface for which weight was left; 0: E is 0
};

/// The key of compensation that goes with VPLs of this seed.
inline std::uint64_t compensation_key(std::uint64_t seed) noexcept { return hash_keys(seed, 0xc0); }

/// Most compensation rays of a point.
inline constexpr std::uint32_t kMaxCompensation = 64;

/// How far compensation rays look, metres: G <= clamp beyond that.
float compensation_reach(float clamp) noexcept;

/// Adds back what the clamp takes at a point, from `count` rays (at most kMaxCompensation) and two or three more for
/// each estimate of the light that arrives at what they met. Random numbers depend on the key alone; where neighbouring
/// points have the same key, the error is alike, too, as that of the VPLs is, and does not show as noise. 0 rays: 0.
/// With exact packing what a ray meets is a function of the ray and the scene alone, too: as long as nothing within
/// reach of the point has changed, the rays in `met` are the only ones that need tracing again (`which`), and the
/// result is that of tracing all, bit for bit.
Compensation compensate(Tracer& tracer, const Hit& hit, const VplArrays& vpls, float clamp,
                        std::uint32_t count, std::uint64_t key, Packing packing = Packing::exact,
                        std::uint64_t which = ~std::uint64_t{0}) noexcept;

}  // namespace icbench
