// FLIP against values worked out by hand from the formulas of the papers.
#include <gtest/gtest.h>

#include <cmath>

#include "core/random.h"
#include "image/codec.h"
#include "image/metrics/colours.h"
#include "image/metrics/flip.h"

namespace icbench {
namespace {

constexpr double kPixelsPerDegree = 67.0;

Image constant(int width, int height, const glm::vec3& colour) {
  Image image = make_image(width, height);
  for (glm::vec3& pixel : image.pixels) pixel = colour;
  return image;
}

Image noise(int width, int height, std::uint64_t seed) {
  Image image = make_image(width, height);
  Pcg32 random(seed);
  for (glm::vec3& pixel : image.pixels) {
    for (int c = 0; c < 3; ++c) pixel[c] = random.uniform();
  }
  return image;
}

double mean(const Image& reference, const Image& image) {
  return first_of(flip(reference, image, nullptr, {}));
}

/// LDR-FLIP of two patches of one colour each, which is the same everywhere.
float of_patches(const glm::vec3& a, const glm::vec3& b) {
  const std::vector<float> errors = ldr_flip(constant(9, 5, a), constant(9, 5, b), kPixelsPerDegree);
  for (const float error : errors) EXPECT_NEAR(error, errors[0], 1e-5f);
  return errors[0];
}

TEST(Flip, EqualImagesHaveNoError) {
  for (const Image& image :
       {noise(37, 23, 1), constant(1, 1, glm::vec3(0.0f)), constant(8, 8, glm::vec3(3e38f))}) {
    EXPECT_EQ(mean(image, image), 0.0);
  }
}

TEST(Flip, PatchesOfOneColour) {
  // HyAB of Hunt-adjusted Lab to the power 0.7, redistributed with the largest at 41.2761^(1/0.7).
  EXPECT_NEAR(of_patches({0, 1, 0}, {0, 0, 1}), 1.0f, 1e-5f);
  EXPECT_NEAR(of_patches({0, 0, 0}, {1, 1, 1}), 0.967380f, 1e-5f);
  EXPECT_NEAR(of_patches({1, 0, 0}, {0, 1, 0}), 0.986662f, 1e-5f);
  EXPECT_NEAR(of_patches({1, 0, 0}, {0, 0, 1}), 0.965079f, 1e-5f);
  EXPECT_NEAR(of_patches(glm::vec3(0.5f), glm::vec3(0.25f)), 0.451850f, 1e-4f);
  EXPECT_NEAR(of_patches(glm::vec3(0.0f), glm::vec3(0.01f)), 0.267698f, 1e-4f);
}

/// LDR-FLIP of an image of one colour against the same with one pixel of another, by distance from that
/// pixel.
class Dot {
 public:
  Dot(const glm::vec3& ground, const glm::vec3& colour) {
    const Image plain = constant(kSide, kSide, ground);
    Image dotted = plain;
    dotted.pixels[place(0, 0)] = colour;
    errors_ = ldr_flip(plain, dotted, kPixelsPerDegree);
  }
  float at(int dx, int dy) const { return errors_[place(dx, dy)]; }

