#include "render/vpl_gather.h"

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstring>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>

#include "render/vpl_words.h"

namespace icbench {
namespace {

// 64 bytes of 0 or 1 as bits: eight at a time, by a product that brings their lowest bits together on top.
std::uint64_t bits_of(const std::uint8_t (&flags)[kWord]) noexcept {
  std::uint64_t bits = 0;
  for (std::size_t i = 0; i < kWord; i += 8) {
    std::uint64_t eight;
    std::memcpy(&eight, flags + i, 8);
    bits |= (eight * 0x0102040810204080u >> 56) << i;
  }
  return bits;
}
static_assert(std::endian::native == std::endian::little, "bits_of takes the first byte for the lowest");

// Which VPLs of a word lie above both horizons.
std::uint64_t facing(const Hit& hit, const WordOfVpls& v) noexcept {
  const glm::vec3 p = hit.p, n = hit.n, ng = hit.ng;
  alignas(64) std::uint8_t flags[kWord];
  for (std::size_t i = 0; i < kWord; ++i) {
    const ToVpl to(v, i, p, n);
    const float surface = to.x * ng.x + to.y * ng.y + to.z * ng.z;
    flags[i] = static_cast<std::uint8_t>((to.here > 0.0f) & (surface > 0.0f) & (to.there > 0.0f));
  }
  return bits_of(flags);
}

std::uint64_t visible(Tracer& tracer, const glm::vec3& from, const Hit& hit, const WordOfVpls& v,
                      Packing packing, Shapes shapes) noexcept {
  const std::uint64_t asked = facing(hit, v);
  if (asked == 0) return 0;
  const float epsilon = tracer.shared().epsilon();
  alignas(64) float x[kWord], y[kWord], z[kWord];
  for (std::size_t i = 0; i < kWord; ++i) {
    x[i] = v.px[i] + epsilon * v.nx[i];
    y[i] = v.py[i] + epsilon * v.ny[i];
    z[i] = v.pz[i] + epsilon * v.nz[i];
  }
  return asked & ~tracer.occluded_from(from, x, y, z, asked, packing, shapes);
}

// A few slots of many words, asked for together: packets are full that way.
class Asked {
 public:
  Asked(Tracer& tracer, const glm::vec3& from, std::span<std::uint64_t> bits, Packing packing,
        Shapes shapes) noexcept
      : tracer_(tracer),
        from_(from),
        bits_(bits),
        packing_(packing),
        shapes_(shapes),
        epsilon_(tracer.shared().epsilon()) {}

  void ask(const WordOfVpls& v, std::size_t word, std::size_t i) noexcept {
    x_[count_] = v.px[i] + epsilon_ * v.nx[i];
    y_[count_] = v.py[i] + epsilon_ * v.ny[i];
    z_[count_] = v.pz[i] + epsilon_ * v.nz[i];
    slot_[count_++] = static_cast<std::uint32_t>(word * kWord + i);
    if (count_ == kWord) answer();
  }

  // Sets the bits of those that see the point.
  void answer() noexcept {
    if (count_ == 0) return;
    const std::uint64_t all = count_ == kWord ? ~std::uint64_t{0} : (std::uint64_t{1} << count_) - 1;
    std::uint64_t seen = all & ~tracer_.occluded_from(from_, x_, y_, z_, all, packing_, shapes_);
    for (; seen != 0; seen &= seen - 1) {
      const std::uint32_t slot = slot_[std::countr_zero(seen)];
      bits_[slot / kWord] |= std::uint64_t{1} << slot % kWord;
    }
    count_ = 0;
  }

 private:
  Tracer& tracer_;
  glm::vec3 from_;
  std::span<std::uint64_t> bits_;
  Packing packing_;
  Shapes shapes_;
  float epsilon_;
  std::size_t count_ = 0;
  alignas(64) float x_[kWord], y_[kWord], z_[kWord];
  std::uint32_t slot_[kWord];
};

// Of every VPL of a word, whether seen or not: 1 / |d|^4, and G. Found once for sums and slopes, by one function, so
// that all sums of the same bits are the same.
struct WordOfG {
  alignas(64) float inverse[kWord], G[kWord];

