#include "render/moved_boxes.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <glm/common.hpp>
#include <glm/ext/matrix_double3x3.hpp>
#include <glm/ext/vector_double3.hpp>
#include <glm/matrix.hpp>

namespace icbench {
namespace {

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
  for (int axis = 0; axis < 3; ++axis)
    step_[axis] = std::abs(inverse_[0][axis]) + std::abs(inverse_[1][axis]) + std::abs(inverse_[2][axis]);
  // Twice epsilon, for both ends of a ray are set off their surfaces by one.
  half_ = 0.5f * (posed.box.upper - posed.box.lower) + own_padding(posed.box) +
          (2.0f * epsilon + shift_rounding(posed.pose)) * step_;
}

bool MovedBox::near(const glm::vec3& p, float distance) const noexcept {
  const glm::vec3 limit = half_ + distance * step_;
  return std::abs(p.x) <= limit.x && std::abs(p.y) <= limit.y && std::abs(p.z) <= limit.z;
}

bool MovedBox::meets(const glm::vec3& a, const glm::vec3& b, float distance) const noexcept {
  const glm::vec3 c = 0.5f * (a + b), d = 0.5f * (b - a);
  return !parted(c.x, c.y, c.z, d.x, d.y, d.z, half_ + distance * step_);
}

void MovedBox::mark(const glm::vec3& a, const float* x, const float* y, const float* z,
                    std::uint64_t& hits) const noexcept {
  const glm::vec3 h = half_;
  alignas(64) std::uint8_t met[64];
  for (std::size_t i = 0; i < 64; ++i) {
    met[i] = !parted(0.5f * (a.x + x[i]), 0.5f * (a.y + y[i]), 0.5f * (a.z + z[i]), 0.5f * (x[i] - a.x),
                     0.5f * (y[i] - a.y), 0.5f * (z[i] - a.z), h);
  }
  // Eight bytes of 0 or 1 at a time: the product brings their lowest bits together on top.
  for (std::size_t i = 0; i < 64; i += 8) {
    std::uint64_t eight;
    std::memcpy(&eight, met + i, 8);
    hits |= (eight * 0x0102040810204080u >> 56) << i;
  }
}
static_assert(std::endian::native == std::endian::little, "the first byte is taken for the lowest");

MovedBoxes::MovedBoxes(const SceneChange& change, float epsilon) : epsilon_(epsilon) {
  for (const MovedMesh& m : change.moved) {
    boxes_.emplace_back(m.before, epsilon);
    boxes_.emplace_back(m.after, epsilon);
  }
}

MovedBoxes::MovedBoxes(std::span<const PosedBox> boxes, float epsilon) : epsilon_(epsilon) {
  for (const PosedBox& box : boxes) boxes_.emplace_back(box, epsilon);
}

bool MovedBoxes::meet(const glm::vec3& a, const glm::vec3& b) const noexcept {
  // What coordinates round by, some ten times over: where a ray from a lamp far outside the scene passes is no better
  // known. Within the scene nothing is left of it.
  const glm::vec3 reach = glm::max(glm::abs(a), glm::abs(b));
  const float rounding = std::max(0.0f, kEpsilonShare * std::max({reach.x, reach.y, reach.z}) - epsilon_);
  return std::any_of(boxes_.begin(), boxes_.end(),
                     [&](const MovedBox& box) { return box.meets(box.to_box(a), box.to_box(b), rounding); });
}

bool MovedBoxes::near(const glm::vec3& p, float distance) const noexcept {
  return std::any_of(boxes_.begin(), boxes_.end(),
                     [&](const MovedBox& box) { return box.near(box.to_box(p), distance); });
}

SegmentEnds::SegmentEnds(const MovedBoxes& boxes, const PointsView& world)
    : boxes_(boxes.boxes()), count_(world.count), padded_((world.count + 63) / 64 * 64) {
  points_.resize(3 * padded_ * boxes_.size());
  words_.resize(padded_ / 64 * boxes_.size());
  float* to = points_.data();
  Bounds* words = words_.data();
  for (const MovedBox& box : boxes_) {
    for (std::size_t i = 0; i < count_; ++i) {
      const glm::vec3 p = box.to_box({world.x[i], world.y[i], world.z[i]});
      Bounds& word = words[i / 64];
      word = i % 64 == 0 ? Bounds{p, p} : Bounds{glm::min(word.lower, p), glm::max(word.upper, p)};
      to[i] = p.x;
      to[padded_ + i] = p.y;
      to[2 * padded_ + i] = p.z;
    }
    to += 3 * padded_;
    words += padded_ / 64;
  }
}

void SegmentEnds::mark(const glm::vec3& from, std::span<std::uint64_t> hits) const noexcept {
  const float* points = points_.data();
  const Bounds* word = words_.data();
  for (const MovedBox& box : boxes_) {
    const glm::vec3 a = box.to_box(from);
    for (std::size_t i = 0; i < padded_; i += 64, ++word)
      if (!box.passed_by(a, *word))
        box.mark(a, points + i, points + padded_ + i, points + 2 * padded_ + i, hits[i / 64]);
    points += 3 * padded_;
  }
  if (!boxes_.empty() && count_ < padded_) hits[count_ / 64] &= (std::uint64_t{1} << count_ % 64) - 1;
}

}  // namespace icbench
