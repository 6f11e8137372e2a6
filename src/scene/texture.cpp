#include "scene/texture.h"

#include <array>
#include <cmath>

namespace icbench {
namespace {

// Linear values of the 256 codes (IEC 61966-2-1).
const std::array<float, 256>& linear_of_code() {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> t{};
    for (int i = 0; i < 256; ++i) {
      const double c = i / 255.0;
      t[static_cast<std::size_t>(i)] =
          static_cast<float>(c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4));
    }
    return t;
  }();
  return table;
}

// The texel that holds a coordinate and its share; the next one, over the edge if need be, has the rest.
struct Between {
  int low, high;
  float share_of_high;
};

Between between(float u, int n) noexcept {
  const float wrapped = std::isfinite(u) ? u - std::floor(u) : 0.0f;  // 1 at most, by rounding
  const float x = wrapped * static_cast<float>(n) - 0.5f;
  const float below = std::floor(x);
  const int low = static_cast<int>(below);
  return {(low + n) % n, (low + 1) % n, x - below};
}

}  // namespace

glm::vec3 Texture::operator()(const glm::vec2& uv) const noexcept {
  const auto& linear = linear_of_code();
  const Between x = between(uv.x, width), y = between(-uv.y, height);  // row 0 is the top
  const auto texel = [&](int column, int row) {
    const std::uint8_t* t = &texels[3 * (static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
                                         static_cast<std::size_t>(column))];
    return glm::vec3(linear[t[0]], linear[t[1]], linear[t[2]]);
  };
  const auto row = [&](int r) {
    return (1.0f - x.share_of_high) * texel(x.low, r) + x.share_of_high * texel(x.high, r);
  };
  return (1.0f - y.share_of_high) * row(y.low) + y.share_of_high * row(y.high);
}

}  // namespace icbench