  [[gnu::noinline]] void find(const WordOfVpls& v, const glm::vec3& p, const glm::vec3& n) noexcept {
    for (std::size_t i = 0; i < kWord; ++i) {
      const ToVpl to(v, i, p, n);
      inverse[i] = 1.0f / to.d4();
      G[i] = to.here * to.there * inverse[i];
    }
  }
};

// The sum of min(G, clamp) flux: 16 partial sums, then those in pairs.
class Sum {
 public:
  [[gnu::noinline]] void add(const WordOfVpls& v, std::uint64_t bits, const WordOfG& word,
                             float clamp) noexcept {
    for (std::size_t first = 0; first < kWord; first += kLanes) {
      const auto some = static_cast<std::uint32_t>(bits >> first & 0xffffu);
      for (std::uint32_t l = 0; l < kLanes; ++l) {
        const std::size_t i = first + l;
        const float bounded = word.G[i] < clamp ? word.G[i] : clamp;
        const float g = (some >> l & 1u) != 0 ? bounded : 0.0f;
        red_[l] += g * v.red[i];
        green_[l] += g * v.green[i];
        blue_[l] += g * v.blue[i];
      }
    }
  }

  Irradiance irradiance() noexcept {
    const auto finish = [](float(&of)[kLanes]) {
      for (std::size_t half = kLanes / 2; half > 0; half /= 2)
        for (std::size_t l = 0; l < half; ++l) of[l] += of[l + half];
      return std::min(of[0] * std::numbers::inv_pi_v<float>, kMaxIrradiance);
    };
    return {finish(red_), finish(green_), finish(blue_)};
  }

 private:
  alignas(64) float red_[kLanes] = {}, green_[kLanes] = {}, blue_[kLanes] = {};
};

// The sums of irradiance's derivatives. With d from the point to VPL j, G = (d.n)(-d.n_j) / |d|^4 changes by
//   -(-d.n_j) n / |d|^4 + (d.n) n_j / |d|^4 + 4 G d / |d|^2    as the point moves,
//   (-d.n_j) / |d|^4 (n x d)                                   as the normal turns, by axis of rotation.
class Slopes {
 public:
  [[gnu::noinline]] void add(const WordOfVpls& v, std::uint64_t bits, const WordOfG& word, const glm::vec3& p,
                             const glm::vec3& n, float clamp) noexcept {
    // In steps, results between them on the stack: in one loop the compiler makes branches, and no vectors.
    alignas(64) std::uint32_t kept[kWord];
    alignas(64) float moves[3][kWord], turns[3][kWord];
    for (std::size_t i = 0; i < kWord; ++i) kept[i] = 0u - static_cast<std::uint32_t>(bits >> i & 1u);
    for (std::size_t i = 0; i < kWord; ++i) kept[i] &= word.G[i] < clamp ? ~0u : 0u;
    // Of what is added below, flux times factors, nothing exceeds 6 (1 / |d|^4 + 1) flux.
    for (std::size_t i = 0; i < kWord; ++i)
      kept[i] &= (word.inverse[i] + 1.0f) * (v.red[i] + v.green[i] + v.blue[i]) < kMostSlope ? ~0u : 0u;
    for (std::size_t i = 0; i < kWord; ++i) {
      const ToVpl to(v, i, p, n);
      const float inverse = masked(word.inverse[i], kept[i]);
      const float turn = to.there * inverse, lean = to.here * inverse;
      const float pull = 4.0f * masked(word.G[i], kept[i]) / (to.d2 + std::numeric_limits<float>::min());
      moves[0][i] = lean * v.nx[i] + pull * to.x - turn * n.x;
      moves[1][i] = lean * v.ny[i] + pull * to.y - turn * n.y;
      moves[2][i] = lean * v.nz[i] + pull * to.z - turn * n.z;
      turns[0][i] = turn * to.x;
      turns[1][i] = turn * to.y;
      turns[2][i] = turn * to.z;
    }
    const float* const flux[3] = {v.red, v.green, v.blue};
    for (int c = 0; c < 3; ++c) {
      add(flux[c], moves, moved_[c]);
      add(flux[c], turns, turned_[c]);
    }
  }

