// Where matrices put shapes of scene files: what placing them and thickening glass have in common.
#pragma once

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <vector>

#include "scene/import_model.h"

namespace icbench::importing {

inline glm::dvec3 transform(const glm::dmat4& m, const glm::dvec3& p) {
  return glm::dvec3(m * glm::dvec4(p, 1.0));
}

/// Turns directions as the normals of surfaces turn, up to length; unlike the inverse it exists for every matrix.
inline glm::dmat3 cofactors(const glm::dmat4& m) {
  const glm::dvec3 a(m[0]), b(m[1]), c(m[2]);
  return {glm::cross(b, c), glm::cross(c, a), glm::cross(a, b)};
}

/// v, of any finite length but 0, as a direction.
inline glm::dvec3 unit_or(const glm::dvec3& v, const glm::dvec3& otherwise) {
  const double longest = std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
  if (!(longest > 0.0 && std::isfinite(longest))) return otherwise;
  return glm::normalize(v / longest);
}

/// For each vertex the sum of the normals around it, weighted by area.
inline std::vector<glm::dvec3> face_sums(const Shape& shape) {
  std::vector<glm::dvec3> sums(shape.positions.size(), glm::dvec3(0.0));
  for (const glm::uvec3& t : shape.triangles) {
    const glm::dvec3& a = shape.positions[t.x];
    const glm::dvec3 n = glm::cross(shape.positions[t.y] - a, shape.positions[t.z] - a);
    for (const std::uint32_t v : {t.x, t.y, t.z}) sums[v] += n;
  }
  return sums;
}

/// Calls f(p) for the corners, where a matrix puts them, of the triangles that have a surface there.
template <class F>
void for_each_used(const Shape& shape, const glm::dmat4& m, F&& f) {
  const glm::dmat3 turn(m);
  for (const glm::uvec3& t : shape.triangles) {
    const glm::dvec3& a = shape.positions[t.x];
    if (glm::cross(turn * (shape.positions[t.y] - a), turn * (shape.positions[t.z] - a)) == glm::dvec3(0.0))
      continue;
    for (const std::uint32_t v : {t.x, t.y, t.z}) f(transform(m, shape.positions[v]));
  }
}

}  // namespace icbench::importing
