#include "scene/implicit_surface.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>
#include <vector>

namespace icbench {
namespace {

struct Grid {
  glm::vec3 origin;
  float cell;
  glm::ivec3 corners;

  std::size_t index(int x, int y, int z) const {
    return (static_cast<std::size_t>(z) * corners.y + y) * corners.x + x;
  }
  glm::vec3 position(int x, int y, int z) const { return origin + cell * glm::vec3(x, y, z); }
};

constexpr std::uint32_t kNoVertex = ~0u;

glm::vec3 gradient(const SolidFunction& f, const glm::vec3& p, float h) {
  const glm::vec3 x(h, 0, 0), y(0, h, 0), z(0, 0, h);
  return glm::vec3(f(p + x) - f(p - x), f(p + y) - f(p - y), f(p + z) - f(p - z)) / (2.0f * h);
}

// Mean of the points where the surface crosses the twelve edges of a cell; false if it crosses none.
bool cell_vertex(const Grid& g, const std::vector<float>& values, int x, int y, int z, glm::vec3& out) {
  glm::vec3 sum(0.0f);
  int crossings = 0;
  for (int axis = 0; axis < 3; ++axis)
    for (int e = 0; e < 4; ++e) {
      glm::ivec3 a(x, y, z);
      a[(axis + 1) % 3] += e & 1;
      a[(axis + 2) % 3] += e >> 1;
      glm::ivec3 b = a;
      b[axis] += 1;
      const float fa = values[g.index(a.x, a.y, a.z)], fb = values[g.index(b.x, b.y, b.z)];
      if ((fa < 0.0f) == (fb < 0.0f)) continue;
      sum += glm::mix(g.position(a.x, a.y, a.z), g.position(b.x, b.y, b.z), fa / (fa - fb));
      ++crossings;
    }
  if (crossings == 0) return false;
  out = sum / static_cast<float>(crossings);
  return true;
}

// One quad for every grid edge the surface crosses, between the four cells around that edge.
void connect(const Grid& g, const std::vector<float>& values, const std::vector<std::uint32_t>& vertex,
             Mesh& mesh) {
  for (int z = 1; z + 1 < g.corners.z; ++z)
    for (int y = 1; y + 1 < g.corners.y; ++y)
      for (int x = 1; x + 1 < g.corners.x; ++x)
        for (int axis = 0; axis < 3; ++axis) {
          glm::ivec3 step(0), u(0), v(0);
          step[axis] = 1;
          u[(axis + 1) % 3] = 1;
          v[(axis + 2) % 3] = 1;
          const bool inside = values[g.index(x, y, z)] < 0.0f;
          if (inside == (values[g.index(x + step.x, y + step.y, z + step.z)] < 0.0f)) continue;
          const auto at = [&](const glm::ivec3& back) {
            return vertex[g.index(x - back.x, y - back.y, z - back.z)];
          };
          std::uint32_t q[4] = {at(u + v), at(v), at(glm::ivec3(0)), at(u)};
          if (!inside) std::swap(q[1], q[3]);
          mesh.triangles.emplace_back(q[0], q[1], q[2]);
          mesh.triangles.emplace_back(q[0], q[2], q[3]);
        }
}

}  // namespace

float ellipsoid(const glm::vec3& p, const glm::vec3& centre, const glm::vec3& r) noexcept {
  const glm::vec3 d = p - centre;
  const float unit = glm::length(d / r), slope = glm::length(d / (r * r));
  return slope > 0.0f ? unit * (unit - 1.0f) / slope : -std::min({r.x, r.y, r.z});
}

float tapered_capsule(const glm::vec3& p, const glm::vec3& a, const glm::vec3& b, float ra,
                      float rb) noexcept {
  const glm::vec3 ab = b - a;
  const float h = std::clamp(glm::dot(p - a, ab) / glm::dot(ab, ab), 0.0f, 1.0f);
  return glm::length(p - a - h * ab) - glm::mix(ra, rb, h);
}

float smooth_union(float a, float b, float k) noexcept {
  const float h = std::max(k - std::abs(a - b), 0.0f) / k;
  return std::min(a, b) - 0.25f * h * h * k;
}

Mesh mesh_implicit(std::string name, const SolidFunction& f, const Bounds& bounds, float cell,
                   std::uint32_t material) {
  const glm::vec3 size = bounds.upper - bounds.lower;
  const Grid g{bounds.lower - glm::vec3(cell), cell, glm::ivec3(glm::ceil(size / cell)) + glm::ivec3(4)};
  const std::size_t corners = static_cast<std::size_t>(g.corners.x) * g.corners.y * g.corners.z;

  std::vector<float> values(corners);
  for (int z = 0; z < g.corners.z; ++z)
    for (int y = 0; y < g.corners.y; ++y)
      for (int x = 0; x < g.corners.x; ++x) values[g.index(x, y, z)] = f(g.position(x, y, z));

  Mesh mesh{std::move(name), {}, {}, {}, material};
  std::vector<std::uint32_t> vertex(corners, kNoVertex);
  glm::vec3 p;
  for (int z = 0; z + 1 < g.corners.z; ++z)
    for (int y = 0; y + 1 < g.corners.y; ++y)
      for (int x = 0; x + 1 < g.corners.x; ++x)
        if (cell_vertex(g, values, x, y, z, p)) {
          vertex[g.index(x, y, z)] = static_cast<std::uint32_t>(mesh.positions.size());
          mesh.positions.push_back(p);
        }
  for (glm::vec3& at : mesh.positions) {
    const glm::vec3 slope = gradient(f, at, 0.5f * cell);
    const float squared = glm::dot(slope, slope);
    mesh.normals.push_back(squared > 0.0f ? slope / std::sqrt(squared) : glm::vec3(0.0f, 1.0f, 0.0f));
    if (!(squared > 0.0f)) continue;
    const glm::vec3 step = f(at) / squared * slope;
    if (glm::dot(step, step) < cell * cell) at -= step;  // further off means the gradient is no guide here
  }
  connect(g, values, vertex, mesh);
  return mesh;
}

}  // namespace icbench
