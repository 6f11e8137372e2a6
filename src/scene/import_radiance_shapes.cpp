#include "scene/import_radiance_shapes.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "scene/import_polygon.h"

namespace icbench::importing {
namespace {

constexpr double kPi = std::numbers::pi;

struct Frame {
  glm::dvec3 u, v;  // unit, cross(u, v) along the axis
};

Frame around(const glm::dvec3& axis) {
  const glm::dvec3 n = glm::normalize(axis);
  const glm::dvec3 u =
      glm::normalize(glm::cross(std::abs(n.x) < 0.5 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0), n));
  return {u, glm::cross(n, u)};
}

glm::dvec3 on_circle(const Frame& f, int i, int segments) {
  const double angle = 2.0 * kPi * (i % segments) / segments;
  return std::cos(angle) * f.u + std::sin(angle) * f.v;
}

void add_triangle(Shape& to, std::uint32_t a, std::uint32_t b, std::uint32_t c, bool reversed) {
  to.triangles.emplace_back(a, reversed ? c : b, reversed ? b : c);
}

void add_vertex(Shape& to, const glm::dvec3& p, const glm::dvec3& n) {
  to.positions.push_back(p);
  to.normals.emplace_back(n);
}

}  // namespace

int segments(double radius, double tolerance) {
  const double n = kPi / std::acos(1.0 - std::clamp(tolerance / radius, 1e-6, 0.5));
  return 4 * static_cast<int>(std::ceil(std::clamp(n, 8.0, 256.0) / 4.0));
}

void add_polygon(Shape& to, std::span<const glm::dvec3> corners) {
  const auto first = static_cast<std::uint32_t>(to.positions.size());
  for (const glm::uvec3& t : triangulate(corners)) to.triangles.push_back(first + t);
  to.positions.insert(to.positions.end(), corners.begin(), corners.end());
}

void add_sphere(Shape& to, const glm::dvec3& centre, double radius, int segments, bool inward) {
  const Frame f{{1, 0, 0}, {0, 1, 0}};
  const auto first = static_cast<std::uint32_t>(to.positions.size());
  const auto n = static_cast<std::uint32_t>(segments), rings = n / 2 - 1;
  const double side = inward ? -1.0 : 1.0;
  const auto add = [&](const glm::dvec3& d) { add_vertex(to, centre + radius * d, side * d); };
  add({0, 0, -1});
  for (std::uint32_t r = 1; r <= rings; ++r) {
    const double polar = kPi * r / (rings + 1);
    for (std::uint32_t i = 0; i < n; ++i)
      add(std::sin(polar) * on_circle(f, static_cast<int>(i), segments) - glm::dvec3(0, 0, std::cos(polar)));
  }
  add({0, 0, 1});
  const std::uint32_t last = first + 1 + rings * n;
  for (std::uint32_t i = 0; i < n; ++i) {
    const std::uint32_t j = (i + 1) % n;
    add_triangle(to, first, first + 1 + j, first + 1 + i, inward);
    for (std::uint32_t r = 0; r + 1 < rings; ++r) {
      const std::uint32_t low = first + 1 + r * n, high = low + n;
      add_triangle(to, low + i, low + j, high + j, inward);
      add_triangle(to, low + i, high + j, high + i, inward);
    }
    add_triangle(to, last, last - n + i, last - n + j, inward);
  }
}

void add_cone(Shape& to, const glm::dvec3& p0, const glm::dvec3& p1, double r0, double r1, int segments,
              bool inward) {
  const glm::dvec3 axis = p1 - p0;
  const double height = glm::length(axis);
  const Frame f = around(axis);
  const auto first = static_cast<std::uint32_t>(to.positions.size());
  for (int i = 0; i < segments; ++i) {
    const glm::dvec3 d = on_circle(f, i, segments);
    const glm::dvec3 n = (inward ? -1.0 : 1.0) * (height * d + (r0 - r1) / height * axis);
    add_vertex(to, p0 + r0 * d, n);
    add_vertex(to, p1 + r1 * d, n);
  }
  const auto count = 2 * static_cast<std::uint32_t>(segments);
  for (std::uint32_t i = 0; i < count; i += 2) {
    const std::uint32_t j = (i + 2) % count;
    add_triangle(to, first + i, first + j, first + j + 1, inward);
    add_triangle(to, first + i, first + j + 1, first + i + 1, inward);
  }
}

void add_ring(Shape& to, const glm::dvec3& centre, const glm::dvec3& n, double inner, double outer,
              int segments) {
  const Frame f = around(n);
  const auto first = static_cast<std::uint32_t>(to.positions.size());
  for (int i = 0; i < segments; ++i) {
    const glm::dvec3 d = on_circle(f, i, segments);
    to.positions.push_back(centre + inner * d);
    to.positions.push_back(centre + outer * d);
  }
  const auto count = 2 * static_cast<std::uint32_t>(segments);
  for (std::uint32_t i = 0; i < count; i += 2) {
    const std::uint32_t j = (i + 2) % count;
    add_triangle(to, first + i, first + i + 1, first + j + 1, false);
    add_triangle(to, first + i, first + j + 1, first + j, false);
  }
}

}  // namespace icbench::importing
