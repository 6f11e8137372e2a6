#include "scene/scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <numbers>
#include <span>
#include <stdexcept>
#include <type_traits>

#include "core/random.h"

namespace icbench {
namespace {

// A triangle whose doubled area is below this share of its longest edge squared has no normal in float
// arithmetic.
constexpr double kThinnest = 1e-6;
// One whose doubled area is below this share of reach^2 is half an epsilon wide.
constexpr double kSmallest = 1e-12;
// Embree ends the program where the square of a ray's coordinate leaves float's range, at 1.8e18.
constexpr float kMostCoordinate = 1e15f;
// Most that all point lights may give to a surface an epsilon away, W/m^2: far below float's largest, 3.4e38.
constexpr double kMostIrradiance = 1e30;

[[noreturn]] void fail(const Scene& scene, const std::string& what) {
  throw std::runtime_error(fmt::format("scene '{}': {}", scene.name, what));
}

/// Hashes numbers, one after the other.
class Hash {
 public:
  template <class T>
  void add(const T& value) noexcept {
    if constexpr (std::is_floating_point_v<T>) {
      state_ = mix64(state_ ^ std::bit_cast<std::uint32_t>(value));
    } else if constexpr (requires { value.x; }) {
      for (glm::length_t i = 0; i < value.length(); ++i) add(value[i]);
    } else if constexpr (requires { value.size(); }) {
      add(std::uint64_t{value.size()});
      for (const auto& item : value) add(item);
    } else {
      state_ = mix64(state_ ^ static_cast<std::uint64_t>(value));
    }
  }
  std::uint64_t value() const noexcept { return state_; }

