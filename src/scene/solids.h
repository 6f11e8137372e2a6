// Closed solids to model furniture and buildings from: swept, extruded, rounded and bent.
//
// Every builder returns a mesh without normals whose triangles share vertices, face outward and leave no hole.
// shade() then gives it normals, smooth where it is round and sharp at its edges. Material 0 unless told otherwise.
// Metres, radians.
#pragma once

#include <cstdint>
#include <functional>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "scene/motion.h"
#include "scene/polygon.h"
#include "scene/scene.h"

namespace icbench {

/// Between what stands or hangs and what it is fixed to: no two surfaces lie in one plane.
inline constexpr float kGap = 1e-3f;

using Path = std::vector<glm::vec3>;

/// The surface of the unit cube, cut into cells along its axes, mapped by f; f keeps right-handed axes right-handed. It
/// may map an edge or side of the cube to one point: what collapses is left out.
Mesh block(const glm::ivec3& cells, const std::function<glm::vec3(const glm::vec3&)>& f);

/// Box whose edges are rounded with `radius` (at most half its shortest side, > 0) in `steps` steps; its flat parts are
/// cut into `cells`, so that it can be bent.
Mesh rounded_box(const Bounds& bounds, float radius, int steps = 2, const glm::ivec3& cells = {1, 1, 1});

/// Prism over a polygon in x and y, from z = 0 to z = depth, with holes through it.
Mesh extrude(const Polygon& outline, float depth, std::span<const Polygon> holes = {});

/// A level of a slab: `inset` from its outline, at height y.
struct SlabLevel {
  float inset, y;
};

/// Slab over a counter-clockwise outline in x and -z: its edge runs through `levels` from bottom to top.
Mesh slab(const Polygon& outline, std::span<const SlabLevel> levels);

/// Sweeps a counter-clockwise profile along a path, mitred at its corners. The profile's y points along `up` (not
/// parallel to the path's beginning), its x along cross(up, path); the frame is carried along without twist. The path
/// of a `loop` is plane and its end joins its beginning.
Mesh sweep(const Path& path, const Polygon& profile, const glm::vec3& up, bool loop = false);

/// Round bar along a path.
Mesh tube(const Path& path, float radius, int sides = 8);

/// Rounds the inner corners of an open path with arcs of `radius` in `steps` steps.
Path fillet(const Path& path, float radius, int steps = 4);

/// Points of a polygon lifted into space: x along `across`, y along `up` from `origin`.
Path lift(const Polygon& polygon, const glm::vec3& origin, const glm::vec3& across, const glm::vec3& up);

/// Rotation about an axis through the origin; `axis` has length 1.
glm::mat3 rotation(const glm::vec3& axis, float angle);

/// Moves a mesh; a map that mirrors turns its triangles round.
Mesh moved(Mesh mesh, const Pose& pose);

/// A mesh mirrored in the plane x = 0.
Mesh mirrored(Mesh mesh);

/// Bends a mesh without normals.
Mesh bent(Mesh mesh, const std::function<glm::vec3(const glm::vec3&)>& f);

/// Gives a mesh normals: triangles that meet at less than `crease` blend, others keep an edge. Exactly equal vertices
/// count as one.
Mesh shade(Mesh mesh, float crease = 0.6f);

/// Solids that belong together, gathered into one mesh for each material.
class Parts {
 public:
  /// Shades a mesh without normals and adds it; one with normals is added as it is.
  void add(std::uint32_t material, const Mesh& mesh);
  void add(const Parts& parts, const Pose& pose = {});

  /// Adds the meshes to a scene, named after the whole.
  void build(Scene& scene, const std::string& name) const;

  const std::map<std::uint32_t, Mesh>& meshes() const noexcept { return meshes_; }

 private:
  std::map<std::uint32_t, Mesh> meshes_;  // by material
};

}  // namespace icbench
