#include "image/metrics/colours.h"

#include <algorithm>
#include <array>

#include "image/codec.h"

namespace icbench {
namespace {

/// sRGB in 1/255 at even distances; straight lines between them stay within 2.3/255 of the full table.
constexpr std::array<std::array<int, 3>, 17> kMagma = {{{0, 0, 4},
                                                        {10, 8, 34},
                                                        {29, 17, 71},
                                                        {54, 16, 107},
                                                        {81, 18, 124},
                                                        {106, 28, 129},
                                                        {131, 38, 129},
                                                        {156, 46, 127},
                                                        {183, 55, 121},
                                                        {207, 64, 112},
                                                        {229, 80, 100},
                                                        {244, 105, 92},
                                                        {251, 135, 97},
                                                        {254, 165, 113},
                                                        {254, 194, 135},
                                                        {253, 224, 161},
                                                        {252, 253, 191}}};

}  // namespace

glm::vec3 magma(float value) {
  const float place = std::clamp(value, 0.0f, 1.0f) * static_cast<float>(kMagma.size() - 1);
  const std::size_t below = std::min(static_cast<std::size_t>(place), kMagma.size() - 2);
  const float share = place - static_cast<float>(below);
  glm::vec3 colour;
  for (std::size_t c = 0; c < 3; ++c) {
    const auto a = static_cast<float>(kMagma[below][c]), b = static_cast<float>(kMagma[below + 1][c]);
    colour[static_cast<int>(c)] = linear_from_srgb((a + share * (b - a)) / 255.0f);
  }
  return colour;
}

}  // namespace icbench
