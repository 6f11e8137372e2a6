// Images in and out: nothing is lost, nothing half written appears, nothing corrupt gets through or takes
// memory.
#include "image/image.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <ImfOutputFile.h>
#include <ImfTiledOutputFile.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <set>

#include "core/random.h"
#include "files/output_file.h"
#include "image/codec.h"
#include "image/metrics/rmse.h"
#include "largest_request.h"
#include "png_chunks.h"
#include "temporary_folder.h"

namespace icbench {
namespace {

constexpr std::size_t kMebibyte = std::size_t{1} << 20;

/// Values over the whole range of positive floats, zero and denormals included.
Image wide_range_image(int width, int height) {
  Image image = make_image(width, height);
  Pcg32 random(hash_keys(static_cast<std::uint64_t>(width), static_cast<std::uint64_t>(height)));
  for (glm::vec3& pixel : image.pixels) {
    for (int c = 0; c < 3; ++c)
      pixel[c] = std::ldexp(random.uniform(), static_cast<int>(random.below(270)) - 143);
  }
  return image;
}

Image grey_ramp(int width, int height) {
  Image image = make_image(width, height);
  for (std::size_t i = 0; i < image.pixels.size(); ++i)
    image.pixels[i] = glm::vec3(static_cast<float>(i) / 64.0f);
  return image;
}

bool is_same(const Image& a, const Image& b) {
  return a.width == b.width && a.height == b.height && a.pixels.size() == b.pixels.size() &&
         std::memcmp(a.pixels.data(), b.pixels.data(), a.pixels.size() * sizeof(glm::vec3)) == 0;
}

TEST(Exr, FloatRoundTripIsExact) {
  TemporaryFolder folder;
  for (const auto& [width, height] : {std::pair{1, 1}, {7, 5}, {301, 17}, {2, 1500}}) {
    const Image image = wide_range_image(width, height);
    write_image(folder / "image.exr", image);
    EXPECT_TRUE(is_same(read_image(folder / "image.exr"), image)) << width << " x " << height;
  }
}

TEST(Exr, DecodingInBandsIsExact) {
  const Image image = grey_ramp(1, kMaxImageSide);  // the longest side
  EXPECT_TRUE(is_same(decode_exr(encode_exr(image, ExrSample::float_bits)), image));
  const Image large = wide_range_image(2048, 1100);  // several bands
  EXPECT_TRUE(is_same(decode_exr(encode_exr(large, ExrSample::float_bits)), large));
}

TEST(Exr, HalfRoundTripRoundsToNearest) {
  Image image = make_image(3, 1);
  image.pixels = {glm::vec3(0.1f, 1.0f, 65504.0f), glm::vec3(0.0f, 1.0f / 3.0f, 1000.3f),
                  glm::vec3(0x1p-14f)};
  const Image read = decode_exr(encode_exr(image, ExrSample::half_bits));
  for (std::size_t i = 0; i < 3; ++i) {
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(read.pixels[i][c], image.pixels[i][c], image.pixels[i][c] * 0x1p-11f);
  }
  EXPECT_EQ(read.pixels[0].z, 65504.0f);
}

TEST(Exr, HalfRefusesWhatItCannotHold) {
  Image image = make_image(1, 1);
  image.pixels[0].g = 70000.0f;
  EXPECT_TRUE(is_one_line_with(error_of([&] { encode_exr(image, ExrSample::half_bits); }), "65504"));
}

TEST(Exr, HeaderHoldsNothingButTheImage) {
  TemporaryFolder folder;
  write_image(folder / "image.exr", wide_range_image(4, 3));
  Imf::InputFile file((folder / "image.exr").c_str());
  std::set<std::string> names;
  for (auto i = file.header().begin(); i != file.header().end(); ++i) names.insert(i.name());
  EXPECT_EQ(names,
            (std::set<std::string>{"channels", "compression", "dataWindow", "displayWindow", "lineOrder",
                                   "pixelAspectRatio", "screenWindowCenter", "screenWindowWidth"}));
  EXPECT_EQ(file.header().compression(), Imf::ZIP_COMPRESSION);
}

TEST(Exr, GreyFilesAreReadAsGrey) {
  TemporaryFolder folder;
  const std::vector<float> luminance = {0.0f, 1e-20f, 1e20f, 0.25f, 1.0f, 2.0f};
  Imf::Header header(3, 2);
  header.channels().insert("Y", Imf::Channel(Imf::FLOAT));
  Imf::FrameBuffer buffer;
  buffer.insert("Y", Imf::Slice::Make(Imf::FLOAT, luminance.data(), header.dataWindow()));
  {
    Imf::OutputFile file((folder / "grey.exr").c_str(), header);
    file.setFrameBuffer(buffer);
    file.writePixels(2);
  }
  const Image image = read_image(folder / "grey.exr");
  ASSERT_EQ(size_error(image), "");
  for (std::size_t i = 0; i < luminance.size(); ++i) EXPECT_EQ(image.pixels[i], glm::vec3(luminance[i]));
}

TEST(Exr, PartsOfAPictureKnowWhereTheyLie) {
  TemporaryFolder folder;
  const std::vector<float> luminance(6, 1.0f);
  const auto part = [&](const char* name, int x, int y) {
    Imf::Header header(Imath::Box2i({-5, 2}, {20, 20}), Imath::Box2i({x, y}, {x + 2, y + 1}));
    header.channels().insert("Y", Imf::Channel(Imf::FLOAT));
    Imf::FrameBuffer buffer;
    buffer.insert("Y", Imf::Slice::Make(Imf::FLOAT, luminance.data(), header.dataWindow()));
    Imf::OutputFile file((folder / name).c_str(), header);
    file.setFrameBuffer(buffer);
    file.writePixels(2);
  };
  part("a.exr", -5, 2);
  part("b.exr", 4, 9);
  const Image a = read_image(folder / "a.exr"), b = read_image(folder / "b.exr");
  EXPECT_EQ(std::pair(a.left, a.top), std::pair(0, 0));
  EXPECT_EQ(std::pair(b.left, b.top), std::pair(9, 7));
  EXPECT_NO_THROW(rmse(b, b, nullptr));
  EXPECT_TRUE(is_one_line_with(error_of([&] { rmse(a, b, nullptr); }), "at pixel (0, 0) and at (9, 7)"));
}

TEST(Exr, OtherLayoutsAreRefused) {
  TemporaryFolder folder;
  const std::vector<float> depth(12);
  Imf::Header header(4, 3);
  header.channels().insert("Z", Imf::Channel(Imf::FLOAT));
  Imf::FrameBuffer buffer;
  buffer.insert("Z", Imf::Slice::Make(Imf::FLOAT, depth.data(), header.dataWindow()));
  {
    Imf::OutputFile file((folder / "depth.exr").c_str(), header);
    file.setFrameBuffer(buffer);
    file.writePixels(3);
  }
  header.setTileDescription(Imf::TileDescription(2, 2));
  {
    Imf::TiledOutputFile file((folder / "tiled.exr").c_str(), header);
    file.setFrameBuffer(buffer);
    file.writeTiles(0, 1, 0, 1);
  }
  EXPECT_TRUE(is_one_line_with(error_of([&] { read_image(folder / "depth.exr"); }), "channels"));
  EXPECT_TRUE(is_one_line_with(error_of([&] { read_image(folder / "tiled.exr"); }), "scan-line"));
}

// Y means grey only where nothing beside it has colour; samples that stand for several pixels are none of an image's.
TEST(Exr, ChannelsThatAreNotTheWholePictureAreRefused) {
  TemporaryFolder folder;
  struct Named {
    const char* name;
    int x, y;  // sampling
  };
  const auto said = [&](const std::vector<Named>& channels) {
    const std::vector<float> values(24, 0.5f);
    Imf::Header header(4, 4);
    Imf::FrameBuffer buffer;
    for (const auto& [name, x, y] : channels) {
      header.channels().insert(name, Imf::Channel(Imf::FLOAT, x, y));
      buffer.insert(name, Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(const_cast<float*>(values.data())),
                                     sizeof(float), 4 * sizeof(float), x, y));
    }
    {
      Imf::OutputFile file((folder / "image.exr").c_str(), header);
      file.setFrameBuffer(buffer);
      file.writePixels(4);
    }
    return error_of([&] { read_image(folder / "image.exr"); });
  };
  EXPECT_EQ(said({{"Y", 1, 1}, {"A", 1, 1}}), "");
  EXPECT_EQ(said({{"R", 1, 1}, {"G", 1, 1}, {"B", 1, 1}, {"Y", 1, 1}, {"Z", 1, 1}}), "");
  const std::vector<std::vector<Named>> partial = {
      {{"Y", 1, 1}, {"RY", 2, 2}},
      {{"Y", 1, 1}, {"BY", 2, 2}},
      {{"X", 1, 1}, {"Y", 1, 1}},
      {{"Y", 1, 1}, {"Z", 1, 1}},
      {{"Y", 2, 1}},
      {{"Y", 1, 2}},
      {{"R", 1, 1}, {"G", 1, 1}},
      {{"R", 1, 1}, {"G", 1, 1}, {"B", 1, 2}},
  };
  for (const std::vector<Named>& channels : partial)
    EXPECT_TRUE(is_one_line_with(said(channels), "neither channels R, G, B nor Y alone")) << channels[0].name;
}

TEST(Srgb, FollowsTheStandard) {
  EXPECT_EQ(srgb_from_linear(0.0f), 0.0f);
  EXPECT_FLOAT_EQ(srgb_from_linear(1.0f), 1.0f);
  EXPECT_FLOAT_EQ(srgb_from_linear(0.002f), 0.02584f);
  EXPECT_NEAR(srgb_from_linear(0.5f), 0.735357f, 1e-6f);
  for (int i = 0; i <= 1000; ++i) {
    const float x = static_cast<float>(i) / 1000.0f;
    EXPECT_NEAR(linear_from_srgb(srgb_from_linear(x)), x, 1e-6f);
  }
}

TEST(Png, EveryLevelSurvivesARoundTrip) {
  TemporaryFolder folder;
  Image image = make_image(16, 16);
  for (std::size_t i = 0; i < 256; ++i) {
    image.pixels[i] = {linear_from_srgb(static_cast<float>(i) / 255.0f),
                       linear_from_srgb(static_cast<float>(255 - i) / 255.0f), 0.0f};
  }
  write_image(folder / "image.PNG", image);
  EXPECT_TRUE(is_same(read_image(folder / "image.PNG"), image));
}

/// A PNG of one row; `row` holds its bytes as the format stores them, `before` chunks that stand before it.
std::string one_row_png(int width, int bit_depth, int colour_type, const std::string& row,
                        const std::string& before = "") {
  const std::string raw = '\0' + row;  // a row starts with its filter: none
  uLongf size = compressBound(raw.size());
  std::string deflated(size, '\0');
  compress(reinterpret_cast<Bytef*>(deflated.data()), &size, reinterpret_cast<const Bytef*>(raw.data()),
           raw.size());
  deflated.resize(size);
  const std::string header = {0, 0, 0, static_cast<char>(width),     0,
                              0, 0, 1, static_cast<char>(bit_depth), static_cast<char>(colour_type),
                              0, 0, 0};
  return "\x89PNG\r\n\x1a\n" + png_chunk("IHDR", header) + before + png_chunk("IDAT", deflated) +
         png_chunk("IEND", "");
}

TEST(Png, OtherColourTypes) {
  const Image grey = decode_png(one_row_png(2, 8, 0, {'\0', '\xff'}));
  EXPECT_EQ(grey.pixels.at(0), glm::vec3(0.0f));
  EXPECT_EQ(grey.pixels.at(1), glm::vec3(1.0f));
  const Image bits = decode_png(one_row_png(3, 1, 0, {'\xa0'}));
  EXPECT_EQ(bits.pixels.at(1), glm::vec3(0.0f));
  EXPECT_EQ(bits.pixels.at(2), glm::vec3(1.0f));
  const Image with_alpha = decode_png(one_row_png(1, 8, 6, {'\xff', '\0', '\xff', '\x7f'}));
  EXPECT_EQ(with_alpha.pixels.at(0), glm::vec3(1.0f, 0.0f, 1.0f));
  const Image deep = decode_png(one_row_png(1, 16, 2, {'\x80', '\0', '\0', '\1', '\xff', '\xff'}));
  EXPECT_FLOAT_EQ(deep.pixels.at(0).r, linear_from_srgb(32768.0f / 65535.0f));
  EXPECT_FLOAT_EQ(deep.pixels.at(0).g, 1.0f / 65535.0f / 12.92f);
  EXPECT_EQ(deep.pixels.at(0).b, 1.0f);
}

TEST(Png, ColoursThatAPaletteLacksAreBlack) {
  std::string row, white;
  for (int i = 0; i < 127; ++i) row += static_cast<char>(2 * i);
  for (int i = 0; i < 3 * 3; ++i) white += '\xff';
  const std::string bytes = one_row_png(127, 8, 3, row, png_chunk("PLTE", white));
  // What it would read otherwise is whatever the stack held.
  for (const int dirt : {0x00, 0x7f, 0xff}) {
    std::array<unsigned char, 1 << 16> stack;
    std::memset(stack.data(), dirt, stack.size());
    asm volatile("" : : "r"(stack.data()) : "memory");
    const Image image = decode_png(bytes);
    for (std::size_t i = 0; i < 127; ++i)
      EXPECT_EQ(image.pixels.at(i), glm::vec3(2 * i < 3 ? 1.0f : 0.0f)) << i;
  }
}

TEST(Png, PalettesHoldWholeColoursAndNoMoreThanCanBeNamed) {
  const auto read = [](std::size_t bytes) {
    return decode_png(
        one_row_png(1, 8, 3, std::string(1, '\0'), png_chunk("PLTE", std::string(bytes, '\xff'))));
  };
  EXPECT_EQ(read(3).pixels.at(0), glm::vec3(1.0f));
  EXPECT_EQ(read(768).pixels.at(0), glm::vec3(1.0f));
  for (const std::size_t bytes : {2u, 4u, 767u, 771u, 4096u})
    EXPECT_TRUE(is_one_line_with(error_of([&] { read(bytes); }), "the palette")) << bytes;
}

TEST(Png, SamplesAreReadByTheGammaThatTheFileStates) {
  const auto read = [](const std::string& before) {
    return decode_png(one_row_png(3, 8, 0, {'\0', '\x80', '\xff'}, before)).pixels;
  };
  const float half = 128.0f / 255.0f;
  const std::vector<glm::vec3> srgb = {glm::vec3(0.0f), glm::vec3(linear_from_srgb(half)), glm::vec3(1.0f)};
  const std::string light = png_chunk("gAMA", big_endian(100'000));
  EXPECT_EQ(read(light), (std::vector{glm::vec3(0.0f), glm::vec3(half), glm::vec3(1.0f)}));
  EXPECT_FLOAT_EQ(read(png_chunk("gAMA", big_endian(50'000))).at(1).r, half * half);
  EXPECT_EQ(read(png_chunk("gAMA", big_endian(45'455))), srgb) << "what writers of sRGB state";
  for (const char* const name : {"sRGB", "iCCP", "cICP"})
    EXPECT_EQ(read(light + png_chunk(name, {'\0'})), srgb) << "which has precedence: " << name;
  EXPECT_EQ(read(png_chunk("gAMA", big_endian(0))), srgb) << "which means nothing";
}

TEST(Png, ExposureScalesAndWhiteClips) {
  Image image = make_image(3, 1);
  image.pixels = {glm::vec3(0.25f), glm::vec3(2.0f), glm::vec3(3e38f)};
  Image doubled = make_image(3, 1);
  doubled.pixels = {glm::vec3(0.5f), glm::vec3(1.0f), glm::vec3(1.0f)};
  EXPECT_EQ(encode_png(image, 2.0f), encode_png(doubled, 1.0f));
  for (const float exposure : {0.0f, -1.0f, std::nanf(""), std::numeric_limits<float>::infinity()}) {
    EXPECT_TRUE(is_one_line_with(error_of([&] { encode_png(image, exposure); }), "exposure"));
  }
}

TEST(Write, RefusesValuesThatAreNotRadiance) {
  TemporaryFolder folder;
  for (const float bad : {std::nanf(""), std::numeric_limits<float>::infinity(), -1e-30f}) {
    for (const char* name : {"image.exr", "image.png"}) {
      Image image = grey_ramp(5, 4);
      image.pixels[13].b = bad;
      const std::string error = error_of([&] { write_image(folder / name, image); });
      EXPECT_TRUE(is_one_line_with(error, "pixel (3, 2)"));
      EXPECT_TRUE(is_one_line_with(error, name));
    }
  }
  EXPECT_EQ(folder.entries(), 0);
}

TEST(Write, SignedFilesHoldNegativeValues) {
  TemporaryFolder folder;
  Image image = wide_range_image(7, 5);
  for (std::size_t i = 0; i < image.pixels.size(); i += 2) image.pixels[i] *= -1.0f;
  const WriteOptions signed_values{ExrSample::float_bits, 1.0f, true};
  write_image(folder / "image.exr", image, signed_values);
  EXPECT_TRUE(is_same(read_image(folder / "image.exr"), image));
  EXPECT_THROW(write_image(folder / "image.png", image, signed_values), std::runtime_error);
  image.pixels[3].y = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(write_image(folder / "image.exr", image, signed_values), std::runtime_error);
}

TEST(Write, RefusesSizesThatDoNotHold) {
  TemporaryFolder folder;
  for (const Image& image :
       {Image{}, Image{2, 2, {glm::vec3(0)}}, Image{-1, 1, {}}, Image{kMaxImageSide + 1, 1, {}}}) {
    EXPECT_TRUE(is_one_line_with(error_of([&] { write_image(folder / "image.exr", image); }), "image.exr"));
  }
  EXPECT_EQ(folder.entries(), 0);
}

TEST(Write, FailuresLeaveNothingBehind) {
  TemporaryFolder folder;
  const Image image = grey_ramp(5, 4);
  EXPECT_TRUE(is_one_line_with(error_of([&] { write_image(folder / "image.jpeg", image); }), ".exr or .png"));
  EXPECT_TRUE(is_one_line_with(error_of([&] { write_image("/dev/full", image); }), ".exr or .png"));
  EXPECT_TRUE(
      is_one_line_with(error_of([&] { write_image(folder / "no/image.exr", image); }), "no/image.exr"));
  EXPECT_TRUE(is_one_line_with(error_of([&] { write_image("/proc/image.exr", image); }), "/proc/image.exr"));
  EXPECT_EQ(folder.entries(), 0);
  std::filesystem::create_directory(folder / "folder.exr");
  EXPECT_TRUE(is_one_line_with(error_of([&] { write_image(folder / "folder.exr", image); }), "directory"));
  EXPECT_EQ(folder.entries(), 1);
}

TEST(Write, FullDeviceIsAnError) {
  TemporaryFolder folder;
  for (const char* name : {"full.exr", "full.png"}) {
    std::filesystem::create_symlink("/dev/full", folder / name);
    EXPECT_TRUE(
        is_one_line_with(error_of([&] { write_image(folder / name, grey_ramp(5, 4)); }), "No space left"));
  }
  EXPECT_TRUE(std::filesystem::is_character_file("/dev/full"));
  EXPECT_EQ(folder.entries(), 2);
}

TEST(Write, ReplacesAFileAndFollowsLinks) {
  TemporaryFolder folder;
  write_file(folder / "real.exr", "old");
  std::filesystem::create_symlink("real.exr", folder / "link.exr");
  const Image image = grey_ramp(5, 4);
  write_image(folder / "link.exr", image);
  EXPECT_TRUE(std::filesystem::is_symlink(folder / "link.exr"));
  EXPECT_TRUE(is_same(read_image(folder / "real.exr"), image));
  EXPECT_EQ(folder.entries(), 2);
}

TEST(Write, KeepsAFilesPermissions) {
  using std::filesystem::perms;
  TemporaryFolder folder;
  for (const perms mode : {perms::owner_read | perms::owner_write, perms::owner_all | perms::group_read}) {
    write_file(folder / "a", "old");
    std::filesystem::permissions(folder / "a", mode);
    write_file(folder / "a", "new");
    EXPECT_EQ(std::filesystem::status(folder / "a").permissions(), mode);
  }
}

TEST(Read, RefusesWhatIsNoFile) {
  TemporaryFolder folder;
  std::filesystem::create_directory(folder / "folder.exr");
  std::filesystem::create_symlink("/dev/zero", folder / "endless.png");
  EXPECT_TRUE(is_one_line_with(error_of([&] { read_image(folder / "none.exr"); }), "none.exr"));
  EXPECT_TRUE(is_one_line_with(error_of([&] { read_image(folder / "folder.exr"); }), "folder.exr"));
  EXPECT_TRUE(is_one_line_with(error_of([&] { read_image(folder / "endless.png"); }), "not a regular file"));
  EXPECT_TRUE(is_one_line_with(error_of([&] { read_image(folder / "image"); }), ".exr or .png"));
}

class Corrupt : public ::testing::TestWithParam<bool> {
 protected:
  std::string encode(const Image& image) const {
    return GetParam() ? encode_exr(image, ExrSample::float_bits) : encode_png(image, 1.0f);
  }
  Image decode(std::string_view bytes) const { return GetParam() ? decode_exr(bytes) : decode_png(bytes); }
};

TEST_P(Corrupt, EveryTruncationIsAnError) {
  const std::string whole = encode(wide_range_image(9, 40));
  for (std::size_t length = 0; length < whole.size(); ++length) {
    EXPECT_FALSE(error_of([&] { decode(std::string_view(whole).substr(0, length)); }).empty()) << length;
  }
}

TEST_P(Corrupt, EveryDamagedByteIsAnErrorOrAnImage) {
  const std::string whole = encode(wide_range_image(9, 40));
  largest_request = 0;
  int errors = 0;
  for (std::size_t i = 0; i < whole.size(); ++i) {
    for (const int flip : {0x01, 0x80, 0xff}) {
      std::string damaged = whole;
      damaged[i] = static_cast<char>(damaged[i] ^ flip);
      const std::string error = error_of([&] { EXPECT_EQ(size_error(decode(damaged)), ""); });
      EXPECT_EQ(error.find('\n'), std::string::npos) << error;
      errors += !error.empty();
    }
  }
  // PNG has checksums everywhere. In EXR the compressed pixels have one, most header fields do not.
  EXPECT_GE(errors, GetParam() ? 1 : static_cast<int>(3 * whole.size()));
  EXPECT_LT(largest_request, 64 * kMebibyte);
}

TEST_P(Corrupt, RandomBytesAreAnError) {
  Pcg32 random(7);
  const std::string whole = encode(grey_ramp(9, 40));
  for (int round = 0; round < 200; ++round) {
    std::string noise(random.below(4000), '\0');
    for (char& c : noise) c = static_cast<char>(random());
    EXPECT_FALSE(error_of([&] { decode(noise); }).empty());
    EXPECT_FALSE(error_of([&] { decode(whole.substr(0, 8) + noise); }).empty());
  }
}

INSTANTIATE_TEST_SUITE_P(Formats, Corrupt, ::testing::Bool(),
                         [](const auto& format) { return format.param ? "Exr" : "Png"; });

TEST(AbsurdSize, OfAnExrTakesNoMemory) {
  std::string bytes = encode_exr(grey_ramp(9, 40), ExrSample::float_bits);
  const std::string_view mark("dataWindow\0box2i\0\x10\0\0\0", 21);
  const std::size_t upper = bytes.find(mark) + mark.size() + 8;
  ASSERT_LT(upper, bytes.size());
  for (const std::int32_t side : {kMaxImageSide - 1, kMaxImageSide, 1 << 24, 0x7ffffffe}) {
    for (const std::int32_t height : {39, side}) {
      std::memcpy(bytes.data() + upper, &side, 4);
      std::memcpy(bytes.data() + upper + 4, &height, 4);
      largest_request = 0;
      EXPECT_FALSE(error_of([&] { decode_exr(bytes); }).empty());
      EXPECT_LT(largest_request, 64 * kMebibyte) << side << " x " << height;
    }
  }
}

TEST(AbsurdSize, OfAPngIsSeenInTheHeader) {
  std::string bytes = encode_png(grey_ramp(9, 40), 1.0f);
  const auto set = [&](std::size_t at, std::uint32_t value) {
    for (std::size_t i = 0; i < 4; ++i) bytes[at + i] = static_cast<char>(value >> (24 - 8 * i));
  };
  for (const std::uint32_t side :
       {std::uint32_t{1} << 14, std::uint32_t{1} << 16, 0x7fffffffu, 0xffffffffu, 0u}) {
    set(16, side);
    set(20, side);
    set(29, static_cast<std::uint32_t>(crc32(0, reinterpret_cast<const Bytef*>(bytes.data()) + 12, 17)));
    EXPECT_TRUE(is_one_line_with(error_of([&] { decode_png(bytes); }), "claims"));
  }
}

}  // namespace
}  // namespace icbench
