// Sculpting: meshes of implicit solids are closed and lie on the surface, all their parts are found, and f is asked for
// near the surface alone.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "scene/implicit_surface.h"
#include "scene_solid.h"

namespace icbench {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr float kCell = 0.05f;
const Bounds kBox{{-2, -1, -1}, {2, 1, 1}};

float ball(const glm::vec3& p, const glm::vec3& centre, float r) { return glm::distance(p, centre) - r; }

TEST(ImplicitSurface, OfABallIsTheSphere) {
  const Mesh mesh = mesh_implicit(
      "ball",
      [](const glm::vec3& p) {
        return ball(p, {0, 0, 0}, 0.9f);
      },
      kBox, kCell, 3);
  EXPECT_EQ(mesh.material, 3u);
  EXPECT_TRUE(is_closed(mesh));
  EXPECT_NEAR(volume(mesh), 4.0 / 3.0 * kPi * std::pow(0.9, 3.0), 0.01);
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    EXPECT_NEAR(glm::length(mesh.positions[i]), 0.9f, 1e-3f);
    EXPECT_GT(glm::dot(mesh.normals[i], glm::normalize(mesh.positions[i])), 0.999f);
  }
}

// Guards against: a part that is not followed because another was found first, and one that has to be looked for.
TEST(ImplicitSurface, HasEveryPartAndHollow) {
  const SolidFunction f = [](const glm::vec3& p) {
    const float shell = std::max(ball(p, {-1, 0, 0}, 0.8f), -ball(p, {-1.03f, 0.01f, 0.02f}, 0.4f));
    return std::min({shell, ball(p, {1.1f, 0.3f, 0.2f}, 0.5f), ball(p, {0.31f, -0.72f, -0.63f}, 0.21f)});
  };
  const Mesh mesh = mesh_implicit("parts", f, kBox, kCell, 0);
  EXPECT_TRUE(is_closed(mesh));
  const auto cube = [](double r) { return r * r * r; };
  EXPECT_NEAR(volume(mesh), 4.0 / 3.0 * kPi * (cube(0.8) - cube(0.4) + cube(0.5) + cube(0.21)), 0.02);
}

TEST(ImplicitSurface, NothingComesOfNothing) {
  EXPECT_TRUE(mesh_implicit(
                  "none", [](const glm::vec3&) { return 1.0f; }, kBox, kCell, 0)
                  .triangles.empty());
}

TEST(ImplicitSurface, IsAskedForNearTheSurfaceAlone) {
  std::size_t asked = 0;
  const SolidFunction f = [&asked](const glm::vec3& p) {
    ++asked;
    return ball(p, {0, 0, 0}, 0.9f);
  };
  const Mesh mesh = mesh_implicit("ball", f, kBox, kCell, 0);
  const glm::vec3 cells = (kBox.upper - kBox.lower) / kCell;
  const auto grid = static_cast<std::size_t>(cells.x * cells.y * cells.z);
  EXPECT_GT(grid, 100'000u);
  EXPECT_LT(asked, 3 * grid / 64 + 12 * mesh.positions.size());
}

}  // namespace
}  // namespace icbench