  IrradianceGradients gradients(const glm::vec3& n) const noexcept {
    IrradianceGradients out;
    for (std::size_t c = 0; c < 3; ++c) {
      const glm::vec3 moved = total(moved_[c]);
      out.translational[c] = bounded(moved - glm::dot(moved, n) * n);
      out.rotational[c] = bounded(glm::cross(n, total(turned_[c])));
    }
    return out;
  }

 private:
  // What changes faster counts as constant, as what the clamp bounds does: so sums over millions do not overflow.
  static constexpr float kMostSlope = 1e31f;

  static glm::vec3 total(const float (&of)[3][kLanes]) noexcept {
    glm::vec3 sum(0.0f);
    for (int axis = 0; axis < 3; ++axis)
      for (const float lane : of[axis]) sum[axis] += lane;
    return std::numbers::inv_pi_v<float> * sum;
  }
  // Flux times factors, lane by lane.
  static void add(const float* flux, const float (&factors)[3][kWord], float (&to)[3][kLanes]) noexcept {
    static_assert(kWord == 4 * kLanes);
    for (int axis = 0; axis < 3; ++axis) {
      const float* const f = factors[axis];
      for (std::size_t l = 0; l < kLanes; ++l) {
        const std::size_t m = l + kLanes, n = m + kLanes, o = n + kLanes;
        to[axis][l] += (flux[l] * f[l] + flux[m] * f[m]) + (flux[n] * f[n] + flux[o] * f[o]);
      }
    }
  }
  // 0 where floats cannot hold it: the record then counts as constant.
  static glm::vec3 bounded(const glm::vec3& v) noexcept { return is_finite(v) ? v : glm::vec3(0.0f); }

  alignas(64) float moved_[3][3][kLanes] = {};  // channel, axis
  alignas(64) float turned_[3][3][kLanes] = {};
};

// A point that is lit, word by word.
class Lit {
 public:
  Lit(const Hit& hit, const VplArrays& vpls, float clamp) noexcept : hit_(hit), vpls_(vpls), clamp_(clamp) {}

  void add(std::size_t word, std::uint64_t bits) noexcept {
    if (bits == 0) return;
    const WordOfVpls v(vpls_, word);
    g_.find(v, hit_.p, hit_.n);
    sum_.add(v, bits, g_, clamp_);
  }
  void add(std::size_t word, std::uint64_t bits, Slopes& slopes) noexcept {
    add(word, bits);
    if (bits != 0) slopes.add(WordOfVpls(vpls_, word), bits, g_, hit_.p, hit_.n, clamp_);
  }

  Irradiance irradiance() noexcept { return sum_.irradiance(); }

