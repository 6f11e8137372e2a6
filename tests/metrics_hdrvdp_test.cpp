// HDR-VDP: its parts against published formulas evaluated apart, the whole against thresholds in closed form.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <thread>

#include "core/random.h"
#include "image/metrics/fourier.h"
#include "image/metrics/hdrvdp.h"
#include "image/metrics/hdrvdp_model.h"

namespace icbench {
namespace {

constexpr double kPi = std::numbers::pi;

/// A width that gratings along x of 3, 6, 12 and 24 pixels fill, mirrored, without a seam; and a height.
constexpr int kSide = 120, kHeight = 24;

/// Radiance is luminance in cd/m^2 in these tests.
Viewing luminance_viewing() {
  Viewing viewing;
  viewing.luminance_scale = 1.0;
  return viewing;
}

Image grey(int width, int height, double level) {
  Image image = make_image(width, height);
  for (glm::vec3& pixel : image.pixels) pixel = glm::vec3(static_cast<float>(level));
  return image;
}

/// Adds the grating of `period` pixels along x, symmetric about the left edge, at `contrast` of each pixel.
Image with_grating(Image image, int period, double contrast) {
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    const double x = static_cast<double>(i % static_cast<std::size_t>(image.width)) + 0.5;
    image.pixels[i] *= static_cast<float>(1.0 + contrast * std::cos(2.0 * kPi * x / period));
  }
  return image;
}

Image with_noise(Image image, double contrast, std::uint64_t seed) {
  Pcg32 random(seed);
  for (glm::vec3& pixel : image.pixels) {
    pixel *= static_cast<float>(1.0 + contrast * (2.0 * random.uniform() - 1.0));
  }
  return image;
}

struct Seen {
  double p75, p95;
};

Seen seen(const Image& reference, const Image& image, const Viewing& viewing = luminance_viewing(),
          Image* map = nullptr) {
  const std::vector<MetricValue> values = hdrvdp(reference, image, map, viewing);
  EXPECT_EQ(values.at(0).name, "p75");
  EXPECT_EQ(values.at(1).name, "p95");
  return {values[0].value.value(), values[1].value.value()};
}

/// Smallest contrast of a grating on `reference` that a quarter of the pixels show with P > 75 %, by
/// bisection.
double visible_contrast(const Image& reference, int period) {
  double low = 1e-3, high = 1.0;
  while (high / low > 1.1) {
    const double middle = std::sqrt(low * high);
    (seen(reference, with_grating(reference, period, middle)).p75 > 25.0 ? high : low) = middle;
  }
  return std::sqrt(low * high);
}

TEST(HdrVdpModel, PupilAndOptics) {
  EXPECT_NEAR(pupil_diameter(1.0), 4.9, 1e-12);
  EXPECT_NEAR(pupil_diameter(100.0), 2.90789, 1e-5);
  EXPECT_NEAR(pupil_diameter(1e-4), 7.66501, 1e-5);
  EXPECT_EQ(optical_transfer(0.0, 3.0), 1.0);
  EXPECT_NEAR(optical_transfer(1.0, 3.0), 0.947613, 1e-6);
  EXPECT_NEAR(optical_transfer(10.0, 3.0), 0.515821, 1e-6);
  EXPECT_NEAR(optical_transfer(10.0, 6.0), 0.307839, 1e-6);
  EXPECT_NEAR(optical_transfer(30.0, 2.0), 0.139050, 1e-6);
}

TEST(HdrVdpModel, ContrastSensitivity) {
  const SensitivityConditions bright{100.0, 100.0, 0.5};
  EXPECT_EQ(contrast_sensitivity(0.0, 0.0, bright), 0.0);
  EXPECT_NEAR(contrast_sensitivity(1.0, 0.0, bright), 130.5684, 1e-3);
  EXPECT_NEAR(contrast_sensitivity(4.0, 0.0, bright), 224.1235, 1e-3);
  EXPECT_NEAR(contrast_sensitivity(4.0, kPi / 2.0, bright), 224.1235, 1e-3);
  EXPECT_NEAR(contrast_sensitivity(4.0, kPi / 4.0, bright), 196.8132, 1e-3);  // the oblique effect
  EXPECT_NEAR(contrast_sensitivity(10.0, 0.0, bright), 95.9557, 1e-3);
  EXPECT_NEAR(contrast_sensitivity(2.0, 0.0, {0.01, 100.0, 0.5}), 17.30635, 1e-4);
  EXPECT_NEAR(contrast_sensitivity(16.0, 0.0, {10.0, 64.0, 2.0}), 28.08725, 1e-4);
  EXPECT_EQ(contrast_sensitivity(1e6, 0.0, bright), 0.0);
  EXPECT_NEAR(peak_sensitivity(bright), 236.8665, 0.01);
  EXPECT_NEAR(peak_sensitivity({1.0, 100.0, 0.5}), 117.5821, 0.01);
  EXPECT_NEAR(peak_sensitivity({1e-3, 100.0, 0.5}), 11.33127, 0.01);
}

TEST(HdrVdpModel, ThresholdsOfTheWholeRange) {
  EXPECT_NEAR(threshold_contrast(1e6), kPeakContrast, 1e-6);
  EXPECT_NEAR(threshold_contrast(100.0), 0.00666671, 1e-8);
  EXPECT_NEAR(threshold_contrast(1.0), 0.01333181, 1e-8);
  EXPECT_NEAR(threshold_contrast(1e-4), 0.28001632, 1e-8);
  // It is the peak of the sensitivity, for images so large that size does not count.
  const auto peak = [](double luminance) { return peak_sensitivity({luminance, 1e12, 1.0}); };
  for (const double luminance : {1e-3, 0.1, 10.0, 100.0}) {
    EXPECT_NEAR(threshold_contrast(luminance) * peak(luminance) / (kPeakContrast * peak(1e9)), 1.0, 1e-3);
  }
}

TEST(HdrVdpModel, OneStepOfTheJndScaleIsTheThreshold) {
  const JndScale jnd;
  EXPECT_EQ(jnd(0.0), 0.0);
  EXPECT_EQ(jnd(kMinLuminance), 0.0);
  EXPECT_EQ(jnd(1e300), jnd(kMaxLuminance));
  for (const double luminance : {1e-4, 1e-2, 1.0, 100.0, 1e6}) {
    const double step = 0.01 * luminance * threshold_contrast(luminance);
    EXPECT_NEAR((jnd(luminance + step) - jnd(luminance - step)) / 0.02, 1.0, 1e-2) << luminance;
  }
  // Weber's law: decades of bright light are ln(10) / 0.006 steps.
  EXPECT_NEAR(jnd(1e9) - jnd(1e8), std::log(10.0) / kPeakContrast, 0.01);
}

TEST(HdrVdpModel, ChannelsAddUpToTheImage) {
  for (double frequency = 0.0; frequency < 0.75; frequency += 0.0007) {
    double sum = base_filter(frequency);
    for (int band = 0; band < kBands; ++band) {
      EXPECT_GE(dom(band, frequency), 0.0);
      sum += dom(band, frequency);
    }
    EXPECT_NEAR(sum, 1.0, 1e-12);
  }
  for (double angle = -kPi / 2.0; angle <= kPi / 2.0; angle += 0.01) {
    double sum = 0.0;
    for (int orientation = 0; orientation < kOrientations; ++orientation) {
      sum += fan(orientation, angle);
      EXPECT_NEAR(fan(orientation, angle), fan(orientation, angle + kPi), 1e-12);
    }
    EXPECT_NEAR(sum, 1.0, 1e-12);
  }
  EXPECT_EQ(dom(2, 1.0 / 6.0), 1.0);  // a frequency that one band has to itself
  EXPECT_EQ(fan(3, 0.0), 1.0);
  EXPECT_NEAR(fan(3, kPi / 12.0), 0.5, 1e-12);
  EXPECT_NEAR(mesa(2, 0.25), 0.5, 1e-12);
}

TEST(HdrVdpModel, MaskingAndDetection) {
  EXPECT_EQ(threshold_elevation(0.0), 1.0);
  EXPECT_NEAR(threshold_elevation(1.0 / 6.0), std::pow(2.0, 0.25), 1e-12);
  EXPECT_NEAR(threshold_elevation(10.0), 60.0, 1e-4);
  EXPECT_EQ(detection_exponent(1.0), 1.0);
  EXPECT_NEAR(detection_exponent(4.0), 128.0, 1e-12);
}

TEST(Fourier, UndoesItselfAndFindsAFrequency) {
  for (const auto& [width, height] : {std::pair{1, 1}, {1, 7}, {12, 10}, {31, 17}}) {
    const Fourier fourier(width, height);
    RealPlane plane(fourier.real_size()), back(fourier.real_size());
    Pcg32 random(1);
    for (std::size_t i = 0; i < plane.size(); ++i) plane[i] = random.uniform();
    Spectrum spectrum(fourier.spectrum_size());
    fourier.forward(plane, spectrum);
    fourier.inverse(spectrum, back);
    for (std::size_t i = 0; i < plane.size(); ++i) EXPECT_NEAR(back[i], plane[i], 1e-14);
  }
  const Fourier fourier(12, 8);
  RealPlane plane(fourier.real_size());
  for (std::size_t i = 0; i < plane.size(); ++i) {
    plane[i] =
        std::cos(2.0 * kPi * (0.25 * static_cast<double>(i % 12) - 0.125 * static_cast<double>(i / 12)));
  }
  Spectrum spectrum(fourier.spectrum_size());
  fourier.forward(plane, spectrum);
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < fourier.spectrum_width(); ++x) {
      const bool is_it = fourier.frequency_x(x) == 0.25 && fourier.frequency_y(y) == -0.125;
      const auto place = static_cast<std::size_t>(y * fourier.spectrum_width() + x);
      EXPECT_NEAR(std::abs(spectrum[place]), is_it ? 48.0 : 0.0, 1e-12);
    }
  }
  EXPECT_EQ(fast_transform_size(1), 2);
  EXPECT_EQ(fast_transform_size(576), 576);
  EXPECT_EQ(fast_transform_size(577), 588);
}

