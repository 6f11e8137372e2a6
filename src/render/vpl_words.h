// Virtual point lights 64 at a time, as their arrays hold them, for loops that become vectors.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "core/types.h"
#include "render/vpl.h"

namespace icbench {

inline constexpr std::size_t kWord = VplArrays::kWord;
inline constexpr std::size_t kLanes = 16;

/// The components of 64 VPLs: those of a word of slots, or a sample of all.
struct WordOfVpls {
  const float *px, *py, *pz, *nx, *ny, *nz, *red, *green, *blue;

  WordOfVpls(const VplArrays& vpls, std::size_t word) noexcept
      : WordOfVpls([&](VplArrays::Component c) { return vpls.of(c) + word * kWord; }) {}
  static WordOfVpls sample(const VplArrays& vpls, std::size_t sample) noexcept {
    return WordOfVpls([&](VplArrays::Component c) { return vpls.sample_of(c, sample); });
  }

 private:
  template <class Of>
  explicit WordOfVpls(const Of& of) noexcept
      : px(of(VplArrays::kPx)),
        py(of(VplArrays::kPy)),
        pz(of(VplArrays::kPz)),
        nx(of(VplArrays::kNx)),
        ny(of(VplArrays::kNy)),
        nz(of(VplArrays::kNz)),
        red(of(VplArrays::kRed)),
        green(of(VplArrays::kGreen)),
        blue(of(VplArrays::kBlue)) {}
};

/// From a point with normal n to VPL i of a word.
struct ToVpl {
  float x, y, z, d2;  // the segment, and its length squared
  float here, there;  // its length times the cosine at either end; negative below the horizon

  ToVpl(const WordOfVpls& v, std::size_t i, const glm::vec3& p, const glm::vec3& n) noexcept
      : x(v.px[i] - p.x),
        y(v.py[i] - p.y),
        z(v.pz[i] - p.z),
        d2(x * x + y * y + z * z),
        here(x * n.x + y * n.y + z * n.z),
        there(-(x * v.nx[i] + y * v.ny[i] + z * v.nz[i])) {}

  // |d|^4; where that vanishes, the smallest number by which what is above both horizons can be divided. A sum, for of
  // a maximum the compiler makes branches, and then no vectors.
  float d4() const noexcept { return d2 * d2 + std::numeric_limits<float>::min(); }
};

/// x where all bits are set, 0 where none is: the compiler makes branches of comparisons, and then no vectors.
inline float masked(float x, std::uint32_t bits) noexcept {
  return std::bit_cast<float>(std::bit_cast<std::uint32_t>(x) & bits);
}

}  // namespace icbench
