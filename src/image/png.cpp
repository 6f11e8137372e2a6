// PNG through stb. stb trusts sizes and skips checksums; both are checked here before it sees a file.
#include <fmt/format.h>
#include <stb_image.h>
#include <stb_image_write.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <stdexcept>

#include "image/codec.h"

namespace icbench {
namespace {

constexpr std::string_view kSignature("\x89PNG\r\n\x1a\n", 8);

/// No deflate stream expands by more.
constexpr std::int64_t kMaxDeflateRatio = 1032;

std::uint32_t big_endian(std::string_view bytes) noexcept {
  std::uint32_t value = 0;
  for (int i = 0; i < 4; ++i)
    value = value << 8 | static_cast<unsigned char>(bytes[static_cast<std::size_t>(i)]);
  return value;
}

struct PngHeader {
  std::int64_t width, height;
  int bit_depth, colour_type;
  std::size_t palette;  // where the PLTE chunk begins; 0 without one
  float gamma;          // samples are light to this power (gAMA); 0: as sRGB has it
};

/// A gAMA chunk's number within this of 1 / 2.2 is what writers of sRGB put there.
constexpr float kSameGamma = 0.005f;

/// Checks the signature and every chunk's length and checksum up to IEND (PNG specification, section 5).
PngHeader check_chunks(std::string_view bytes) {
  if (bytes.substr(0, kSignature.size()) != kSignature) throw std::runtime_error("not a PNG image");
  const std::size_t size = bytes.size();
  bytes.remove_prefix(kSignature.size());
  PngHeader header{};
  bool has_space = false;  // a chunk that has precedence over gAMA
  for (bool first = true;; first = false) {
    if (bytes.size() < 12 || big_endian(bytes) > bytes.size() - 12) {
      throw std::runtime_error("the PNG image ends too early");
    }
    const std::size_t length = big_endian(bytes);
    const std::string_view body = bytes.substr(4, 4 + length);
    const auto sum = ::crc32(0, reinterpret_cast<const Bytef*>(body.data()), static_cast<uInt>(body.size()));
    if (sum != big_endian(bytes.substr(8 + length)))
      throw std::runtime_error("a checksum of the PNG image is wrong");
    const std::string_view type = body.substr(0, 4);
    if (first != (type == "IHDR") || (first && length != 13))
      throw std::runtime_error("the PNG header is wrong");
    if (first) header = {big_endian(body.substr(4)), big_endian(body.substr(8)), body[12], body[13], 0, 0.0f};
    if (type == "PLTE") header.palette = size - bytes.size();
    if (type == "gAMA" && length == 4)
      header.gamma = static_cast<float>(big_endian(body.substr(4))) / 100'000.0f;
    has_space |= type == "sRGB" || type == "iCCP" || type == "cICP";
    if (type == "IEND") {
      if (has_space || std::abs(header.gamma - 1.0f / 2.2f) < kSameGamma) header.gamma = 0.0f;
      return header;
    }
    bytes.remove_prefix(12 + length);
  }
}

/// Throws if the pixels claimed are too many, or more than the file's bytes can hold.
void check_size(const PngHeader& header, std::size_t file_size) {
  const bool fits = header.width >= 1 && header.height >= 1 && header.width <= kMaxImageSide &&
                    header.height <= kMaxImageSide && header.width * header.height <= kMaxImagePixels;
  constexpr std::array<int, 7> kSamples = {1, 0, 3, 1, 2, 0, 4};  // per pixel, by colour type
  const bool known = header.colour_type >= 0 && header.colour_type < 7;
  const std::int64_t bits =
      known ? kSamples[static_cast<std::size_t>(header.colour_type)] * header.bit_depth : 0;
  if (!fits || bits < 1 ||
      header.height * (1 + header.width * bits / 8) >
          kMaxDeflateRatio * static_cast<std::int64_t>(file_size)) {
    throw std::runtime_error(fmt::format("the PNG image claims {} x {} pixels, which it cannot hold",
                                         header.width, header.height));
  }
}

/// The file with a palette of 256 colours, those that it lacks black: stb looks up any index in a table of which it has
/// set only those that are there.
std::string with_whole_palette(std::string_view bytes, std::size_t at) {
  constexpr std::uint32_t kWhole = 3 * 256;
  const std::uint32_t length = big_endian(bytes.substr(at));
  if (length % 3 != 0 || length > kWhole) throw std::runtime_error("the palette of the PNG image is wrong");
  std::string whole(bytes.substr(0, at + 8 + length));
  for (std::size_t i = 0; i < 4; ++i) whole[at + i] = static_cast<char>(kWhole >> (24 - 8 * i) & 0xff);
  whole.append(kWhole - length, '\0');
  whole += bytes.substr(at + 8 + length);  // its checksum, which stb skips, and the rest
  return whole;
}

template <class Sample, class Load>
Image decode(std::string_view bytes, Load load, float white, float gamma) {
  Image image;
  int channels = 0;
  const std::unique_ptr<Sample, void (*)(void*)> samples(
      load(reinterpret_cast<const stbi_uc*>(bytes.data()), static_cast<int>(bytes.size()), &image.width,
           &image.height, &channels, 3),
      stbi_image_free);
  if (!samples) throw std::runtime_error(fmt::format("the PNG image is damaged ({})", stbi_failure_reason()));
  const std::size_t count = static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height);
  image.pixels.reserve(count);
  const auto linear = [&](Sample sample) {
    const float encoded = static_cast<float>(sample) / white;
    return gamma == 0.0f ? linear_from_srgb(encoded) : std::pow(encoded, 1.0f / gamma);
  };
  for (const Sample* s = samples.get(); s != samples.get() + 3 * count; s += 3)
    image.pixels.emplace_back(linear(s[0]), linear(s[1]), linear(s[2]));
  return image;
}

}  // namespace