 private:
  const Hit& hit_;
  const VplArrays& vpls_;
  float clamp_;
  WordOfG g_;  // of the word added last
  Sum sum_;
};

}  // namespace

float vpl_clamp(const Bounds& bounds) noexcept {
  const float near = kClampShare * glm::length(bounds.upper - bounds.lower);
  return 1.0f / (near * near);
}

void trace_visibility(Tracer& tracer, const Hit& hit, const VplArrays& vpls, std::span<std::uint64_t> bits,
                      Packing packing, Shapes shapes) noexcept {
  const glm::vec3 from = tracer.shared().leave(hit.p, hit.ng);
  for (std::size_t w = 0; w < vpls.words(); ++w)
    bits[w] = visible(tracer, from, hit, WordOfVpls(vpls, w), packing, shapes);
}

void trace_visibility(Tracer& tracer, const Hit& hit, const VplArrays& vpls,
                      std::span<const std::uint64_t> which, std::span<std::uint64_t> bits, Packing packing,
                      Shapes shapes) noexcept {
  Asked asked(tracer, tracer.shared().leave(hit.p, hit.ng), bits, packing, shapes);
  for (std::size_t w = 0; w < vpls.words(); ++w) {
    if (which[w] == 0) continue;
    const WordOfVpls v(vpls, w);
    bits[w] &= ~which[w];
    for (std::uint64_t rest = which[w] & facing(hit, v); rest != 0; rest &= rest - 1)
      asked.ask(v, w, static_cast<std::size_t>(std::countr_zero(rest)));
  }
  asked.answer();
}

std::uint64_t count_facing(const Hit& hit, const VplArrays& vpls,
                           std::span<const std::uint64_t> which) noexcept {
  std::uint64_t count = 0;
  for (std::size_t w = 0; w < vpls.words(); ++w)
    if (which[w] != 0)
      count += static_cast<std::uint64_t>(std::popcount(which[w] & facing(hit, WordOfVpls(vpls, w))));
  return count;
}

Irradiance irradiance_from(std::span<const std::uint64_t> bits, const Hit& hit, const VplArrays& vpls,
                           float clamp) noexcept {
  Lit lit(hit, vpls, clamp);
  for (std::size_t w = 0; w < vpls.words(); ++w) lit.add(w, bits[w]);
  return lit.irradiance();
}

Irradiance irradiance_from(std::span<const std::uint64_t> bits, const Hit& hit, const VplArrays& vpls,
                           float clamp, IrradianceGradients& gradients) noexcept {
  Lit lit(hit, vpls, clamp);
  Slopes slopes;
  for (std::size_t w = 0; w < vpls.words(); ++w) lit.add(w, bits[w], slopes);
  gradients = slopes.gradients(hit.n);
  return lit.irradiance();
}

Irradiance gather_vpls(Tracer& tracer, const Hit& hit, const VplArrays& vpls, float clamp,
                       Packing packing) noexcept {
  const glm::vec3 from = tracer.shared().leave(hit.p, hit.ng);
  Lit lit(hit, vpls, clamp);
  for (std::size_t w = 0; w < vpls.words(); ++w)
    lit.add(w, visible(tracer, from, hit, WordOfVpls(vpls, w), packing, Shapes::all));
  return lit.irradiance();
}

Irradiance gather_vpls(Tracer& tracer, const Hit& hit, const VplArrays& vpls, float clamp, Packing packing,
                       IrradianceGradients& gradients) noexcept {
  const glm::vec3 from = tracer.shared().leave(hit.p, hit.ng);
  Lit lit(hit, vpls, clamp);
  Slopes slopes;
  for (std::size_t w = 0; w < vpls.words(); ++w)
    lit.add(w, visible(tracer, from, hit, WordOfVpls(vpls, w), packing, Shapes::all), slopes);
  gradients = slopes.gradients(hit.n);
  return lit.irradiance();
}

std::vector<TracedRay> record_vpl_rays(const RayTracer& rays, std::span<const Hit> points,
                                       const VplArrays& vpls) {
  std::vector<TracedRay> out;
  for (const Hit& hit : points) {
    const glm::vec3 from = rays.leave(hit.p, hit.ng);
    for (std::size_t w = 0; w < vpls.words(); ++w)
      for (std::uint64_t rest = facing(hit, WordOfVpls(vpls, w)); rest != 0; rest &= rest - 1) {
        const Vpl vpl = vpls[w * kWord + static_cast<std::size_t>(std::countr_zero(rest))];
        out.push_back({{from, 1.0f, rays.leave(vpl.p, vpl.n) - from}, true});
      }
  }
  return out;
}

}  // namespace icbench
