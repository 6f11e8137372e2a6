// Flicker against closed forms.
#include <gtest/gtest.h>

#include <cmath>

#include "core/random.h"
#include "image/metrics/flicker.h"
#include "temporary_folder.h"

namespace icbench {
namespace {

Image constant(float value) {
  Image image = make_image(6, 4);
  for (glm::vec3& pixel : image.pixels) pixel = glm::vec3(value);
  return image;
}

TEST(Flicker, LastingErrorAndSharedMotionHaveNone) {
  Flicker flicker;
  EXPECT_EQ(flicker.value(), std::nullopt);
  for (const float level : {1.0f, 5.0f, 2.0f, 0.0f}) flicker.add(constant(level), constant(level + 0.5f));
  EXPECT_EQ(flicker.frames(), 4);
  EXPECT_EQ(flicker.value(), 0.0);
}

TEST(Flicker, IsTheRootMeanSquareOfChanges) {
  Flicker flicker;
  flicker.add(constant(1.0f), constant(1.0f));
  EXPECT_EQ(flicker.value(), std::nullopt);
  flicker.add(constant(1.0f), constant(9.0f), false);  // frames between them are missing
  EXPECT_EQ(flicker.value(), std::nullopt);
  flicker.add(constant(1.0f), constant(1.0f), false);
  flicker.add(constant(1.0f), constant(1.25f));
  EXPECT_DOUBLE_EQ(flicker.value().value(), 0.25);
  flicker.add(constant(2.0f), constant(1.5f));  // from +0.25 to -0.5
  EXPECT_DOUBLE_EQ(flicker.value().value(), std::sqrt((0.0625 + 0.5625) / 2.0));
}

TEST(Flicker, EveryChannelAndPixelCountsOnce) {
  for (int channel = 0; channel < 3; ++channel) {
    Image image = constant(1.0f);
    image.pixels[static_cast<std::size_t>(7 * channel)][channel] = 4.0f;
    Flicker flicker;
    flicker.add(constant(1.0f), constant(1.0f));
    flicker.add(constant(1.0f), image);
    EXPECT_DOUBLE_EQ(flicker.value().value(), std::sqrt(9.0 / 72.0));
  }
}

TEST(Flicker, RefusesWhatIsNoAnimation) {
  Flicker flicker;
  flicker.add(constant(1.0f), constant(1.0f));
  EXPECT_TRUE(is_one_line_with(error_of([&] { flicker.add(make_image(4, 6), make_image(4, 6)); }),
                               "6 x 4 and 4 x 6"));
  EXPECT_TRUE(
      is_one_line_with(error_of([&] { flicker.add(constant(1.0f), make_image(4, 6)); }), "cannot compare"));
  EXPECT_EQ(flicker.frames(), 1);
}

}  // namespace
}  // namespace icbench
