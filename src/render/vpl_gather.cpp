#include "render/vpl_gather.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>

#include "core/random.h"
#include "render/primary.h"
#include "render/sampling.h"
#include "render/transport.h"

namespace icbench {
namespace {

constexpr std::size_t kWord = VplArrays::kWord;
constexpr std::size_t kLanes = 16;

// The components of 64 VPLs: those of a word of slots, or a sample of all.
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

// From a point with normal n to VPL i of a word.
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

std::uint32_t reverse_bits(std::uint32_t x) noexcept {
  x = (x >> 1 & 0x55555555u) | (x & 0x55555555u) << 1;
  x = (x >> 2 & 0x33333333u) | (x & 0x33333333u) << 2;
  x = (x >> 4 & 0x0f0f0f0fu) | (x & 0x0f0f0f0fu) << 4;
  return __builtin_bswap32(x);
}

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

// x where all bits are set, 0 where none is: the compiler makes branches of comparisons, and then no vectors.
inline float masked(float x, std::uint32_t bits) noexcept {
  return std::bit_cast<float>(std::bit_cast<std::uint32_t>(x) & bits);
}

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

// Share of the light between two facing points that the clamp takes; 0 where it takes none.
float taken_share(const glm::vec3& from, const glm::vec3& n, const Hit& met, float clamp) noexcept {
  const glm::vec3 d = met.p - from;
  const float d2 = glm::dot(d, d);
  const float d4 = d2 * d2 + std::numeric_limits<float>::min();  // as in ToVpl
  const float G = glm::dot(d, n) * -glm::dot(d, met.ng) / d4;
  return G > clamp ? 1.0f - clamp / G : 0.0f;
}

constexpr std::uint32_t kProposals = 4;  // light samples of which one is asked; of eight, noise is no less

// Compensation rays that share an estimate of the light that arrives at what they met. Of 32 rays at a point, eight
// estimates make no more error than 32 beside that of 1,024 VPLs; four would leave edges that are seen.
constexpr std::uint32_t kPerEstimate = 4;

float sum_of(const glm::vec3& v) noexcept { return v.x + v.y + v.z; }

// One of the weights, drawn in their proportion: the first below whose end `target`, of [0, their sum), lies. `target`
// becomes what is left of it there. Where rounding carries it past all, the last.
std::size_t pick(std::span<const float> weights, float& target) noexcept {
  std::size_t i = 0;
  for (; i + 1 < weights.size() && !(target < weights[i]); ++i) target -= weights[i];
  return i;
}

// Irradiance from the lamps, weighted as propose_light does beside rays of length `reach`: of a few samples one is
// asked, drawn by what it would send if nothing lay between (importance resampling, Talbot et al. 2005). Where there
// are many lamps that spares most noise.
Irradiance sample_lamps(Tracer& tracer, const Hit& at, float q, float reach, Pcg32& random) noexcept {
  LightProposal proposals[kProposals];
  float sends[kProposals], total = 0.0f;
  for (std::uint32_t k = 0; k < kProposals; ++k) {
    sends[k] =
        propose_light(tracer.shared(), at, q, random, proposals[k], reach) ? sum_of(proposals[k].E) : 0.0f;
    total += sends[k];
  }
  const float u = random.uniform();
  if (!(total > 0.0f && total < kMaxIrradiance))
    return glm::vec3(0.0f);  // or beyond what a float can be summed to
  float target = u * total;
  const std::size_t k = pick(sends, target);
  if (!(sends[k] > 0.0f) || tracer.occluded(proposals[k].shadow)) return glm::vec3(0.0f);
  return total / kProposals * (proposals[k].E / sends[k]);
}

// Irradiance from all VPLs, clamped, by one of them: a sample of 64 is drawn at random, and of it one VPL, by what it
// would send if nothing lay between. When samples were neighbouring slots, asking four made the noise of compensation
// some 5 % less and its rays almost twice as many.
Irradiance sample_vpls(Tracer& tracer, const Hit& at, const VplArrays& vpls, float clamp,
                       Pcg32& random) noexcept {
  const auto samples = static_cast<float>(vpls.samples());
  const auto sample = static_cast<std::size_t>(random.uniform() * samples);
  const float u = random.uniform();
  if (sample >= vpls.samples()) return glm::vec3(0.0f);  // there are none, or it was rounded up
  const WordOfVpls v = WordOfVpls::sample(vpls, sample);
  alignas(64) float sends[kWord], flux[kWord];
  for (std::size_t i = 0; i < kWord; ++i) {
    const ToVpl to(v, i, at.p, at.n);
    const float surface = to.x * at.ng.x + to.y * at.ng.y + to.z * at.ng.z;
    const float G = to.here * to.there / to.d4();
    flux[i] = v.red[i] + v.green[i] + v.blue[i];
    const bool facing = (to.here > 0.0f) & (surface > 0.0f) & (to.there > 0.0f);
    sends[i] = (G < clamp ? G : clamp) * masked(flux[i], facing ? ~0u : 0u);
  }
  // Part by part: sums that do not wait for each other.
  constexpr std::size_t kParts = kWord / kLanes;
  float parts[kParts] = {};
  for (std::size_t l = 0; l < kLanes; ++l)
    for (std::size_t part = 0; part < kParts; ++part) parts[part] += sends[part * kLanes + l];
  float total = 0.0f;
  for (const float part : parts) total += part;
  if (!(total > 0.0f && total < kMaxIrradiance))
    return glm::vec3(0.0f);  // or beyond what a float can be summed to

  float target = u * total;
  const std::size_t first = pick(parts, target) * kLanes;
  const std::size_t i = first + pick({sends + first, kLanes}, target);
  if (!(sends[i] > 0.0f)) return glm::vec3(0.0f);
  const RayTracer& rays = tracer.shared();
  const glm::vec3 from = rays.leave(at.p, at.ng);
  const glm::vec3 to = rays.leave({v.px[i], v.py[i], v.pz[i]}, {v.nx[i], v.ny[i], v.nz[i]});
  if (tracer.occluded(Ray{from, 1.0f, to - from})) return glm::vec3(0.0f);
  const glm::vec3 colour(v.red[i] / flux[i], v.green[i] / flux[i], v.blue[i] / flux[i]);
  return samples * total * std::numbers::inv_pi_v<float> * colour;
}

// Irradiance at a surface, unbiased: from the lamps, from the VPLs, and what the clamp takes of the latter. That comes
// from within reach, so no ray looks farther; lamps beyond are left to light samples.
Irradiance irradiance_at(Tracer& tracer, Hit at, const VplArrays& vpls, float clamp, Pcg32& random) noexcept {
  constexpr float kGoOn = 0.5f;  // what the clamp takes at the second surface counts little
  const RayTracer& rays = tracer.shared();
  const float reach = compensation_reach(clamp);
  glm::vec3 E(0.0f), weight(1.0f);
  for (;;) {
    const float q = kGoOn * survival(weight);
    if (!(q > 0.0f)) return E;
    E += weight * (sample_lamps(tracer, at, q, reach, random) + sample_vpls(tracer, at, vpls, clamp, random));

    if (!(random.uniform() < q)) return E;
    const float u_elevation = random.uniform(), u_azimuth = random.uniform();
    const glm::vec3 d = cosine_direction(Basis(at.n), u_elevation, u_azimuth);
    if (!(glm::dot(d, at.ng) > 0.0f)) return E;  // into the surface, past a tilted shading normal
    const Hit next = tracer.intersect(Ray{rays.leave(at.p, at.ng), reach, d});
    if (next.missed()) return E;
    const Material& material = rays.material(next);
    if (next.front && material.emits()) {
      const float p_b = glm::dot(d, at.n) * std::numbers::inv_pi_v<float>;
      E += std::numbers::pi_v<float> * emitter_weight(rays, next, d, p_b, q) / q * weight * material.emission;
    }
    if (!reflects(rays, next)) return E;
    weight *= taken_share(at.p, at.n, next, clamp) / q * rays.albedo(next);
    at = next;
  }
}

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

float compensation_reach(float clamp) noexcept { return 1.0f / std::sqrt(clamp); }

Compensation compensate(Tracer& tracer, const Hit& hit, const VplArrays& vpls, float clamp,
                        std::uint32_t count, std::uint64_t key, Packing packing,
                        std::uint64_t which) noexcept {
  const RayTracer& rays = tracer.shared();
  const glm::vec3 from = rays.leave(hit.p, hit.ng);
  const Basis basis(hit.n);
  const float reach = compensation_reach(clamp);
  Pcg32 shifts(key);
  const float elevation_shift = shifts.uniform();
  const std::uint32_t azimuth_shift = shifts();
  Ray asked[kMaxCompensation];
  Hit met[kMaxCompensation];
  std::uint32_t index[kMaxCompensation];
  std::uint32_t n = 0;
  for (std::uint32_t i = 0; i < std::min(count, kMaxCompensation); ++i) {
    if ((which >> i & 1u) == 0) continue;
    // A Hammersley set, shifted at random: each direction has the cosine's density.
    const std::uint32_t reversed = reverse_bits(i) + azimuth_shift;
    const glm::vec3 d =
        cosine_direction(basis, (static_cast<float>(i) + elevation_shift) / static_cast<float>(count),
                         static_cast<float>(reversed >> 8) * 0x1p-24f);
    if (!(glm::dot(d, hit.ng) > 0.0f)) continue;
    asked[n] = {from, reach, d};
    index[n++] = i;
  }
  if (packing == Packing::fast)
    tracer.intersect({asked, n}, {met, n});
  else
    for (std::uint32_t k = 0; k < n; ++k) met[k] = tracer.intersect(asked[k]);

  Compensation out;
  for (std::uint32_t k = 0; k < n;) {
    // What the surfaces met count, in all.
    const std::uint32_t group = index[k] / kPerEstimate;
    float weights[kPerEstimate], total = 0.0f;
    std::uint32_t counting[kPerEstimate], m = 0;
    for (; k < n && index[k] / kPerEstimate == group; ++k) {
      if (!reflects(rays, met[k])) continue;
      const float share = taken_share(hit.p, hit.n, met[k], clamp);
      const float weight = share * sum_of(rays.albedo(met[k]));
      if (!(weight > 0.0f)) continue;
      out.met |= std::uint64_t{1} << index[k];
      counting[m] = k;
      weights[m++] = weight;
      total += weight;
    }
    if (m == 0) continue;
    // The light that arrives there, at one of them.
    Pcg32 random(hash_keys(key, group + 1));
    float target = random.uniform() * total;
    const Hit& at = met[counting[pick({weights, m}, target)]];
    const glm::vec3 albedo = rays.albedo(at);
    const float scale =
        total / (static_cast<float>(count) * std::max(sum_of(albedo), std::numeric_limits<float>::min()));
    out.E += scale * albedo * irradiance_at(tracer, at, vpls, clamp, random);
  }
  return out;
}

}  // namespace icbench
