#include "scene/scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <stdexcept>

namespace icbench {
namespace {

// A triangle whose doubled area is below this share of its longest edge squared has no normal in float
// arithmetic.
constexpr double kThinnest = 1e-6;
// One whose doubled area is below this share of reach^2 is a tenth of epsilon wide.
constexpr double kSmallest = 1e-12;

[[noreturn]] void fail(const Scene& scene, const std::string& what) {
  throw std::runtime_error(fmt::format("scene '{}': {}", scene.name, what));
}

void check_material(const Scene& scene, std::size_t i) {
  const Material& m = scene.materials[i];
  for (int c = 0; c < 3; ++c) {
    if (!(m.albedo[c] >= 0.0f && m.albedo[c] <= 1.0f))
      fail(scene, fmt::format("material {} has albedo {}; give each channel in [0, 1]", i, m.albedo[c]));
    if (!(m.emission[c] >= 0.0f && std::isfinite(m.emission[c])))
      fail(scene, fmt::format("material {} emits {} W/(m^2 sr); give each channel finite and >= 0", i,
                              m.emission[c]));
  }
}

void check_mesh(const Scene& scene, const Mesh& mesh) {
  if (mesh.material >= scene.materials.size())
    fail(scene,
         fmt::format("mesh '{}' names material {} of {}", mesh.name, mesh.material, scene.materials.size()));
  if (!mesh.normals.empty() && mesh.normals.size() != mesh.positions.size())
    fail(scene, fmt::format("mesh '{}' has {} normals for {} vertices; give one each or none", mesh.name,
                            mesh.normals.size(), mesh.positions.size()));
  for (std::size_t v = 0; v < mesh.positions.size(); ++v)
    if (!is_finite(mesh.positions[v]))
      fail(scene, fmt::format("vertex {} of mesh '{}' is not finite; repair the mesh", v, mesh.name));
  for (std::size_t v = 0; v < mesh.normals.size(); ++v)
    if (!is_unit(mesh.normals[v]))
      fail(scene, fmt::format("normal {} of mesh '{}' has not length 1; normalise it", v, mesh.name));
  const std::size_t count = mesh.positions.size();
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const glm::uvec3 i = mesh.triangles[t];
    const std::uint32_t largest = std::max({i.x, i.y, i.z});
    if (largest >= count)
      fail(scene, fmt::format("triangle {} of mesh '{}' uses vertex {} of {}", t, mesh.name, largest, count));
  }
}

void check_camera(const Scene& scene) {
  const Camera& c = scene.camera;
  if (!is_finite(c.eye) || !is_finite(c.target) || !is_finite(c.up)) fail(scene, "the camera is not finite");
  const glm::vec3 view = c.target - c.eye;
  if (!(glm::length(view) > 0.0f)) fail(scene, "the camera's eye and target coincide; move one of them");
  if (!(glm::length(glm::cross(view, c.up)) > 1e-4f * glm::length(view) * glm::length(c.up)))
    fail(scene, "the camera's up vector is parallel to its view direction; choose another");
  if (!(c.fov_y > 0.0f && c.fov_y < std::numbers::pi_v<float>))
    fail(scene, fmt::format("the camera's vertical angle is {} rad; give one in (0, pi)", c.fov_y));
}

bool is_degenerate(const Mesh& mesh, const glm::uvec3& t, double reach) {
  const glm::dvec3 a(mesh.positions[t.x]), b(mesh.positions[t.y]), c(mesh.positions[t.z]);
  const glm::dvec3 ab = b - a, ac = c - a, bc = c - b;
  const double longest = std::max({glm::dot(ab, ab), glm::dot(ac, ac), glm::dot(bc, bc)});
  return !(glm::length(glm::cross(ab, ac)) > std::max(kThinnest * longest, kSmallest * reach * reach));
}

}  // namespace

float reach_of(const Bounds& bounds) noexcept {
  const glm::vec3 far = glm::max(glm::abs(bounds.lower), glm::abs(bounds.upper));
  return std::max({far.x, far.y, far.z});
}

void prepare(Scene& scene) {
  for (std::size_t i = 0; i < scene.materials.size(); ++i) check_material(scene, i);
  for (const Mesh& mesh : scene.meshes) check_mesh(scene, mesh);
  check_camera(scene);

  constexpr float kFar = std::numeric_limits<float>::max();
  Bounds bounds{glm::vec3(kFar), glm::vec3(-kFar)};
  bool any = false;
  for (const Mesh& mesh : scene.meshes) {
    for (const glm::uvec3& t : mesh.triangles) {
      for (const std::uint32_t v : {t.x, t.y, t.z}) {
        bounds.lower = glm::min(bounds.lower, mesh.positions[v]);
        bounds.upper = glm::max(bounds.upper, mesh.positions[v]);
      }
      any = true;
    }
  }
  if (!any) fail(scene, "has no surface; add a mesh with at least one triangle");
  const float reach = reach_of(bounds);
  if (!(reach >= kMinReach && reach <= kMaxReach))
    fail(scene, fmt::format("reaches {} m from the origin; scale it to between {} and {} m", reach, kMinReach,
                            kMaxReach));

  std::size_t left = 0;
  for (Mesh& mesh : scene.meshes) {
    scene.dropped_triangles +=
        std::erase_if(mesh.triangles, [&](const glm::uvec3& t) { return is_degenerate(mesh, t, reach); });
    left += mesh.triangles.size();
  }
  if (left == 0) fail(scene, "has only degenerate triangles; check its coordinates");

  const glm::vec3 pad(scene_epsilon(reach));
  scene.bounds = {bounds.lower - pad, bounds.upper + pad};
  scene.lights = LightTable(scene);
}

}  // namespace icbench
