// How images are looked at: what the metrics that model an observer need to know. It is fixed before
// measuring and stated beside every figure.
#pragma once

#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <stdexcept>

namespace icbench {

/// Defaults: those of HDR-VDP (Mantiuk et al. 2005) for display and distance, Radiance's luminous efficacy of
/// white light for luminance, and FLIP's own 0.7 m from a display of 3840 pixels on 0.7 m.
struct Viewing {
  double luminance_scale = 179.0;  ///< luminance of radiance 1, cd/m^2 per W/(m^2 sr), that is lm/W
  double distance = 0.5;           ///< eye to display, metres
  int display_pixels_x = 1280;
  int display_pixels_y = 1024;
  double display_width = 0.375;   ///< metres
  double display_height = 0.300;  ///< metres
  double flip_pixels_per_degree = 67.0;
};

/// Throws std::runtime_error with one line unless every number is positive, finite and of a sane size.
inline void check_viewing(const Viewing& viewing) {
  const auto check = [](const char* what, double value, double low, double high) {
    if (!(value >= low && value <= high)) {
      throw std::runtime_error(
          fmt::format("the {} of {} is out of range; it must be from {} to {}", what, value, low, high));
    }
  };
  check("luminance scale", viewing.luminance_scale, 1e-10, 1e10);
  check("viewing distance", viewing.distance, 0.01, 1000.0);
  check("display's number of pixels across", viewing.display_pixels_x, 1, 1 << 20);
  check("display's number of pixels down", viewing.display_pixels_y, 1, 1 << 20);
  check("display width", viewing.display_width, 0.001, 1000.0);
  check("display height", viewing.display_height, 0.001, 1000.0);
  check("number of pixels per degree", viewing.flip_pixels_per_degree, 1.0, 1000.0);
}

/// Pixels per degree of visual angle, for a pixel in the middle of the display.
struct PixelsPerDegree {
  double x, y;
};

inline PixelsPerDegree pixels_per_degree(const Viewing& viewing) {
  const auto along = [&](double size, int pixels) {
    return std::numbers::pi / 180.0 / (2.0 * std::atan(0.5 * size / pixels / viewing.distance));
  };
  return {along(viewing.display_width, viewing.display_pixels_x),
          along(viewing.display_height, viewing.display_pixels_y)};
}

}  // namespace icbench
