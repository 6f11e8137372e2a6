// What the scene tests ask of solids.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <glm/geometric.hpp>
#include <limits>
#include <map>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "scene/scene.h"

namespace icbench {

// Volume by the divergence theorem: positive exactly if the fronts of a closed mesh face outward.
inline double volume(std::span<const glm::vec3> positions, std::span<const glm::uvec3> triangles) {
  double six = 0.0;
  for (const glm::uvec3& t : triangles)
    six += glm::dot(glm::dvec3(positions[t.x]),
                    glm::cross(glm::dvec3(positions[t.y]), glm::dvec3(positions[t.z])));
  return six / 6.0;
}
inline double volume(const Mesh& mesh) { return volume(mesh.positions, mesh.triangles); }

// Number of each position, equal for vertices in the same place: at creases several differ in their normal alone.
inline std::vector<std::uint32_t> welded(const Mesh& mesh) {
  std::map<std::array<float, 3>, std::uint32_t> seen;
  std::vector<std::uint32_t> number;
  for (const glm::vec3& p : mesh.positions)
    number.push_back(
        seen.try_emplace({p.x, p.y, p.z}, static_cast<std::uint32_t>(seen.size())).first->second);
  return number;
}

// The smallest volume of the pieces that a mesh falls into.
inline double smallest_piece(const Mesh& mesh) {
  const std::vector<std::uint32_t> v = welded(mesh);
  std::vector<std::uint32_t> parent(v.size());
  std::iota(parent.begin(), parent.end(), 0u);
  const auto root = [&](std::uint32_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  for (const glm::uvec3& t : mesh.triangles) {
    parent[root(v[t.y])] = root(v[t.x]);
    parent[root(v[t.z])] = root(v[t.x]);
  }
  std::map<std::uint32_t, std::vector<glm::uvec3>> pieces;
  for (const glm::uvec3& t : mesh.triangles) pieces[root(v[t.x])].push_back(t);
  double smallest = std::numeric_limits<double>::max();
  for (const auto& [first, triangles] : pieces)
    smallest = std::min(smallest, volume(mesh.positions, triangles));
  return smallest;
}

// Each directed edge as often as its opposite: no hole, consistent orientation.
inline bool is_closed(const Mesh& mesh) {
  const std::vector<std::uint32_t> v = welded(mesh);
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> surplus;
  for (const glm::uvec3& t : mesh.triangles)
    for (const auto& [a, b] : {std::pair{v[t.x], v[t.y]}, {v[t.y], v[t.z]}, {v[t.z], v[t.x]}}) {
      ++surplus[{a, b}];
      --surplus[{b, a}];
    }
  for (const auto& [edge, count] : surplus)
    if (count != 0) return false;
  return true;
}

// Share of a smooth mesh's triangle corners whose normal lies behind the triangle.
inline double share_of_normals_astray(std::span<const glm::vec3> positions,
                                      std::span<const glm::vec3> normals,
                                      std::span<const glm::uvec3> triangles) {
  std::size_t astray = 0;
  for (const glm::uvec3& t : triangles) {
    const glm::vec3 ng = glm::cross(positions[t.y] - positions[t.x], positions[t.z] - positions[t.x]);
    for (const std::uint32_t v : {t.x, t.y, t.z}) astray += glm::dot(ng, normals[v]) <= 0.0f;
  }
  return static_cast<double>(astray) / (3.0 * static_cast<double>(triangles.size()));
}
inline double share_of_normals_astray(const Mesh& mesh) {
  return share_of_normals_astray(mesh.positions, mesh.normals, mesh.triangles);
}

}  // namespace icbench