TEST(Fourier, PlansFromManyThreads) {
  std::vector<std::jthread> threads;
  std::vector<int> good(8, 0);
  for (int t = 0; t < 8; ++t) {
    threads.emplace_back([t, &good] {
      for (int round = 0; round < 20; ++round) {
        const Fourier fourier(30 + t, 20 + round);
        RealPlane plane(fourier.real_size());
        for (std::size_t i = 0; i < plane.size(); ++i) plane[i] = 1.0;
        Spectrum spectrum(fourier.spectrum_size());
        fourier.forward(plane, spectrum);
        good[static_cast<std::size_t>(t)] +=
            std::abs(spectrum[0].real() - static_cast<double>(plane.size())) < 1e-9;
      }
    });
  }
  threads.clear();
  for (const int count : good) EXPECT_EQ(count, 20);
}

TEST(HdrVdp, EqualImagesAreEqual) {
  for (const Image& image : {with_noise(grey(37, 23, 50.0), 0.9, 1), grey(1, 1, 0.0), grey(70, 64, 3e38)}) {
    Image map;
    const Seen result = seen(image, image, luminance_viewing(), &map);
    EXPECT_EQ(result.p75, 0.0);
    EXPECT_EQ(result.p95, 0.0);
    for (const glm::vec3& pixel : map.pixels) EXPECT_EQ(pixel, glm::vec3(0.0f));
  }
}

