// Animated WebP, to look at: pictures in, one looping file out.
//
// Lossy, 8 bits, sRGB; brighter than white is clipped. Encoded as pictures come, so that only the compressed
// animation is held. All throw std::runtime_error with one line.
#pragma once

#include <filesystem>
#include <memory>

#include "image/image.h"

namespace icbench {

class WebpAnimation {
 public:
  /// For pictures of this size, shown at `fps` a second; shrunk by a whole factor until no side exceeds `max_side`.
  /// Radiance is multiplied by `exposure`, then 1 is white.
  WebpAnimation(int width, int height, float exposure, double fps = 25.0, int max_side = 640);
  ~WebpAnimation();
  WebpAnimation(const WebpAnimation&) = delete;
  WebpAnimation& operator=(const WebpAnimation&) = delete;

  /// Adds the next picture, of the size given.
  void add(const Image& picture);

  /// Writes the file as write_file does; at least one picture has been added. Once.
  void write(const std::filesystem::path& path);

 private:
  struct Encoder;
  std::unique_ptr<Encoder> encoder_;
};

}  // namespace icbench
