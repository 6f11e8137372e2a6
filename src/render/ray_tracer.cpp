#include "render/ray_tracer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <stdexcept>
#include <utility>

#include "render/embree.h"
#include "render/inner_spheres.h"
#include "render/occluders.h"
#include "scene/shapes.h"

namespace icbench {

struct RayTracer::Embree {
  static constexpr std::size_t kManyMoving = 32;  // more shapes than this are found sooner by their BVH
  static constexpr float kLeast = 1e-30f;         // of a direction: less counts as this

  RTCDevice device = nullptr;
  RTCScene still = nullptr;                 // all meshes that do not move; as an instance it would be slower
  RTCScene moving = nullptr;                // instances of those that do; null if none does
  std::vector<RTCScene> shapes;             // by mesh: of those that move and are no instances; else null
  std::vector<std::vector<Sphere>> inside;  // by mesh: of those shapes that do not deform
  std::vector<RTCGeometry> placings;        // by mesh: the instance in `moving` of those that move; else null
  std::vector<Bounds> bounds;               // of each of them in the world, padded; none where they are many
  Occluders occluders;
  bool has_packets = false;  // of 16; Embree makes two halves of them where vectors are shorter, at no gain

  Embree() : device(embree::new_device()) {
    if (!device)
      throw std::runtime_error(
          fmt::format("Embree finds no device (error {})", static_cast<int>(rtcGetDeviceError(nullptr))));
    still = new_scene();
    has_packets = rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED) != 0;
  }
  ~Embree() {
    for (const RTCGeometry placing : placings)
      if (placing) rtcReleaseGeometry(placing);
    for (const RTCScene shape : shapes)
      if (shape) rtcReleaseScene(shape);
    if (moving) rtcReleaseScene(moving);
    rtcReleaseScene(still);
    rtcReleaseDevice(device);
  }
  Embree(const Embree&) = delete;
  Embree& operator=(const Embree&) = delete;

  RTCScene new_scene() const {
    const RTCScene made = rtcNewScene(device);
    rtcSetSceneFlags(made, RTC_SCENE_FLAG_ROBUST);
    rtcSetSceneBuildQuality(made, RTC_BUILD_QUALITY_HIGH);
    return made;
  }

  // Rays meet what stands still first, then, as far as they got, what moves.
  void intersect(RTCRayHit& ray, embree::Query& query) const noexcept {
    embree::intersect1(still, ray, query);
    if (may_meet_moving(ray.ray)) embree::intersect1(moving, ray, query);
  }
  void intersect(const int* valid, RTCRayHit16& rays, embree::Query& query) const noexcept {
    embree::intersect16(valid, still, rays, query);
    if (moving) embree::intersect16(valid, moving, rays, query);
  }
  // Whether anything lies on the ray: its tfar is below 0 then. Such rays are not traced any farther.
  void occlude(RTCRay& ray, embree::Query& query) const noexcept {
    embree::occluded1(still, ray, query);
    if (!(ray.tfar < 0.0f) && may_meet_moving(ray)) embree::occluded1(moving, ray, query);
  }
  void occlude(const int* valid, RTCRay8& rays, embree::Query& query) const noexcept {
    embree::occluded8(valid, still, rays, query);
    if (moving) embree::occluded8(valid, moving, rays, query);
  }
  void occlude(const int* valid, RTCRay16& rays, embree::Query& query) const noexcept {
    embree::occluded16(valid, still, rays, query);
    if (moving) embree::occluded16(valid, moving, rays, query);
  }

  // Whether a ray comes near the bounds of anything that moves: slabs (Kay and Kajiya 1986). Spares most rays the
  // second BVH. Certain only if it says no.
  bool may_meet_moving(const RTCRay& ray) const noexcept {
    if (bounds.empty()) return moving != nullptr;
    const auto inverse = [](float d) { return 1.0f / (std::fabs(d) > kLeast ? d : kLeast); };
    const glm::vec3 o(ray.org_x, ray.org_y, ray.org_z);
    const glm::vec3 by(inverse(ray.dir_x), inverse(ray.dir_y), inverse(ray.dir_z));
    for (const Bounds& box : bounds) {
      const glm::vec3 a = (box.lower - o) * by, b = (box.upper - o) * by;
      const glm::vec3 in = glm::min(a, b), out = glm::max(a, b);
      // Wider by some roundings of either, which for an origin far away are more than the padding.
      if (std::max({in.x, in.y, in.z, 0.0f}) <= std::min({out.x, out.y, out.z, ray.tfar}) * (1.0f + 0x1p-20f))
        return true;
    }
    return false;
  }

