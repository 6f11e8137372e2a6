// Points on a scene's surfaces with the radii that records would have there: what synthetic workloads are
// made of.
//
// Real geometry, no rendering: points are where rays that bounce about the scene land, radii are harmonic
// mean distances to the surfaces seen from there, by Embree. Deterministic by seed; independent of the number
// of threads.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/types.h"
#include "render/ray_tracer.h"

namespace icbench {

struct SurfacePoints {
  Bounds bounds;
  std::vector<SurfacePoint> points;
  /// Harmonic mean distance at each point, metres, > 0; empty where not asked for.
  std::vector<float> radii;
};

/// Whether points come with radii, which take sixteen rays each.
enum class WithRadii : bool { no, yes };

/// `n` points scattered over all surfaces that light reaches: the hits of random walks from the camera.
SurfacePoints scattered_points(const RayTracer& rays, std::uint32_t n, std::uint64_t seed,
                               WithRadii with_radii);

/// The points seen through the pixels of a width x height image, in tiles of 16 x 16 along a Z-curve; pixels
/// that see nothing are left out. `tile_ends` receives the index past each tile's last point.
SurfacePoints image_points(const RayTracer& rays, int width, int height, std::uint64_t seed,
                           WithRadii with_radii, std::vector<std::uint32_t>& tile_ends);

}  // namespace icbench