float srgb_from_linear(float linear) noexcept {
  return linear <= 0.0031308f ? 12.92f * linear : 1.055f * std::pow(linear, 1.0f / 2.4f) - 0.055f;
}

float linear_from_srgb(float encoded) noexcept {
  return encoded <= 0.04045f ? encoded / 12.92f : std::pow((encoded + 0.055f) / 1.055f, 2.4f);
}

std::string encode_png(const Image& image, float exposure) {
  if (!(exposure > 0.0f) || !std::isfinite(exposure)) {
    throw std::runtime_error(fmt::format("the exposure is {}; it must be positive and finite", exposure));
  }
  std::vector<unsigned char> samples;
  samples.reserve(3 * image.pixels.size());
  for (const glm::vec3& pixel : image.pixels) {
    for (int c = 0; c < 3; ++c) {
      const float encoded = srgb_from_linear(std::min(pixel[c] * exposure, 1.0f));
      samples.push_back(static_cast<unsigned char>(255.0f * encoded + 0.5f));
    }
  }
  std::string bytes;
  const auto append = [](void* context, void* data, int size) {
    static_cast<std::string*>(context)->append(static_cast<const char*>(data),
                                               static_cast<std::size_t>(size));
  };
  if (!stbi_write_png_to_func(append, &bytes, image.width, image.height, 3, samples.data(),
                              3 * image.width)) {
    throw std::runtime_error("not enough memory to encode the PNG image");
  }
  return bytes;
}

Image decode_png(std::string_view bytes, bool is_srgb) {
  if (bytes.size() > std::size_t{1} << 30) throw std::runtime_error("the PNG image is larger than 1 GiB");
  const PngHeader header = check_chunks(bytes);
  check_size(header, bytes.size());
  std::string whole;
  if (header.palette != 0) bytes = whole = with_whole_palette(bytes, header.palette);
  const float gamma = is_srgb ? 0.0f : header.gamma;
  return header.bit_depth == 16 ? decode<stbi_us>(bytes, stbi_load_16_from_memory, 65535.0f, gamma)
                                : decode<stbi_uc>(bytes, stbi_load_from_memory, 255.0f, gamma);
}

}  // namespace icbench
