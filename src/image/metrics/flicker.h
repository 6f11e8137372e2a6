// Flicker: error that changes from frame to frame. The eye forgives a lasting error that it would not see in
// a still; it does not forgive one that comes and goes.
//
// Takes an animation frame by frame and keeps one image. A lasting error, however large, has no flicker, and
// neither has motion that both animations share.
#pragma once

#include <cmath>
#include <stdexcept>
#include <utility>

#include "image/metrics/metric.h"

namespace icbench {

class Flicker {
 public:
  /// The next frame of the reference and of the animation to judge, all of one size. Throws
  /// std::runtime_error with one line if they cannot be compared.
  void add(const Image& reference, const Image& image) {
    check_comparable(reference, image);
    if (frames_ > 0 && (reference.width != last_.width || reference.height != last_.height)) {
      throw std::runtime_error(fmt::format("frames of {} x {} and {} x {} pixels are of no one animation",
                                           last_.width, last_.height, reference.width, reference.height));
    }
    Image difference = make_image(reference.width, reference.height);
    for (std::size_t i = 0; i < difference.pixels.size(); ++i) {
      difference.pixels[i] = image.pixels[i] - reference.pixels[i];
    }
    if (frames_ > 0) {
      squares_ += channel_mean(last_, difference, [](double a, double b) { return (b - a) * (b - a); });
    }
    last_ = std::move(difference);
    ++frames_;
  }

  int frames() const noexcept { return frames_; }

  /// Root of the mean over channels, pixels and pairs of successive frames of (d' - d)^2, where d is image
  /// minus reference; W/(m^2 sr). 0 for fewer than two frames. Infinite where differences exceed float.
  double value() const noexcept { return frames_ < 2 ? 0.0 : std::sqrt(squares_ / (frames_ - 1)); }

 private:
  Image last_;  // image minus reference
  double squares_ = 0.0;
  int frames_ = 0;
};

}  // namespace icbench
