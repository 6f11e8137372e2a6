// OpenEXR in memory. Decoding goes band by band and takes memory for a band only when the one above it was
// there, so that a header alone cannot ask for much.
#include <ImathBox.h>
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputFile.h>
#include <ImfOutputFile.h>
#include <fmt/format.h>
#include <half.h>
#include <openexr.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <stdexcept>

#include "image/codec.h"

namespace icbench {
namespace {

constexpr std::array<const char*, 3> kChannels = {"R", "G", "B"};

/// Pixels decoded at once, up to a row more.
constexpr int kBandPixels = 1 << 20;

class MemoryInput final : public Imf::IStream {
 public:
  explicit MemoryInput(std::string_view bytes) : IStream("image"), bytes_(bytes) {}

  bool read(char out[], int n) override {
    if (n < 0 || position_ > bytes_.size() || static_cast<std::size_t>(n) > bytes_.size() - position_) {
      throw std::runtime_error("the OpenEXR file ends too early");
    }
    std::memcpy(out, bytes_.data() + position_, static_cast<std::size_t>(n));
    position_ += static_cast<std::size_t>(n);
    return position_ < bytes_.size();
  }
  std::uint64_t tellg() override { return position_; }
  void seekg(std::uint64_t position) override { position_ = position; }

 private:
  std::string_view bytes_;
  std::uint64_t position_ = 0;
};

class MemoryOutput final : public Imf::OStream {
 public:
  MemoryOutput() : OStream("image") {}

  void write(const char in[], int n) override {
    const auto size = static_cast<std::size_t>(n);
    if (position_ + size > bytes_.size()) bytes_.resize(position_ + size);
    std::memcpy(bytes_.data() + position_, in, size);
    position_ += size;
  }
  std::uint64_t tellp() override { return position_; }
  void seekp(std::uint64_t position) override { position_ = position; }

  std::string take() { return std::move(bytes_); }

