// Synthetic plans on points made by hand: no ray tracing, whose library sanitizers do not see into.
#pragma once

#include <string>

#include "core/random.h"
#include "workload/synthetic_plan.h"

namespace icbench {

inline constexpr std::uint32_t kMadePoints = 20000;
inline constexpr std::uint32_t kMadeTile = 256;

/// Points on the walls of the unit box, normals inwards.
inline SurfacePoints box_points(std::uint32_t n, std::uint64_t seed) {
  SurfacePoints out;
  Pcg32 random(seed);
  for (std::uint32_t i = 0; i < n; ++i) {
    const unsigned face = random.below(6);
    const int axis = static_cast<int>(face % 3);
    SurfacePoint x{{random.uniform(), random.uniform(), random.uniform()}, {0, 0, 0}};
    x.p[axis] = face < 3 ? 0.0f : 1.0f;
    x.n[axis] = face < 3 ? 1.0f : -1.0f;
    out.points.push_back(x);
    out.radii.push_back(0.05f + 0.2f * random.uniform());
  }
  return out;
}

inline SyntheticPlan made_plan(const std::string& workload) {
  const WorkloadSpec spec = parse_workload(workload);
  PlanPoints points{box_points(kMadePoints, 1), {}, box_points(spec.prefilled() + spec.inserts(), 2)};
  for (std::uint32_t end = kMadeTile; end < kMadePoints; end += kMadeTile) points.tile_ends.push_back(end);
  points.tile_ends.push_back(kMadePoints);
  return {spec, std::move(points), 1};
}

}  // namespace icbench
