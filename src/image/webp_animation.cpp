#include "image/webp_animation.h"

#include <fmt/format.h>
#include <webp/encode.h>
#include <webp/mux.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/common.hpp>
#include <stdexcept>
#include <vector>

#include "files/output_file.h"
#include "image/codec.h"

namespace icbench {
namespace {

constexpr float kQuality = 80.0f;

std::uint8_t srgb(float x) {
  return static_cast<std::uint8_t>(std::lround(255.0f * srgb_from_linear(std::clamp(x, 0.0f, 1.0f))));
}

}  // namespace

struct WebpAnimation::Encoder {
  int width, height, factor;  // of a picture as it comes; and how many of its pixels one here spans
  float exposure;
  double milliseconds;  // a picture
  int pictures = 0;
  WebPAnimEncoder* encoder = nullptr;
  WebPConfig config{};
  WebPPicture frame{};

  ~Encoder() {
    WebPPictureFree(&frame);
    WebPAnimEncoderDelete(encoder);
  }
  int time() const { return static_cast<int>(std::lround(pictures * milliseconds)); }
  void check(bool went_well) const {
    if (!went_well)
      throw std::runtime_error(fmt::format("cannot encode picture {} of the animation as WebP: {}", pictures,
                                           WebPAnimEncoderGetError(encoder)));
  }
};

WebpAnimation::WebpAnimation(int width, int height, float exposure, double fps, int max_side)
    : encoder_(std::make_unique<Encoder>()) {
  Encoder& e = *encoder_;
  e.width = width;
  e.height = height;
  e.factor = (std::max(width, height) + max_side - 1) / max_side;
  e.exposure = exposure;
  e.milliseconds = 1000.0 / fps;
  WebPAnimEncoderOptions options;
  bool ready = WebPAnimEncoderOptionsInit(&options) && WebPPictureInit(&e.frame) &&
               WebPConfigPreset(&e.config, WEBP_PRESET_PHOTO, kQuality);
  e.config.method = 2;  // a preview: encoded quickly rather than tightly
  e.frame.width = (width + e.factor - 1) / e.factor;
  e.frame.height = (height + e.factor - 1) / e.factor;
  e.encoder = ready ? WebPAnimEncoderNew(e.frame.width, e.frame.height, &options) : nullptr;
  if (e.encoder == nullptr)
    throw std::runtime_error(fmt::format("libwebp cannot encode an animation of {}x{}", width, height));
}

WebpAnimation::~WebpAnimation() = default;

void WebpAnimation::add(const Image& picture) {
  Encoder& e = *encoder_;
  std::vector<std::uint8_t> rgb;
  rgb.reserve(3 * static_cast<std::size_t>(e.frame.width) * static_cast<std::size_t>(e.frame.height));
  for (int y = 0; y < e.height; y += e.factor)
    for (int x = 0; x < e.width; x += e.factor) {
      glm::vec3 sum(0.0f);
      int count = 0;
      for (int v = y; v < std::min(y + e.factor, e.height); ++v)
        for (int u = x; u < std::min(x + e.factor, e.width); ++u, ++count)
          sum += glm::min(
              e.exposure * picture.pixels[static_cast<std::size_t>(v) * static_cast<std::size_t>(e.width) +
                                          static_cast<std::size_t>(u)],
              glm::vec3(1.0f));
      for (int c = 0; c < 3; ++c) rgb.push_back(srgb(sum[c] / static_cast<float>(count)));
    }
  e.check(WebPPictureImportRGB(&e.frame, rgb.data(), 3 * e.frame.width) &&
          WebPAnimEncoderAdd(e.encoder, &e.frame, e.time(), &e.config));
  ++e.pictures;
}

void WebpAnimation::write(const std::filesystem::path& path) {
  Encoder& e = *encoder_;
  WebPData data;
  WebPDataInit(&data);
  e.check(WebPAnimEncoderAdd(e.encoder, nullptr, e.time(), nullptr) &&
          WebPAnimEncoderAssemble(e.encoder, &data));
  const std::unique_ptr<WebPData, void (*)(WebPData*)> freed(&data, WebPDataClear);
  write_file(path, {reinterpret_cast<const char*>(data.bytes), data.size});
}

}  // namespace icbench
