#include "render/ray_tracer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <stdexcept>
#include <utility>

#include "render/embree.h"

namespace icbench {

struct RayTracer::Embree {
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;

  Embree() : device(rtcNewDevice(nullptr)) {
    if (!device)
      throw std::runtime_error(
          fmt::format("Embree finds no device (error {})", static_cast<int>(rtcGetDeviceError(nullptr))));
    scene = rtcNewScene(device);
    rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
    rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
  }
  ~Embree() {
    rtcReleaseScene(scene);
    rtcReleaseDevice(device);
  }
  Embree(const Embree&) = delete;
  Embree& operator=(const Embree&) = delete;
};

// What a hit needs of a mesh, without the vectors' indirections.
struct RayTracer::MeshView {
  const glm::vec3* positions;
  const glm::vec3* normals;  // null for flat shading
  const glm::uvec3* triangles;
  std::uint32_t material;
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

void set_ray(RTCRay16& to, std::size_t i, const Ray& ray) noexcept {
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

void set_missed(Hit& hit) noexcept {
  hit.t = kInfinity;
  hit.material = kMiss;
  hit.front = false;
}

}  // namespace

RayTracer::RayTracer(Scene scene) : scene_(std::move(scene)) {
  prepare(scene_);
  epsilon_ = scene_epsilon(reach_of(scene_.bounds));
  embree_ = std::make_unique<Embree>();
  meshes_ = std::make_unique<MeshView[]>(scene_.meshes.size());
  for (std::uint32_t i = 0; i < scene_.meshes.size(); ++i) {
    const Mesh& mesh = scene_.meshes[i];
    meshes_[i] = {mesh.positions.data(), mesh.normals.empty() ? nullptr : mesh.normals.data(),
                  mesh.triangles.data(), mesh.material};
    if (mesh.triangles.empty()) continue;
    const RTCGeometry geometry = rtcNewGeometry(embree_->device, RTC_GEOMETRY_TYPE_TRIANGLE);
    copy_to_buffer(geometry, RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT3, mesh.positions);
    copy_to_buffer(geometry, RTC_BUFFER_TYPE_INDEX, RTC_FORMAT_UINT3, mesh.triangles);
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(embree_->scene, geometry, i);
    rtcReleaseGeometry(geometry);
  }
  rtcCommitScene(embree_->scene);
  if (const RTCError error = rtcGetDeviceError(embree_->device); error != RTC_ERROR_NONE)
    throw std::runtime_error(fmt::format("Embree cannot build the BVH of scene '{}' (error {})", scene_.name,
                                         static_cast<int>(error)));
}

RayTracer::~RayTracer() = default;

void RayTracer::fill(Hit& hit, std::uint32_t mesh, std::uint32_t triangle, float u, float v,
                     const glm::vec3& d, float t) const noexcept {
  const MeshView& m = meshes_[mesh];
  const glm::uvec3 i = m.triangles[triangle];
  const glm::vec3 p0 = m.positions[i.x], e1 = m.positions[i.y] - p0, e2 = m.positions[i.z] - p0;
  const glm::vec3 cross = glm::cross(e1, e2);
  const bool front = glm::dot(cross, d) < 0.0f;
  const float scale = (front ? 1.0f : -1.0f) / std::sqrt(glm::dot(cross, cross));
  hit.p = p0 + u * e1 + v * e2;
  hit.ng = scale * cross;
  hit.n = hit.ng;
  if (m.normals) {
    const glm::vec3 n = (1.0f - u - v) * m.normals[i.x] + u * m.normals[i.y] + v * m.normals[i.z];
    const float squared = glm::dot(n, n);
    // Opposite vertex normals may cancel; the geometric normal then has to do.
    if (squared > 1e-6f) hit.n = (glm::dot(n, hit.ng) < 0.0f ? -1.0f : 1.0f) / std::sqrt(squared) * n;
  }
  hit.t = t;
  hit.material = m.material;
  hit.front = front;
}

void RayTracer::intersect(std::span<const Ray> rays, std::span<Hit> out) const noexcept {
  for (std::size_t first = 0; first < rays.size(); first += kPacket) {
    const std::size_t count = std::min(kPacket, rays.size() - first);
    if (count < kFew)
      intersect_singly(rays.subspan(first), out.subspan(first));
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
    embree::intersect1(embree_->scene, r, query);
    if (r.hit.geomID == RTC_INVALID_GEOMETRY_ID)
      set_missed(out[i]);
    else
      fill(out[i], r.hit.geomID, r.hit.primID, r.hit.u, r.hit.v, rays[i].d, r.ray.tfar);
  }
}

void RayTracer::intersect_packet(std::span<const Ray> rays, std::span<Hit> out) const noexcept {
  embree::Query query;
  RTCRayHit16 packet;
  alignas(64) int valid[kPacket] = {};
  for (std::size_t i = 0; i < rays.size(); ++i) {
    set_ray(packet.ray, i, rays[i]);
    valid[i] = -1;
    packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
  }
  embree::intersect16(valid, embree_->scene, packet, query);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (packet.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID)
      set_missed(out[i]);
    else
      fill(out[i], packet.hit.geomID[i], packet.hit.primID[i], packet.hit.u[i], packet.hit.v[i], rays[i].d,
           packet.ray.tfar[i]);
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
        embree::occluded1(embree_->scene, r, query);
        out[i] = r.tfar < 0.0f;
      }
      return;
    }
    RTCRay16 packet;
    alignas(64) int valid[kPacket] = {};
    for (std::size_t i = 0; i < count; ++i) {
      set_ray(packet, i, rays[first + i]);
      valid[i] = -1;
    }
    embree::occluded16(valid, embree_->scene, packet, query);
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
      embree::occluded1(embree_->scene, r.ray, query);
      hits += r.ray.tfar < 0.0f;
    } else {
      r.hit.geomID = RTC_INVALID_GEOMETRY_ID;
      embree::intersect1(embree_->scene, r, query);
      hits += r.hit.geomID != RTC_INVALID_GEOMETRY_ID;
    }
  }
  return hits;
}

}  // namespace icbench
