// Images in memory, and reading and writing them as OpenEXR (exact) or PNG (for viewing).
//
// Guarantees: bytes written depend on the pixels and the options alone, never on threads, time or machine; a
// file appears under its name whole or not at all; no file, however corrupt, causes memory to be taken far
// beyond what its own bytes can decode to. All functions throw std::runtime_error with one line that names
// the file. Costs: the encoded file is held in memory next to the image.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

namespace icbench {

/// Longest side and largest area of an image that is read or written, pixels.
inline constexpr int kMaxImageSide = 1 << 16;
inline constexpr std::int64_t kMaxImagePixels = std::int64_t{1} << 28;

/// Linear RGB radiance, W/(m^2 sr), row-major, top row first; pixels.size() is width * height.
struct Image {
  int width = 0;
  int height = 0;
  std::vector<glm::vec3> pixels;
  int left = 0, top = 0;  ///< where in the whole picture it lies, if it was read and is a part; pixels
};

/// A black image.
inline Image make_image(int width, int height) {
  return {width, height,
          std::vector<glm::vec3>(static_cast<std::size_t>(width) * static_cast<std::size_t>(height))};
}

/// One line if the sides are out of range or do not match the number of pixels, else empty.
std::string size_error(const Image& image);

/// One line naming the first pixel with a NaN or an infinity, and with a negative value unless
/// `negative_allowed`; else empty.
std::string value_error(const Image& image, bool negative_allowed);

/// How an EXR file stores its samples. `half_bits` reaches 65504; larger values are an error.
enum class ExrSample : std::uint8_t { float_bits, half_bits };

struct WriteOptions {
  ExrSample exr_sample = ExrSample::float_bits;
  float exposure = 1.0f;   ///< PNG: radiance is multiplied by this (> 0, finite), then 1 is white
  bool is_signed = false;  ///< EXR: values may be negative, as a difference of pictures has them
};

/// Writes .exr (ZIP compression, channels B G R) or .png (8 bits, sRGB transfer function, brighter than white
/// clipped), by the extension of `path`. A regular file is replaced by a rename; anything else (a device, a
/// pipe) is written in place. Refuses images of wrong size or with NaN or infinite values, and with negative ones
/// unless it is an EXR file that is said to be signed.
void write_image(const std::filesystem::path& path, const Image& image, const WriteOptions& options = {});

/// Reads .exr (scan lines; the data window, and where in the display window that lies; channels R G B, or Y alone
/// as grey) or .png (any colour type; sRGB, or the gamma that the file states; alpha is ignored; [0, 1]). Values of
/// an EXR file are returned as they are, NaN and negative ones too.
Image read_image(const std::filesystem::path& path);

}  // namespace icbench
