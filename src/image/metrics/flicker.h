// Flicker: error that changes from frame to frame. The eye forgives a lasting error that it would not see in
// a still; it does not forgive one that comes and goes.
//
// Takes an animation frame by frame and keeps one image. A lasting error, however large, has no flicker, and
// neither has motion that both animations share.
#pragma once

#include <cmath>
#include <optional>
#include <stdexcept>
#include <utility>

#include "image/metrics/metric.h"

namespace icbench {

class Flicker {
 public:
  /// The next frame of the reference and of the animation to judge, all of one size; `follows` the one before, or
  /// frames between them are missing. Throws std::runtime_error with one line if they cannot be compared.
  void add(const Image& reference, const Image& image, bool follows = true) {
    check_comparable(reference, image);
    if (frames_ > 0 && (reference.width != last_.width || reference.height != last_.height)) {
      throw std::runtime_error(fmt::format("frames of {} x {} and {} x {} pixels are of no one animation",
                                           last_.width, last_.height, reference.width, reference.height));
    }
    Image difference = make_image(reference.width, reference.height);
    for (std::size_t i = 0; i < difference.pixels.size(); ++i) {
      difference.pixels[i] = image.pixels[i] - reference.pixels[i];
    }
    if (frames_ > 0 && follows) {
      squares_ += channel_mean(last_, difference, [](double a, double b) { return (b - a) * (b - a); });
      ++pairs_;
    }
    last_ = std::move(difference);
    ++frames_;
  }

  int frames() const noexcept { return frames_; }

  /// Root of the mean over channels, pixels and pairs of successive frames of (d' - d)^2, where d is image
  /// minus reference; W/(m^2 sr). None without such a pair. Infinite where differences exceed float.
  std::optional<double> value() const noexcept {
    return pairs_ == 0 ? std::nullopt : std::optional(std::sqrt(squares_ / pairs_));
  }

 private:
  Image last_;  // image minus reference
  double squares_ = 0.0;
  int frames_ = 0, pairs_ = 0;
};

}  // namespace icbench
