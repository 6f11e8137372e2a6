// Which segments may have been touched by what moved: those that meet a moved mesh's box where it stood before or
// where it stands now.
//
// Conservative: a segment that Embree could find the mesh on is always told, whatever the rounding. Boxes are tested in
// the mesh's own space, where they fit best, by separating axes, without a division: about 30 operations, many
// segments at once where their ends lie side by side, and none for 64 of them that pass a box by together.
#pragma once

#include <cstdint>
#include <glm/common.hpp>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "render/ray_tracer.h"

namespace icbench {

/// Points in structure-of-arrays form.
struct PointsView {
  const float *x, *y, *z;
  std::size_t count;
};

/// A box as seen from a space in which it stands at the origin, parallel to the axes.
class MovedBox {
 public:
  /// `epsilon`: the scene's.
  MovedBox(const PosedBox& posed, float epsilon) noexcept;

  /// From the world to the box's space.
  glm::vec3 to_box(const glm::vec3& p) const noexcept { return inverse_ * (p - shift_) - centre_; }

  /// Whether the segment between two points of its space comes within `distance` (of the world); conservative.
  bool meets(const glm::vec3& a, const glm::vec3& b, float distance) const noexcept;

  /// Whether it comes within `distance` (of the world) of a point of its space; conservative.
  bool near(const glm::vec3& p, float distance) const noexcept;

  /// Whether no segment from `a` to what lies within these bounds can meet it, all in its space; conservative.
  bool passed_by(const glm::vec3& a, const Bounds& ends) const noexcept {
    const glm::vec3 low = glm::min(a, ends.lower), high = glm::max(a, ends.upper);
    return (low.x > half_.x) | (low.y > half_.y) | (low.z > half_.z) | (high.x < -half_.x) |
           (high.y < -half_.y) | (high.z < -half_.z);
  }

  /// Sets bit i of `hits` for each of the segments from `a` to 64 ends, in the box's space, that meets it; leaves other
  /// bits as they are.
  void mark(const glm::vec3& a, const float* x, const float* y, const float* z,
            std::uint64_t& hits) const noexcept;

 private:
  glm::mat3 inverse_;
  glm::vec3 shift_, centre_, half_;
  glm::vec3 step_;  // what a step of 1 in the world can amount to along each axis of the box, at most
};

/// The boxes of all that moved in one change, before and after; or any others.
class MovedBoxes {
 public:
  MovedBoxes() = default;
  MovedBoxes(const SceneChange& change, float epsilon);
  explicit MovedBoxes(std::span<const PosedBox> boxes, float epsilon);

  bool empty() const noexcept { return boxes_.empty(); }

  /// Whether any comes within `distance` (metres) of a point; conservative.
  bool near(const glm::vec3& p, float distance) const noexcept;

  /// Whether a segment of the world meets any; conservative, however far outside the scene its ends lie.
  bool meet(const glm::vec3& a, const glm::vec3& b) const noexcept;

  std::span<const MovedBox> boxes() const noexcept { return boxes_; }

 private:
  std::vector<MovedBox> boxes_;
  float epsilon_ = 0.0f;
};

/// Points that segments to every box end in, in each box's space: computed once, used for any number of beginnings. Of
/// boxes that outlive it; these may be moved (the vector's memory stays where it is), but not copied in its stead.
class SegmentEnds {
 public:
  SegmentEnds() = default;
  SegmentEnds(const MovedBoxes& boxes, const PointsView& world);

  /// Sets bit i of `hits` (64 to a word, lowest first) for each segment from `from` to end i that meets any box. Bits
  /// beyond the last end become 0.
  void mark(const glm::vec3& from, std::span<std::uint64_t> hits) const noexcept;

 private:
  std::span<const MovedBox> boxes_;
  std::size_t count_ = 0, padded_ = 0;  // padded: to whole words
  std::vector<float> points_;           // x of all, y of all, z of all; for each box
  std::vector<Bounds> words_;           // of the points of each word; for each box
};

}  // namespace icbench
