// Ray tracing through Embree: the scene and its BVH, shared by all threads, and a Tracer per thread that
// counts.
//
// Epsilon policy, the only one there is. A ray leaves a surface at p + epsilon * ng, on the side it travels to, and is
// then intersected from t = 0; a shadow ray also ends epsilon off the light, at t = 1. epsilon is kEpsilonShare of the
// scene's largest |coordinate| (scene.h): coordinates round by their distance from the origin, and files whose scenes
// lie far from it are moved there (import_scene.h). Gaps narrower than epsilon are closed. Hit positions are
// interpolated from the vertices, not stepped along the ray, so that their error does not grow with the ray. Embree
// scenes are robust: no ray slips between two triangles that share an edge.
//
// Everything here is safe to call from any number of threads; building the BVH uses oneTBB.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/mat3x3.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <span>
#include <vector>

#include "scene/scene.h"

namespace icbench {

struct Ray {
  glm::vec3 o;  ///< origin, metres
  float t_max;  ///< length in units of |d|
  glm::vec3 d;  ///< direction; of any length, unit for distances in metres
};

/// A ray as it was traced, for replay.
struct TracedRay {
  Ray ray;
  bool shadow;  ///< asked whether anything is there, not what comes first
};

/// Hit::material of a ray that left the scene.
inline constexpr std::uint32_t kMiss = ~0u;

/// A point on a surface, seen from the side its normals face.
struct Hit {
  glm::vec3 p;                     ///< metres
  glm::vec3 n;                     ///< unit shading normal, on the side of ng
  glm::vec3 ng;                    ///< unit geometric normal, facing the ray
  float t;                         ///< distance in units of the ray's |d|
  std::uint32_t material = kMiss;  ///< index into the scene's materials
  std::uint32_t mesh = kMiss;      ///< index into the scene's meshes
  glm::vec2 uv{0.0f};              ///< texture coordinates; 0 where the mesh has none
  bool front = false;              ///< seen from the side that emits

  bool missed() const noexcept { return material == kMiss; }
};

/// How shadow rays are put into packets.
enum class Packing : std::uint8_t {
  fast,  ///< where a ray brushes an edge within rounding, its answer may depend on the rays traced with it
  exact  ///< each answer is a function of its ray, and of the shapes that lie on it and their poses, alone
};

/// Which shapes a shadow ray is asked of.
enum class Shapes : std::uint8_t {
  all,
  still,  ///< those of meshes that never move
  moving  ///< the others: that nothing still lies on the ray is known
};

/// Rays a thread has traced.
struct RayCounts {
  std::uint64_t closest = 0;    ///< nearest-hit rays
  std::uint64_t occlusion = 0;  ///< shadow rays; one asked of still and of moving shapes apart counts twice

  std::uint64_t total() const noexcept { return closest + occlusion; }
  RayCounts& operator+=(const RayCounts& o) noexcept {
    closest += o.closest;
    occlusion += o.occlusion;
    return *this;
  }
  friend RayCounts operator-(const RayCounts& a, const RayCounts& b) noexcept {
    return {a.closest - b.closest, a.occlusion - b.occlusion};
  }
};

/// A box in a mesh's own space, and how it stands in the world.
struct PosedBox {
  Bounds box;  ///< holds all vertices
  Pose pose;
};

/// What such a box is padded by, in its own space, against the rounding of its coordinates: some hundred times that.
inline float own_padding(const Bounds& box) noexcept {
  const glm::vec3 reach = glm::max(glm::abs(box.lower), glm::abs(box.upper));
  return 1e-5f * std::max({reach.x, reach.y, reach.z});
}

/// What a world's coordinates may be off by, metres, as they are taken to a shape's own space: of a shape that lies far
/// from its pivot the pose shifts by far more than the scene is large. Some times the rounding.
inline float shift_rounding(const Pose& pose) noexcept {
  const glm::vec3 far = glm::abs(pose.shift);
  return 0x1p-21f * std::max({far.x, far.y, far.z});
}

/// A mesh that moved or changed shape from one frame to another.
struct MovedMesh {
  std::uint32_t mesh;
  PosedBox before, after;
};

/// What one call of RayTracer::go_to changed; exact: whatever is bitwise as it was is not in it.
struct SceneChange {
  std::vector<MovedMesh> moved;
  bool camera = false;
  bool materials = false;  ///< albedo or emission of any
  bool lights = false;     ///< emission, place, shape or intensity of any light

  bool any() const noexcept { return !moved.empty() || camera || materials || lights; }
};

/// A prepared scene and its BVH. Shared by all threads; changes only in go_to.
///
/// What stands still is one BVH. Every shape that moves has a BVH of its own; a small one over these is rebuilt for
/// each frame (Wald et al. 2003) and asked after the first. Rigid motion changes nothing but that; the BVH of a
/// deforming mesh is refitted.
class RayTracer {
 public:
  /// Prepares the scene and builds the BVH in parallel, in the caller's oneTBB arena. Throws
  /// std::runtime_error as prepare() does, or if Embree fails.
  explicit RayTracer(Scene scene);
  ~RayTracer();
  RayTracer(const RayTracer&) = delete;
  RayTracer& operator=(const RayTracer&) = delete;

  /// The scene as it is at the current frame: camera, materials, lights and the vertices of deforming meshes.
  const Scene& scene() const noexcept { return scene_; }
  float frame() const noexcept { return frame_; }