TEST(HdrVdp, GratingsAppearAtTheInverseOfTheSensitivity) {
  // The periods are those that fall into one channel each, so that no probability is summed: P is 75 % where
  // the contrast is (ln 4)^(1/3.5) thresholds. `largest` is the grating's largest value at a pixel's centre.
  const double ppd = pixels_per_degree(Viewing{}).x;
  const double area = kSide / ppd * (kHeight / ppd);
  const double units75 = std::pow(std::log(4.0), 1.0 / kPsychometricSlope);
  const double units95 = std::pow(std::log(20.0), 1.0 / kPsychometricSlope);
  for (const double level : {0.1, 10.0, 100.0}) {
    const Image uniform = grey(kSide, kHeight, level);
    for (const int period : {3, 6, 12, 24}) {
      const SensitivityConditions at{level, area, 0.5};
      const double relative = contrast_sensitivity(ppd / period, 0.0, at) / peak_sensitivity(at);
      const double largest = period == 3 ? 1.0 : std::cos(kPi / period);
      const double threshold = threshold_contrast(level) / relative / largest;
      if (threshold * units95 > 0.2) continue;  // contrast so large that the response is no longer linear
      const auto look = [&](double units) {
        return seen(uniform, with_grating(uniform, period, units * threshold));
      };
      EXPECT_EQ(look(0.95 * units75).p75, 0.0) << level << " cd/m2, period " << period;
      const Seen between = look(std::sqrt(units75 * units95));
      EXPECT_GT(between.p75, 0.0) << level << " cd/m2, period " << period;
      EXPECT_EQ(between.p95, 0.0) << level << " cd/m2, period " << period;
      EXPECT_GT(look(1.05 * units95).p95, 0.0) << level << " cd/m2, period " << period;
    }
  }
}

