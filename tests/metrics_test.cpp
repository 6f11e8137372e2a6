// Error metrics against closed forms.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <bit>
#include <cmath>
#include <limits>

#include "core/random.h"
#include "image/metrics/registry.h"
#include "temporary_folder.h"

namespace icbench {
namespace {

Image constant(int width, int height, float value) {
  Image image = make_image(width, height);
  for (glm::vec3& pixel : image.pixels) pixel = glm::vec3(value);
  return image;
}

Image noise(int width, int height, std::uint64_t seed) {
  Image image = make_image(width, height);
  Pcg32 random(seed);
  for (glm::vec3& pixel : image.pixels) {
    for (int c = 0; c < 3; ++c) pixel[c] = std::pow(10.0f, 40.0f * random.uniform() - 20.0f);
  }
  return image;
}

double figure(MetricFunction metric, const Image& reference, const Image& image, Image* map = nullptr) {
  const std::vector<MetricValue> values = metric(reference, image, map);
  EXPECT_EQ(values.size(), 1u);
  return first_of(values);
}

TEST(Metrics, EqualImagesAreEqual) {
  for (const Image& image : {noise(37, 23, 1), constant(1, 1, 0.0f), constant(8, 8, 3e38f)}) {
    EXPECT_EQ(figure(rmse, image, image), 0.0);
    EXPECT_EQ(figure(relmse, image, image), 0.0);
    EXPECT_EQ(figure(mean_ratio, image, image), 1.0);
    EXPECT_EQ(figure(block_rmse, image, image), 0.0);
  }
}

TEST(Metrics, ConstantFactor) {
  for (const float level : {1e-20f, 0.5f, 1e20f}) {
    const double c = level;
    const Image reference = constant(37, 23, level);
    const Image brighter = constant(37, 23, 1.5f * level);
    EXPECT_NEAR(figure(rmse, reference, brighter) / c, 0.5, 1e-6);
    const double relative = 0.25 * c * c / (c * c + kRelmseEpsilon);
    EXPECT_NEAR(figure(relmse, reference, brighter) / relative, 1.0, 1e-6);
    EXPECT_NEAR(figure(mean_ratio, reference, brighter), 1.5, 1e-6);
    EXPECT_NEAR(figure(block_rmse, reference, brighter), 0.5, 1e-6);
  }
}

TEST(Metrics, EveryChannelAndPixelCountsOnce) {
  const Image reference = constant(16, 8, 2.0f);
  for (const std::size_t pixel : {std::size_t{0}, std::size_t{77}, std::size_t{127}}) {
    for (int channel = 0; channel < 3; ++channel) {
      Image image = reference;
      image.pixels[pixel][channel] = 5.0f;
      const double terms = 3.0 * 128.0;
      EXPECT_DOUBLE_EQ(figure(rmse, reference, image), std::sqrt(9.0 / terms));
      EXPECT_DOUBLE_EQ(figure(relmse, reference, image), 9.0 / (4.0 + kRelmseEpsilon) / terms);
      EXPECT_DOUBLE_EQ(figure(mean_ratio, reference, image), (2.0 * terms + 3.0) / (2.0 * terms));
      const double block = 3.0 / 16.0;
      EXPECT_DOUBLE_EQ(figure(block_rmse, reference, image), std::sqrt(block * block * 16.0 / terms) / 2.0);
    }
  }
}

TEST(Metrics, RelmseOfABlackReferenceIsFinite) {
  EXPECT_NEAR(figure(relmse, constant(3, 3, 0.0f), constant(3, 3, 0.1f)), 1.0, 1e-6);
}

TEST(Metrics, ScaledRelmseIsThatOfPicturesOfMeanLuminanceOneHoweverBrightTheLight) {
  Image reference = constant(8, 4, 0.5f), image = reference;
  for (std::size_t i = 0; i < reference.pixels.size(); ++i) {
    reference.pixels[i] = {i % 2 ? 1.5f : 0.5f, i % 2 ? 1.25f : 0.75f, i % 3 ? 1.0f : 0.0f};
    image.pixels[i] = 1.125f * reference.pixels[i] + 0.0625f;
  }
  const double scale = relmse_scale(reference);
  const auto times = [](Image pixels, double factor) {
    for (glm::vec3& L : pixels.pixels) L *= static_cast<float>(factor);
    return pixels;
  };
  const Image one = times(reference, scale);
  EXPECT_NEAR(relmse_scale(one), 1.0, 1e-6);
  EXPECT_NEAR(relmse_scale(constant(2, 2, 4.0f)), 0.25, 1e-9);
  const double expected = figure(relmse, one, times(image, scale));
  for (const double brightness : {1e-3, 1.0, 1e3}) {
    EXPECT_NEAR(scaled_relmse(times(reference, brightness), times(image, brightness)) / expected, 1.0, 1e-5);
  }
  const Image black = constant(3, 3, 0.0f), grey = constant(3, 3, 0.1f);
  EXPECT_EQ(scaled_relmse(black, grey), figure(relmse, black, grey));
}

TEST(Metrics, BlocksAverageNoiseOut) {
  const Image reference = constant(16, 12, 2.0f);
  Image image = reference;
  for (std::size_t i = 0; i < image.pixels.size(); ++i) image.pixels[i] += (i + i / 16) % 2 ? 0.5f : -0.5f;
  EXPECT_EQ(figure(rmse, reference, image), 0.5);
  EXPECT_EQ(figure(block_rmse, reference, image), 0.0);
}

TEST(Metrics, EdgeBlocksWeighByTheirPixels) {
  const Image reference = constant(5, 1, 1.0f);  // a block of four pixels and one of one
  Image image = reference;
  image.pixels[0] = glm::vec3(5.0f);
  image.pixels[4] = glm::vec3(3.0f);
  Image map;
  EXPECT_DOUBLE_EQ(figure(block_rmse, reference, image, &map), std::sqrt((4 * 1.0 + 1 * 4.0) / 5));
  EXPECT_EQ(map.pixels[0], glm::vec3(1.0f));
  EXPECT_EQ(map.pixels[3], glm::vec3(1.0f));
  EXPECT_EQ(map.pixels[4], glm::vec3(2.0f));
}

TEST(Metrics, MapsHoldTheTermsOfTheMean) {
  const Image reference = constant(4, 4, 1.0f);
  Image image = reference;
  image.pixels[6].g = 0.25f;
  Image map;
  figure(rmse, reference, image, &map);
  EXPECT_EQ(map.pixels[6], glm::vec3(0.0f, 0.75f, 0.0f));
  figure(relmse, reference, image, &map);
  EXPECT_EQ(map.pixels[6], glm::vec3(0.0f, static_cast<float>(0.5625 / 1.01), 0.0f));
}

TEST(Metrics, EveryMapCanBeWritten) {
  TemporaryFolder folder;
  Image reference = noise(9, 7, 2);
  Image image = noise(9, 7, 3);
  reference.pixels[5] = glm::vec3(3e38f);
  image.pixels[5] = glm::vec3(-3e38f);
  for (const Metric& metric : kMetrics) {
    Image map;
    metric.compute(reference, image, &map, {});
    EXPECT_EQ(map.pixels.empty(), !metric.has_map) << metric.name;
    if (!metric.has_map) continue;
    EXPECT_NO_THROW(write_image(folder / "map.exr", map)) << metric.name;
    if (!metric.paint) continue;
    EXPECT_NO_THROW(write_image(folder / "map.png", metric.paint(map, reference))) << metric.name;
  }
}

TEST(Metrics, DarkReferences) {
  const Image black = constant(4, 4, 0.0f);
  const Image bright = constant(4, 4, 1.0f);
  EXPECT_EQ(figure(mean_ratio, black, black), 1.0);
  EXPECT_EQ(figure(mean_ratio, bright, black), 0.0);
  EXPECT_EQ(figure(block_rmse, bright, black), 1.0);
  EXPECT_EQ(mean_ratio(black, bright, nullptr).at(0).value, std::nullopt);
  EXPECT_EQ(block_rmse(black, bright, nullptr).at(0).value, std::nullopt);
}

TEST(Metrics, RefuseWhatCannotBeCompared) {
  const Image image = constant(4, 3, 1.0f);
  Image broken = image;
  broken.pixels[7].r = std::nanf("");
  for (const Metric& metric : kMetrics) {
    const auto error = [&](const Image& a, const Image& b) {
      return error_of([&] { metric.compute(a, b, nullptr, {}); });
    };
    EXPECT_TRUE(is_one_line_with(error(image, constant(3, 4, 1.0f)), "4 x 3 and 3 x 4"));
    EXPECT_TRUE(is_one_line_with(error(image, Image{}), "empty"));
    EXPECT_TRUE(is_one_line_with(error(image, broken), "the image: pixel (3, 1)"));
    EXPECT_TRUE(is_one_line_with(error(broken, image), "the reference: pixel (3, 1)"));
  }
}

TEST(Metrics, SumsKeepTheirDigits) {
  // One running sum of three million terms would be off by 1e-11.
  EXPECT_NEAR(channel_mean(constant(1024, 1024, 0.1f)) / double{0.1f}, 1.0, 1e-13);
}

TEST(Metrics, DoNotDependOnTheNumberOfThreads) {
  for (const Metric& metric : kMetrics) {
    const bool is_costly = metric.paint != nullptr;
    const int width = is_costly ? 97 : 517, height = is_costly ? 61 : 311;
    const Image reference = noise(width, height, 4);
    const Image image = noise(width, height, 5);
    std::vector<std::vector<std::uint64_t>> results;
    for (const std::size_t threads : {1u, 2u, 3u, 8u}) {
      const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
      for (int round = 0; round < (is_costly ? 1 : 5); ++round) {
        Image map;
        std::vector<std::uint64_t> bits;
        for (const MetricValue& part : metric.compute(reference, image, &map, {})) {
          bits.push_back(std::bit_cast<std::uint64_t>(part.value.value()));
        }
        for (const glm::vec3& pixel : map.pixels) bits.push_back(std::bit_cast<std::uint32_t>(pixel.y));
        results.push_back(bits);
      }
    }
    for (const auto& bits : results) EXPECT_EQ(bits, results.front()) << metric.name;
  }
}

}  // namespace
}  // namespace icbench
