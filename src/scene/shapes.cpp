#include "scene/shapes.h"

#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_inverse.hpp>
#include <map>
#include <numbers>
#include <utility>
#include <vector>

namespace icbench {

Mesh quad(std::string name, const glm::vec3& p, const glm::vec3& u, const glm::vec3& v,
          std::uint32_t material) {
  return {std::move(name), {p, p + u, p + u + v, p + v}, {}, {{0, 1, 2}, {0, 2, 3}}, material};
}

Mesh box(std::string name, const Bounds& b, std::uint32_t material, bool inward) {
  Mesh mesh{std::move(name), {}, {}, {}, material};
  for (int i = 0; i < 8; ++i)
    mesh.positions.emplace_back((i & 1) ? b.upper.x : b.lower.x, (i & 2) ? b.upper.y : b.lower.y,
                                (i & 4) ? b.upper.z : b.lower.z);
  constexpr std::uint32_t kFaces[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                                          {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
  for (const auto& f : kFaces) {
    mesh.triangles.emplace_back(f[0], f[1], f[2]);
    mesh.triangles.emplace_back(f[0], f[2], f[3]);
  }
  if (inward)
    for (glm::uvec3& t : mesh.triangles) std::swap(t.y, t.z);
  return mesh;
}

Mesh solid_box(const glm::vec3& lower, const glm::vec3& upper) { return box("", {lower, upper}, 0); }

Mesh icosphere(std::string name, const glm::vec3& centre, float radius, int levels, std::uint32_t material) {
  constexpr float kGolden = std::numbers::phi_v<float>;
  Mesh mesh{std::move(name), {}, {}, {}, material};
  for (int axis = 0; axis < 3; ++axis)
    for (int i = 0; i < 4; ++i) {
      glm::vec3 v(0.0f);
      v[axis] = (i & 1) ? 1.0f : -1.0f;
      v[(axis + 1) % 3] = (i & 2) ? kGolden : -kGolden;
      mesh.positions.push_back(glm::normalize(v));
    }
  // The faces are the 20 triples of vertices that are mutual neighbours (two apart, before normalising).
  const float near = 1.1f * 2.0f / std::sqrt(1.0f + kGolden * kGolden);
  const auto& v = mesh.positions;
  const auto close = [&](std::uint32_t a, std::uint32_t b) { return glm::distance(v[a], v[b]) < near; };
  for (std::uint32_t a = 0; a < 12; ++a)
    for (std::uint32_t b = a + 1; b < 12; ++b)
      for (std::uint32_t c = b + 1; c < 12; ++c) {
        if (!close(a, b) || !close(b, c) || !close(a, c)) continue;
        const bool outward = glm::dot(glm::cross(v[b] - v[a], v[c] - v[a]), v[a]) > 0.0f;
        mesh.triangles.push_back(outward ? glm::uvec3(a, b, c) : glm::uvec3(a, c, b));
      }
  for (int level = 0; level < levels; ++level) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middles;
    const auto middle = [&](std::uint32_t a, std::uint32_t b) {
      const auto [at, fresh] =
          middles.try_emplace(std::minmax(a, b), static_cast<std::uint32_t>(mesh.positions.size()));
      if (fresh) mesh.positions.push_back(glm::normalize(mesh.positions[a] + mesh.positions[b]));
      return at->second;
    };
    std::vector<glm::uvec3> finer;
    for (const glm::uvec3& t : mesh.triangles) {
      const std::uint32_t xy = middle(t.x, t.y), yz = middle(t.y, t.z), zx = middle(t.z, t.x);
      finer.insert(finer.end(), {{t.x, xy, zx}, {t.y, yz, xy}, {t.z, zx, yz}, {xy, yz, zx}});
    }
    mesh.triangles = std::move(finer);
  }
  for (glm::vec3& p : mesh.positions) p = centre + radius * p;
  return mesh;
}

Mesh ball(std::string name, const glm::vec3& centre, float radius, int levels, std::uint32_t material) {
  Mesh mesh = icosphere(std::move(name), centre, radius, levels, material);
  for (const glm::vec3& p : mesh.positions) mesh.normals.push_back(glm::normalize(p - centre));
  return mesh;
}

Mesh rounded_box(std::string name, const Bounds& bounds, float radius, int segments, std::uint32_t material) {
  Mesh mesh{std::move(name), {}, {}, {}, material};
  const auto arc = static_cast<std::uint32_t>(segments + 1);
  // (sine, cosine) along a quarter circle; its ends are exact, so that neighbouring pieces meet in the same points.
  std::vector<glm::vec2> quarter(arc);
  for (std::uint32_t i = 0; i < arc; ++i) {
    const float phi = 0.5f * std::numbers::pi_v<float> * static_cast<float>(i) / static_cast<float>(segments);
    quarter[i] = {std::sin(phi), std::cos(phi)};
  }
  quarter.front() = {0.0f, 1.0f};
  quarter.back() = {1.0f, 0.0f};
  // Rows from the top to the bottom, columns round the vertical axis, of a sphere cut into octants that sit in the
  // box's corners.
  const std::uint32_t rows = 2 * arc, columns = 4 * arc;
  for (std::uint32_t r = 0; r < rows; ++r)
    for (std::uint32_t c = 0; c < columns; ++c) {
      const glm::vec2 polar = r < arc ? quarter[r] : quarter[rows - 1 - r];
      const glm::vec2 around = quarter[c % arc];
      const std::uint32_t quadrant = c / arc;
      const bool left = quadrant == 1 || quadrant == 2, front = quadrant < 2, top = r < arc;
      const glm::vec2 xz = (quadrant & 1) ? around : glm::vec2(around.y, around.x);
      const glm::vec3 n((left ? -polar.x : polar.x) * xz.x, top ? polar.y : -polar.y,
                        (front ? polar.x : -polar.x) * xz.y);
      const glm::vec3 corner(left ? bounds.lower.x + radius : bounds.upper.x - radius,
                             top ? bounds.upper.y - radius : bounds.lower.y + radius,
                             front ? bounds.upper.z - radius : bounds.lower.z + radius);
      mesh.positions.push_back(corner + radius * n);
      mesh.normals.push_back(glm::normalize(n));
    }
  const auto add = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    const auto& p = mesh.positions;
    if (p[a] != p[b] && p[b] != p[c] && p[c] != p[a]) mesh.triangles.emplace_back(a, b, c);
  };
  for (std::uint32_t r = 0; r + 1 < rows; ++r)
    for (std::uint32_t c = 0; c < columns; ++c) {
      const std::uint32_t next = (c + 1) % columns;
      const std::uint32_t a = r * columns + c, b = r * columns + next;
      add(a, b, b + columns);
      add(a, b + columns, a + columns);
    }
  const std::uint32_t last = (rows - 1) * columns;
  for (std::uint32_t k = 1; k < 3; ++k) {
    add(0, (k + 1) * arc, k * arc);
    add(last, last + k * arc, last + (k + 1) * arc);
  }
  return mesh;
}

Mesh tube(std::string name, std::span<const glm::vec3> path, float radius, int segments,
          std::uint32_t material) {
  Mesh mesh{std::move(name), {}, {}, {}, material};
  const auto n = static_cast<std::uint32_t>(segments);
  const std::size_t last = path.size() - 1;
  glm::vec3 side(0.0f);
  const auto add_ring = [&](std::size_t at, const glm::vec3& along, const glm::vec3* flat) {
    const glm::vec3 up = glm::cross(along, side);
    for (std::uint32_t s = 0; s < n; ++s) {
      const float phi =
          2.0f * std::numbers::pi_v<float> * static_cast<float>(s) / static_cast<float>(segments);
      const glm::vec3 out = std::cos(phi) * side + std::sin(phi) * up;
      mesh.positions.push_back(path[at] + radius * out);
      mesh.normals.push_back(flat ? *flat : glm::normalize(out));
    }
  };
  const auto add_end = [&](std::size_t at, const glm::vec3& along, bool far) {
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    const glm::vec3 flat = far ? along : -along;
    add_ring(at, along, &flat);
    for (std::uint32_t s = 1; s + 1 < n; ++s)
      mesh.triangles.emplace_back(first, first + (far ? s : s + 1), first + (far ? s + 1 : s));
  };
  glm::vec3 along(0.0f);
  for (std::size_t i = 0; i <= last; ++i) {
    const glm::vec3 back = i > 0 ? glm::normalize(path[i] - path[i - 1]) : glm::vec3(0.0f);
    const glm::vec3 ahead = i < last ? glm::normalize(path[i + 1] - path[i]) : glm::vec3(0.0f);
    along = glm::normalize(back + ahead);
    if (i == 0) side = std::abs(along.y) < 0.9f ? glm::vec3(0, 1, 0) : glm::vec3(1, 0, 0);
    side = glm::normalize(side - glm::dot(side, along) * along);  // turns no more than the path does
    if (i == 0) add_end(0, along, false);
    add_ring(i, along, nullptr);
    const auto row = static_cast<std::uint32_t>(mesh.positions.size()) - n;
    for (std::uint32_t s = 0; i > 0 && s < n; ++s) {
      const std::uint32_t a = row - n + s, b = row - n + (s + 1) % n;
      mesh.triangles.emplace_back(a, b, b + n);
      mesh.triangles.emplace_back(a, b + n, a + n);
    }
  }
  add_end(last, along, true);
  return mesh;
}

Mesh revolve(std::string name, const glm::vec3& base, std::span<const glm::vec2> profile, int segments,
             std::uint32_t material) {
  Mesh mesh{std::move(name), {}, {}, {}, material};
  const std::size_t rows = profile.size();
  const auto tangent = [&](std::size_t i) {  // one-sided at creases and ends
    const bool from_below = i > 0 && profile[i] != profile[i - 1];
    const bool to_above = i + 1 < rows && profile[i] != profile[i + 1];
    return profile[to_above ? i + 1 : i] - profile[from_below ? i - 1 : i];
  };
  for (std::size_t row = 0; row < rows; ++row) {
    const glm::vec2 d = tangent(row);
    for (int s = 0; s < segments; ++s) {
      const float phi =
          2.0f * std::numbers::pi_v<float> * static_cast<float>(s) / static_cast<float>(segments);
      const float c = std::cos(phi), z = -std::sin(phi);
      mesh.positions.push_back(base + glm::vec3(profile[row].x * c, profile[row].y, profile[row].x * z));
      mesh.normals.push_back(glm::normalize(glm::vec3(d.y * c, -d.x, d.y * z)));
    }
  }
  const auto n = static_cast<std::uint32_t>(segments);
  for (std::uint32_t row = 0; row + 1 < rows; ++row) {
    if (profile[row] == profile[row + 1]) continue;  // a crease
    for (std::uint32_t s = 0; s < n; ++s) {
      const std::uint32_t a = row * n + s, b = row * n + (s + 1) % n;
      if (profile[row].x > 0.0f)
        mesh.triangles.emplace_back(a, b, b + n);  // at a pole one of the two is a line
      if (profile[row + 1].x > 0.0f) mesh.triangles.emplace_back(a, b + n, a + n);
    }
  }
  return mesh;
}

void place(Mesh& mesh, float scale, float angle, const glm::vec3& shift) {
  const float c = std::cos(angle), s = std::sin(angle);
  const auto turn = [&](const glm::vec3& v) { return glm::vec3(c * v.x + s * v.z, v.y, c * v.z - s * v.x); };
  for (glm::vec3& p : mesh.positions) p = scale * turn(p) + shift;
  for (glm::vec3& n : mesh.normals) n = turn(n);
}

void place(Mesh& mesh, const Pose& pose) {
  const glm::mat3 normals = glm::inverseTranspose(pose.linear);
  for (glm::vec3& p : mesh.positions) p = pose(p);
  for (glm::vec3& n : mesh.normals) n = glm::normalize(normals * n);
}

namespace {

// Gives a mesh without normals those of its triangles.
void facet(Mesh& mesh) {
  Mesh flat{std::move(mesh.name), {}, {}, {}, mesh.material};
  for (const glm::uvec3& t : mesh.triangles) {
    const glm::vec3 a = mesh.positions[t.x], b = mesh.positions[t.y], c = mesh.positions[t.z];
    const auto first = static_cast<std::uint32_t>(flat.positions.size());
    flat.positions.insert(flat.positions.end(), {a, b, c});
    flat.normals.insert(flat.normals.end(), 3, glm::normalize(glm::cross(b - a, c - a)));
    flat.triangles.emplace_back(first, first + 1, first + 2);
  }
  mesh = std::move(flat);
}

}  // namespace

void append(Mesh& mesh, Mesh part) {
  if (mesh.normals.empty() && !part.normals.empty()) facet(mesh);
  if (!mesh.normals.empty() && part.normals.empty()) facet(part);
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), part.positions.begin(), part.positions.end());
  mesh.normals.insert(mesh.normals.end(), part.normals.begin(), part.normals.end());
  for (const glm::uvec3& t : part.triangles) mesh.triangles.push_back(t + glm::uvec3(first));
}

Bounds bounds_of(const Mesh& mesh) {
  Bounds b{mesh.positions.front(), mesh.positions.front()};
  for (const glm::vec3& p : mesh.positions) {
    b.lower = glm::min(b.lower, p);
    b.upper = glm::max(b.upper, p);
  }
  return b;
}

}  // namespace icbench
