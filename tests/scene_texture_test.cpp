// Lookups of textures against closed forms: where texels lie, what is between them, and what is outside.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <limits>
#include <vector>

#include "scene/texture.h"

namespace icbench {
namespace {

// Two rows of four texels, one by one from the upper left: only where its number says is one lit.
Texture lit_at(std::size_t texel) {
  Texture t{"dot", 4, 2, std::vector<std::uint8_t>(3 * 8, 0)};
  t.texels[3 * texel + 1] = 255;
  return t;
}

TEST(SceneTexture, TexelsHaveTheirValueInTheirMiddleFromTheUpperLeft) {
  for (std::size_t lit = 0; lit < 8; ++lit) {
    const Texture texture = lit_at(lit);
    for (std::size_t at = 0; at < 8; ++at) {
      const glm::vec2 uv((static_cast<float>(at % 4) + 0.5f) / 4.0f, at < 4 ? 0.75f : 0.25f);
      EXPECT_EQ(texture(uv), glm::vec3(0, lit == at ? 1 : 0, 0)) << lit << " at " << at;
    }
  }
}

// A tent over the lit texel, one texel wide to each side, repeated.
TEST(SceneTexture, BetweenTexelsAndOverTheEdgesItIsBilinear) {
  const auto tent = [](double away, double period) {
    return std::max(0.0, 1.0 - std::abs(std::remainder(away, period)));
  };
  for (const std::size_t lit : {0u, 3u, 5u}) {
    const Texture texture = lit_at(lit);
    for (int i = -37; i < 80; ++i)
      for (int k = -11; k < 50; ++k) {
        const glm::vec2 uv(static_cast<float>(i) / 32.0f, static_cast<float>(k) / 16.0f);  // exact
        const double column = 4.0 * uv.x - 0.5 - static_cast<double>(lit % 4);
        const double row = 2.0 * (1.0 - uv.y) - 0.5 - static_cast<double>(lit / 4);
        // Both rows next to any place are the two of the texture.
        ASSERT_NEAR(texture(uv).y, tent(column, 4.0) * tent(row, 2.0), 1e-6) << uv.x << ' ' << uv.y;
      }
  }
}

TEST(SceneTexture, CodesAreSrgb) {
  for (int code = 0; code < 256; ++code) {
    const double c = code / 255.0, linear = c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4);
    const Texture texture{"grey", 1, 1, {static_cast<std::uint8_t>(code), 0, 255}};
    EXPECT_LT(glm::distance(texture({0.3f, 0.8f}), glm::vec3(linear, 0, 1)), 1e-6f) << code;
  }
}

TEST(SceneTexture, AnyCoordinatesAreAnswered) {
  const Texture texture = lit_at(4);
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN(),
                  kInf = std::numeric_limits<float>::infinity();
  for (const float odd : {kNan, kInf, -kInf}) {
    EXPECT_EQ(texture({odd, 0.25f}), texture({0.0f, 0.25f}));
    EXPECT_EQ(texture({0.125f, odd}), texture({0.125f, 0.0f}));
  }
  for (const float edge : {-1e-30f, 1e30f, -1e30f, 1.0f - 0x1p-24f, 1.0f, -0.0f})
    for (const glm::vec2& uv : {glm::vec2(edge, 0.25f), glm::vec2(0.125f, edge), glm::vec2(edge)}) {
      const glm::vec3 colour = texture(uv);
      EXPECT_TRUE(colour.y >= 0.0f && colour.y <= 1.0f) << uv.x << ' ' << uv.y;
    }
}

}  // namespace
}  // namespace icbench
