// A scene: triangle meshes with their materials and motion, lights and a pinhole camera.
//
// A scene is described (materials, meshes, camera), then prepared once: prepare() checks it, drops degenerate
// triangles and derives what rendering needs (bounds, lights). RayTracer prepares the scene it is given, so only code
// that uses a scene without tracing has to call prepare itself.
//
// Motion is a function of the frame. Frames count from 0 to `frames` - 1 and begin again after that. Nothing
// that stands still costs anything while others move.
//
// Units: metres, W/(m^2 sr), radians. Diffuse surfaces reflect on both sides and emit from the front side
// only, the one from which a triangle's vertices run counter-clockwise.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <glm/mat3x3.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <string>
#include <vector>

#include "core/types.h"
#include "scene/lights.h"
#include "scene/texture.h"

namespace icbench {

enum class Surface : std::uint8_t {
  diffuse,    ///< Lambertian reflector, the only one that irradiance is cached for
  mirror,     ///< perfect mirror on both sides
  dielectric  ///< smooth boundary, as of glass: Fresnel reflection and refraction; its front is outside
};

struct Material {
  /// RGB in [0, 1]: the share of the light that a diffuse surface reflects, by which a mirror reflects, or that is
  /// left of what a dielectric reflects or lets through.
  glm::vec3 albedo{0.0f};
  glm::vec3 emission{0.0f};  ///< radiance emitted from the front, RGB >= 0, W/(m^2 sr); diffuse surfaces only
  Surface surface = Surface::diffuse;
  float ior = 1.5f;  ///< dielectric: index of refraction inside over outside, in (0, 10], not 1
  /// Index into Scene::textures; multiplies the albedo of a diffuse surface.
  std::uint32_t texture = kNoTexture;

  bool emits() const noexcept { return emission.x > 0.0f || emission.y > 0.0f || emission.z > 0.0f; }
  bool is_specular() const noexcept { return surface != Surface::diffuse; }
  bool operator==(const Material&) const = default;
};

/// From object to world: x -> linear * x + shift. `linear` is invertible and does not mirror.
struct Pose {
  glm::mat3 linear{1.0f};
  glm::vec3 shift{0.0f};  ///< metres

  glm::vec3 operator()(const glm::vec3& p) const noexcept { return linear * p + shift; }
  bool operator==(const Pose&) const = default;
};

/// Where a mesh stands at a frame.
using Motion = std::function<Pose(float frame)>;

/// Overwrites a mesh's vertices and normals (as many as there are at rest; no normals if it has none) with those of a
/// frame.
using Deformation =
    std::function<void(float frame, std::span<glm::vec3> positions, std::span<glm::vec3> normals)>;

/// Mesh::instance_of of a mesh with triangles of its own.
inline constexpr std::uint32_t kOwnShape = ~0u;

struct Mesh {
  std::string name;                   ///< for error messages
  std::vector<glm::vec3> positions;   ///< metres; at rest
  std::vector<glm::vec3> normals;     ///< unit, one per position; empty for flat shading
  std::vector<glm::uvec3> triangles;  ///< indices into positions
  std::uint32_t material = 0;         ///< index into Scene::materials
  /// Texture coordinates, one per position; empty unless the material has a texture.
  std::vector<glm::vec2> uvs{};
  Motion pose{};         ///< moves rigidly, or affinely; empty: stands where its positions are
  Deformation deform{};  ///< changes shape; excludes `pose`
  /// Index of the mesh whose shape (positions, normals, uvs and triangles) this one has too, its own being empty: the
  /// two share memory and BVH. The other has a `pose` as well and is no instance itself.
  std::uint32_t instance_of = kOwnShape;

  bool moves() const noexcept { return pose || deform; }
};

struct Camera {
  glm::vec3 eye{0.0f, 0.0f, 1.0f};
  glm::vec3 target{0.0f};
  glm::vec3 up{0.0f, 1.0f, 0.0f};  ///< not parallel to the view direction
  float fov_y = 0.7f;              ///< full vertical angle, in (0, pi)

  bool operator==(const Camera&) const = default;
};

struct Scene {
  std::string name;
  std::vector<Material> materials;
  std::vector<Mesh> meshes;
  Camera camera;
  std::vector<PointLight> point_lights;
  std::vector<Texture> textures;

  std::uint32_t frames = 1;                        ///< of its animation, >= 1
  std::function<Camera(float frame)> camera_path;  ///< empty: `camera` at every frame
  /// Changes materials (albedo and emission, no more) and point lights (not their number) to what they are at a frame;
  /// it is given those of frame 0 or of any other. Empty: they do not change.
  std::function<void(float frame, std::span<Material>, std::span<PointLight>)> change_light;

  // Derived by prepare().
  Bounds bounds{};    ///< of all surfaces in all frames, padded by the scene's epsilon
  LightTable lights;  ///< every emitting triangle, and the point lights, as they are at frame 0
  std::size_t dropped_triangles = 0;  ///< degenerate ones that prepare() removed

  std::uint32_t add_material(const Material& m) {
    materials.push_back(m);
    return static_cast<std::uint32_t>(materials.size() - 1);
  }

  /// The mesh that holds the shape of mesh i: itself or the one it is an instance of.
  const Mesh& shape(std::size_t i) const noexcept {
    return meshes[meshes[i].instance_of == kOwnShape ? i : meshes[i].instance_of];
  }
  bool moves() const noexcept;         ///< whether any mesh does
  bool is_animated() const noexcept;   ///< whether anything at all depends on the frame
  bool has_specular() const noexcept;  ///< whether any mesh is a mirror or a dielectric
};

/// A scene's largest |coordinate| must lie in this range, metres: inside it no product below leaves float's
/// range.
inline constexpr float kMinReach = 1e-3f;
inline constexpr float kMaxReach = 1e6f;

/// The one length below which geometry is not told apart, as a share of the largest |coordinate|: ten times the
/// rounding error of an interpolated hit, and of Embree's intersections (rays first meet the surface they leave at an
/// eighth of it). A fifth of a millimetre in a hall of 100 m. Rays start this far off their surface, and bounds are
/// padded by it.
inline constexpr float kEpsilonShare = 2e-6f;

/// The scene's epsilon, metres; `reach` is the largest |coordinate|.
inline float scene_epsilon(float reach) noexcept { return kEpsilonShare * reach; }

/// Largest |coordinate| of a box.
float reach_of(const Bounds& bounds) noexcept;

/// Checks the scene, drops triangles too thin or too small to have a normal (counted; deforming meshes keep theirs),
/// and derives bounds and lights. Idempotent, but where triangles dropped as too small had widened the bounds. Throws
/// std::runtime_error with one line if the scene has no surface, a NaN or infinite vertex, an index out of range, an
/// unphysical material or light, a camera that cannot look, either of them with a coordinate above 1e15 m, or a size
/// outside [kMinReach, kMaxReach], in any of its frames.
void prepare(Scene& scene);

/// A hash of what the light in a prepared scene depends on at a frame: shapes and where they stand, materials, textures
/// and lights as they are then, and the frame. Neither the camera nor the scene's name.
std::uint64_t light_key(const Scene& scene, std::uint32_t frame);

/// The same with the camera as it looks then: of what a picture depends on.
std::uint64_t picture_key(const Scene& scene, std::uint32_t frame);

}  // namespace icbench