 private:
  static constexpr int kSide = 41;
  static std::size_t place(int dx, int dy) { return static_cast<std::size_t>((20 + dy) * kSide + 20 + dx); }
  std::vector<float> errors_;
};

// The values of the next two are evaluated apart from this code, with the papers' two-dimensional kernels.
TEST(Flip, OneWhitePixel) {
  const Dot dot(glm::vec3(0.0f), glm::vec3(1.0f));
  EXPECT_NEAR(dot.at(0, 0), 0.865049f, 1e-4f);  // points decide up to two pixels, then edges
  EXPECT_NEAR(dot.at(2, 0), 0.480472f, 1e-4f);
  EXPECT_NEAR(dot.at(3, 0), 0.133567f, 1e-4f);
  EXPECT_NEAR(dot.at(4, 0), 0.017979f, 1e-4f);
  for (const auto& [dx, dy] : {std::pair{-3, 0}, {0, 3}, {0, -3}}) {
    EXPECT_NEAR(dot.at(dx, dy), dot.at(3, 0), 1e-5f);
  }
  EXPECT_EQ(dot.at(11, 0), 0.0f);  // filters reach ten pixels
  EXPECT_EQ(dot.at(0, -20), 0.0f);
}

TEST(Flip, OneColouredPixel) {
  const Dot red(glm::vec3(0.5f), {1.0f, 0.35f, 0.5f});
  EXPECT_NEAR(red.at(0, 0), 0.160077f, 1e-4f);
  EXPECT_NEAR(red.at(2, 0), 0.050643f, 1e-4f);
  const Dot blue(glm::vec3(0.5f), {0.5f, 0.5f, 1.0f});
  EXPECT_NEAR(blue.at(0, 0), 0.102903f, 1e-4f);
  EXPECT_NEAR(blue.at(4, 0), 0.022829f, 1e-4f);
}

// Filters leave colours that no display has; they count as the nearest that it has.
TEST(Flip, OnePixelAroundWhichFiltersLeaveTheDisplaysColours) {
  const Dot blue(glm::vec3(0.0f), {0.0f, 0.0f, 1.0f});
  EXPECT_NEAR(blue.at(0, 0), 0.406942f, 1e-4f);
  EXPECT_NEAR(blue.at(4, 0), 0.047398f, 1e-4f);
  EXPECT_NEAR(blue.at(6, 0), 0.019575f, 1e-4f);
  const Dot green({1.0f, 0.0f, 0.0f}, {0.0f, 1.0f, 0.0f});
  EXPECT_NEAR(green.at(2, 0), 0.176486f, 1e-4f);
  EXPECT_NEAR(green.at(4, 0), 0.0f, 1e-4f);
}

// The edge's pixels go on outside.
TEST(Flip, OnePixelAtTheEdge) {
  const auto errors = [](const glm::vec3& ground, std::size_t place, const glm::vec3& colour) {
    const Image plain = constant(12, 9, ground);
    Image dotted = plain;
    dotted.pixels[place] = colour;
    return ldr_flip(plain, dotted, kPixelsPerDegree);
  };
  const std::vector<float> white = errors(glm::vec3(0.0f), 1, glm::vec3(1.0f));
  EXPECT_NEAR(white[0], 0.906616f, 1e-4f);
  EXPECT_NEAR(white[1], 0.968240f, 1e-4f);
  EXPECT_NEAR(white[3], 0.659704f, 1e-4f);
  EXPECT_NEAR(white[2 * 12], 0.476396f, 1e-4f);
  EXPECT_NEAR(white[3 * 12 + 1], 0.177196f, 1e-4f);
  const std::vector<float> blue = errors(glm::vec3(0.5f), 107, {0.5f, 0.5f, 1.0f});
  EXPECT_NEAR(blue[107], 0.385929f, 1e-4f);
  EXPECT_NEAR(blue[105], 0.228901f, 1e-4f);
  EXPECT_NEAR(blue[5 * 12 + 11], 0.166127f, 1e-4f);
}

TEST(Flip, LdrOutsideTheRangeOfDisplaysIsAtItsEnds) {
  EXPECT_EQ(of_patches(glm::vec3(1.0f), {1.0f, 3.0f, 1e30f}), 0.0f);
  EXPECT_EQ(of_patches(glm::vec3(0.0f), {0.0f, -3.0f, -1e30f}), 0.0f);
}

TEST(Flip, IsSymmetricForLdr) {
  const Image a = noise(40, 30, 2), b = noise(40, 30, 3);
  EXPECT_EQ(ldr_flip(a, b, kPixelsPerDegree), ldr_flip(b, a, kPixelsPerDegree));
}

TEST(Flip, FineDetailVanishesFromAfar) {
  Image stripes = make_image(64, 64);
  for (std::size_t i = 0; i < stripes.pixels.size(); ++i) stripes.pixels[i] = glm::vec3(i % 2 ? 0.6f : 0.4f);
  const Image grey = constant(64, 64, glm::vec3(0.5f));
  const auto middle = [&](double ppd) { return ldr_flip(grey, stripes, ppd)[32 * 64 + 32]; };
  EXPECT_GT(middle(10.0), 0.1f);
  EXPECT_LT(middle(60.0), 0.02f);
}

TEST(Flip, GrowsWithTheDifference) {
  const Image reference = noise(48, 32, 4);
  double last = 0.0;
  for (const float amount : {0.01f, 0.03f, 0.1f, 0.3f, 1.0f}) {
    Image image = reference;
    for (std::size_t i = 0; i < image.pixels.size(); ++i) image.pixels[i] *= i % 3 ? 1.0f : 1.0f + amount;
    const double error = mean(reference, image);
    EXPECT_GT(error, last);
    last = error;
  }
  EXPECT_LT(last, 1.0);
}

TEST(Flip, ExposuresBringMaximumAndMedianTo85Percent) {
  constexpr double kRoot = 2.118872324;  // where the tone curve reaches 0.85
  Image image = constant(9, 1, glm::vec3(0.125f));
  image.pixels[4] = glm::vec3(1.0f);
  FlipExposures exposures = flip_exposures(image);
  EXPECT_NEAR(exposures.start, std::log2(kRoot), 1e-6);
  EXPECT_NEAR(exposures.stop, std::log2(kRoot) + 3.0, 1e-6);
  EXPECT_NEAR(exposures.at(exposures.count - 1), exposures.stop, 1e-12);
  EXPECT_GE(exposures.count, 3);
  EXPECT_LE(exposures.count, 4);
  exposures = flip_exposures(constant(3, 3, glm::vec3(4.0f)));
  EXPECT_EQ(exposures.count, 1);
  EXPECT_NEAR(exposures.start, std::log2(kRoot) - 2.0, 1e-6);
}

TEST(Flip, ExposuresOfDarkReferences) {
  EXPECT_EQ(flip_exposures(constant(3, 3, glm::vec3(0.0f))).count, 1);
  EXPECT_EQ(flip_exposures(constant(3, 3, glm::vec3(-1.0f))).start, 0.0);
  Image image = constant(9, 1, glm::vec3(0.0f));
  for (const std::size_t i : {1u, 2u, 3u}) image.pixels[i] = glm::vec3(i == 3 ? 1.0f : 0.5f);
  const FlipExposures exposures = flip_exposures(image);
  EXPECT_NEAR(exposures.stop - exposures.start, 1.0, 1e-6);  // the median of the lit ones
}

TEST(Flip, HdrOfTwoLevels) {
  // One exposure: the reference at 0.85, the image at 0.939674, the tone curve's value of twice that light.
  constexpr double kExpected = 0.144753;
  for (const float level : {1e-20f, 1.0f, 1e20f}) {
    EXPECT_NEAR(mean(constant(5, 5, glm::vec3(level)), constant(5, 5, glm::vec3(2.0f * level))), kExpected,
                2e-4);
  }
}

TEST(Flip, DoesNotDependOnTheUnitOfRadiance) {
  Image a = noise(30, 20, 5), b = noise(30, 20, 6);
  const double error = mean(a, b);
  for (Image* image : {&a, &b}) {
    for (glm::vec3& pixel : image->pixels) pixel *= 1024.0f;
  }
  EXPECT_NEAR(mean(a, b), error, 1e-6);
}

TEST(Flip, FindsErrorsThatOneExposureHides) {
  // In the dark, which the exposure for the lamp makes black, and in the lamp, which the other makes white.
  Image reference = constant(40, 40, glm::vec3(1e-3f));
  for (std::size_t i = 0; i < 400; ++i) reference.pixels[i] = glm::vec3(10.0f);
  Image image = reference;
  for (std::size_t i = 1200; i < 1600; ++i) image.pixels[i] *= 2.0f;
  for (std::size_t i = 0; i < 400; ++i) image.pixels[i] *= 0.5f;
  EXPECT_LT(ldr_flip(reference, image, kPixelsPerDegree).back(), 0.1f);
  EXPECT_EQ(ldr_flip(reference, image, kPixelsPerDegree).front(), 0.0f);
  Image map;
  flip(reference, image, &map, {});
  EXPECT_GT(map.pixels.back().x, 0.1f);
  EXPECT_GT(map.pixels.front().x, 0.1f);
}

TEST(Flip, HardCases) {
  Image wild = noise(8, 6, 7);
  wild.pixels[3] = glm::vec3(3e38f);
  wild.pixels[4] = glm::vec3(-3e38f);
  wild.pixels[5] = glm::vec3(1e-38f);
  for (const Image& a : {wild, constant(8, 6, glm::vec3(0.0f)), constant(8, 6, glm::vec3(1e20f))}) {
    for (const Image& b : {wild, constant(8, 6, glm::vec3(0.0f)), constant(8, 6, glm::vec3(1e-20f))}) {
      const double error = mean(a, b);
      EXPECT_GE(error, 0.0);
      EXPECT_LE(error, 1.0);
    }
  }
}

TEST(Flip, MapIsTheErrorAndPaintsAsMagma) {
  const Image a = noise(20, 10, 8), b = noise(20, 10, 9);
  Image map;
  const double error = first_of(flip(a, b, &map, {}));
  EXPECT_NEAR(channel_mean(map), error, 1e-9);
  const Image painted = paint_flip(map, a);
  EXPECT_EQ(painted.pixels[7], magma(map.pixels[7].x));
  // matplotlib's table at 0, 0.5 (between entries 127 and 128) and 1.
  const auto is_near = [](const glm::vec3& colour, int r, int g, int b8) {
    EXPECT_NEAR(255.0f * srgb_from_linear(colour.r), r, 2.5f);
    EXPECT_NEAR(255.0f * srgb_from_linear(colour.g), g, 2.5f);
    EXPECT_NEAR(255.0f * srgb_from_linear(colour.b), b8, 2.5f);
  };
  is_near(magma(-1.0f), 0, 0, 4);
  is_near(magma(0.5f), 182, 55, 122);
  is_near(magma(2.0f), 252, 253, 191);
}

}  // namespace
}  // namespace icbench
