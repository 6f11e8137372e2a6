#include "scene/polygon.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <iterator>
#include <limits>
#include <numbers>
#include <stdexcept>

namespace icbench {
namespace {

using Point = glm::dvec2;

double turn(const Point& a, const Point& b, const Point& c) {  // > 0: to the left
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

bool inside_or_on(const Point& p, const Point& a, const Point& b, const Point& c) {
  return turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0;
}

// Whether two segments that share no end have a point in common.
bool meet(const Point& a, const Point& b, const Point& c, const Point& d) {
  if (a == c || a == d || b == c || b == d) return false;
  const double ac = turn(a, b, c), ad = turn(a, b, d), ca = turn(c, d, a), cb = turn(c, d, b);
  if (ac == 0.0 && ad == 0.0) {  // in line
    const Point low = glm::max(glm::min(a, b), glm::min(c, d)),
                high = glm::min(glm::max(a, b), glm::max(c, d));
    return low.x <= high.x && low.y <= high.y;
  }
  return ac * ad <= 0.0 && ca * cb <= 0.0;
}

using Ring = std::vector<std::uint32_t>;

class EarClipper {
 public:
  EarClipper(const Polygon& outline, std::span<const Polygon> holes) {
    ring_ = add(outline, true);
    std::vector<Ring> rings;
    for (const Polygon& hole : holes) rings.push_back(add(hole, false));
    while (!rings.empty()) bridge(rings);
  }

  std::vector<glm::uvec3> clip() {
    std::vector<double> shape(ring_.size());  // of the ear at each corner; <= 0: there is none
    for (std::size_t i = 0; i < ring_.size(); ++i) shape[i] = ear(i);
    std::vector<glm::uvec3> triangles;
    while (ring_.size() > 3) {
      const auto best =
          static_cast<std::size_t>(std::max_element(shape.begin(), shape.end()) - shape.begin());
      if (shape[best] <= 0.0) throw std::runtime_error("a polygon crosses itself; it cannot be triangulated");
      const std::size_t n = ring_.size();
      triangles.emplace_back(ring_[(best + n - 1) % n], ring_[best], ring_[(best + 1) % n]);
      ring_.erase(ring_.begin() + static_cast<std::ptrdiff_t>(best));
      shape.erase(shape.begin() + static_cast<std::ptrdiff_t>(best));
      const std::size_t after = best % (n - 1), before = (best + n - 2) % (n - 1);
      shape[before] = ear(before);
      shape[after] = ear(after);
    }
    if (ear(1) <= 0.0) throw std::runtime_error("a polygon crosses itself; it cannot be triangulated");
    triangles.emplace_back(ring_[0], ring_[1], ring_[2]);
    return triangles;
  }

 private:
  // Corners of a loop in the direction asked for.
  Ring add(const Polygon& loop, bool counter_clockwise) {
    Ring ring;
    for (const glm::vec2& p : loop) {
      ring.push_back(static_cast<std::uint32_t>(points_.size()));
      points_.emplace_back(p);
    }
    if ((doubled_area(loop) > 0.0) != counter_clockwise) std::reverse(ring.begin(), ring.end());
    return ring;
  }

  bool crosses(const Ring& ring, const Point& a, const Point& b) const {
    for (std::size_t i = 0; i < ring.size(); ++i)
      if (meet(a, b, points_[ring[i]], points_[ring[(i + 1) % ring.size()]])) return true;
    return false;
  }

  // Whether the way from corner i of the ring to p begins inside it: bridges make a point a corner more than once.
  bool opens(std::size_t i, const Point& p) const {
    const std::size_t n = ring_.size();
    const Point &a = points_[ring_[(i + n - 1) % n]], &b = points_[ring_[i]],
                &c = points_[ring_[(i + 1) % n]];
    const bool left_of_in = turn(a, b, p) > 0.0, left_of_out = turn(b, c, p) > 0.0;
    return turn(a, b, c) > 0.0 ? left_of_in && left_of_out : left_of_in || left_of_out;
  }

  // Joins the hole nearest to the ring to it, by the shortest bridge that crosses nothing.
  void bridge(std::vector<Ring>& holes) {
    std::size_t best_hole = 0, from = 0, to = 0;
    double shortest = std::numeric_limits<double>::infinity();
    for (std::size_t h = 0; h < holes.size(); ++h)
      for (std::size_t i = 0; i < ring_.size(); ++i)
        for (std::size_t j = 0; j < holes[h].size(); ++j) {
          const Point &a = points_[ring_[i]], &b = points_[holes[h][j]];
          const double length = glm::distance(a, b);
          if (length >= shortest || !opens(i, b) || crosses(ring_, a, b) ||
              std::any_of(holes.begin(), holes.end(), [&](const Ring& r) { return crosses(r, a, b); }))
            continue;
          shortest = length;
          best_hole = h;
          from = i;
          to = j;
        }
    if (!std::isfinite(shortest))
      throw std::runtime_error("a hole of a polygon lies outside it or crosses it");
    Ring hole = std::move(holes[best_hole]);
    holes.erase(holes.begin() + static_cast<std::ptrdiff_t>(best_hole));
    std::rotate(hole.begin(), hole.begin() + static_cast<std::ptrdiff_t>(to), hole.end());
    hole.push_back(hole.front());
    hole.push_back(ring_[from]);
    ring_.insert(ring_.begin() + static_cast<std::ptrdiff_t>(from) + 1, hole.begin(), hole.end());
  }

  // How well shaped the triangle at corner i is (height over longest side), 0 if it is no ear.
  double ear(std::size_t i) const {
    const std::size_t n = ring_.size();
    const Point &a = points_[ring_[(i + n - 1) % n]], &b = points_[ring_[i]],
                &c = points_[ring_[(i + 1) % n]];
    const double area = turn(a, b, c);
    const Point ab = b - a, bc = c - b, ca = a - c;
    const double longest = std::max({glm::dot(ab, ab), glm::dot(bc, bc), glm::dot(ca, ca)});
    if (area <= 1e-9 * longest) return 0.0;
    for (const std::uint32_t other : ring_) {
      const Point& p = points_[other];
      if (p != a && p != b && p != c && inside_or_on(p, a, b, c)) return 0.0;
    }
    return area / longest;
  }

  std::vector<Point> points_;
  Ring ring_;
};

}  // namespace

Polygon arc(const glm::vec2& centre, float radius, float from, float to, int steps) {
  Polygon points;
  for (int i = 0; i <= steps; ++i) {
    const float angle = from + (to - from) * static_cast<float>(i) / static_cast<float>(steps);
    points.push_back(centre + radius * glm::vec2(std::cos(angle), std::sin(angle)));
  }
  return points;
}

Polygon circle(const glm::vec2& centre, float radius, int corners) {
  Polygon points = arc(centre, radius, 0.0f, 2.0f * std::numbers::pi_v<float>, corners);
  points.pop_back();
  return points;
}

Polygon rectangle(const glm::vec2& lower, const glm::vec2& upper) {
  return {lower, {upper.x, lower.y}, upper, {lower.x, upper.y}};
}

Polygon arched_opening(float x, float width, float sill, float springing, int steps) {
  Polygon points = arc({x, springing}, 0.5f * width, 0.0f, std::numbers::pi_v<float>, steps);
  points.emplace_back(x - 0.5f * width, sill);
  points.emplace_back(x + 0.5f * width, sill);
  return points;
}

Polygon superellipse(float a, float b, float n, int corners) {
  Polygon points;
  for (const glm::vec2& p : circle({0.0f, 0.0f}, 1.0f, corners)) {
    const float r = std::pow(std::pow(std::abs(p.x), n) + std::pow(std::abs(p.y), n), -1.0f / n);
    points.emplace_back(a * r * p.x, b * r * p.y);
  }
  return points;
}

Polygon inset(const Polygon& polygon, float distance) {
  Polygon moved;
  const std::size_t n = polygon.size();
  for (std::size_t i = 0; i < n; ++i) {
    const glm::vec2 in = glm::normalize(polygon[i] - polygon[(i + n - 1) % n]);
    const glm::vec2 out = glm::normalize(polygon[(i + 1) % n] - polygon[i]);
    const glm::vec2 left = glm::vec2(-in.y, in.x) + glm::vec2(-out.y, out.x);
    moved.push_back(polygon[i] + left * (2.0f * distance / glm::dot(left, left)));
  }
  return moved;
}

double doubled_area(const Polygon& polygon) {
  double area = 0.0;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Point a(polygon[i]), b(polygon[(i + 1) % polygon.size()]);
    area += a.x * b.y - b.x * a.y;
  }
  return area;
}

std::vector<glm::uvec3> triangulate(const Polygon& outline, std::span<const Polygon> holes) {
  return EarClipper(outline, holes).clip();
}

}  // namespace icbench