TEST(HdrVdp, GrowsWithContrast) {
  const Image reference = with_noise(grey(kSide, kHeight, 50.0), 0.02, 2);
  Seen last{0.0, 0.0};
  for (const double contrast : {0.002, 0.01, 0.02, 0.05, 0.1, 0.3}) {
    const Seen now = seen(reference, with_grating(reference, 12, contrast));
    EXPECT_GE(now.p75, last.p75);
    EXPECT_GE(now.p95, last.p95);
    EXPECT_GE(now.p75, now.p95);
    last = now;
  }
  EXPECT_GT(last.p95, 60.0);
}

TEST(HdrVdp, NoiseMasks) {
  const Image uniform = grey(kSide, kHeight, 50.0);
  const double plain = visible_contrast(uniform, 6);
  const double on_weak = visible_contrast(with_noise(uniform, 0.1, 3), 6);
  const double on_strong = visible_contrast(with_noise(uniform, 0.4, 3), 6);
  EXPECT_GT(on_weak, 2.0 * plain);
  EXPECT_GT(on_strong, 1.5 * on_weak);
}

TEST(HdrVdp, MaskingDoesNotDependOnThePhaseOfTheMask) {
  // A grating, and the same with a weaker one a quarter of a period off: it is largest where the first is 0,
  // and hidden there all the same. Judged in the middle, away from where the mirrored image has a kink.
  const Image mask = with_grating(grey(kSide, kHeight, 50.0), 12, 0.1);
  const auto quadrature = [](const Image& on, double contrast) {
    Image image = on;
    for (std::size_t i = 0; i < image.pixels.size(); ++i) {
      const double x = static_cast<double>(i % kSide) + 0.5;
      image.pixels[i] += static_cast<float>(50.0 * contrast * std::sin(2.0 * kPi * x / 12.0));
    }
    return image;
  };
  const auto largest_in_the_middle = [](const Image& reference, const Image& image) {
    Image map;
    seen(reference, image, luminance_viewing(), &map);
    float largest = 0.0f;
    for (std::size_t i = 0; i < map.pixels.size(); ++i) {
      if (i % kSide >= 48 && i % kSide < 72) largest = std::max(largest, map.pixels[i].x);
    }
    return largest;
  };
  const Image uniform = grey(kSide, kHeight, 50.0);
  EXPECT_GT(largest_in_the_middle(uniform, quadrature(uniform, 0.03)), 0.95f);
  EXPECT_LT(largest_in_the_middle(mask, quadrature(mask, 0.03)), 0.05f);
}

