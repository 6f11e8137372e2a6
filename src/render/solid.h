// Boxes around and inside a closed mesh, by which most shadow rays that come near it are answered without its BVH.
//
// `around` together hold every triangle: a segment that meets none of them meets no triangle. `inside` lie within the
// solid that the triangles bound: a segment that meets one of them, and has an end outside the mesh's bounds, crosses
// the surface. Both are certain: points inside have another winding number than those outside (Jacobson et al. 2013),
// so between them there is a triangle; and Embree's robust scenes let no ray through where triangles share an edge. So
// answers are those of the BVH.
//
// A mesh that is not closed, where any directed edge lacks its opposite, has no boxes inside. Costs, once a mesh: a
// sort of its edges, and a sum over its triangles for each connected part of space that it leaves free.
#pragma once

#include <glm/vec3.hpp>
#include <vector>

#include "scene/scene.h"

namespace icbench {

struct Solid {
  struct Box {
    glm::vec3 centre, half;
  };
  std::vector<Box> around;  ///< of triangles; a little larger than need be
  std::vector<Box> inside;  ///< a little smaller than may be; none where the mesh is not known to be closed
};

/// Of a mesh at rest, in its own space.
Solid make_solid(const Mesh& mesh);

}  // namespace icbench
