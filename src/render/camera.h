// Pinhole camera: from pixels to rays.
#pragma once

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <limits>

#include "render/ray_tracer.h"
#include "scene/scene.h"

namespace icbench {

/// A camera set up for an image size. Pixels are square; row 0 is the top.
class CameraView {
 public:
  CameraView(const Camera& camera, int width, int height) noexcept
      : eye_(camera.eye), forward_(glm::normalize(camera.target - camera.eye)) {
    const glm::vec3 right = glm::normalize(glm::cross(forward_, camera.up));
    const glm::vec3 up = glm::cross(right, forward_);
    const float pixel = 2.0f * std::tan(0.5f * camera.fov_y) / static_cast<float>(height);
    across_ = pixel * right;
    down_ = -pixel * up;
    corner_ =
        forward_ - 0.5f * static_cast<float>(width) * across_ - 0.5f * static_cast<float>(height) * down_;
    half_ = 0.5f * pixel * glm::vec2(static_cast<float>(width), static_cast<float>(height));
  }

  /// Whether the picture has a place for the point, though something may stand before it.
  bool shows(const glm::vec3& p) const noexcept {
    const glm::vec3 d = p - eye_;
    const float depth = glm::dot(d, forward_);
    return std::abs(glm::dot(d, glm::normalize(across_))) <= half_.x * depth &&
           std::abs(glm::dot(d, glm::normalize(down_))) <= half_.y * depth;
  }

  /// Ray through a point of the image plane, in pixels from the top left corner; unit direction.
  Ray ray(float x, float y) const noexcept {
    return {eye_, std::numeric_limits<float>::infinity(), glm::normalize(corner_ + x * across_ + y * down_)};
  }

 private:
  glm::vec3 eye_, forward_, corner_, across_, down_;
  glm::vec2 half_;  // of the picture, at unit depth
};

}  // namespace icbench