 private:
  std::uint64_t state_ = 0;
};

void check_material(const Scene& scene, std::size_t i) {
  const Material& m = scene.materials[i];
  for (int c = 0; c < 3; ++c) {
    if (!(m.albedo[c] >= 0.0f && m.albedo[c] <= 1.0f))
      fail(scene, fmt::format("material {} has albedo {}; give each channel in [0, 1]", i, m.albedo[c]));
    if (!(m.emission[c] >= 0.0f && std::isfinite(m.emission[c])))
      fail(scene, fmt::format("material {} emits {} W/(m^2 sr); give each channel finite and >= 0", i,
                              m.emission[c]));
  }
  if (m.is_specular() && m.emits())
    fail(scene, fmt::format("material {} is specular and emits; give it one", i));
  if (m.surface == Surface::dielectric && !(m.ior > 0.0f && m.ior <= 10.0f && m.ior != 1.0f))
    fail(scene,
         fmt::format("material {} has index of refraction {}; give one in (0, 10] that is not 1", i, m.ior));
  if (m.texture != kNoTexture && m.texture >= scene.textures.size())
    fail(scene, fmt::format("material {} names texture {} of {}", i, m.texture, scene.textures.size()));
}

void check_texture(const Scene& scene, const Texture& t) {
  if (t.width <= 0 || t.height <= 0 ||
      t.texels.size() != 3 * static_cast<std::size_t>(t.width) * static_cast<std::size_t>(t.height))
    fail(scene, fmt::format("texture '{}' has {} bytes for {} x {} texels of 3", t.name, t.texels.size(),
                            t.width, t.height));
}

void check_place(const Scene& scene, const std::string& what, const glm::vec3& p) {
  for (int c = 0; c < 3; ++c)
    if (!(std::abs(p[c]) <= kMostCoordinate))
      fail(scene, fmt::format("{} has a coordinate of {:.6g} m; give it at most {:.6g} m", what, p[c],
                              kMostCoordinate));
}

void check_point_light(const Scene& scene, std::size_t i) {
  const PointLight& l = scene.point_lights[i];
  if (!is_finite(l.p)) fail(scene, fmt::format("point light {} stands nowhere finite", i));
  check_place(scene, fmt::format("point light {}", i), l.p);
  if (!is_unit(l.axis))
    fail(scene, fmt::format("the axis of point light {} has not length 1; normalise it", i));
  for (int c = 0; c < 3; ++c)
    if (!(l.intensity[c] >= 0.0f && std::isfinite(l.intensity[c])))
      fail(scene, fmt::format("point light {} has intensity {} W/sr; give each channel finite and >= 0", i,
                              l.intensity[c]));
  if (!(l.cos_outer >= -1.0f && l.cos_outer <= l.cos_inner && l.cos_inner <= 1.0f))
    fail(scene, fmt::format("point light {} needs -1 <= cos_outer <= cos_inner <= 1", i));
}

// Whether what `lights` give to surfaces within `bounds`, an epsilon away at least, can be added and reflected in floats.
void check_brightness(const Scene& scene, std::span<const PointLight> lights, const Bounds& bounds,
                      double epsilon) {
  for (std::size_t i = 0; i < lights.size(); ++i) {
    const glm::dvec3 p(lights[i].p);
    const glm::dvec3 nearest = glm::clamp(p, glm::dvec3(bounds.lower), glm::dvec3(bounds.upper));
    const double distance = std::max(glm::distance(p, nearest), epsilon);
    const double most = kMostIrradiance * distance * distance / static_cast<double>(lights.size());
    const double brightest = std::max({lights[i].intensity.x, lights[i].intensity.y, lights[i].intensity.z});
    if (brightest > most)
      fail(scene,
           fmt::format(
               "point light {} has {:.3g} W/sr, too bright so close to the scene; give it at most {:.3g}", i,
               brightest, most));
  }
}

void check_vertices(const Scene& scene, const Mesh& mesh, std::span<const glm::vec3> positions,
                    std::span<const glm::vec3> normals) {
  for (std::size_t v = 0; v < positions.size(); ++v)
    if (!is_finite(positions[v]))
      fail(scene, fmt::format("vertex {} of mesh '{}' is not finite; repair the mesh", v, mesh.name));
  for (std::size_t v = 0; v < normals.size(); ++v)
    if (!is_unit(normals[v]))
      fail(scene, fmt::format("normal {} of mesh '{}' has not length 1; normalise it", v, mesh.name));
}

void check_instance(const Scene& scene, const Mesh& mesh) {
  if (mesh.instance_of >= scene.meshes.size() || scene.meshes[mesh.instance_of].instance_of != kOwnShape)
    fail(scene, fmt::format("mesh '{}' is an instance of mesh {}, which has no shape of its own", mesh.name,
                            mesh.instance_of));
  if (!mesh.pose || !scene.meshes[mesh.instance_of].pose)
    fail(scene, fmt::format("mesh '{}' and the one it is an instance of need a pose each", mesh.name));
  if (!mesh.positions.empty() || !mesh.normals.empty() || !mesh.uvs.empty() || !mesh.triangles.empty())
    fail(scene,
         fmt::format("mesh '{}' is an instance and has vertices; give it one or the other", mesh.name));
}

void check_mesh(const Scene& scene, const Mesh& mesh) {
  if (mesh.material >= scene.materials.size())
    fail(scene,
         fmt::format("mesh '{}' names material {} of {}", mesh.name, mesh.material, scene.materials.size()));
  if (mesh.pose && mesh.deform)
    fail(scene, fmt::format("mesh '{}' moves rigidly and deforms; give it one of the two", mesh.name));
  if (mesh.instance_of != kOwnShape) return check_instance(scene, mesh);
  if (!mesh.normals.empty() && mesh.normals.size() != mesh.positions.size())
    fail(scene, fmt::format("mesh '{}' has {} normals for {} vertices; give one each or none", mesh.name,
                            mesh.normals.size(), mesh.positions.size()));
  if (!mesh.uvs.empty() && mesh.uvs.size() != mesh.positions.size())
    fail(scene, fmt::format("mesh '{}' has {} texture coordinates for {} vertices; give one each or none",
                            mesh.name, mesh.uvs.size(), mesh.positions.size()));
  check_vertices(scene, mesh, mesh.positions, mesh.normals);
  const std::size_t count = mesh.positions.size();
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const glm::uvec3 i = mesh.triangles[t];
    const std::uint32_t largest = std::max({i.x, i.y, i.z});
    if (largest >= count)
      fail(scene, fmt::format("triangle {} of mesh '{}' uses vertex {} of {}", t, mesh.name, largest, count));
  }
}

void check_camera(const Scene& scene, const Camera& c) {
  if (!is_finite(c.eye) || !is_finite(c.target) || !is_finite(c.up)) fail(scene, "the camera is not finite");
  for (const glm::vec3& p : {c.eye, c.target}) check_place(scene, "the camera", p);
  const glm::vec3 view = c.target - c.eye;
  if (!(glm::length(view) > 0.0f)) fail(scene, "the camera's eye and target coincide; move one of them");
  if (!(glm::length(glm::cross(view, c.up)) > 1e-4f * glm::length(view) * glm::length(c.up)))
    fail(scene, "the camera's up vector is parallel to its view direction; choose another");
  if (!(c.fov_y > 0.0f && c.fov_y < std::numbers::pi_v<float>))
    fail(scene, fmt::format("the camera's vertical angle is {} rad; give one in (0, pi)", c.fov_y));
}

// Calls f(frame) for all frames if `animated`, else for the first.
template <class F>
void for_each_frame(const Scene& scene, bool animated, F&& f) {
  for (std::uint32_t frame = 0; frame < (animated ? scene.frames : 1u); ++frame) f(static_cast<float>(frame));
}

constexpr float kFar = std::numeric_limits<float>::max();
constexpr const char* kOnlyDegenerate = "has only degenerate triangles; check its coordinates";

void extend(Bounds& bounds, const glm::vec3& p) {
  bounds.lower = glm::min(bounds.lower, p);
  bounds.upper = glm::max(bounds.upper, p);
}

/// What decides whether a triangle has a surface: twice its area, and the square of its longest side.
struct Extent {
  double area, longest;