  void check(const Scene& described) const {
    if (const RTCError error = rtcGetDeviceError(device); error != RTC_ERROR_NONE)
      throw std::runtime_error(fmt::format("Embree cannot build the BVH of scene '{}' (error {})",
                                           described.name, static_cast<int>(error)));
  }
};

namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr std::size_t kPacket = 16;
constexpr std::size_t kFew = 5;  // fewer rays than this go faster one by one than in a packet

template <class T>
void copy_to_buffer(RTCGeometry geometry, RTCBufferType type, RTCFormat format, const std::vector<T>& from) {
  void* to = rtcSetNewGeometryBuffer(geometry, type, 0, format, sizeof(T), from.size());
  if (!to)
    throw std::runtime_error(fmt::format("Embree has no memory for {} vertices or triangles", from.size()));
  std::copy(from.begin(), from.end(), static_cast<T*>(to));
}

void set_pose(RTCGeometry instance, const Pose& pose) {
  const float columns[12] = {pose.linear[0].x, pose.linear[0].y, pose.linear[0].z, pose.linear[1].x,
                             pose.linear[1].y, pose.linear[1].z, pose.linear[2].x, pose.linear[2].y,
                             pose.linear[2].z, pose.shift.x,     pose.shift.y,     pose.shift.z};
  rtcSetGeometryTransform(instance, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, columns);
  embree::commit(instance);
}

// Gives the mesh of a shape's scene other vertices, and commits both and the instance.
void refit(RTCScene shape, RTCGeometry instance, std::uint32_t id, const std::vector<glm::vec3>& positions) {
  const RTCGeometry geometry = rtcGetGeometry(shape, id);
  std::copy(positions.begin(), positions.end(),
            static_cast<glm::vec3*>(rtcGetGeometryBufferData(geometry, RTC_BUFFER_TYPE_VERTEX, 0)));
  rtcUpdateGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0);
  embree::commit(geometry);
  embree::commit(shape);
  embree::commit(instance);
}

void set_ray(RTCRay& to, const Ray& ray) noexcept {
  to.org_x = ray.o.x;
  to.org_y = ray.o.y;
  to.org_z = ray.o.z;
  to.tnear = 0.0f;
  to.dir_x = ray.d.x;
  to.dir_y = ray.d.y;
  to.dir_z = ray.d.z;
  to.time = 0.0f;
  to.tfar = ray.t_max;
  to.mask = ~0u;
  to.id = 0;
  to.flags = 0;
}

template <class Packet>
void set_ray(Packet& to, std::size_t i, const Ray& ray) noexcept {
  to.org_x[i] = ray.o.x;
  to.org_y[i] = ray.o.y;
  to.org_z[i] = ray.o.z;
  to.tnear[i] = 0.0f;
  to.dir_x[i] = ray.d.x;
  to.dir_y[i] = ray.d.y;
  to.dir_z[i] = ray.d.z;
  to.time[i] = 0.0f;
  to.tfar[i] = ray.t_max;
  to.mask[i] = ~0u;
  to.id[i] = 0;
  to.flags[i] = 0;
}

// Bounds of a box as it stands, larger by `pad` on every side, and by the rounding of its own coordinates.
Bounds in_world(const PosedBox& posed, float pad) noexcept {
  const glm::mat3& m = posed.pose.linear;
  const glm::vec3 centre = posed.pose(0.5f * (posed.box.lower + posed.box.upper));
  const glm::mat3 stretch(glm::abs(m[0]), glm::abs(m[1]), glm::abs(m[2]));
  const glm::vec3 half =
      stretch * (0.5f * (posed.box.upper - posed.box.lower) + own_padding(posed.box)) + pad;
  return {centre - half, centre + half};
}

// Geometries and instances have the index of their mesh.
std::uint32_t mesh_of(std::uint32_t instance, std::uint32_t geometry) noexcept {
  return instance == RTC_INVALID_GEOMETRY_ID ? geometry : instance;
}

void set_missed(Hit& hit) noexcept {
  hit.t = kInfinity;
  hit.material = kMiss;
  hit.mesh = kMiss;
  hit.front = false;
}

}  // namespace

