// Radiance's surfaces as triangles. Curved ones have smooth normals and stray from the surface by at most a
// given chord tolerance.
#pragma once

#include <glm/vec3.hpp>
#include <span>

#include "scene/import_model.h"

namespace icbench::importing {

/// Corners of a circle of a radius, so that its chords stray by at most the tolerance: 8 to 256, a multiple
/// of 4.
int segments(double radius, double tolerance);

/// Each appends to a shape; `inward` turns the front to the inside. Radii are > 0 unless said otherwise.
void add_polygon(Shape& to, std::span<const glm::dvec3> corners);
void add_sphere(Shape& to, const glm::dvec3& centre, double radius, int segments, bool inward);
/// Open at both ends; one radius may be 0; the ends differ.
void add_cone(Shape& to, const glm::dvec3& p0, const glm::dvec3& p1, double r0, double r1, int segments,
              bool inward);
/// Faces along n; the inner radius may be 0.
void add_ring(Shape& to, const glm::dvec3& centre, const glm::dvec3& n, double inner, double outer,
              int segments);

/// Triangles that the above make.
inline std::size_t sphere_triangles(int segments) {
  return static_cast<std::size_t>(segments) * static_cast<std::size_t>(segments - 2);
}
inline std::size_t strip_triangles(int segments) { return 2 * static_cast<std::size_t>(segments); }

}  // namespace icbench::importing
