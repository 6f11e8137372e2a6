// A unit normal in 32 bits.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>

namespace icbench {

/// Unit normal in 32 bits: octahedral, 16 bits a coordinate (Meyer et al. 2010). Directions change by less than 1e-4.
struct PackedNormal {
  std::uint32_t bits = 0;
  static PackedNormal pack(const glm::vec3& n) noexcept;
  glm::vec3 unpack() const noexcept;  ///< unit
};

}  // namespace icbench