RayTracer::RayTracer(Scene scene) : scene_(std::move(scene)) {
  prepare(scene_);
  epsilon_ = scene_epsilon(reach_of(scene_.bounds));
  if (scene_.camera_path) scene_.camera = scene_.camera_path(frame_);
  const auto count = static_cast<std::uint32_t>(scene_.meshes.size());
  placed_.resize(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    const Mesh &mesh = scene_.meshes[i], &shape = scene_.shape(i);
    meshes_.push_back({shape.positions.data(), shape.normals.empty() ? nullptr : shape.normals.data(),
                       shape.uvs.empty() ? nullptr : shape.uvs.data(), shape.triangles.data(),
                       mesh.pose ? &placed_[i] : nullptr, mesh.material});
    if (!shape.positions.empty()) placed_[i].box = bounds_of(shape);
    if (mesh.pose) place(i, mesh.pose(frame_));
  }
  build_scene();
}

RayTracer::~RayTracer() = default;

void RayTracer::place(std::uint32_t mesh, const Pose& pose) {
  placed_[mesh].pose = pose;
  // Cofactors: the inverse transposed, up to the determinant, which is positive.
  const glm::mat3& m = pose.linear;
  placed_[mesh].normals = {glm::cross(m[1], m[2]), glm::cross(m[2], m[0]), glm::cross(m[0], m[1])};
}

// Attaches the triangles of a mesh to a scene, under the mesh's index.
void RayTracer::attach_shape(std::uint32_t i) {
  const Mesh& mesh = scene_.meshes[i];
  if (mesh.triangles.empty()) return;
  RTCScene to = embree_->still;
  if (mesh.moves()) to = embree_->shapes[i] = embree_->new_scene();
  const RTCGeometry geometry = rtcNewGeometry(embree_->device, RTC_GEOMETRY_TYPE_TRIANGLE);
  if (mesh.deform) {
    rtcSetSceneFlags(to, RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_DYNAMIC);
    rtcSetGeometryBuildQuality(geometry, RTC_BUILD_QUALITY_REFIT);
  }
  copy_to_buffer(geometry, RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT3, mesh.positions);
  copy_to_buffer(geometry, RTC_BUFFER_TYPE_INDEX, RTC_FORMAT_UINT3, mesh.triangles);
  embree::commit(geometry);
  rtcAttachGeometryByID(to, geometry, i);
  rtcReleaseGeometry(geometry);
  if (mesh.moves()) embree::commit(to);
  embree_->check(scene_);  // before anything is asked of it
  if (mesh.pose) embree_->inside[i] = inner_spheres(to, mesh);
}

void RayTracer::build_scene() {
  embree_ = std::make_unique<Embree>();
  const auto count = static_cast<std::uint32_t>(scene_.meshes.size());
  embree_->shapes.resize(count);
  embree_->inside.resize(count);
  embree_->placings.resize(count);
  if (scene_.moves()) embree_->moving = embree_->new_scene();
  for (std::uint32_t i = 0; i < count; ++i) attach_shape(i);

  for (std::uint32_t i = 0; i < count; ++i) {
    const Mesh& mesh = scene_.meshes[i];
    const RTCScene shape = embree_->shapes[mesh.instance_of == kOwnShape ? i : mesh.instance_of];
    if (!shape) continue;
    const RTCGeometry instance = rtcNewGeometry(embree_->device, RTC_GEOMETRY_TYPE_INSTANCE);
    rtcSetGeometryInstancedScene(instance, shape);
    set_pose(instance, placed_[i].pose);
    rtcAttachGeometryByID(embree_->moving, instance, i);
    embree_->placings[i] = instance;
  }
  embree::commit(embree_->still);
  if (embree_->moving) embree::commit(embree_->moving);
  embree_->check(scene_);
  place_occluders();
}

void RayTracer::place_occluders() {
  Occluders& all = embree_->occluders;
  all.clear();
  all.add_still(embree_->still);
  embree_->bounds.clear();
  for (std::uint32_t i = 0; i < scene_.meshes.size(); ++i) {
    if (!embree_->placings[i]) continue;
    embree_->bounds.push_back(in_world({placed_[i].box, placed_[i].pose}, epsilon_));
    const std::uint32_t shape = scene_.meshes[i].instance_of == kOwnShape ? i : scene_.meshes[i].instance_of;
    all.add_moving(embree_->shapes[shape], {placed_[i].box, placed_[i].pose}, epsilon_,
                   embree_->inside[shape]);
  }
  if (embree_->bounds.size() > Embree::kManyMoving) embree_->bounds.clear();
}

std::vector<PosedBox> RayTracer::moving() const {
  std::vector<PosedBox> out;
  for (std::uint32_t i = 0; i < scene_.meshes.size(); ++i)
    if (embree_->placings[i]) out.push_back({placed_[i].box, placed_[i].pose});
  return out;
}

