#include "scene/shapes.h"

#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <map>
#include <numbers>
#include <utility>

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

Bounds bounds_of(const Mesh& mesh) {
  Bounds b{mesh.positions.front(), mesh.positions.front()};
  for (const glm::vec3& p : mesh.positions) {
    b.lower = glm::min(b.lower, p);
    b.upper = glm::max(b.upper, p);
  }
  return b;
}

}  // namespace icbench
