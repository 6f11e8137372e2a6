#include "render/occluders.h"

#include <bit>
#include <cmath>
#include <cstring>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <utility>

namespace icbench {
namespace {

constexpr std::uint32_t kPacket = 8, kFan = 64;
constexpr std::uint32_t kOneByOne = 5;  // up to so many lanes in use, Embree traverses them one by one

// Directions of rays that are still under way, and the bit each answers to.
struct Fan {
  std::uint32_t count = 0;
  alignas(64) float x[kFan + kPacket], y[kFan + kPacket],
      z[kFan + kPacket];  // room to read a whole last packet
  alignas(64) std::uint8_t bit[kFan + kPacket];

  void push(float dx, float dy, float dz, std::uint8_t b) noexcept {
    x[count] = dx;
    y[count] = dy;
    z[count] = dz;
    bit[count++] = b;
  }

  // Rays that nobody asks for, up to a whole packet: lanes not in use hold numbers, whatever those are.
  void pad() noexcept {
    for (std::uint32_t l = count; l < count + kPacket; ++l) {
      x[l] = y[l] = z[l] = 1.0f;
      bit[l] = 0;
    }
  }

  // Rays in whole packets.
  std::uint32_t padded() const noexcept { return (count + kPacket - 1) & ~(kPacket - 1); }
};

// The rays of `fan` that are in `keep`.
void select(const Fan& fan, std::uint64_t keep, Fan& out) noexcept {
  out.count = 0;
  for (std::uint32_t i = 0; i < fan.count; ++i)
    if (keep >> fan.bit[i] & 1u) out.push(fan.x[i], fan.y[i], fan.z[i], fan.bit[i]);
  out.pad();
}

// Directions in another space.
void turn(const Fan& fan, const glm::mat3& m, Fan& out) noexcept {
  out.count = fan.count;
  std::memcpy(out.bit, fan.bit, sizeof out.bit);
  for (std::uint32_t i = 0; i < fan.padded(); ++i) {
    out.x[i] = m[0].x * fan.x[i] + m[1].x * fan.y[i] + m[2].x * fan.z[i];
    out.y[i] = m[0].y * fan.x[i] + m[1].y * fan.y[i] + m[2].y * fan.z[i];
    out.z[i] = m[0].z * fan.x[i] + m[1].z * fan.y[i] + m[2].z * fan.z[i];
  }
}

// Bits of the rays whose segment may meet a box: separating axes (Gottschalk et al. 1996), without a division. None
// that meets it is missing; what is told to meet it does meet one that is larger by more than rounding.
std::uint64_t near_box(const Fan& fan, const glm::vec3& from, const glm::vec3& centre,
                       const glm::vec3& half) noexcept {
  const glm::vec3 o = from - centre;
  const float slack = 1e-5f * (half.x + half.y + half.z);  // of the cross products, per |d|
  alignas(64) std::uint32_t meets[kFan + kPacket];
  const std::uint32_t rays = fan.padded();
  for (std::uint32_t i = 0; i < rays; ++i) {
    const float hx = 0.5f * fan.x[i], hy = 0.5f * fan.y[i], hz = 0.5f * fan.z[i];
    const float mx = o.x + hx, my = o.y + hy, mz = o.z + hz;
    const float ax = std::fabs(hx), ay = std::fabs(hy), az = std::fabs(hz);
    const float loose = slack * (ax + ay + az);
    const bool apart = (std::fabs(mx) > half.x + ax) | (std::fabs(my) > half.y + ay) |
                       (std::fabs(mz) > half.z + az) |
                       (std::fabs(my * hz - mz * hy) > half.y * az + half.z * ay + loose) |
                       (std::fabs(mz * hx - mx * hz) > half.x * az + half.z * ax + loose) |
                       (std::fabs(mx * hy - my * hx) > half.x * ay + half.y * ax + loose);
    meets[i] = apart ? 0u : 1u;
  }
  std::uint64_t bits = 0;
  for (std::uint32_t i = 0; i < fan.count; ++i) bits |= std::uint64_t{meets[i]} << fan.bit[i];
  return bits;
}

// Bits of the rays whose segment has an end outside a box and, between its ends, passes the middle of a sphere by less
// than its radius. By no more than rounding some are told that do not, and some are not that do; so spheres are smaller
// here than they might be (add_moving).
std::uint64_t through(const Fan& fan, const glm::vec3& from, std::span<const Sphere> spheres,
                      const glm::vec3& centre, const glm::vec3& half) noexcept {
  alignas(64) float d2[kFan + kPacket];
  alignas(64) std::uint32_t meets[kFan + kPacket] = {}, leaves[kFan + kPacket];
  const std::uint32_t rays = fan.padded();
  const glm::vec3 start = glm::abs(from - centre);
  const std::uint32_t starts_outside = (start.x > half.x) | (start.y > half.y) | (start.z > half.z);
  for (std::uint32_t i = 0; i < rays; ++i) {
    d2[i] = fan.x[i] * fan.x[i] + fan.y[i] * fan.y[i] + fan.z[i] * fan.z[i];
    const glm::vec3 end = from - centre + glm::vec3(fan.x[i], fan.y[i], fan.z[i]);
    leaves[i] = starts_outside |
                static_cast<std::uint32_t>((std::fabs(end.x) > half.x) | (std::fabs(end.y) > half.y) |
                                           (std::fabs(end.z) > half.z));
  }
  for (const Sphere& sphere : spheres) {
    const glm::vec3 c = sphere.centre - from;
    const float r2 = sphere.radius * sphere.radius;
    for (std::uint32_t i = 0; i < rays; ++i) {
      const float along = c.x * fan.x[i] + c.y * fan.y[i] + c.z * fan.z[i];
      const float x = c.y * fan.z[i] - c.z * fan.y[i], y = c.z * fan.x[i] - c.x * fan.z[i],
                  z = c.x * fan.y[i] - c.y * fan.x[i];
      meets[i] |=
          static_cast<std::uint32_t>((along > 0.0f) & (along < d2[i]) & (x * x + y * y + z * z < r2 * d2[i]));
    }
  }
  std::uint64_t bits = 0;
  for (std::uint32_t i = 0; i < fan.count; ++i) bits |= std::uint64_t{meets[i] & leaves[i]} << fan.bit[i];
  return bits;
}

std::uint64_t trace(RTCScene scene, const glm::vec3& from, const Fan& fan, std::uint32_t lanes) noexcept {
  embree::Query query;
  RTCRay8 packet;
  for (std::uint32_t l = 0; l < kPacket; ++l) {
    packet.org_x[l] = from.x;
    packet.org_y[l] = from.y;
    packet.org_z[l] = from.z;
    packet.tnear[l] = 0.0f;
    packet.time[l] = 0.0f;
    packet.mask[l] = ~0u;
    packet.id[l] = 0;
    packet.flags[l] = 0;
  }
  std::uint64_t hit = 0;
  for (std::uint32_t first = 0; first < fan.count; first += lanes) {
    alignas(32) int valid[kPacket];
    for (std::uint32_t l = 0; l < kPacket; ++l) {
      packet.dir_x[l] = fan.x[first + l];
      packet.dir_y[l] = fan.y[first + l];
      packet.dir_z[l] = fan.z[first + l];
      packet.tfar[l] = 1.0f;
      valid[l] = (l < lanes) & (first + l < fan.count) ? -1 : 0;
    }
    embree::occluded8(valid, scene, packet, query);
    for (std::uint32_t l = 0; l < kPacket; ++l)
      hit |= static_cast<std::uint64_t>((valid[l] != 0) & (packet.tfar[l] < 0.0f)) << fan.bit[first + l];
  }
  return hit;
}

}  // namespace

void Occluders::add_moving(RTCScene scene, const PosedBox& at, float pad, std::span<const Sphere> inside) {
  Part part{.scene = scene, .everywhere = false, .posed = at.pose != Pose{}};
  part.to_object = glm::mat3(glm::inverse(glm::dmat3(at.pose.linear)));
  part.shift = at.pose.shift;
  part.centre = 0.5f * (at.box.lower + at.box.upper);
  const glm::mat3& m = part.to_object;
  // A step of that length in the world is this long in the shape's own space, at most.
  const glm::vec3 step = (pad + shift_rounding(at.pose)) * (glm::abs(m[0]) + glm::abs(m[1]) + glm::abs(m[2]));
  part.half = 0.5f * (at.box.upper - at.box.lower) + own_padding(at.box) + step;
  const float shrink = own_padding(at.box) + glm::length(step);
  for (const Sphere& sphere : inside)
    if (sphere.radius > shrink) part.inside.push_back({sphere.centre, sphere.radius - shrink});
  parts_.push_back(std::move(part));
}

std::uint64_t Occluders::occluded_from(const glm::vec3& from, const float* x, const float* y, const float* z,
                                       std::uint64_t which, Packing packing, Shapes shapes) const noexcept {
  const std::uint32_t lanes = packing == Packing::fast ? kPacket : kOneByOne;
  Fan fan;
  for (std::uint64_t rest = which; rest != 0; rest &= rest - 1) {
    const int i = std::countr_zero(rest);
    fan.push(x[i] - from.x, y[i] - from.y, z[i] - from.z, static_cast<std::uint8_t>(i));
  }
  fan.pad();
  Fan turned;  // into a shape's own space
  std::uint64_t hit = 0;
  for (const Part& part : parts_) {
    if (hit == which) break;
    if (shapes != Shapes::all && part.everywhere != (shapes == Shapes::still)) continue;
    if (part.everywhere) {
      hit |= trace(part.scene, from, fan, lanes);
      continue;
    }
    const glm::vec3 o = part.posed ? part.to_object * (from - part.shift) : from;
    if (part.posed) turn(fan, part.to_object, turned);
    const Fan& here = part.posed ? turned : fan;
    std::uint64_t asked = near_box(here, o, part.centre, part.half) & ~hit;
    if (asked == 0) continue;
    Fan some;
    select(here, asked, some);
    if (!part.inside.empty()) {
      const std::uint64_t blocked = through(some, o, part.inside, part.centre, part.half);
      hit |= blocked;
      asked &= ~blocked;
      if (asked == 0) continue;
      if (blocked != 0) select(here, asked, some);
    }
    hit |= trace(part.scene, o, some, lanes);
  }
  return hit;
}

}  // namespace icbench