TEST(HdrVdp, MaskingWantsTheContrastInBothImages) {
  // Mutual masking: noise that is in one image only hides nothing; it is what is seen.
  const Image uniform = grey(kSide, kHeight, 50.0);
  EXPECT_GT(seen(uniform, with_noise(uniform, 0.4, 4)).p95, 90.0);
}

TEST(HdrVdp, FineDetailVanishesFromAfar) {
  const Image uniform = grey(kSide, kHeight, 50.0);
  const Image detail = with_grating(uniform, 6, 0.1);
  Viewing viewing = luminance_viewing();
  EXPECT_GT(seen(uniform, detail, viewing).p75, 50.0);
  viewing.distance = 5.0;
  EXPECT_EQ(seen(uniform, detail, viewing).p75, 0.0);
}

TEST(HdrVdp, LessIsSeenInTheDark) {
  const Image uniform = grey(kSide, kHeight, 100.0);
  const Image detail = with_grating(uniform, 12, 0.05);
  Viewing viewing = luminance_viewing();
  EXPECT_GT(seen(uniform, detail, viewing).p75, 50.0);
  viewing.luminance_scale = 1e-5;
  EXPECT_EQ(seen(uniform, detail, viewing).p75, 0.0);
}

TEST(HdrVdp, DoesNotSeeColourOrAFactorOfTheWhole) {
  EXPECT_EQ(seen(grey(64, 64, 10.0), grey(64, 64, 15.0)).p75, 0.0);
  Image green = grey(64, 64, 0.0);
  for (glm::vec3& pixel : green.pixels) pixel = {0.0f, 10.0f / 0.7152f, 0.0f};
  EXPECT_EQ(seen(grey(64, 64, 10.0), green).p75, 0.0);
}

TEST(HdrVdp, IsSymmetric) {
  const Image a = with_noise(grey(70, 50, 5.0), 0.5, 5), b = with_noise(a, 0.2, 6);
  const Seen ab = seen(a, b), ba = seen(b, a);
  EXPECT_GT(ab.p75, 0.0);
  EXPECT_EQ(ab.p75, ba.p75);
  EXPECT_EQ(ab.p95, ba.p95);
}

TEST(HdrVdp, DifferencesStayAtTheirPlace) {
  // Opposite edges do not meet.
  const Image uniform = with_noise(grey(128, 64, 50.0), 0.01, 7);
  Image image = uniform;
  for (std::size_t y = 0; y < 64; ++y) {
    for (std::size_t x = 0; x < 4; ++x) image.pixels[y * 128 + x] *= x % 2 ? 1.5f : 0.7f;
  }
  for (std::size_t i = 0; i < image.pixels.size(); ++i) image.pixels[i] *= i % 128 == 5 ? 1.0f : 1.0001f;
  Image map;
  seen(uniform, image, luminance_viewing(), &map);
  for (std::size_t y = 0; y < 64; ++y) {
    EXPECT_GT(map.pixels[y * 128 + 1].x, 0.95f);
    EXPECT_LT(map.pixels[y * 128 + 127].x, 0.01f);
    EXPECT_EQ(map.pixels[y * 128 + 5].x, 0.0f);  // the only column that is equal
  }
}

