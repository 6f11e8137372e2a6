// Polygons cut into triangles: hard ones are covered exactly, in any plane.
#include <gtest/gtest.h>

#include <cmath>
#include <glm/ext/vector_double3.hpp>
#include <glm/ext/vector_uint3.hpp>
#include <glm/geometric.hpp>
#include <numbers>
#include <random>
#include <vector>

#include "scene/import_polygon.h"

namespace icbench {
namespace {

// Area by triangles, or a negative number if one runs the wrong way.
double covered(const std::vector<glm::dvec3>& corners) {
  double sum = 0.0;
  for (const glm::uvec3& t : importing::triangulate(corners)) {
    const double a = 0.5 * glm::cross(corners[t.y] - corners[t.x], corners[t.z] - corners[t.x]).z;
    if (a < -1e-9) return -1.0;
    sum += a;
  }
  return sum;
}

TEST(Triangulate, CoversHardPolygonsExactly) {
  std::vector<glm::dvec3> comb;  // 20 teeth
  for (int i = 0; i < 20; ++i) comb.insert(comb.end(), {{2.0 * i, 0, 0}, {2.0 * i + 1, 5, 0}});
  comb.insert(comb.end(), {{40, 0, 0}, {40, -1, 0}, {0, -1, 0}});
  std::reverse(comb.begin(), comb.end());
  EXPECT_NEAR(covered(comb), 40.0 + 100.0, 1e-9);
  std::vector<glm::dvec3> spiral;
  for (int i = 0; i <= 200; ++i) {
    const double a = 0.1 * i;
    spiral.emplace_back((1 + a) * std::cos(a), (1 + a) * std::sin(a), 0);
  }
  for (int i = 200; i >= 0; --i) {
    const double a = 0.1 * i;
    spiral.emplace_back((2 + a) * std::cos(a), (2 + a) * std::sin(a), 0);
  }
  double twice = 0.0;
  for (std::size_t i = 0; i < spiral.size(); ++i)
    twice += glm::cross(spiral[i], spiral[(i + 1) % spiral.size()]).z;
  std::reverse(spiral.begin(), spiral.end());
  EXPECT_NEAR(covered(spiral), 0.5 * std::abs(twice), 1e-6);
  // Points on the edges, and a point twice.
  EXPECT_NEAR(
      covered({{0, 0, 0}, {1, 0, 0}, {1, 0, 0}, {2, 0, 0}, {2, 2, 0}, {1, 2, 0}, {0, 2, 0}, {0, 1, 0}}), 4.0,
      1e-9);
  // Corners twice, in the way of others.
  EXPECT_NEAR(covered({{1, 1, 0}, {1, 1, 0}, {1, 2, 0}, {2, 1, 0}, {2, 1, 0}, {2, 3, 0}, {0, 3, 0}}), 2.5,
              1e-9);
  // Two holes by two seams from one corner.
  EXPECT_NEAR(covered({{0, 0, 0},
                       {9, 0, 0},
                       {9, 9, 0},
                       {0, 9, 0},
                       {0, 0, 0},
                       {1, 2, 0},
                       {1, 4, 0},
                       {3, 4, 0},
                       {3, 2, 0},
                       {1, 2, 0},
                       {0, 0, 0},
                       {5, 2, 0},
                       {5, 4, 0},
                       {8, 4, 0},
                       {8, 2, 0},
                       {5, 2, 0}}),
              81.0 - 4.0 - 6.0, 1e-9);
  EXPECT_TRUE(importing::triangulate(std::vector<glm::dvec3>{{0, 0, 0}, {1, 1, 1}, {2, 2, 2}}).empty());
}

// As many corners as are read: what is tried for every ear has to be remembered.
TEST(Triangulate, CoversPolygonsOfManyCorners) {
  constexpr int kTeeth = static_cast<int>(importing::kMaxCorners) / 2 - 2;
  std::vector<glm::dvec3> comb;  // its teeth see all of each other's tips
  for (int i = 0; i < kTeeth; ++i) comb.insert(comb.end(), {{2.0 * i, 0, 0}, {2.0 * i + 1, 5.0 + i % 7, 0}});
  comb.insert(comb.end(), {{2.0 * kTeeth, 0, 0}, {2.0 * kTeeth, -1, 0}, {0, -1, 0}});
  std::reverse(comb.begin(), comb.end());
  double area = 2.0 * kTeeth;
  for (int i = 0; i < kTeeth; ++i) area += 5.0 + i % 7;
  EXPECT_NEAR(covered(comb), area, 1e-6);

  constexpr int kTurns = static_cast<int>(importing::kMaxCorners) / 2;
  std::vector<glm::dvec3> spiral;
  const auto add = [&](int i, double r) {
    spiral.emplace_back(r * std::cos(0.02 * i), r * std::sin(0.02 * i), 0);
  };
  for (int i = 0; i < kTurns; ++i) add(i, 1 + 0.02 * i);
  for (int i = kTurns; i-- > 0;) add(i, 1.5 + 0.02 * i);
  std::reverse(spiral.begin(), spiral.end());
  double twice = 0.0;
  for (std::size_t i = 0; i < spiral.size(); ++i)
    twice += glm::cross(spiral[i], spiral[(i + 1) % spiral.size()]).z;
  EXPECT_NEAR(covered(spiral), 0.5 * std::abs(twice), 1e-4);
}

TEST(Triangulate, CoversStarsInAnyPlaneExactly) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(0.1, 1.0);
  for (int trial = 0; trial < 200; ++trial) {
    const int n = 3 + trial;
    const glm::dvec3 u = glm::normalize(glm::dvec3(uniform(random), uniform(random), -uniform(random)));
    const glm::dvec3 w =
        glm::normalize(glm::cross(u, glm::dvec3(uniform(random), -uniform(random), uniform(random))));
    const glm::dvec3 v = glm::cross(w, u);
    std::vector<glm::dvec3> star;
    glm::dvec3 twice(0.0), sum(0.0);
    for (int i = 0; i < n; ++i) {
      const double a = 2.0 * std::numbers::pi * i / n, r = uniform(random);
      star.push_back(r * std::cos(a) * u + r * std::sin(a) * v + glm::dvec3(1e3));
    }
    for (int i = 0; i < n; ++i)
      twice += glm::cross(star[static_cast<std::size_t>(i)] - star[0],
                          star[static_cast<std::size_t>((i + 1) % n)] - star[0]);
    double all = 0.0;
    for (const glm::uvec3& t : importing::triangulate(star)) {
      const glm::dvec3 a = 0.5 * glm::cross(star[t.y] - star[t.x], star[t.z] - star[t.x]);
      sum += a;
      all += glm::length(a);
    }
    EXPECT_NEAR(glm::length(sum), 0.5 * glm::length(twice), 1e-9);
    EXPECT_NEAR(all, glm::length(sum), 1e-9) << "triangles overlap in a star of " << n;
  }
}

}  // namespace
}  // namespace icbench
