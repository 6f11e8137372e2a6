// Orders of records that do not depend on who found them.
#pragma once

#include <bit>
#include <cstdint>
#include <glm/vec3.hpp>

#include "core/random.h"

namespace icbench {

/// A number for a place, by which records can be put in an order that has nothing to do with how they are found.
/// Coordinates alone would not do: all records of a wall may share one.
inline std::uint64_t hash_of(const glm::vec3& p) noexcept {
  const auto bits = [](float x) { return std::uint64_t{std::bit_cast<std::uint32_t>(x)}; };
  return mix64(mix64(bits(p.x) << 32 | bits(p.y)) ^ bits(p.z));
}

}  // namespace icbench
