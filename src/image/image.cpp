#include "image/image.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "files/input_file.h"
#include "files/output_file.h"
#include "image/codec.h"

namespace icbench {
namespace {

enum class Format { exr, png };

Format format_of(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c); });
  if (extension == ".exr") return Format::exr;
  if (extension == ".png") return Format::png;
  throw std::runtime_error(
      fmt::format("unknown image format of '{}': the name must end in .exr or .png", path.string()));
}

const char* flaw(float value, bool negative_allowed) noexcept {
  if (std::isnan(value)) return "NaN";
  if (std::isinf(value)) return "infinite";
  if (value < 0.0f && !negative_allowed) return "negative";
  return nullptr;
}

}  // namespace

std::string size_error(const Image& image) {
  if (image.width < 1 || image.height < 1) {
    return fmt::format("an image of {} x {} pixels is empty", image.width, image.height);
  }
  const std::int64_t area = std::int64_t{image.width} * image.height;
  if (image.width > kMaxImageSide || image.height > kMaxImageSide || area > kMaxImagePixels) {
    return fmt::format("{} x {} pixels are too many; at most {} a side and {} in all", image.width,
                       image.height, kMaxImageSide, kMaxImagePixels);
  }
  if (image.pixels.size() != static_cast<std::size_t>(area)) {
    return fmt::format("an image of {} x {} pixels holds {} of them", image.width, image.height,
                       image.pixels.size());
  }
  return {};
}

std::string value_error(const Image& image, bool negative_allowed) {
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      if (const char* what = flaw(image.pixels[i][c], negative_allowed)) {
        const auto width = static_cast<std::size_t>(std::max(image.width, 1));
        return fmt::format("pixel ({}, {}) is {} in channel {}", i % width, i / width, what, "RGB"[c]);
      }
    }
  }
  return {};
}

void write_image(const std::filesystem::path& path, const Image& image, const WriteOptions& options) {
  const Format format = format_of(path);
  std::string reason = size_error(image);
  if (reason.empty()) reason = value_error(image, options.is_signed && format == Format::exr);
  std::string bytes;
  if (reason.empty()) {
    try {
      bytes =
          format == Format::exr ? encode_exr(image, options.exr_sample) : encode_png(image, options.exposure);
    } catch (const std::runtime_error& error) {
      reason = error.what();
    }
  }
  if (!reason.empty()) throw std::runtime_error(fmt::format("cannot write '{}': {}", path.string(), reason));
  write_file(path, bytes);
}

Image read_image(const std::filesystem::path& path) {
  const Format format = format_of(path);
  const std::string bytes = load_file(path);
  try {
    return format == Format::exr ? decode_exr(bytes) : decode_png(bytes);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(fmt::format("cannot read '{}': {}", path.string(), error.what()));
  }
}

}  // namespace icbench
