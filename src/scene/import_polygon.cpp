#include "scene/import_polygon.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>

namespace icbench::importing {
namespace {

// Points closer to a line than this share of the polygon's size are on it.
constexpr double kOnLine = 1e-12;

double cross(const glm::dvec2& a, const glm::dvec2& b) { return a.x * b.y - a.y * b.x; }

// Cuts off one ear after another. For every corner that is none it is known which other one is in the way, so that it
// is looked for again only when that one is gone: usually as many steps as the square of the number of corners.
class EarClipper {
 public:
  EarClipper(std::vector<glm::dvec2> points, double tolerance)
      : p_(std::move(points)), in_the_way_(p_.size(), kNone), is_cut_(p_.size()), tolerance_(tolerance) {
    const auto n = static_cast<std::uint32_t>(p_.size());
    for (std::uint32_t i = 0; i < n; ++i) {
      next_.push_back((i + 1) % n);
      before_.push_back((i + n - 1) % n);
    }
  }

  std::vector<glm::uvec3> run() {
    std::uint32_t at = 0;
    for (std::size_t left = p_.size(); left > 3; --left) {
      at = find_ear(at, left);
      clip(at);
      // Away from the new triangle, so that fans of slivers do not arise.
      at = next_[next_[at]];
    }
    clip(at);
    return std::move(triangles_);
  }

 private:
  double area(std::uint32_t i) const { return cross(p_[i] - p_[before_[i]], p_[next_[i]] - p_[i]); }

  // An ear, or what comes nearest where rounding or a crossing leaves none: one that only touches other
  // corners, a corner without area, any convex corner.
  std::uint32_t find_ear(std::uint32_t start, std::size_t left) {
    std::uint32_t flat = kNone, convex = kNone, i = start;
    for (std::size_t n = 0; n < left; ++n, i = next_[i]) {
      const double a = area(i);
      if (std::abs(a) <= tolerance_) {
        if (is_idle(i)) return i;
        flat = flat == kNone ? i : flat;
        continue;
      }
      if (a < 0.0) continue;
      convex = convex == kNone ? i : convex;
      if (is_ear(i, left)) return i;
    }
    for (std::size_t n = 0; n < left; ++n, i = next_[i])
      if (area(i) > tolerance_ && inside(i, left, -tolerance_) == kNone) return i;
    for (const std::uint32_t choice : {flat, convex})
      if (choice != kNone) return choice;
    return start;
  }

  // The outline goes there and back, or stands still: until one of two equal corners is gone neither is an ear.
  bool is_idle(std::uint32_t i) const { return p_[before_[i]] == p_[next_[i]] || p_[i] == p_[next_[i]]; }

  bool is_ear(std::uint32_t i, std::size_t left) {
    std::uint32_t& q = in_the_way_[i];
    if (q == kNone || is_cut_[q]) q = inside(i, left, tolerance_);
    return q == kNone;
  }

  // Another corner in the triangle at i, with a margin; corners at the same place do not count.
  std::uint32_t inside(std::uint32_t i, std::size_t left, double margin) const {
    const glm::dvec2 &a = p_[before_[i]], &b = p_[i], &c = p_[next_[i]];
    std::uint32_t k = next_[next_[i]];
    for (std::size_t n = 3; n < left; ++n, k = next_[k]) {
      const glm::dvec2& q = p_[k];
      if (q == a || q == b || q == c) continue;
      if (cross(b - a, q - a) >= -margin && cross(c - b, q - b) >= -margin && cross(a - c, q - c) >= -margin)
        return k;
    }
    return kNone;
  }

  void clip(std::uint32_t i) {
    if (std::abs(area(i)) > 0.0) triangles_.emplace_back(before_[i], i, next_[i]);
    next_[before_[i]] = next_[i];
    before_[next_[i]] = before_[i];
    is_cut_[i] = true;
    in_the_way_[before_[i]] = in_the_way_[next_[i]] = kNone;  // other triangles now
  }

  static constexpr std::uint32_t kNone = ~0u;

  std::vector<glm::dvec2> p_;
  std::vector<std::uint32_t> next_, before_;
  // By corner: another one in its triangle, perhaps cut off since; kNone: unknown.
  std::vector<std::uint32_t> in_the_way_;
  std::vector<bool> is_cut_;
  std::vector<glm::uvec3> triangles_;
  double tolerance_;
};

// Twice the area as a vector.
glm::dvec3 normal_of(std::span<const glm::dvec3> corners) {
  glm::dvec3 n(0.0);
  for (std::size_t i = 1; i + 1 < corners.size(); ++i)
    n += glm::cross(corners[i] - corners[0], corners[i + 1] - corners[0]);
  return n;
}

}  // namespace

std::vector<glm::uvec3> triangulate(std::span<const glm::dvec3> corners) {
  if (corners.size() < 3) return {};
  const glm::dvec3 signed_n = normal_of(corners), n = glm::abs(signed_n);
  const double largest = std::max({n.x, n.y, n.z});
  if (!(largest > 0.0 && std::isfinite(largest))) return {};
  // Along the axis nearest to the normal, turned so that the polygon runs counter-clockwise.
  const int drop = n.x == largest ? 0 : n.y == largest ? 1 : 2;
  const int u = (drop + 1) % 3, v = (drop + 2) % 3;
  const double sign = signed_n[drop] > 0.0 ? 1.0 : -1.0;
  std::vector<glm::dvec2> flat;
  double size = 0.0;
  for (const glm::dvec3& p : corners) {
    const glm::dvec3 d = p - corners[0];
    flat.emplace_back(d[u], sign * d[v]);
    size = std::max({size, std::abs(d[u]), std::abs(d[v])});
  }
  return EarClipper(std::move(flat), kOnLine * size * size).run();
}

}  // namespace icbench::importing
