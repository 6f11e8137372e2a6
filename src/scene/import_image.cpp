// PNG by way of the project's own reader, JPEG through stb, which is told only about images whose size the
// file's bytes can account for.
#include <fmt/format.h>
#include <stb_image.h>

#include <algorithm>
#include <memory>
#include <stdexcept>

#include "image/codec.h"
#include "scene/import_model.h"

namespace icbench::importing {
namespace {

constexpr std::string_view kPng("\x89PNG\r\n\x1a\n", 8), kJpeg("\xff\xd8\xff", 3);
// A block of 8 x 8 samples takes at least a bit of a JPEG file, and chroma is subsampled at most 4 by 4
// times.
constexpr std::size_t kTexelsPerByte = 8 * 64;
constexpr std::size_t kMostScans = 100;  // of a progressive JPEG image, which usually has some ten

void check_size(std::size_t width, std::size_t height) {
  if (width == 0 || height == 0 || width > kMaxTexels || height > kMaxTexels / width)
    throw std::runtime_error(fmt::format("has {} x {} texels; give it 1 to {}", width, height, kMaxTexels));
}

std::size_t big_endian(std::string_view bytes) {
  std::size_t value = 0;
  for (const char c : bytes) value = value << 8 | static_cast<unsigned char>(c);
  return value;
}

void decode_png_into(Texture& texture, std::string_view bytes) {
  if (bytes.size() >= 24) check_size(big_endian(bytes.substr(16, 4)), big_endian(bytes.substr(20, 4)));
  const Image image = decode_png(bytes, true);
  texture.width = image.width;
  texture.height = image.height;
  texture.texels.reserve(3 * image.pixels.size());
  for (const glm::vec3& pixel : image.pixels)
    for (int c = 0; c < 3; ++c)
      texture.texels.push_back(
          static_cast<std::uint8_t>(255.0f * srgb_from_linear(std::clamp(pixel[c], 0.0f, 1.0f)) + 0.5f));
}

void decode_jpeg_into(Texture& texture, std::string_view bytes) {
  if (bytes.size() > std::size_t{1} << 30) throw std::runtime_error("is larger than 1 GiB");
  const auto* data = reinterpret_cast<const stbi_uc*>(bytes.data());
  const int size = static_cast<int>(bytes.size());
  int channels = 0;
  if (!stbi_info_from_memory(data, size, &texture.width, &texture.height, &channels))
    throw std::runtime_error("is a damaged JPEG image");
  const auto width = static_cast<std::size_t>(texture.width),
             height = static_cast<std::size_t>(texture.height);
  check_size(width, height);
  if (width * height > 16 * 64 + kTexelsPerByte * bytes.size())
    throw std::runtime_error(
        fmt::format("claims {} x {} texels, which its {} bytes cannot hold", width, height, size));
  // Each goes over all texels, whether or not anything is left for it to tell.
  std::size_t scans = 0;
  for (std::size_t at = 0; (at = bytes.find("\xff\xda", at)) != bytes.npos; at += 2) ++scans;
  if (scans > kMostScans)
    throw std::runtime_error(
        fmt::format("is a JPEG image of {} scans, {} at most are read; convert it", scans, kMostScans));
  const std::unique_ptr<stbi_uc, void (*)(void*)> texels(
      stbi_load_from_memory(data, size, &texture.width, &texture.height, &channels, 3), stbi_image_free);
  if (!texels) throw std::runtime_error(fmt::format("is a damaged JPEG image ({})", stbi_failure_reason()));
  texture.texels.assign(texels.get(), texels.get() + 3 * width * height);
}

}  // namespace

bool is_texture(std::string_view bytes) noexcept {
  return bytes.starts_with(kPng) || bytes.starts_with(kJpeg);
}

Texture decode_texture(std::string_view bytes, std::string name) {
  Texture texture;
  texture.name = std::move(name);
  if (bytes.starts_with(kPng)) {
    decode_png_into(texture, bytes);
  } else if (bytes.starts_with(kJpeg)) {
    decode_jpeg_into(texture, bytes);
  } else {
    throw std::runtime_error("is neither a PNG nor a JPEG image; convert it");
  }
  return texture;
}

glm::vec3 mean_colour(const Texture& texture) {
  std::size_t counts[3][256] = {};
  for (std::size_t i = 0; i < texture.texels.size(); ++i) ++counts[i % 3][texture.texels[i]];
  glm::dvec3 sum(0.0);
  for (int c = 0; c < 3; ++c)
    for (int code = 0; code < 256; ++code)
      sum[c] += static_cast<double>(counts[c][code]) * linear_from_srgb(static_cast<float>(code) / 255.0f);
  return glm::vec3(sum / std::max(1.0, static_cast<double>(texture.texels.size() / 3)));
}

}  // namespace icbench::importing
