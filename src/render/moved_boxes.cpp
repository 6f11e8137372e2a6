#include "render/moved_boxes.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/ext/matrix_double3x3.hpp>
#include <glm/ext/vector_double3.hpp>
#include <glm/matrix.hpp>

namespace icbench {
namespace {

// Share of the largest coordinate of its own that a box is padded by: some hundred times the rounding of a float.
constexpr float kPadShare = 1e-5f;

// Whether a segment given by its middle and its half length misses a box of half extents h around the origin: one of
// the six axes that can part them does (the box's three, and their cross products with the segment's direction).
// Written for whole registers: no branches.
inline bool parted(float cx, float cy, float cz, float dx, float dy, float dz, const glm::vec3& h) noexcept {
  const float ax = std::abs(dx), ay = std::abs(dy), az = std::abs(dz);
  bool is = std::abs(cx) > h.x + ax;
  is |= std::abs(cy) > h.y + ay;
  is |= std::abs(cz) > h.z + az;
  is |= std::abs(cy * dz - cz * dy) > h.y * az + h.z * ay;
  is |= std::abs(cz * dx - cx * dz) > h.z * ax + h.x * az;
  is |= std::abs(cx * dy - cy * dx) > h.x * ay + h.y * ax;
  return is;
}

}  // namespace

MovedBox::MovedBox(const PosedBox& posed, float epsilon) noexcept
    : inverse_(glm::inverse(glm::dmat3(posed.pose.linear))),
      shift_(posed.pose.shift),
      centre_(0.5f * (posed.box.lower + posed.box.upper)) {
  const glm::vec3 reach = glm::max(glm::abs(posed.box.lower), glm::abs(posed.box.upper));
  const float own = kPadShare * std::max({reach.x, reach.y, reach.z});
  for (int axis = 0; axis < 3; ++axis)
    step_[axis] = std::abs(inverse_[0][axis]) + std::abs(inverse_[1][axis]) + std::abs(inverse_[2][axis]);
  // Twice epsilon, for both ends of a ray are set off their surfaces by one.
  half_ = 0.5f * (posed.box.upper - posed.box.lower) + own + 2.0f * epsilon * step_;
}

bool MovedBox::near(const glm::vec3& p, float distance) const noexcept {
  const glm::vec3 limit = half_ + distance * step_;
  return std::abs(p.x) <= limit.x && std::abs(p.y) <= limit.y && std::abs(p.z) <= limit.z;
}

bool MovedBox::meets(const glm::vec3& a, const glm::vec3& b) const noexcept {
  const glm::vec3 c = 0.5f * (a + b), d = 0.5f * (b - a);
  return !parted(c.x, c.y, c.z, d.x, d.y, d.z, half_);
}

void MovedBox::mark(const glm::vec3& a, const PointsView& ends,
                    std::span<std::uint64_t> hits) const noexcept {
  const glm::vec3 h = half_;
  for (std::size_t first = 0; first < ends.count; first += 64) {
    const std::size_t count = std::min<std::size_t>(64, ends.count - first);
    std::uint8_t met[64];
    for (std::size_t i = 0; i < count; ++i) {
      const float x = ends.x[first + i], y = ends.y[first + i], z = ends.z[first + i];
      met[i] = !parted(0.5f * (a.x + x), 0.5f * (a.y + y), 0.5f * (a.z + z), 0.5f * (x - a.x),
                       0.5f * (y - a.y), 0.5f * (z - a.z), h);
    }
    std::uint64_t word = 0;
    for (std::size_t i = 0; i < count; ++i) word |= std::uint64_t{met[i]} << i;
    hits[first / 64] |= word;
  }
}

MovedBoxes::MovedBoxes(const SceneChange& change, float epsilon) {
  for (const MovedMesh& m : change.moved) {
    boxes_.emplace_back(m.before, epsilon);
    boxes_.emplace_back(m.after, epsilon);
  }
}

bool MovedBoxes::meet(const glm::vec3& a, const glm::vec3& b) const noexcept {
  return std::any_of(boxes_.begin(), boxes_.end(),
                     [&](const MovedBox& box) { return box.meets(box.to_box(a), box.to_box(b)); });
}

bool MovedBoxes::near(const glm::vec3& p, float distance) const noexcept {
  return std::any_of(boxes_.begin(), boxes_.end(),
                     [&](const MovedBox& box) { return box.near(box.to_box(p), distance); });
}

SegmentEnds::SegmentEnds(const MovedBoxes& boxes, const PointsView& world)
    : boxes_(boxes.boxes()), count_(world.count), points_(3 * world.count * boxes.boxes().size()) {
  float* to = points_.data();
  for (const MovedBox& box : boxes_) {
    for (std::size_t i = 0; i < count_; ++i) {
      const glm::vec3 p = box.to_box({world.x[i], world.y[i], world.z[i]});
      to[i] = p.x;
      to[count_ + i] = p.y;
      to[2 * count_ + i] = p.z;
    }
    to += 3 * count_;
  }
}

void SegmentEnds::mark(const glm::vec3& from, std::span<std::uint64_t> hits) const noexcept {
  const float* points = points_.data();
  for (const MovedBox& box : boxes_) {
    box.mark(box.to_box(from), {points, points + count_, points + 2 * count_, count_}, hits);
    points += 3 * count_;
  }
}

}  // namespace icbench