// A patch of six pixels a period in a window that is far wider than that has the grating's threshold in its middle.
TEST(HdrVdp, PatchIsSeenWhereItIsAndAboveItsThreshold) {
  constexpr int kWide = 240;
  constexpr double kPeriod = 6.0, kLevel = 50.0,
                   kWindow = 24.0;  // pixels, cd/m^2, standard deviation in pixels
  const double ppd = pixels_per_degree(Viewing{}).x;
  const SensitivityConditions at{kLevel, kWide / ppd * (kHeight / ppd), 0.5};
  const double threshold =
      threshold_contrast(kLevel) * peak_sensitivity(at) / contrast_sensitivity(ppd / kPeriod, 0.0, at);
  const Image uniform = grey(kWide, kHeight, kLevel);
  const auto probabilities = [&](double units) {
    Image image = uniform, map;
    for (std::size_t i = 0; i < image.pixels.size(); ++i) {
      const double x = static_cast<double>(i % kWide) - kWide / 2;
      const double window = std::exp(-0.5 * x * x / (kWindow * kWindow));
      image.pixels[i] *=
          static_cast<float>(1.0 + units * threshold * window * std::cos(2.0 * kPi * x / kPeriod));
    }
    seen(uniform, image, luminance_viewing(), &map);
    return map;
  };
  const auto chance = [](double units) { return 1.0 - std::exp(-std::pow(units, kPsychometricSlope)); };
  for (const double units : {0.5, 0.8, 1.0, 1.25, 2.0}) {
    const Image map = probabilities(units);
    for (std::size_t y = 0; y < kHeight; ++y) {
      const float middle = map.pixels[y * kWide + kWide / 2].x;
      EXPECT_GT(middle, chance(0.95 * units)) << units;
      EXPECT_LT(middle, chance(1.05 * units)) << units;
      for (const std::size_t x : {0, 24, kWide - 24, kWide - 1})
        EXPECT_LT(map.pixels[y * kWide + x].x, 0.001f);
    }
  }
}

// The same at an angle, on pixels of any shape: an orientation of the cortex to itself, seen less than upright ones.
TEST(HdrVdp, ObliquePatchesAreSeenAboveTheirOwnThreshold) {
  constexpr int kSize = 160;
  constexpr double kPeriod = 6.0, kLevel = 50.0, kWindow = 20.0, kAngle = kPi / 6.0;
  for (const double height : {0.3, 0.2}) {
    Viewing viewing = luminance_viewing();
    viewing.display_height = height;
    const PixelsPerDegree ppd = pixels_per_degree(viewing);
    const double fx = ppd.x * std::cos(kAngle) / kPeriod, fy = ppd.y * std::sin(kAngle) / kPeriod;
    const SensitivityConditions at{kLevel, kSize / ppd.x * (kSize / ppd.y), 0.5};
    const double threshold = threshold_contrast(kLevel) * peak_sensitivity(at) /
                             contrast_sensitivity(std::hypot(fx, fy), std::atan2(fy, fx), at);
    const Image uniform = grey(kSize, kSize, kLevel);
    for (const double units : {0.8, 1.0, 1.25}) {
      Image image = uniform, map;
      for (std::size_t i = 0; i < image.pixels.size(); ++i) {
        const double x = static_cast<double>(i % kSize) - kSize / 2,
                     y = static_cast<double>(i / kSize) - kSize / 2;
        const double along = x * std::cos(kAngle) + y * std::sin(kAngle);
        const double window = std::exp(-0.5 * (x * x + y * y) / (kWindow * kWindow));
        image.pixels[i] *=
            static_cast<float>(1.0 + units * threshold * window * std::cos(2.0 * kPi * along / kPeriod));
      }
      seen(uniform, image, viewing, &map);
      const float middle = map.pixels[kSize / 2 * kSize + kSize / 2].x;
      const auto chance = [](double c) { return 1.0 - std::exp(-std::pow(c, kPsychometricSlope)); };
      EXPECT_GT(middle, chance(0.95 * units)) << units << " on a display of " << height << " m";
      EXPECT_LT(middle, chance(1.05 * units)) << units << " on a display of " << height << " m";
    }
  }
}

TEST(HdrVdp, HardCases) {
  for (const auto& [width, height] : {std::pair{1, 1}, {1, 9}, {67, 3}}) {
    const Image levels[] = {grey(width, height, 0.0), grey(width, height, 1e-20), grey(width, height, 1e20),
                            with_noise(grey(width, height, 1.0), 1.0, 8),
                            with_noise(grey(width, height, -1.0), 2.0, 9)};
    for (const Image& a : levels) {
      for (const Image& b : levels) {
        Image map;
        const Seen result = seen(a, b, Viewing{}, &map);
        EXPECT_TRUE(result.p95 >= 0.0 && result.p95 <= result.p75 && result.p75 <= 100.0);
        EXPECT_TRUE(value_error(map, false).empty());
        EXPECT_TRUE(value_error(paint_hdrvdp(map, a), false).empty());
      }
    }
  }
}