  bool is_thin() const noexcept { return !(area > kThinnest * longest); }
};

/// `linear` brings the mesh to the size at which that counts.
Extent extent_of(const Mesh& mesh, const glm::uvec3& t, const glm::dmat3& linear) {
  const glm::dvec3 a(mesh.positions[t.x]), b(mesh.positions[t.y]), c(mesh.positions[t.z]);
  const glm::dvec3 ab = linear * (b - a), ac = linear * (c - a), bc = ac - ab;
  return {glm::length(glm::cross(ab, ac)), std::max({glm::dot(ab, ab), glm::dot(ac, ac), glm::dot(bc, bc)})};
}

/// Whether a triangle is dropped however large the scene is, and so counts for nothing. Where a pose may stretch it,
/// only if two of its corners are one.
bool has_no_surface(const Mesh& mesh, const glm::uvec3& t) {
  if (mesh.deform) return false;
  if (!mesh.pose) return extent_of(mesh, t, glm::dmat3(1.0)).is_thin();
  const std::vector<glm::vec3>& p = mesh.positions;
  return p[t.x] == p[t.y] || p[t.y] == p[t.z] || p[t.z] == p[t.x];
}

Bounds used_bounds(const Mesh& mesh) {
  Bounds bounds{glm::vec3(kFar), glm::vec3(-kFar)};
  for (const glm::uvec3& t : mesh.triangles) {
    if (has_no_surface(mesh, t)) continue;
    for (const std::uint32_t v : {t.x, t.y, t.z}) extend(bounds, mesh.positions[v]);
  }
  return bounds;
}

void check_pose(const Scene& scene, const Mesh& mesh, const Pose& pose, float frame) {
  const bool finite = is_finite(pose.shift) && is_finite(pose.linear[0]) && is_finite(pose.linear[1]) &&
                      is_finite(pose.linear[2]);
  if (!finite || !(glm::determinant(pose.linear) > 0.0f))
    fail(scene, fmt::format("mesh '{}' has a pose at frame {} that is not finite, flattens or mirrors it",
                            mesh.name, frame));
}

// Extends `bounds` by where a mesh is in any frame, and sets `largest` to its pose if it shows its shape larger.
void extend_by_mesh(const Scene& scene, std::size_t i, Bounds& bounds, glm::mat3& largest) {
  const Mesh& mesh = scene.meshes[i];
  const Mesh& shape = scene.shape(i);
  if (shape.triangles.empty()) return;
  if (mesh.deform) {
    Mesh moved = mesh;
    for_each_frame(scene, true, [&](float frame) {
      mesh.deform(frame, moved.positions, moved.normals);
      check_vertices(scene, mesh, moved.positions, moved.normals);
      const Bounds b = used_bounds(moved);
      extend(bounds, b.lower);
      extend(bounds, b.upper);
    });
    return;
  }
  const Bounds rest = used_bounds(shape);
  if (rest.lower.x > rest.upper.x) return;
  if (!mesh.pose) {
    extend(bounds, rest.lower);
    extend(bounds, rest.upper);
    return;
  }
  for_each_frame(scene, true, [&](float frame) {
    const Pose pose = mesh.pose(frame);
    check_pose(scene, mesh, pose, frame);
    if (glm::determinant(pose.linear) > glm::determinant(largest)) largest = pose.linear;
    for (int c = 0; c < 8; ++c) extend(bounds, pose(corner(rest, c)));
  });
}

bool is_degenerate(const Mesh& mesh, const glm::uvec3& t, const glm::dmat3& linear, double reach) {
  const Extent extent = extent_of(mesh, t, linear);
  return extent.is_thin() || !(extent.area > kSmallest * reach * reach);
}

}  // namespace