  /// Goes to a frame (>= 0, counted modulo the scene's) and tells what changed. Quiescent: no ray is under way.
  /// Builds in parallel, in the caller's oneTBB arena.
  SceneChange go_to(float frame);

  /// How the meshes that can move stand at the current frame.
  std::vector<PosedBox> moving() const;

  /// How mesh i stands at the current frame.
  const Pose& pose(std::uint32_t mesh) const noexcept { return placed_[mesh].pose; }
  const Material& material(const Hit& hit) const noexcept { return scene_.materials[hit.material]; }

  /// Albedo where the hit is, texture included.
  glm::vec3 albedo(const Hit& hit) const noexcept {
    const Material& m = material(hit);
    return m.texture == kNoTexture ? m.albedo : m.albedo * scene_.textures[m.texture](hit.uv);
  }
  float epsilon() const noexcept { return epsilon_; }

  /// Where a ray that leaves the surface on the side of ng starts.
  glm::vec3 leave(const glm::vec3& p, const glm::vec3& ng) const noexcept { return p + epsilon_ * ng; }

  /// Radiance emitted towards the ray that made the hit; 0 for a miss.
  glm::vec3 emitted(const Hit& hit) const noexcept {
    return hit.front && !hit.missed() ? material(hit).emission : glm::vec3(0.0f);
  }

  /// Nearest hits of many rays; out[i] belongs to rays[i]. Both have the same length. Many rays a call go faster than
  /// one where the processor has vectors of 16.
  void intersect(std::span<const Ray> rays, std::span<Hit> out) const noexcept;

  /// Whether anything lies on each of many rays.
  void occluded(std::span<const Ray> rays, std::span<bool> out) const noexcept;

  /// Shadow rays from one point, which lies off its surface already (leave), to up to 64 ends: bit i of `which` asks
  /// for the ray to (x[i], y[i], z[i]). Returns the bits of those on which any of these shapes lies (occluders.h): that
  /// of all shapes is the "or" of the other two, with exact packing to the bit.
  std::uint64_t occluded_from(const glm::vec3& from, const float* x, const float* y, const float* z,
                              std::uint64_t which, Packing packing,
                              Shapes shapes = Shapes::all) const noexcept;

  /// Traces each ray by itself, by Embree's single-ray calls and nothing else but a look at the bounds of what moves:
  /// the speed limit of everything above. Returns how many hit or were occluded.
  std::uint64_t bare_trace(std::span<const TracedRay> rays) const noexcept;

  /// Traces shadow rays in Embree's packets of 8 or 16 and nothing else: the speed limit of occluded_from. Returns how
  /// many were occluded.
  std::uint64_t bare_occluded(std::span<const TracedRay> rays, unsigned packet) const noexcept;

 private:
  struct Embree;

  // How a mesh that moves stands.
  struct Placed {
    Bounds box{};  // of its vertices at rest, or of those of this frame if it deforms
    Pose pose{};
    glm::mat3 normals{1.0f};  // from object to world, up to length
  };

  // What a hit needs of a mesh, without the vectors' indirections.
  struct MeshView {
    const glm::vec3* positions;
    const glm::vec3* normals;  // null for flat shading
    const glm::vec2* uvs;      // null if there are none
    const glm::uvec3* triangles;
    const Placed* placed;  // null if it has no pose
    std::uint32_t material;
  };

  void intersect_singly(std::span<const Ray> rays, std::span<Hit> out) const noexcept;
  void intersect_packet(std::span<const Ray> rays, std::span<Hit> out) const noexcept;  // at most 16
  void attach_shape(std::uint32_t mesh);
  void build_scene();
  void place_occluders();
  void place(std::uint32_t mesh, const Pose& pose);
  void fill(Hit& hit, std::uint32_t mesh, std::uint32_t triangle, float u, float v, const glm::vec3& d,
            float t) const noexcept;

  Scene scene_;
  float epsilon_ = 0.0f;
  float frame_ = 0.0f;
  std::vector<Placed> placed_;
  std::vector<MeshView> meshes_;
  std::unique_ptr<Embree> embree_;
};

/// A thread's access to the ray tracer; one thread at a time.
class Tracer {
 public:
  explicit Tracer(const RayTracer& rays) noexcept : rays_(&rays) {}

  const RayTracer& shared() const noexcept { return *rays_; }
  const Scene& scene() const noexcept { return rays_->scene(); }

  void intersect(std::span<const Ray> rays, std::span<Hit> out) noexcept {
    counts.closest += rays.size();
    rays_->intersect(rays, out);
  }
  void occluded(std::span<const Ray> rays, std::span<bool> out) noexcept {
    counts.occlusion += rays.size();
    rays_->occluded(rays, out);
  }
  Hit intersect(const Ray& ray) noexcept {
    Hit hit;
    intersect({&ray, 1}, {&hit, 1});
    return hit;
  }
  std::uint64_t occluded_from(const glm::vec3& from, const float* x, const float* y, const float* z,
                              std::uint64_t which, Packing packing, Shapes shapes = Shapes::all) noexcept {
    counts.occlusion += static_cast<std::uint64_t>(std::popcount(which));
    return rays_->occluded_from(from, x, y, z, which, packing, shapes);
  }
  bool occluded(const Ray& ray) noexcept {
    bool out;
    occluded({&ray, 1}, {&out, 1});
    return out;
  }

  RayCounts counts;

 private:
  const RayTracer* rays_;
};

}  // namespace icbench
