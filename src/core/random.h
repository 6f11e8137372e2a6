// Counter-based random numbers: a value depends on its key and dimension alone, never on the thread that
// draws it.
#pragma once

#include <cstdint>

namespace icbench {

/// Finaliser of MurmurHash3 (64 bit): a bijection with good avalanche.
constexpr std::uint64_t mix64(std::uint64_t x) noexcept {
  x ^= x >> 33;
  x *= 0xff51afd7ed558ccdULL;
  x ^= x >> 33;
  x *= 0xc4ceb9fe1a85ec53ULL;
  return x ^ (x >> 33);
}

/// Hash of up to three keys, for seeding one stream per (seed, pixel, sample) and the like.
constexpr std::uint64_t hash_keys(std::uint64_t a, std::uint64_t b = 0, std::uint64_t c = 0) noexcept {
  return mix64(mix64(mix64(a + 0x9e3779b97f4a7c15ULL) ^ b) + 0x9e3779b97f4a7c15ULL * (c + 1));
}

/// PCG32 (O'Neill 2014, XSH-RR variant): 64-bit state, 32-bit output. Satisfies UniformRandomBitGenerator.
class Pcg32 {
 public:
  using result_type = std::uint32_t;

  explicit constexpr Pcg32(std::uint64_t key) noexcept : state_(mix64(key)), increment_(mix64(~key) | 1u) {
    (*this)();
  }

  constexpr std::uint32_t operator()() noexcept {
    const std::uint64_t old = state_;
    state_ = old * 6364136223846793005ULL + increment_;
    const auto shifted = static_cast<std::uint32_t>(((old >> 18u) ^ old) >> 27u);
    const auto rotation = static_cast<std::uint32_t>(old >> 59u);
    return (shifted >> rotation) | (shifted << ((32u - rotation) & 31u));
  }

  /// Uniform in [0, 1), 24 bits.
  constexpr float uniform() noexcept { return static_cast<float>((*this)() >> 8) * 0x1p-24f; }

  /// Uniform in [0, n), n > 0, by multiply-shift (Lemire 2019); bias below n / 2^32.
  constexpr std::uint32_t below(std::uint32_t n) noexcept {
    return static_cast<std::uint32_t>((static_cast<std::uint64_t>((*this)()) * n) >> 32);
  }

  static constexpr std::uint32_t min() noexcept { return 0; }
  static constexpr std::uint32_t max() noexcept { return ~0u; }

 private:
  std::uint64_t state_;
  std::uint64_t increment_;
};

}  // namespace icbench
