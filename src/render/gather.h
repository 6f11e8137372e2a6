// Hemisphere gather: the irradiance that reaches a point by way of other surfaces, and how far those are.
//
// Rays leave the point in stratified cosine-weighted directions (Ward & Heckbert 1992: M elevations x N
// azimuths, N about pi M). Each hit is lit by next-event estimation, and the path goes on under Russian
// roulette without a bounce limit, so that the mean is the exact indirect irradiance. Light that a gather ray
// meets on a lamp directly is direct light and not counted.
//
// Cost: about 2 (1 + albedo + albedo^2 + ...) rays per stratum. Paths advance together, one bounce at a time,
// so that shadow rays are traced in packets of 16; everything lives on the stack. Random numbers depend on
// the key alone.
//
// Rays go on through mirrors and dielectrics as the path tracer's do; a lamp seen that way is indirect light. Distances
// are to the first surface, whatever it is.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/types.h"
#include "render/hemisphere.h"
#include "render/ray_tracer.h"

namespace icbench {

struct GatherResult {
  Irradiance E;        ///< indirect, W/m^2
  float R;             ///< harmonic mean distance to the surfaces seen, metres; infinite if there are none
  std::uint64_t rays;  ///< traced, shadow rays and later bounces included
};

/// Gathers at `x`. T is Tracer or RecordingTracer.
template <class T>
GatherResult gather(T& tracer, const Hit& x, const Strata& strata, std::uint64_t key) noexcept;

/// What becomes of light that comes straight from a lamp by way of mirrors and glass, which rays find by chance alone.
enum class FocusedLight : bool {
  seen,  ///< it is in the cell whose ray found it
  apart  ///< no cell has it: it is in Hemisphere::apart, and in the irradiance as ever. What surfaces reflect of such
  ///< light is in no cell either, nor apart
};

/// The same, bit for bit, and what each cell saw; `seen` keeps its memory from call to call.
GatherResult gather(Tracer& tracer, const Hit& x, const Strata& strata, std::uint64_t key, Hemisphere& seen,
                    FocusedLight focused = FocusedLight::seen) noexcept;

/// A Tracer that also logs its rays, in the order traced. Out of memory ends the program.
class RecordingTracer : public Tracer {
 public:
  using Tracer::Tracer;

  void intersect(std::span<const Ray> rays, std::span<Hit> out) noexcept {
    for (const Ray& ray : rays) log.push_back({ray, false});
    Tracer::intersect(rays, out);
  }
  void occluded(std::span<const Ray> rays, std::span<bool> out) noexcept {
    for (const Ray& ray : rays) log.push_back({ray, true});
    Tracer::occluded(rays, out);
  }

  std::vector<TracedRay> log;
};

/// The rays that gather() traces at these points, to be replayed by RayTracer::bare_trace: how fast the same
/// rays go without any of the work around them. The i-th point's key is hash_keys(key, i).
std::vector<TracedRay> record_gather_rays(const RayTracer& rays, std::span<const Hit> points,
                                          const Strata& strata, std::uint64_t key);

/// The counterpart to time: the same gathers, unrecorded. Returns the rays traced.
std::uint64_t gather_all(Tracer& tracer, std::span<const Hit> points, const Strata& strata,
                         std::uint64_t key) noexcept;

}  // namespace icbench