bool Scene::moves() const noexcept {
  return std::any_of(meshes.begin(), meshes.end(), [](const Mesh& m) { return m.moves(); });
}

bool Scene::is_animated() const noexcept { return moves() || camera_path || change_light; }

bool Scene::has_specular() const noexcept {
  return std::any_of(meshes.begin(), meshes.end(),
                     [&](const Mesh& m) { return materials[m.material].is_specular(); });
}

float reach_of(const Bounds& bounds) noexcept {
  const glm::vec3 far = glm::max(glm::abs(bounds.lower), glm::abs(bounds.upper));
  return std::max({far.x, far.y, far.z});
}

void prepare(Scene& scene) {
  if (scene.frames == 0) fail(scene, "has no frame; give it at least 1");
  for (std::size_t i = 0; i < scene.materials.size(); ++i) check_material(scene, i);
  for (const Texture& texture : scene.textures) check_texture(scene, texture);
  for (std::size_t i = 0; i < scene.point_lights.size(); ++i) check_point_light(scene, i);
  for (const Mesh& mesh : scene.meshes) check_mesh(scene, mesh);
  for_each_frame(scene, static_cast<bool>(scene.camera_path), [&](float frame) {
    check_camera(scene, scene.camera_path ? scene.camera_path(frame) : scene.camera);
  });

  for (Mesh& mesh : scene.meshes)
    if (mesh.deform) mesh.deform(0.0f, mesh.positions, mesh.normals);

  Bounds bounds{glm::vec3(kFar), glm::vec3(-kFar)};
  // By mesh that has a shape: its pose where it is shown largest, by whatever instance.
  std::vector<glm::mat3> largest(scene.meshes.size(), glm::mat3(0.0f));
  for (std::size_t i = 0; i < scene.meshes.size(); ++i) {
    const std::uint32_t shape = scene.meshes[i].instance_of;
    extend_by_mesh(scene, i, bounds, largest[shape == kOwnShape ? i : shape]);
  }
  if (bounds.lower.x > bounds.upper.x) {
    const bool has_triangles = std::any_of(scene.meshes.begin(), scene.meshes.end(),
                                           [](const Mesh& m) { return !m.triangles.empty(); });
    fail(scene, has_triangles ? kOnlyDegenerate : "has no surface; add a mesh with at least one triangle");
  }
  const float reach = reach_of(bounds);
  if (!(reach >= kMinReach && reach <= kMaxReach))
    fail(scene, fmt::format("reaches {} m from the origin; scale it to between {} and {} m", reach, kMinReach,
                            kMaxReach));
  check_brightness(scene, scene.point_lights, bounds, scene_epsilon(reach));
  if (scene.change_light) {
    Scene changed;
    changed.name = scene.name;
    changed.materials = scene.materials;
    changed.point_lights = scene.point_lights;
    changed.textures = scene.textures;
    for_each_frame(scene, true, [&](float frame) {
      scene.change_light(frame, changed.materials, changed.point_lights);
      for (std::size_t i = 0; i < changed.materials.size(); ++i) check_material(changed, i);
      for (std::size_t i = 0; i < changed.point_lights.size(); ++i) check_point_light(changed, i);
      check_brightness(scene, changed.point_lights, bounds, scene_epsilon(reach));
    });
    scene.change_light(0.0f, scene.materials, scene.point_lights);
  }

  std::size_t left = 0;
  for (std::size_t i = 0; i < scene.meshes.size(); ++i) {
    Mesh& mesh = scene.meshes[i];
    if (!mesh.deform) {
      const glm::dmat3 linear(mesh.pose ? largest[i] : glm::mat3(1.0f));
      scene.dropped_triangles += std::erase_if(
          mesh.triangles, [&](const glm::uvec3& t) { return is_degenerate(mesh, t, linear, reach); });
    }
    left += mesh.triangles.size();
  }
  if (left == 0) fail(scene, kOnlyDegenerate);

  const glm::vec3 pad(scene_epsilon(reach));
  scene.bounds = {bounds.lower - pad, bounds.upper + pad};
  scene.lights = LightTable(scene, 0.0f);
}