SceneChange RayTracer::go_to(float frame) {
  frame_ = std::fmod(frame, static_cast<float>(scene_.frames));
  SceneChange change;
  bool lamp_moved = false;
  for (std::uint32_t i = 0; i < scene_.meshes.size(); ++i) {
    Mesh& mesh = scene_.meshes[i];
    const PosedBox before{placed_[i].box, placed_[i].pose};
    if (mesh.pose) {
      const Pose pose = mesh.pose(frame_);
      if (pose == before.pose) continue;
      place(i, pose);
      if (embree_->placings[i]) set_pose(embree_->placings[i], pose);
    } else if (mesh.deform && !mesh.positions.empty()) {
      const std::vector<glm::vec3> positions = mesh.positions, normals = mesh.normals;
      mesh.deform(frame_, mesh.positions, mesh.normals);
      if (positions == mesh.positions && normals == mesh.normals) continue;
      placed_[i].box = bounds_of(mesh);
      if (embree_->placings[i]) refit(embree_->shapes[i], embree_->placings[i], i, mesh.positions);
    } else {
      continue;
    }
    change.moved.push_back({i, before, {placed_[i].box, placed_[i].pose}});
    lamp_moved |= scene_.materials[mesh.material].emits();
  }
  if (!change.moved.empty()) {
    embree::commit(embree_->moving);
    place_occluders();
  }
  embree_->check(scene_);

  if (scene_.camera_path) {
    const Camera camera = scene_.camera_path(frame_);
    change.camera = camera != scene_.camera;
    scene_.camera = camera;
  }
  if (scene_.change_light) {
    const std::vector<Material> materials = scene_.materials;
    const std::vector<PointLight> lights = scene_.point_lights;
    scene_.change_light(frame_, scene_.materials, scene_.point_lights);
    change.materials = scene_.materials != materials;
    change.lights = scene_.point_lights != lights;
    for (std::size_t i = 0; i < materials.size(); ++i)
      change.lights |= materials[i].emission != scene_.materials[i].emission;
  }
  change.lights |= lamp_moved;
  if (change.lights) scene_.lights = LightTable(scene_, frame_);
  return change;
}

void RayTracer::fill(Hit& hit, std::uint32_t mesh, std::uint32_t triangle, float u, float v,
                     const glm::vec3& d, float t) const noexcept {
  const MeshView& m = meshes_[mesh];
  const glm::uvec3 i = m.triangles[triangle];
  glm::vec3 p0 = m.positions[i.x], p1 = m.positions[i.y], p2 = m.positions[i.z];
  if (m.placed) {
    const Pose& pose = m.placed->pose;
    p0 = pose(p0);
    p1 = pose(p1);
    p2 = pose(p2);
  }
  const glm::vec3 e1 = p1 - p0, e2 = p2 - p0;
  const glm::vec3 cross = glm::cross(e1, e2);
  const bool front = glm::dot(cross, d) < 0.0f;
  // A deforming mesh may have triangles without area for a while; nothing sensible is asked of their normals.
  const float scale =
      (front ? 1.0f : -1.0f) / std::sqrt(std::max(glm::dot(cross, cross), std::numeric_limits<float>::min()));
  hit.p = p0 + u * e1 + v * e2;
  hit.ng = scale * cross;
  hit.n = hit.ng;
  if (m.normals) {
    glm::vec3 n = (1.0f - u - v) * m.normals[i.x] + u * m.normals[i.y] + v * m.normals[i.z];
    float squared = glm::dot(n, n);
    // Opposite vertex normals may cancel; the geometric normal then has to do.
    if (squared > 1e-6f) {
      if (m.placed) {
        n = m.placed->normals * (n / std::sqrt(squared));
        squared = glm::dot(n, n);
      }
      hit.n = (glm::dot(n, hit.ng) < 0.0f ? -1.0f : 1.0f) / std::sqrt(squared) * n;
    }
  }
  if (m.uvs) hit.uv = (1.0f - u - v) * m.uvs[i.x] + u * m.uvs[i.y] + v * m.uvs[i.z];
  hit.t = t;
  hit.material = m.material;
  hit.mesh = mesh;
  hit.front = front;
}

void RayTracer::intersect(std::span<const Ray> rays, std::span<Hit> out) const noexcept {
  for (std::size_t first = 0; first < rays.size(); first += kPacket) {
    const std::size_t count = std::min(kPacket, rays.size() - first);
    if (count < kFew || !embree_->has_packets)
      intersect_singly(rays.subspan(first, count), out.subspan(first, count));
    else
      intersect_packet(rays.subspan(first, count), out.subspan(first, count));
  }
}

