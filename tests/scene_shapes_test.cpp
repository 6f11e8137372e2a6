// Shape builders: closed, oriented outward, of the size asked for, with normals that agree with the triangles.
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <numbers>
#include <vector>

#include "scene/motion.h"
#include "scene/shapes.h"
#include "scene_solid.h"

namespace icbench {
namespace {

constexpr double kPi = std::numbers::pi;

void expect_smooth_solid(const Mesh& mesh, double expected_volume, double tolerance) {
  EXPECT_TRUE(is_closed(mesh)) << mesh.name;
  EXPECT_NEAR(volume(mesh), expected_volume, tolerance * expected_volume) << mesh.name;
  ASSERT_EQ(mesh.normals.size(), mesh.positions.size()) << mesh.name;
  for (const glm::vec3& n : mesh.normals) ASSERT_TRUE(is_unit(n)) << mesh.name;
  EXPECT_EQ(share_of_normals_astray(mesh), 0.0) << mesh.name;
}

TEST(SceneShapes, ABallIsASphereWithItsOwnNormals) {
  const Mesh mesh = ball("ball", {3, 4, 5}, 2.0f, 4, 0);
  expect_smooth_solid(mesh, 32.0 / 3.0 * kPi, 0.01);
  for (std::size_t v = 0; v < mesh.positions.size(); ++v)
    EXPECT_LT(glm::distance(mesh.positions[v], glm::vec3(3, 4, 5) + 2.0f * mesh.normals[v]), 1e-5f);
}

TEST(SceneShapes, ARoundedBoxIsABoxLessItsEdges) {
  const Bounds bounds{{-1, 2, 3}, {3, 4, 6}};
  const double a = 4, b = 2, c = 3, r = 0.3;
  // Core, six slabs, twelve quarter cylinders, eight eighths of a ball.
  const double x = a - 2 * r, y = b - 2 * r, z = c - 2 * r;
  const double expected =
      x * y * z + 2 * r * (x * y + y * z + z * x) + kPi * r * r * (x + y + z) + 4.0 / 3.0 * kPi * r * r * r;
  const Mesh mesh = rounded_box("rounded", bounds, 0.3f, 12, 0);
  expect_smooth_solid(mesh, expected, 1e-3);
  EXPECT_LT(glm::distance(bounds_of(mesh).lower, bounds.lower), 1e-6f);
  EXPECT_LT(glm::distance(bounds_of(mesh).upper, bounds.upper), 1e-6f);
}

TEST(SceneShapes, ARodIsACylinder) {
  for (const glm::vec3 end :
       {glm::vec3(0, 2, 0), glm::vec3(0, -2, 0), glm::vec3(2, 0, 0), glm::vec3(1, -1, 1)}) {
    const glm::vec3 start(0.5f, 0.25f, -1.0f);
    const std::vector<glm::vec3> path{start, start + end};
    expect_smooth_solid(tube("rod", path, 0.4f, 64, 0), kPi * 0.16 * glm::length(end), 0.01);
  }
}

TEST(SceneShapes, ATubeFollowsItsPath) {
  std::vector<glm::vec3> path;
  for (int i = 0; i <= 64; ++i) {
    const float phi = 1.5f * std::numbers::pi_v<float> * static_cast<float>(i) / 64.0f;
    path.emplace_back(std::cos(phi), std::sin(phi), 0.2f * phi);
  }
  double length = 0.0;
  for (std::size_t i = 1; i < path.size(); ++i) length += glm::distance(path[i], path[i - 1]);
  expect_smooth_solid(tube("tube", path, 0.1f, 48, 0), kPi * 0.01 * length, 0.01);
}

TEST(SceneShapes, AppendingKeepsBothShapesAndTheirLook) {
  const Bounds unit{glm::vec3(0.0f), glm::vec3(1.0f)};
  for (const bool smooth_first : {false, true}) {
    Mesh flat = box("flat", unit, 7), smooth = ball("smooth", {5, 5, 5}, 1.0f, 3, 8);
    const double both = volume(flat) + volume(smooth);
    Mesh mesh = smooth_first ? smooth : flat;
    append(mesh, smooth_first ? flat : smooth);
    EXPECT_EQ(mesh.material, smooth_first ? 8u : 7u);
    expect_smooth_solid(mesh, both, 1e-6);
    for (const glm::uvec3& t : mesh.triangles) {
      if (mesh.positions[t.x].x > 2.0f) continue;
      EXPECT_EQ(mesh.normals[t.x], mesh.normals[t.y]) << "the box went smooth";
    }
  }
  Mesh flat = box("flat", unit, 0);
  append(flat, box("other", {glm::vec3(2.0f), glm::vec3(3.0f)}, 0));
  EXPECT_TRUE(flat.normals.empty());
  EXPECT_NEAR(volume(flat), 2.0, 1e-6);
  Mesh none{"none", {}, {}, {}, 3};
  append(none, ball("ball", {}, 1.0f, 2, 0));
  EXPECT_TRUE(is_closed(none));
}

TEST(SceneShapes, PlacingByAPoseTurnsNormalsToo) {
  const Pose squash{{{2.0f, 0, 0}, {0, 0.5f, 0}, {0.3f, 0, 1.0f}}, {1, 2, 3}};
  Mesh mesh = ball("ball", {}, 1.0f, 4, 0);
  const double before = volume(mesh);
  place(mesh, squash);
  expect_smooth_solid(mesh, before, 1e-4);
  // On x^2 + y^2 + z^2 = 1 the image's normal follows from the inverse alone.
  const glm::mat3 inverse = glm::inverse(squash.linear);
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    const glm::vec3 on_ball = inverse * (mesh.positions[v] - squash.shift);
    EXPECT_LT(glm::distance(mesh.normals[v], glm::normalize(glm::transpose(inverse) * on_ball)), 1e-5f);
  }
}

TEST(SceneShapes, BothWaysOfPlacingAgree) {
  Mesh by_angle = ball("ball", {1, 2, 3}, 1.0f, 2, 0), by_pose = by_angle;
  place(by_angle, 1.5f, 0.7f, {1, 0, -1});
  place(by_pose, turned(0.7f, {1, 0, -1}, 1.5f));
  for (std::size_t v = 0; v < by_angle.positions.size(); ++v) {
    EXPECT_LT(glm::distance(by_angle.positions[v], by_pose.positions[v]), 1e-5f);
    EXPECT_LT(glm::distance(by_angle.normals[v], by_pose.normals[v]), 1e-5f);
  }
}

}  // namespace
}  // namespace icbench