 private:
  std::string bytes_;
  std::uint64_t position_ = 0;
};

/// The first line of a library's message.
std::string first_line(const std::exception& error) {
  const std::string_view text = error.what();
  return std::string(text.substr(0, text.find('\n')));
}

/// Makes OpenEXR refuse headers that claim more than we accept; tables of offsets are as long as the claim.
void limit_sizes() {
  static const bool limited = [] {
    Imf::Header::setMaxImageSize(kMaxImageSide, kMaxImageSide);
    return true;
  }();
  static_cast<void>(limited);
}

/// Throws unless the header is sound: OpenEXR's C++ reader trusts the sizes of attributes and takes memory
/// for them, its C reader holds them against the size of the file.
void check_header(std::string_view bytes) {
  exr_context_initializer_t setup = EXR_DEFAULT_CONTEXT_INITIALIZER;
  setup.user_data = &bytes;
  setup.error_handler_fn = [](exr_const_context_t, exr_result_t, const char*) {};
  setup.size_fn = [](exr_const_context_t, void* data) {
    return static_cast<std::int64_t>(static_cast<const std::string_view*>(data)->size());
  };
  setup.read_fn = [](exr_const_context_t, void* data, void* out, std::uint64_t size, std::uint64_t offset,
                     exr_stream_error_func_ptr_t) {
    const std::string_view& file = *static_cast<const std::string_view*>(data);
    return static_cast<std::int64_t>(offset > file.size() ? 0
                                                          : file.copy(static_cast<char*>(out), size, offset));
  };
  setup.flags = EXR_CONTEXT_FLAG_STRICT_HEADER;
  setup.max_image_width = setup.max_image_height = kMaxImageSide;

  exr_context_t context = nullptr;
  exr_result_t result = exr_start_read(&context, "image", &setup);
  int parts = 0;
  exr_storage_t storage = EXR_STORAGE_LAST_TYPE;
  if (result == EXR_ERR_SUCCESS) {
    exr_get_count(context, &parts);
    exr_get_storage(context, 0, &storage);
    exr_finish(&context);
  }
  if (result != EXR_ERR_SUCCESS) {
    throw std::runtime_error(
        fmt::format("not a whole OpenEXR image ({})", exr_get_default_error_message(result)));
  }
  if (parts != 1 || storage != EXR_STORAGE_SCANLINE) {
    throw std::runtime_error("a tiled, deep or multi-part OpenEXR file; only scan-line images are read");
  }
}

/// Whether the file is grey (Y alone); throws if it is neither that nor RGB at full resolution.
bool is_grey(const Imf::ChannelList& channels) {
  const auto is_full = [&](const char* name) {
    const Imf::Channel* channel = channels.findChannel(name);
    return channel && channel->xSampling == 1 && channel->ySampling == 1;
  };
  if (std::all_of(kChannels.begin(), kChannels.end(), is_full)) return false;
  const auto has = [&](const char* name) { return channels.findChannel(name) != nullptr; };
  // Y of colour differences or of CIE XYZ is not all there is.
  if (is_full("Y") && !has("RY") && !has("BY") && !has("X") && !has("Z")) return true;
  throw std::runtime_error("the OpenEXR image has neither channels R, G, B nor Y alone, at full resolution");
}

/// Throws if the file is too short for its pixels. PIZ and DWA know no bound; with them only the bands
/// protect.
void check_length(const Imf::Header& header, bool is_grey, std::int64_t pixels, std::size_t file_size) {
  constexpr std::int64_t kMaxExpansion = 1032 * 4 / 3;  // of deflate, and of PXR24 that stores 4 bytes in 3
  const Imf::Compression compression = header.compression();
  if (compression == Imf::PIZ_COMPRESSION || compression == Imf::DWAA_COMPRESSION ||
      compression == Imf::DWAB_COMPRESSION) {
    return;
  }
  constexpr std::int64_t kSmallestSample = 2;
  if (pixels * (is_grey ? 1 : 3) * kSmallestSample > kMaxExpansion * static_cast<std::int64_t>(file_size)) {
    throw std::runtime_error("the OpenEXR file is too short for the pixels that it claims");
  }
}

Image decode(std::string_view bytes) {
  check_header(bytes);
  MemoryInput stream(bytes);
  Imf::InputFile file(stream, 0);
  const Imath::Box2i window = file.header().dataWindow();
  Image image;
  image.width = window.max.x - window.min.x + 1;
  image.height = window.max.y - window.min.y + 1;
  // In 32 bits with wrap-round: only whether two are equal is asked.
  const Imath::V2i whole = file.header().displayWindow().min;
  image.left = static_cast<int>(static_cast<unsigned>(window.min.x) - static_cast<unsigned>(whole.x));
  image.top = static_cast<int>(static_cast<unsigned>(window.min.y) - static_cast<unsigned>(whole.y));
  const std::int64_t area = std::int64_t{image.width} * image.height;
  if (area > kMaxImagePixels) {
    throw std::runtime_error(
        fmt::format("the OpenEXR image claims {} x {} pixels", image.width, image.height));
  }
  const bool grey = is_grey(file.header().channels());
  check_length(file.header(), grey, area, bytes.size());
  if (!file.isComplete()) throw std::runtime_error("the OpenEXR file is incomplete");

  const auto width = static_cast<std::size_t>(image.width);
  for (int row = 0, rows = 0; row < image.height; row += rows) {
    rows = std::min(1 + kBandPixels / image.width, image.height - row);
    image.pixels.resize(image.pixels.size() + width * static_cast<std::size_t>(rows));
    glm::vec3* band = image.pixels.data() + width * static_cast<std::size_t>(row);
    Imf::FrameBuffer buffer;
    for (int c = 0; c < (grey ? 1 : 3); ++c) {
      buffer.insert(grey ? "Y" : kChannels[static_cast<std::size_t>(c)],
                    Imf::Slice::Make(Imf::FLOAT, &(*band)[c], {window.min.x, window.min.y + row}, image.width,
                                     rows, sizeof(glm::vec3), width * sizeof(glm::vec3)));
    }
    file.setFrameBuffer(buffer);
    file.readPixels(window.min.y + row, window.min.y + row + rows - 1);
    if (grey) {
      std::for_each(band, band + width * static_cast<std::size_t>(rows),
                    [](glm::vec3& p) { p = glm::vec3(p.x); });
    }
  }
  return image;
}

template <class Sample>
std::string encode(const Image& image, Imf::PixelType type, const std::vector<Sample>& samples) {
  MemoryOutput stream;
  {
    Imf::Header header(image.width, image.height);
    header.compression() = Imf::ZIP_COMPRESSION;
    Imf::FrameBuffer buffer;
    for (int c = 0; c < 3; ++c) {
      const char* name = kChannels[static_cast<std::size_t>(c)];
      header.channels().insert(name, Imf::Channel(type));
      buffer.insert(name, Imf::Slice::Make(type, samples.data() + c, Imath::V2i(0), image.width, image.height,
                                           3 * sizeof(Sample),
                                           3 * sizeof(Sample) * static_cast<std::size_t>(image.width)));
    }
    Imf::OutputFile file(stream, header, 0);
    file.setFrameBuffer(buffer);
    file.writePixels(image.height);
  }
  return stream.take();
}

template <class Sample>
std::vector<Sample> samples_of(const Image& image) {
  std::vector<Sample> samples;
  samples.reserve(3 * image.pixels.size());
  for (const glm::vec3& pixel : image.pixels) {
    for (int c = 0; c < 3; ++c) samples.push_back(Sample(pixel[c]));
  }
  return samples;
}

}  // namespace

std::string encode_exr(const Image& image, ExrSample sample) {
  limit_sizes();
  if (sample == ExrSample::float_bits) return encode(image, Imf::FLOAT, samples_of<float>(image));
  const std::vector<half> samples = samples_of<half>(image);
  if (std::any_of(samples.begin(), samples.end(), [](half h) { return h.isInfinity(); })) {
    throw std::runtime_error("a value is above 65504, the largest of 16-bit samples; store 32-bit samples");
  }
  return encode(image, Imf::HALF, samples);
}

Image decode_exr(std::string_view bytes) {
  limit_sizes();
  try {
    return decode(bytes);
  } catch (const std::runtime_error&) {
    throw;
  } catch (const std::exception& error) {  // OpenEXR's own, and std::bad_alloc
    throw std::runtime_error(fmt::format("not a whole OpenEXR image ({})", first_line(error)));
  }
}

}  // namespace icbench
