// Elementary meshes to build scenes from. Triangles face the way each docstring says.
#pragma once

#include <glm/vec2.hpp>
#include <span>
#include <string>

#include "scene/scene.h"

namespace icbench {

/// Parallelogram p, p + u, p + u + v, p + v; its front is the side of cross(u, v).
Mesh quad(std::string name, const glm::vec3& p, const glm::vec3& u, const glm::vec3& v,
          std::uint32_t material);

/// Axis-aligned box, fronts outward, or inward for a room.
Mesh box(std::string name, const Bounds& bounds, std::uint32_t material, bool inward = false);

/// The same, fronts outward, as a part of something else, which names it and has its material.
Mesh solid_box(const glm::vec3& lower, const glm::vec3& upper);

/// Sphere of 20 * 4^levels flat triangles, front outward. Metres.
Mesh icosphere(std::string name, const glm::vec3& centre, float radius, int levels, std::uint32_t material);

/// The same with the sphere's own normals: it looks round.
Mesh ball(std::string name, const glm::vec3& centre, float radius, int levels, std::uint32_t material);

/// Box whose edges and corners are rounded by quarter circles of `segments` pieces; smooth, front outward. The radius
/// is below half the shortest side. Metres.
Mesh rounded_box(std::string name, const Bounds& bounds, float radius, int segments, std::uint32_t material);

/// Round tube with flat ends along a path of at least two points, none of them twice in a row; a rod if there are two.
/// Smooth round its side, front outward; metres.
Mesh tube(std::string name, std::span<const glm::vec3> path, float radius, int segments,
          std::uint32_t material);

/// Surface of revolution about the vertical axis through `base`: `profile` holds (radius, height) from bottom
/// to top, joined smoothly except where a point is repeated (a crease); front outward. Metres.
Mesh revolve(std::string name, const glm::vec3& base, std::span<const glm::vec2> profile, int segments,
             std::uint32_t material);

/// Moves every vertex by x -> scale * rotate_y(x, angle) + shift. Radians, metres.
void place(Mesh& mesh, float scale, float angle, const glm::vec3& shift);

/// The same by a pose.
void place(Mesh& mesh, const Pose& pose);

/// Adds the triangles of `part` to `mesh`, which keeps its name and material; textures are not carried. If one of the
/// two is smooth, the other keeps its flat look.
void append(Mesh& mesh, Mesh part);

/// Bounds of a mesh's vertices; the mesh must have some.
Bounds bounds_of(const Mesh& mesh);

}  // namespace icbench
