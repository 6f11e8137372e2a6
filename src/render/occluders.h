// Shadow rays in packets, fast or with answers that do not depend on the packet.
//
// Temporal caching keeps what still shapes answered to shadow rays and traces a part of them anew, in other packets; it
// promises the very bits of a fresh start. Embree's packets do not keep that promise: where a ray touches a triangle
// within rounding, packets cull other boxes than single rays do, and others again in other company. Measured with
// Embree 3.13, robust scenes: full packets of 16 through triangles alone answered 1 % of rays in the plane of a face
// otherwise than rtcOccluded1, full packets of 8 a few of 10^7 that brush vertices, any packet through instances 3 % of
// rays in the plane of a face; of 3 10^6 rays between random surface points none.
//
// Two things make an answer exact, a function of the ray and of what it meets alone:
// - Instances are resolved here, for both kinds of packing: a ray is asked of all that stands still, then of each
//   moving shape whose box it meets, in the shape's own space. So the answer is the "or" of answers each of which
//   depends on one shape and its pose.
// - Exact packing leaves lanes empty: up to five rays in a packet of 8 are traversed one by one, as rtcOccluded1 does,
//   but with less ado. tests/render_occlusion_test holds the installed Embree to it.
//
// A closed shape that moves rigidly or affinely answers most rays that it blocks by a few spheres inside it
// (inner_spheres.h), for both kinds of packing.
//
// Costs, in rays a second on the Cornell box (72,000 triangles, one core of an Intel Xeon with AVX-512): rtcOccluded1
// 1, exact 1.3, fast 1.55, full packets of 16 1.55, measured while rtcOccluded1 and the packets of 16 went through
// instances. A box test per ray and moving shape besides.
#pragma once

#include <cstdint>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "render/embree.h"
#include "render/inner_spheres.h"
#include "render/ray_tracer.h"

namespace icbench {

class Occluders {
 public:
  /// Adds a scene of triangles that stands still.
  void add_still(RTCScene scene) { parts_.push_back({.scene = scene}); }

  /// Adds one that moves, and says where it stands; `pad` (metres) is more than the rounding of what is asked.
  /// `inside`: inner_spheres() of the shape, if it does not deform.
  void add_moving(RTCScene scene, const PosedBox& at, float pad, std::span<const Sphere> inside);

  /// Forgets all.
  void clear() noexcept { parts_.clear(); }

  /// RayTracer::occluded_from.
  std::uint64_t occluded_from(const glm::vec3& from, const float* x, const float* y, const float* z,
                              std::uint64_t which, Packing packing, Shapes shapes) const noexcept;

 private:
  struct Part {
    RTCScene scene;
    bool everywhere = true;  // stands still: no box, no pose
    bool posed = false;
    glm::mat3 to_object{1.0f};
    glm::vec3 shift{0.0f};
    glm::vec3 centre{0.0f}, half{0.0f};  // of its box, in its own space, padded
    std::vector<Sphere> inside{};        // likewise, shrunk by as much
  };

  std::vector<Part> parts_;
};

}  // namespace icbench
