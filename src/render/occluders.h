// Shadow rays in packets whose answers do not depend on the packet.
//
// Temporal caching keeps the answers of shadow rays and traces a part of them anew, in other packets, beside things that
// have moved meanwhile; it promises the very bits of a fresh start. Embree does not make that promise: in its packets a
// ray that runs in the plane of a triangle, or through a vertex along an axis, may be answered otherwise than alone, and
// otherwise with other rays beside it. Two things do so: 16 rays at once, and packets through instances. (Embree 3.13,
// robust scenes; 3 % of such rays through instances, none of 10^7 between random surface points. tests/render_vpl_test
// holds the installed version to what follows.)
//
// Packets of 8 through a scene of triangles without instances are traversed ray by ray and give every ray the answer of
// rtcOccluded1, whichever lanes are in use. So instances are resolved here: a ray is asked of all that stands still,
// then of each moving shape whose box it meets, in the shape's own space. An answer is then the "or" of answers each of
// which depends on the ray, one shape and its pose alone.
//
// Costs: that of packets of 8, which are as fast as those of 16 or faster; a box test per ray and moving shape.
#pragma once

#include <cstdint>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "render/embree.h"
#include "render/ray_tracer.h"

namespace icbench {

class Occluders {
 public:
  /// Adds a scene of triangles that stands still.
  void add_still(RTCScene scene) { parts_.push_back({.scene = scene}); }

  /// Adds one that moves, and says where it stands; `pad` (metres) is more than the rounding of what is asked.
  void add_moving(RTCScene scene, const PosedBox& at, float pad);

  /// Forgets all.
  void clear() noexcept { parts_.clear(); }

  /// RayTracer::occluded_from.
  std::uint64_t occluded_from(const glm::vec3& from, const float* x, const float* y, const float* z,
                              std::uint64_t which) const noexcept;

 private:
  struct Part {
    RTCScene scene;
    bool everywhere = true;  // stands still: no box, no pose
    bool posed = false;
    glm::vec3 centre{0.0f}, half{0.0f};  // of its box in the world, padded
    glm::mat3 to_object{1.0f};
    glm::vec3 shift{0.0f};
  };

  std::vector<Part> parts_;
};

}  // namespace icbench