std::uint64_t light_key(const Scene& scene, std::uint32_t frame) {
  Hash hash;
  const auto add = [&hash](const auto&... values) { (hash.add(values), ...); };
  const auto at = static_cast<float>(frame % scene.frames);
  add(frame, scene.materials.size(), scene.meshes.size(), scene.point_lights.size());
  std::vector<Material> materials = scene.materials;
  std::vector<PointLight> point_lights = scene.point_lights;
  if (scene.change_light) scene.change_light(at, materials, point_lights);
  for (const Material& m : materials) add(m.albedo, m.emission, m.surface, m.ior, m.texture);
  for (const Mesh& m : scene.meshes) {
    std::vector<glm::vec3> positions = m.positions, normals = m.normals;
    if (m.deform) m.deform(at, positions, normals);
    add(positions, normals, m.triangles, m.material, m.uvs, m.moves(), m.instance_of);
    const Pose pose = m.pose ? m.pose(at) : Pose{};
    add(pose.linear[0], pose.linear[1], pose.linear[2], pose.shift);
  }
  for (const PointLight& l : point_lights) add(l.p, l.intensity, l.axis, l.cos_inner, l.cos_outer);
  for (const Texture& t : scene.textures) add(t.width, t.height, t.texels);
  return hash.value();
}

std::uint64_t picture_key(const Scene& scene, std::uint32_t frame) {
  const Camera camera =
      scene.camera_path ? scene.camera_path(static_cast<float>(frame % scene.frames)) : scene.camera;
  Hash hash;
  hash.add(light_key(scene, frame));
  for (const glm::vec3& v : {camera.eye, camera.target, camera.up}) hash.add(v);
  hash.add(camera.fov_y);
  return hash.value();
}

}  // namespace icbench
