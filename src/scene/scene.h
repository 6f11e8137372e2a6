// A scene: triangle meshes of diffuse materials, the area lights among them, and a pinhole camera.
//
// A scene is described (materials, meshes, camera), then prepared once: prepare() checks it, drops degenerate
// triangles and derives what rendering needs (bounds, lights). RayTracer prepares the scene it is given, so
// only code that uses a scene without tracing has to call prepare itself.
//
// Units: metres, W/(m^2 sr), radians. Surfaces reflect on both sides and emit from the front side only, the
// one from which a triangle's vertices run counter-clockwise.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "core/types.h"
#include "scene/lights.h"

namespace icbench {

/// A diffuse reflector that may emit.
struct Material {
  glm::vec3 albedo{0.0f};    ///< share of the light reflected, RGB in [0, 1]
  glm::vec3 emission{0.0f};  ///< radiance emitted from the front, RGB >= 0, W/(m^2 sr)

  bool emits() const noexcept { return emission.x > 0.0f || emission.y > 0.0f || emission.z > 0.0f; }
};

struct Mesh {
  std::string name;                   ///< for error messages
  std::vector<glm::vec3> positions;   ///< metres
  std::vector<glm::vec3> normals;     ///< unit, one per position; empty for flat shading
  std::vector<glm::uvec3> triangles;  ///< indices into positions
  std::uint32_t material = 0;         ///< index into Scene::materials
};

struct Camera {
  glm::vec3 eye{0.0f, 0.0f, 1.0f};
  glm::vec3 target{0.0f};
  glm::vec3 up{0.0f, 1.0f, 0.0f};  ///< not parallel to the view direction
  float fov_y = 0.7f;              ///< full vertical angle, in (0, pi)
};

struct Scene {
  std::string name;
  std::vector<Material> materials;
  std::vector<Mesh> meshes;
  Camera camera;

  // Derived by prepare().
  Bounds bounds;                      ///< of all surfaces, padded by the scene's epsilon
  LightTable lights;                  ///< every emitting triangle
  std::size_t dropped_triangles = 0;  ///< degenerate ones that prepare() removed

  std::uint32_t add_material(const Material& m) {
    materials.push_back(m);
    return static_cast<std::uint32_t>(materials.size() - 1);
  }
};

/// A scene's largest |coordinate| must lie in this range, metres: inside it no product below leaves float's
/// range.
inline constexpr float kMinReach = 1e-3f;
inline constexpr float kMaxReach = 1e6f;

/// The one length below which geometry is not told apart, as a share of the largest |coordinate|: some fifty
/// times the rounding error of an interpolated hit. Rays start this far off their surface, and bounds are
/// padded by it.
inline constexpr float kEpsilonShare = 1e-5f;

/// The scene's epsilon, metres; `reach` is the largest |coordinate|.
inline float scene_epsilon(float reach) noexcept { return kEpsilonShare * reach; }

/// Largest |coordinate| of a box.
float reach_of(const Bounds& bounds) noexcept;

/// Checks the scene, drops triangles too thin or too small to have a normal (counted), and derives bounds and
/// lights. Idempotent. Throws std::runtime_error with one line if the scene has no surface, a NaN or infinite
/// vertex, an index out of range, an unphysical material, a camera that cannot look, or a size outside
/// [kMinReach, kMaxReach].
void prepare(Scene& scene);

}  // namespace icbench
