// Irradiance in closed form from surfaces of even radiance (Lambert 1760, Photometria).
#pragma once

#include <cmath>
#include <glm/geometric.hpp>
#include <vector>

#include "scene/scene.h"

namespace icbench {

using Polygon3 = std::vector<glm::dvec3>;

/// At p, facing n, from a plane polygon above the horizon that sends radiance L, by the contour integral: L/2 sum of
/// angle_i (unit normal of edge i and p) . n. Edges of no length count nothing.
inline double lambert(const glm::dvec3& p, const glm::dvec3& n, const Polygon3& polygon, double L) {
  double E = 0.0;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const glm::dvec3 a = polygon[i] - p, b = polygon[(i + 1) % polygon.size()] - p, c = glm::cross(a, b);
    const double length = glm::length(c);
    if (length > 0.0) E += std::atan2(length, glm::dot(a, b)) * glm::dot(c, n) / length;
  }
  return 0.5 * L * std::abs(E);
}

/// The same of a convex body: its triangles that face p do not hide each other.
inline double lambert(const glm::dvec3& p, const glm::dvec3& n, const Mesh& body, double L) {
  double E = 0.0;
  for (const glm::uvec3& t : body.triangles) {
    const Polygon3 corners = {body.positions[t.x], body.positions[t.y], body.positions[t.z]};
    const glm::dvec3 front = glm::cross(corners[1] - corners[0], corners[2] - corners[0]);
    if (glm::dot(front, p - corners[0]) > 0.0) E += lambert(p, n, corners, L);
  }
  return E;
}

/// A level rectangle at the height y.
inline Polygon3 rectangle(double x0, double x1, double y, double z0, double z1) {
  return {{x0, y, z0}, {x1, y, z0}, {x1, y, z1}, {x0, y, z1}};
}

}  // namespace icbench
