// Spheres inside a closed mesh, by which most shadow rays that it blocks are answered without its BVH.
//
// A segment that meets one of them, and has an end outside the mesh's bounds, crosses the surface: points inside have
// another winding number than those outside (Jacobson et al. 2013), so between them there is a triangle; and Embree's
// robust scenes let no ray through where triangles share an edge. So the answer is the BVH's
// (tests/render_inner_spheres_test compares the two).
//
// A mesh that is not closed, where any directed edge lacks its opposite, has none; nor has one of so few triangles that
// its BVH is as fast, one too thin to hold a sphere that is worth it, or one a hundred times its size from its origin.
#pragma once

#include <glm/vec3.hpp>
#include <vector>

#include "render/embree.h"
#include "scene/scene.h"

namespace icbench {

struct Sphere {
  glm::vec3 centre;
  float radius;  ///< > 0
};

/// Of a mesh, in its own space: at most 32, each a thousandth of the mesh's longest side away from every triangle.
/// `shape` holds the mesh's triangles and nothing else. Takes some 50 ms on two cores for the bunny's 70,000
/// triangles: distances in parallel, in the caller's oneTBB arena, the choice among centres by one thread, in time that
/// goes with the square of their number (14,000 at most).
std::vector<Sphere> inner_spheres(RTCScene shape, const Mesh& mesh);

}  // namespace icbench
