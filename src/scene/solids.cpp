#include "scene/solids.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <numbers>
#include <utility>

namespace icbench {
namespace {

using glm::vec3;

// Makes exactly equal vertices one and removes triangles that have collapsed.
void weld(Mesh& mesh) {
  const auto less = [](const vec3& a, const vec3& b) {
    return a.x != b.x ? a.x < b.x : a.y != b.y ? a.y < b.y : a.z < b.z;
  };
  std::map<vec3, std::uint32_t, decltype(less)> known(less);
  std::vector<std::uint32_t> index;
  std::vector<vec3> positions;
  for (const vec3& p : mesh.positions) {
    const auto [at, fresh] = known.try_emplace(p, static_cast<std::uint32_t>(positions.size()));
    if (fresh) positions.push_back(p);
    index.push_back(at->second);
  }
  mesh.positions = std::move(positions);
  for (glm::uvec3& t : mesh.triangles) t = {index[t.x], index[t.y], index[t.z]};
  std::erase_if(mesh.triangles, [](const glm::uvec3& t) { return t.x == t.y || t.y == t.z || t.z == t.x; });
}

void add_quad(Mesh& mesh, std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) {
  mesh.triangles.emplace_back(a, b, c);
  mesh.triangles.emplace_back(a, c, d);
}

// Joins rings of n vertices each, then closes both ends with `cap`, or the last with the first.
void join_rings(Mesh& mesh, std::uint32_t n, const std::vector<glm::uvec3>& cap, bool loop) {
  const auto rings = static_cast<std::uint32_t>(mesh.positions.size()) / n;
  for (std::uint32_t r = 0; r + (loop ? 0 : 1) < rings; ++r)
    for (std::uint32_t i = 0; i < n; ++i) {
      const std::uint32_t a = r * n, b = (r + 1) % rings * n, j = (i + 1) % n;
      add_quad(mesh, a + i, a + j, b + j, b + i);
    }
  if (loop) return;
  const std::uint32_t last = (rings - 1) * n;
  for (const glm::uvec3& t : cap) {
    mesh.triangles.emplace_back(t.x, t.z, t.y);
    mesh.triangles.emplace_back(last + t.x, last + t.y, last + t.z);
  }
}

vec3 rotated_between(const vec3& v, const vec3& from, const vec3& to) {
  const vec3 axis = glm::cross(from, to);
  const float sine = glm::length(axis);
  if (sine < 1e-6f) return v;
  return rotation(axis / sine, std::atan2(sine, glm::dot(from, to))) * v;
}

}  // namespace

Mesh block(const glm::ivec3& cells, const std::function<vec3(const vec3&)>& f) {
  Mesh mesh;
  std::map<std::array<int, 3>, std::uint32_t> known;
  const auto vertex = [&](const glm::ivec3& i) {
    const auto [at, fresh] =
        known.try_emplace({i.x, i.y, i.z}, static_cast<std::uint32_t>(mesh.positions.size()));
    if (fresh) mesh.positions.push_back(f(vec3(i) / vec3(cells)));
    return at->second;
  };
  for (int axis = 0; axis < 3; ++axis) {
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    for (int side = 0; side < 2; ++side)
      for (int i = 0; i < cells[u]; ++i)
        for (int j = 0; j < cells[v]; ++j) {
          const auto at = [&](int di, int dj) {
            glm::ivec3 p;
            p[axis] = side * cells[axis];
            p[u] = i + di;
            p[v] = j + dj;
            return vertex(p);
          };
          if (side == 1)
            add_quad(mesh, at(0, 0), at(1, 0), at(1, 1), at(0, 1));
          else
            add_quad(mesh, at(0, 0), at(0, 1), at(1, 1), at(1, 0));
        }
  }
  weld(mesh);
  return mesh;
}

Mesh rounded_box(const Bounds& bounds, float radius, int steps, const glm::ivec3& cells) {
  // Along each axis: `steps` cells of rounding, the flat cells, `steps` cells of rounding.
  const glm::ivec3 all = cells + 2 * steps;
  return block(all, [&](const vec3& unit) {
    vec3 core, offset;
    for (int c = 0; c < 3; ++c) {
      const int i = static_cast<int>(std::lround(unit[c] * static_cast<float>(all[c])));
      const float low = bounds.lower[c] + radius, high = bounds.upper[c] - radius;
      const int flat = std::clamp(i - steps, 0, cells[c]);
      core[c] = low + (high - low) * static_cast<float>(flat) / static_cast<float>(cells[c]);
      const auto beyond = static_cast<float>(i - steps - flat) / static_cast<float>(steps);
      offset[c] = std::tan(0.25f * std::numbers::pi_v<float> * beyond);
    }
    return core + radius * glm::normalize(offset);
  });
}

Mesh extrude(const Polygon& outline, float depth, std::span<const Polygon> holes) {
  Mesh mesh;
  std::vector<Polygon> loops{outline};
  loops.insert(loops.end(), holes.begin(), holes.end());
  std::uint32_t count = 0;
  for (const Polygon& loop : loops) count += static_cast<std::uint32_t>(loop.size());
  for (const float z : {0.0f, depth})
    for (const Polygon& loop : loops)
      for (const glm::vec2& p : loop) mesh.positions.emplace_back(p.x, p.y, z);
  for (const glm::uvec3& t : triangulate(outline, holes)) {
    mesh.triangles.emplace_back(t.x, t.z, t.y);
    mesh.triangles.emplace_back(count + t.x, count + t.y, count + t.z);
  }
  std::uint32_t first = 0;
  for (std::size_t l = 0; l < loops.size(); ++l) {
    const auto n = static_cast<std::uint32_t>(loops[l].size());
    const bool as_given = (doubled_area(loops[l]) > 0.0) == (l == 0);
    for (std::uint32_t i = 0; i < n; ++i) {
      std::uint32_t a = first + i, b = first + (i + 1) % n;
      if (!as_given) std::swap(a, b);
      add_quad(mesh, a, b, b + count, a + count);
    }
    first += n;
  }
  return mesh;
}

Mesh slab(const Polygon& outline, std::span<const SlabLevel> levels) {
  Mesh mesh;
  for (const SlabLevel& level : levels)
    for (const glm::vec2& p : inset(outline, level.inset)) mesh.positions.emplace_back(p.x, level.y, -p.y);
  join_rings(mesh, static_cast<std::uint32_t>(outline.size()), triangulate(outline), false);
  return mesh;
}

Mesh sweep(const Path& path, const Polygon& profile, const vec3& up, bool loop) {
  Mesh mesh;
  const std::size_t n = path.size();
  const auto edge = [&](std::size_t i) { return glm::normalize(path[(i + 1) % n] - path[i % n]); };
  vec3 along = edge(0);
  vec3 y = glm::normalize(up - along * glm::dot(up, along));
  for (std::size_t i = 0; i < n; ++i) {
    const vec3 in = loop || i > 0 ? edge(i + n - 1) : along;
    const vec3 out = loop || i + 1 < n ? edge(i) : in;
    y = rotated_between(y, along, out);
    along = out;
    const vec3 x = glm::cross(y, along), mitre = glm::normalize(in + out);
    for (const glm::vec2& p : profile) {
      const vec3 offset = p.x * x + p.y * y;
      mesh.positions.push_back(path[i] + offset - along * (glm::dot(offset, mitre) / glm::dot(along, mitre)));
    }
  }
  join_rings(mesh, static_cast<std::uint32_t>(profile.size()), triangulate(profile), loop);
  return mesh;
}

Mesh tube(const Path& path, float radius, int sides) {
  const vec3 along = path[1] - path[0];
  const vec3 up = std::abs(along.y) > std::abs(along.x) + std::abs(along.z) ? vec3(1, 0, 0) : vec3(0, 1, 0);
  return sweep(path, circle({0.0f, 0.0f}, radius, sides), up);
}

Path fillet(const Path& path, float radius, int steps) {
  Path round{path.front()};
  for (std::size_t i = 1; i + 1 < path.size(); ++i) {
    const vec3 in = glm::normalize(path[i] - path[i - 1]), out = glm::normalize(path[i + 1] - path[i]);
    const float turn = std::acos(std::clamp(glm::dot(in, out), -1.0f, 1.0f));
    if (turn < 1e-3f) {
      round.push_back(path[i]);
      continue;
    }
    const vec3 inward = glm::normalize(out - in * glm::dot(in, out));
    const vec3 start = path[i] - in * (radius * std::tan(0.5f * turn));
    for (int s = 0; s <= steps; ++s) {
      const float angle = turn * static_cast<float>(s) / static_cast<float>(steps);
      round.push_back(start + radius * (std::sin(angle) * in + (1.0f - std::cos(angle)) * inward));
    }
  }
  round.push_back(path.back());
  return round;
}

Path lift(const Polygon& polygon, const vec3& origin, const vec3& across, const vec3& up) {
  Path path;
  for (const glm::vec2& p : polygon) path.push_back(origin + p.x * across + p.y * up);
  return path;
}

glm::mat3 rotation(const vec3& axis, float angle) {
  const float c = std::cos(angle), s = std::sin(angle);
  glm::mat3 m;
  for (int i = 0; i < 3; ++i) {
    vec3 e(0.0f);
    e[i] = 1.0f;
    m[i] = c * e + s * glm::cross(axis, e) + (1.0f - c) * glm::dot(axis, e) * axis;
  }
  return m;
}

Mesh moved(Mesh mesh, const Pose& pose) {
  const glm::mat3 for_normals = glm::transpose(glm::inverse(pose.linear));
  for (vec3& p : mesh.positions) p = pose(p);
  for (vec3& n : mesh.normals) n = glm::normalize(for_normals * n);
  if (glm::determinant(pose.linear) < 0.0f)
    for (glm::uvec3& t : mesh.triangles) std::swap(t.y, t.z);
  return mesh;
}

Mesh mirrored(Mesh mesh) {
  return moved(std::move(mesh), {glm::mat3(-1, 0, 0, 0, 1, 0, 0, 0, 1), vec3(0.0f)});
}

Mesh bent(Mesh mesh, const std::function<vec3(const vec3&)>& f) {
  for (vec3& p : mesh.positions) p = f(p);
  return mesh;
}

Mesh shade(Mesh mesh, float crease) {
  weld(mesh);
  const std::size_t count = mesh.triangles.size();
  std::vector<glm::dvec3> faces(count);
  std::vector<std::vector<std::pair<std::uint32_t, double>>> around(
      mesh.positions.size());  // triangle, its angle
  for (std::uint32_t t = 0; t < count; ++t) {
    const glm::uvec3& v = mesh.triangles[t];
    const glm::dvec3 p[3] = {mesh.positions[v.x], mesh.positions[v.y], mesh.positions[v.z]};
    faces[t] = glm::normalize(glm::cross(p[1] - p[0], p[2] - p[0]));
    for (int k = 0; k < 3; ++k) {
      const glm::dvec3 a = p[(k + 1) % 3] - p[k], b = p[(k + 2) % 3] - p[k];
      around[v[k]].emplace_back(t, std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b)));
    }
  }
  const double blend = std::cos(static_cast<double>(crease));
  std::vector<vec3> positions, normals;
  std::vector<std::vector<std::uint32_t>> copies(mesh.positions.size());
  for (std::uint32_t t = 0; t < count; ++t)
    for (int k = 0; k < 3; ++k) {
      const std::uint32_t v = mesh.triangles[t][k];
      glm::dvec3 sum(0.0);
      for (const auto& [other, angle] : around[v])
        if (glm::dot(faces[other], faces[t]) >= blend) sum += angle * faces[other];
      const vec3 normal = glm::normalize(glm::normalize(sum));
      const auto same = std::find_if(copies[v].begin(), copies[v].end(), [&](std::uint32_t c) {
        return glm::dot(normals[c] - normal, normals[c] - normal) < 1e-10f;
      });
      if (same != copies[v].end()) {
        mesh.triangles[t][k] = *same;
        continue;
      }
      mesh.triangles[t][k] = static_cast<std::uint32_t>(positions.size());
      copies[v].push_back(mesh.triangles[t][k]);
      positions.push_back(mesh.positions[v]);
      normals.push_back(normal);
    }
  mesh.positions = std::move(positions);
  mesh.normals = std::move(normals);
  return mesh;
}

void Parts::add(std::uint32_t material, const Mesh& given) {
  const Mesh mesh = given.normals.empty() ? shade(given) : given;
  Mesh& to = meshes_[material];
  to.material = material;
  const auto first = static_cast<std::uint32_t>(to.positions.size());
  to.positions.insert(to.positions.end(), mesh.positions.begin(), mesh.positions.end());
  to.normals.insert(to.normals.end(), mesh.normals.begin(), mesh.normals.end());
  for (const glm::uvec3& t : mesh.triangles) to.triangles.push_back(t + first);
}

void Parts::add(const Parts& parts, const Pose& pose) {
  for (const auto& [material, mesh] : parts.meshes_) add(material, moved(mesh, pose));
}

void Parts::build(Scene& scene, const std::string& name) const {
  for (const auto& [material, mesh] : meshes_) {
    scene.meshes.push_back(mesh);
    scene.meshes.back().name = name;
  }
}

}  // namespace icbench
