// Base-colour textures: 8-bit sRGB images, looked up bilinearly and repeated.
#pragma once

#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

namespace icbench {

/// Material::texture of a material without one.
inline constexpr std::uint32_t kNoTexture = ~0u;

struct Texture {
  std::string name;  ///< for error messages
  int width = 0, height = 0;
  /// RGB, sRGB transfer function, row-major, top row first: 3 * width * height.
  std::vector<std::uint8_t> texels;

  /// Linear colour in [0, 1]; (0, 0) is the lower left corner of the image, (1, 1) the upper right, repeated outside.
  /// Not finite coordinates count as 0.
  glm::vec3 operator()(const glm::vec2& uv) const noexcept;
};

}  // namespace icbench
