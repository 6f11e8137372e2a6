// RMSE of averages over blocks of pixels: noise of single pixels averages out, smooth and blotchy error, the
// kind that irradiance caching makes, stays.
#pragma once

#include <array>
#include <cmath>

#include "image/metrics/metric.h"

namespace icbench {

inline constexpr int kBlockSide = 4;  ///< pixels

/// sqrt(mean(d^2)) / mean(ref), where d is the difference of block averages per channel; blocks of 4 x 4
/// pixels, smaller at the right and lower edge, each weighed by its number of pixels. Dimensionless; 0 if
/// both images are black, none if only the reference has no light. Map: |d| / mean(ref) per channel, over each
/// block.
inline std::vector<MetricValue> block_rmse(const Image& reference, const Image& image, Image* map) {
  check_comparable(reference, image);
  const double mean = channel_mean(reference);
  const bool is_scaled = mean > 0.0;
  if (map) *map = make_image(reference.width, reference.height);

  const auto columns = static_cast<std::size_t>((reference.width + kBlockSide - 1) / kBlockSide);
  const auto rows = static_cast<std::size_t>((reference.height + kBlockSide - 1) / kBlockSide);
  const double sum = parallel_sum(rows * columns, [&](std::size_t block) {
    const int x0 = static_cast<int>(block % columns) * kBlockSide;
    const int y0 = static_cast<int>(block / columns) * kBlockSide;
    const int x1 = std::min(x0 + kBlockSide, reference.width);
    const int y1 = std::min(y0 + kBlockSide, reference.height);
    const auto for_each_pixel = [&](const auto& f) {
      for (int y = y0; y < y1; ++y) {
        for (int x = x0; x < x1; ++x) {
          f(static_cast<std::size_t>(y) * static_cast<std::size_t>(reference.width) +
            static_cast<std::size_t>(x));
        }
      }
    };

    std::array<double, 3> difference{};
    for_each_pixel([&](std::size_t i) {
      for (int c = 0; c < 3; ++c) {
        difference[static_cast<std::size_t>(c)] +=
            double{image.pixels[i][c]} - double{reference.pixels[i][c]};
      }
    });
    const double pixels = (x1 - x0) * (y1 - y0);
    double squares = 0.0;
    glm::vec3 error;
    for (int c = 0; c < 3; ++c) {
      const double d = difference[static_cast<std::size_t>(c)] / pixels;
      squares += d * d;
      error[c] = is_scaled ? map_value(std::abs(d) / mean) : 0.0f;
    }
    if (map) for_each_pixel([&](std::size_t i) { map->pixels[i] = error; });
    return pixels * squares;
  });

  const double block_mse = sum / (3.0 * static_cast<double>(reference.pixels.size()));
  if (is_scaled) return {{"", std::sqrt(block_mse) / mean}};
  if (mean == 0.0 && block_mse == 0.0) return {{"", 0.0}};
  return {{"", std::nullopt}};
}

}  // namespace icbench