void RayTracer::intersect_singly(std::span<const Ray> rays, std::span<Hit> out) const noexcept {
  embree::Query query;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    RTCRayHit r;
    set_ray(r.ray, rays[i]);
    r.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    r.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    embree_->intersect(r, query);
    if (r.hit.geomID == RTC_INVALID_GEOMETRY_ID)
      set_missed(out[i]);
    else
      fill(out[i], mesh_of(r.hit.instID[0], r.hit.geomID), r.hit.primID, r.hit.u, r.hit.v, rays[i].d,
           r.ray.tfar);
  }
}

void RayTracer::intersect_packet(std::span<const Ray> rays, std::span<Hit> out) const noexcept {
  embree::Query query;
  RTCRayHit16 packet;
  alignas(64) int valid[kPacket] = {};
  for (std::size_t i = 0; i < kPacket; ++i) {
    set_ray(packet.ray, i, rays[std::min(i, rays.size() - 1)]);
    valid[i] = i < rays.size() ? -1 : 0;
    packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
    packet.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
  }
  embree_->intersect(valid, packet, query);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (packet.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID)
      set_missed(out[i]);
    else
      fill(out[i], mesh_of(packet.hit.instID[0][i], packet.hit.geomID[i]), packet.hit.primID[i],
           packet.hit.u[i], packet.hit.v[i], rays[i].d, packet.ray.tfar[i]);
  }
}

void RayTracer::occluded(std::span<const Ray> rays, std::span<bool> out) const noexcept {
  embree::Query query;
  for (std::size_t first = 0; first < rays.size(); first += kPacket) {
    const std::size_t count = std::min(kPacket, rays.size() - first);
    if (count < kFew) {
      for (std::size_t i = first; i < rays.size(); ++i) {
        RTCRay r;
        set_ray(r, rays[i]);
        embree_->occlude(r, query);
        out[i] = r.tfar < 0.0f;
      }
      return;
    }
    RTCRay16 packet;
    alignas(64) int valid[kPacket] = {};
    for (std::size_t i = 0; i < kPacket; ++i) {
      set_ray(packet, i, rays[first + std::min(i, count - 1)]);
      valid[i] = i < count ? -1 : 0;
    }
    embree_->occlude(valid, packet, query);
    for (std::size_t i = 0; i < count; ++i) out[first + i] = packet.tfar[i] < 0.0f;
  }
}

std::uint64_t RayTracer::bare_trace(std::span<const TracedRay> rays) const noexcept {
  embree::Query query;
  std::uint64_t hits = 0;
  for (const TracedRay& traced : rays) {
    RTCRayHit r;
    set_ray(r.ray, traced.ray);
    if (traced.shadow) {
      embree_->occlude(r.ray, query);
      hits += r.ray.tfar < 0.0f;
    } else {
      r.hit.geomID = RTC_INVALID_GEOMETRY_ID;
      r.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
      embree_->intersect(r, query);
      hits += r.hit.geomID != RTC_INVALID_GEOMETRY_ID;
    }
  }
  return hits;
}

std::uint64_t RayTracer::occluded_from(const glm::vec3& from, const float* x, const float* y, const float* z,
                                       std::uint64_t which, Packing packing, Shapes shapes) const noexcept {
  return embree_->occluders.occluded_from(from, x, y, z, which, packing, shapes);
}

std::uint64_t RayTracer::bare_occluded(std::span<const TracedRay> rays, unsigned packet) const noexcept {
  embree::Query query;
  std::uint64_t hits = 0;
  const auto trace = [&](auto& lanes) {
    alignas(64) int valid[kPacket];
    for (std::size_t first = 0; first < rays.size(); first += packet) {
      const std::size_t count = std::min<std::size_t>(packet, rays.size() - first);
      for (std::size_t i = 0; i < packet; ++i) {
        set_ray(lanes, i, rays[first + std::min(i, count - 1)].ray);
        valid[i] = i < count ? -1 : 0;
      }
      embree_->occlude(valid, lanes, query);
      for (std::size_t i = 0; i < count; ++i) hits += lanes.tfar[i] < 0.0f;
    }
  };
  if (packet == 8) {
    RTCRay8 lanes;
    trace(lanes);
  } else if (packet == kPacket) {
    RTCRay16 lanes;
    trace(lanes);
  }
  return hits;
}

}  // namespace icbench
