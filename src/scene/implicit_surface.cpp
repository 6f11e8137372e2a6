#include "scene/implicit_surface.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/ext/vector_int3.hpp>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>
#include <limits>
#include <utility>
#include <vector>

namespace icbench {
namespace {

// Corners of the cells, a float of f at each, evaluated when it is first asked for.
class Grid {
 public:
  Grid(const SolidFunction& f, const Bounds& bounds, float cell)
      : f_(f),
        origin_(bounds.lower - glm::vec3(cell)),
        cell_(cell),
        corners_(glm::ivec3(glm::ceil((bounds.upper - bounds.lower) / cell)) + glm::ivec3(4)),
        values_(static_cast<std::size_t>(corners_.x) * corners_.y * corners_.z,
                std::numeric_limits<float>::quiet_NaN()) {}

  const glm::ivec3& corners() const { return corners_; }
  std::size_t size() const { return values_.size(); }
  std::size_t index(const glm::ivec3& c) const {
    return (static_cast<std::size_t>(c.z) * corners_.y + c.y) * corners_.x + c.x;
  }
  glm::ivec3 corner(std::size_t index) const {
    const auto i = static_cast<int>(index);
    return {i % corners_.x, i / corners_.x % corners_.y, i / corners_.x / corners_.y};
  }
  glm::vec3 position(const glm::ivec3& c) const { return origin_ + cell_ * glm::vec3(c); }
  float value(const glm::ivec3& c) {
    float& v = values_[index(c)];
    if (std::isnan(v)) v = f_(position(c));
    return v;
  }
  bool is_inside(const glm::ivec3& c) { return value(c) < 0.0f; }

 private:
  const SolidFunction& f_;
  glm::vec3 origin_;
  float cell_;
  glm::ivec3 corners_;
  std::vector<float> values_;
};

constexpr std::uint32_t kNoVertex = ~0u;
constexpr int kStride = 4;  // cells from one corner that is looked at in search of a part to the next

glm::ivec3 along(int axis) {
  glm::ivec3 step(0);
  step[axis] = 1;
  return step;
}

glm::vec3 gradient(const SolidFunction& f, const glm::vec3& p, float h) {
  const glm::vec3 x(h, 0, 0), y(0, h, 0), z(0, 0, h);
  return glm::vec3(f(p + x) - f(p - x), f(p + y) - f(p - y), f(p + z) - f(p - z)) / (2.0f * h);
}

/// The cells, named by their lowest corners, that the surface crosses, in the order of their indices: every part of it
/// is followed from cell to cell from where it is met on lines kStride cells apart.
std::vector<std::size_t> crossed_cells(Grid& g) {
  const glm::ivec3 end = g.corners() - 1;  // of cells
  std::vector<bool> seen(g.size());
  std::vector<std::size_t> cells;  // those behind `next` are to be followed
  const auto add = [&](const glm::ivec3& c) {
    if (glm::any(glm::lessThan(c, glm::ivec3(0))) || glm::any(glm::greaterThanEqual(c, end))) return;
    const std::size_t i = g.index(c);
    if (seen[i]) return;
    seen[i] = true;
    cells.push_back(i);
  };
  glm::ivec3 c;
  for (c.z = 0; c.z < end.z; c.z += kStride)
    for (c.y = 0; c.y < end.y; c.y += kStride)
      for (c.x = 0; c.x < end.x; c.x += kStride)
        for (int axis = 0; axis < 3; ++axis) {
          const glm::ivec3 step = along(axis);
          const int steps = std::min(kStride, end[axis] - c[axis]);
          if (g.is_inside(c) == g.is_inside(c + steps * step)) continue;
          for (int i = 0; i < steps; ++i)
            if (g.is_inside(c + i * step) != g.is_inside(c + (i + 1) * step)) add(c + i * step);
        }
  for (std::size_t next = 0; next < cells.size(); ++next) {
    const glm::ivec3 at = g.corner(cells[next]);
    for (int axis = 0; axis < 3; ++axis) {
      const glm::ivec3 out = along(axis), u = along((axis + 1) % 3), v = along((axis + 2) % 3);
      for (const int side : {0, 1}) {
        const glm::ivec3 face = at + side * out;
        const bool inside = g.is_inside(face);
        if (inside == g.is_inside(face + u) && inside == g.is_inside(face + v) &&
            inside == g.is_inside(face + u + v))
          continue;
        add(side == 0 ? at - out : at + out);
      }
    }
  }
  std::sort(cells.begin(), cells.end());
  return cells;
}

// Mean of the points where the surface crosses the twelve edges of a cell; it crosses one at least.
glm::vec3 cell_vertex(Grid& g, const glm::ivec3& cell) {
  glm::vec3 sum(0.0f);
  int crossings = 0;
  for (int axis = 0; axis < 3; ++axis)
    for (int e = 0; e < 4; ++e) {
      const glm::ivec3 a = cell + (e & 1) * along((axis + 1) % 3) + (e >> 1) * along((axis + 2) % 3);
      const glm::ivec3 b = a + along(axis);
      const float fa = g.value(a), fb = g.value(b);
      if ((fa < 0.0f) == (fb < 0.0f)) continue;
      sum += glm::mix(g.position(a), g.position(b), fa / (fa - fb));
      ++crossings;
    }
  return sum / static_cast<float>(crossings);
}

// One quad for every edge the surface crosses, between the four cells around it; it is the lowest cell's.
void connect(Grid& g, const std::vector<std::size_t>& cells, const std::vector<std::uint32_t>& vertex,
             Mesh& mesh) {
  for (const std::size_t cell : cells) {
    const glm::ivec3 c = g.corner(cell);
    if (glm::any(glm::equal(c, glm::ivec3(0)))) continue;
    for (int axis = 0; axis < 3; ++axis) {
      const glm::ivec3 u = along((axis + 1) % 3), v = along((axis + 2) % 3);
      const bool inside = g.is_inside(c);
      if (inside == g.is_inside(c + along(axis))) continue;
      const auto at = [&](const glm::ivec3& back) { return vertex[g.index(c - back)]; };
      std::uint32_t q[4] = {at(u + v), at(v), at(glm::ivec3(0)), at(u)};
      if (!inside) std::swap(q[1], q[3]);
      mesh.triangles.emplace_back(q[0], q[1], q[2]);
      mesh.triangles.emplace_back(q[0], q[2], q[3]);
    }
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
  Grid g(f, bounds, cell);
  const std::vector<std::size_t> cells = crossed_cells(g);
  Mesh mesh{std::move(name), {}, {}, {}, material};
  std::vector<std::uint32_t> vertex(g.size(), kNoVertex);
  for (const std::size_t i : cells) {
    vertex[i] = static_cast<std::uint32_t>(mesh.positions.size());
    mesh.positions.push_back(cell_vertex(g, g.corner(i)));
  }
  for (glm::vec3& at : mesh.positions) {
    const glm::vec3 slope = gradient(f, at, 0.5f * cell);
    const float squared = glm::dot(slope, slope);
    mesh.normals.push_back(squared > 0.0f ? slope / std::sqrt(squared) : glm::vec3(0.0f, 1.0f, 0.0f));
    if (!(squared > 0.0f)) continue;
    const glm::vec3 step = f(at) / squared * slope;
    if (glm::dot(step, step) < cell * cell) at -= step;  // further off means the gradient is no guide here
  }
  connect(g, cells, vertex, mesh);
  return mesh;
}

}  // namespace icbench