TEST(HdrVdp, MapPaintsGreyGreenRed) {
  const Image reference = grey(4, 1, 1.0);
  Image map = make_image(4, 1);
  for (std::size_t i = 0; i < 4; ++i) map.pixels[i] = glm::vec3(std::array{0.2f, 0.75f, 0.95f, 1.0f}[i]);
  const Image painted = paint_hdrvdp(map, reference);
  EXPECT_EQ(painted.pixels[0], glm::vec3(painted.pixels[0].x));
  EXPECT_TRUE(painted.pixels[1].g > 0.1f && painted.pixels[1].r < 1e-6f && painted.pixels[1].b == 0.0f);
  EXPECT_TRUE(painted.pixels[2].r > 0.1f && painted.pixels[2].g < 1e-6f && painted.pixels[2].b == 0.0f);
  EXPECT_NEAR(painted.pixels[3].r, painted.pixels[2].r, 1e-6f);
}

TEST(HdrVdp, PaintsOnGreyOfWhichTheMeanOfWhatIsLitIsAQuarter) {
  Image reference = grey(5, 1, 0.0), map = grey(5, 1, 0.0);
  reference.pixels[1] = glm::vec3(1.0f);
  reference.pixels[2] = reference.pixels[3] = reference.pixels[4] = glm::vec3(4.0f);
  const auto key = static_cast<float>(std::pow(4.0, 0.75));
  const float lit = 4.0f / (4.0f + 3.0f * key), shade = 0.15f + 0.85f * lit;
  map.pixels[3] = glm::vec3(0.625f);
  map.pixels[4] = glm::vec3(0.85f);
  const Image painted = paint_hdrvdp(map, reference);
  const auto expect_near = [](const glm::vec3& a, const glm::vec3& b) {
    EXPECT_LT(glm::distance(a, b), 1e-5f);
  };
  expect_near(painted.pixels[0], glm::vec3(0.0f));
  expect_near(painted.pixels[1], glm::vec3(1.0f / (1.0f + 3.0f * key)));
  expect_near(painted.pixels[2], glm::vec3(lit));
  expect_near(painted.pixels[3], 0.5f * glm::vec3(lit) + 0.5f * shade * glm::vec3(0, 1, 0));
  expect_near(painted.pixels[4], shade * glm::vec3(0.5f, 0.5f, 0));
  expect_near(paint_hdrvdp(grey(1, 1, 0.0), grey(1, 1, 3.0)).pixels[0], glm::vec3(0.25f));
}

// Luminances that differ by less than 10^-4 cd/m^2 are the same, whatever differs beside them.
TEST(HdrVdp, LuminancesThatHardlyDifferAreTheSame) {
  const Image uniform = grey(64, 64, 1.0);
  Image image = uniform, map;
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    const std::size_t x = i % 64;
    image.pixels[i] += glm::vec3(x < 4 ? (x % 2 ? 0.5f : -0.3f) : x == 4 ? 2e-4f : x == 5 ? 5e-5f : 0.0f);
  }
  seen(uniform, image, luminance_viewing(), &map);
  for (std::size_t y = 0; y < 64; ++y) {
    EXPECT_GT(map.pixels[y * 64 + 4].x, 0.0f);
    EXPECT_EQ(map.pixels[y * 64 + 5].x, 0.0f);
  }
}

TEST(Viewing, PixelsPerDegree) {
  const PixelsPerDegree ppd = pixels_per_degree({});
  EXPECT_NEAR(ppd.x, 29.78695, 1e-5);  // 0.375 m / 1280 at 0.5 m
  EXPECT_NEAR(ppd.y, ppd.x, 1e-9);
  Viewing viewing;
  viewing.distance = 0.0;
  EXPECT_THROW(check_viewing(viewing), std::runtime_error);
  viewing.distance = std::nan("");
  EXPECT_THROW(check_viewing(viewing), std::runtime_error);
}

}  // namespace
}  // namespace icbench
