// The key that makes random numbers depend on pixel, sample and frame alone.
#pragma once

#include <cstdint>

#include "core/random.h"
#include "scene/directions.h"

namespace icbench {

/// The largest float below 1: what numbers of [0, 1) are kept at that rounding would lift out of it.
inline constexpr float kBelowOne = 0x1.fffffep-1f;

/// What a pixel's random numbers are for; each purpose has numbers of its own.
enum class Purpose : std::uint32_t { lens, direct, gather, path, cell, residual_draw, residual, probe, caustic };

/// Names one sample of an image; equal keys give equal random numbers in any thread.
struct SampleKey {
  std::uint64_t seed = 0;
  std::uint32_t frame = 0;
  std::uint32_t sample = 0;

  SampleKey next_sample(std::uint32_t steps) const noexcept { return {seed, frame, sample + steps}; }

  /// Key of a pixel's random numbers.
  std::uint64_t of_pixel(std::uint32_t pixel, Purpose purpose) const noexcept {
    const auto use = static_cast<std::uint64_t>(purpose);
    return hash_keys(seed, std::uint64_t{frame} << 32 | sample, use << 32 | pixel);
  }
};

}  // namespace icbench
