// Compiled once for each kind of machine; what is the same for all of them comes first, once.
#include "caches/packed_filter.h"

#ifndef ICBENCH_LANE_ORDERS
#define ICBENCH_LANE_ORDERS
#include <array>
#include <cstdint>

namespace icbench {

/// For each mask of eight lanes, which lanes are in it, from the lowest; then zeros.
constexpr auto kOrders = [] {
  std::array<std::array<std::uint8_t, 8>, 256> orders{};
  for (unsigned mask = 0; mask < orders.size(); ++mask) {
    unsigned n = 0;
    for (std::uint8_t lane = 0; lane < 8; ++lane) {
      if ((mask >> lane & 1u) != 0) orders[mask][n++] = lane;
    }
  }
  return orders;
}();

/// `reach_of` of every code.
[[maybe_unused]] alignas(64) constexpr auto kReaches = [] {
  std::array<float, kReachAlways + 1> reaches{};
  for (std::uint32_t code = 0; code < reaches.size(); ++code) reaches[code] = reach_of(code);
  return reaches;
}();

}  // namespace icbench
#endif

// Below the compiler's own target too, so that tests reach every width that the machine has.
#define HWY_COMPILE_ALL_ATTAINABLE
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "caches/packed_filter.cpp"
#include <hwy/foreach_target.h>  // first, compiles this file once for each kind of machine
#include <hwy/highway.h>

#include "core/sanitizers.h"

HWY_BEFORE_NAMESPACE();
namespace icbench {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using Words = hn::CappedTag<std::uint32_t, kStripLanes>;
using Floats = hn::RebindToFloat<Words>;
using Word = hn::Vec<Words>;
using Float = hn::Vec<Floats>;

// Whether a load under a mask leaves alone what is masked out. ThreadSanitizer does not see such loads.
#if !HWY_ARCH_X86
constexpr bool kHasMaskedLoads = false;
#else  // the better targets have the smaller numbers
constexpr bool kHasMaskedLoads = !kThreadSanitizer && HWY_TARGET <= HWY_AVX2;
#endif

/// The words of the lanes in `bits`, anything elsewhere.
HWY_INLINE Word load(const std::uint32_t* from, [[maybe_unused]] std::uint64_t bits,
                     [[maybe_unused]] hn::Mask<Words> mask) {
  const Words words;
  if constexpr (kHasMaskedLoads) {
    return hn::MaskedLoad(mask, words, from);
  } else {
    if (bits == ~std::uint64_t{0} >> (64 - hn::Lanes(words))) return hn::LoadU(words, from);
    HWY_ALIGN std::uint32_t copy[kStripLanes] = {};
    for (; bits != 0; bits &= bits - 1) copy[std::countr_zero(bits)] = from[std::countr_zero(bits)];
    return hn::Load(words, copy);
  }
}

/// A place and kPlaceOrigin, from lanes whose coordinate has been moved to kPlaceMask.
HWY_INLINE Float place_of(Word bits) {
  const Words words;
  const auto place = hn::Or(hn::And(bits, hn::Set(words, kPlaceMask)),
                            hn::Set(words, std::bit_cast<std::uint32_t>(kPlaceOrigin)));
  return hn::BitCast(Floats(), place);
}

/// A LanePoint before every lane of a vector.
struct Query {
  HWY_INLINE explicit Query(const LanePoint& at)
      : x(hn::Set(Floats(), at.x)),
        y(hn::Set(Floats(), at.y)),
        z(hn::Set(Floats(), at.z)),
        slack(hn::Set(Floats(), at.slack)) {}
  Float x, y, z, slack;
};

/// The reaches of lanes' codes, times the share.
#if HWY_ARCH_X86 && HWY_TARGET <= HWY_AVX3 && HWY_MAX_BYTES == 64
// All of them in two vectors. Highway looks up in one alone.
struct Reaches {
  HWY_INLINE explicit Reaches(Float share)
      : low(hn::Mul(hn::Load(Floats(), kReaches.data()), share)),
        high(hn::Mul(hn::Load(Floats(), kReaches.data() + kStripLanes), share)) {}
  HWY_INLINE Float of(Word lane) const {
    return Float{_mm512_permutex2var_ps(low.raw, lane.raw, high.raw)};  // by the lowest five bits
  }
  Float low, high;
};
#else
struct Reaches {
  HWY_INLINE explicit Reaches(Float s) : share(s) {}
  HWY_INLINE Float of(Word lane) const {
    const Words words;
    const Floats floats;
    const Word code = hn::And(lane, hn::Set(words, kReachAlways));
    const Float expressed =
        hn::BitCast(floats, hn::Add(hn::ShiftLeft<kReachShift>(code), hn::Set(words, kReachBase)));
    const auto is_far = hn::RebindMask(floats, hn::Eq(code, hn::Set(words, kReachAlways)));
    return hn::Mul(hn::IfThenElse(is_far, hn::Set(floats, kFarReach), expressed), share);
  }
  Float share;
};
#endif

/// `keeps` (caches/packed_lanes.h), operation by operation.
HWY_INLINE hn::Mask<Floats> keeps_of(const Reaches& reaches, const Query& at, Word lane) {
  const Float dx = hn::Sub(at.x, place_of(hn::ShiftLeft<kPlaceBits>(lane)));
  const Float dy = hn::Sub(at.y, place_of(lane));
  const Float dz = hn::Sub(at.z, place_of(hn::ShiftRight<kPlaceBits>(lane)));
  const Float distance2 = hn::Add(hn::Add(hn::Mul(dx, dx), hn::Mul(dy, dy)), hn::Mul(dz, dz));
  const Float most = hn::Add(reaches.of(lane), at.slack);
  return hn::Lt(distance2, hn::Mul(most, most));
}

#if HWY_TARGET == HWY_SCALAR || (HWY_ARCH_X86 && HWY_TARGET <= HWY_AVX3)
constexpr bool kCompresses = true;
#else
constexpr bool kCompresses = false;
#endif

/// The lanes of `from` that are in `keep` first, in their order; anything behind them.
HWY_INLINE Word compressed(Word from, hn::Mask<Words> keep) {
  const Words words;
  if constexpr (kCompresses) {
    return hn::Compress(from, keep);
  } else {
    // Highway does it by a table as well, which GCC 12 copies to the stack every time (seen with 8 lanes a vector).
    static_assert(kCompresses || hn::MaxLanes(Words()) <= 8);
    std::uint8_t bits[8];
    hn::StoreMaskBits(words, keep, bits);
    const auto order = hn::LoadU(hn::Rebind<std::uint8_t, Words>(), kOrders[bits[0]].data());
    return hn::TableLookupLanes(from, hn::IndicesFromVec(words, hn::PromoteTo(words, order)));
  }
}

// Without a branch on what the lanes hold: which of them are kept cannot be foreseen.
std::uint32_t filter_lanes(float query_share, LaneLayout layout, const LaneRun* runs, std::uint32_t n,
                           UnitIndex* out) {
  const Words words;
  const auto lanes = static_cast<std::uint32_t>(hn::Lanes(words));
  const Reaches reaches(hn::Set(Floats(), query_share));
  UnitIndex* end = out;
  for (const LaneRun* run = runs; run != runs + n; ++run) {
    const Query at(run->at);
    const std::uint32_t *strip = run->first, *next = run->more;
    for (std::uint64_t rest = run->mask; rest != 0;) {
      for (std::uint32_t i = 0; i < kStripLanes; i += lanes) {
        const std::uint64_t bits = rest >> i & (~std::uint64_t{0} >> (64 - lanes));
        if (lanes < kStripLanes && bits == 0) continue;
        const auto mask = hn::LoadMaskBits(words, reinterpret_cast<const std::uint8_t*>(&bits));
        const Word lane = load(strip + i, bits, mask);
        const Word index = load(strip + layout.stride + i, bits, mask);
        // Nothing is kept of lanes outside the mask, which read as zeros (caches/packed_lanes.h).
        const auto keep = hn::RebindMask(words, keeps_of(reaches, at, lane));
        hn::StoreU(compressed(index, keep), words, end);  // the whole vector
        end += hn::CountTrue(words, keep);
      }
      rest >>= kStripLanes;
      if (rest == 0) break;
      strip = next;
      next += layout.step;
    }
  }
  return static_cast<std::uint32_t>(end - out);
}

#if HWY_TARGET == HWY_SCALAR
void weigh_records(const SurfacePoint& x, float a, const Record* const* records, std::uint32_t n,
                   float* weights) {
  weigh_records_scalar(x, a, records, n, weights);
}
std::uint32_t add_records(const SurfacePoint& x, float a, const Record* const* records, std::uint32_t n,
                          WeightedSums& sums) {
  return add_records_scalar(x, a, records, n, sums);
}
#else
// Records are weighed eight at a time, or four where vectors are no longer than that.
using Group = hn::CappedTag<float, kWeighed>;
using Pairs = hn::RepartitionToWide<Group>;
using Block = hn::CappedTag<float, kSummed>;
constexpr std::size_t kGroup = hn::MaxLanes(Group());
static_assert(kGroup == 4 || kGroup == kWeighed);

/// Four floats, from `from` on, of record k and, where a group is two blocks of four, of record k + 4. A template, so
/// that only one way is compiled.
template <class Floats8Or4>
HWY_INLINE hn::Vec<Floats8Or4> blocks_of(Floats8Or4 floats, const Record* const* records, std::size_t k,
                                         std::size_t from) {
  const auto block = [&](std::size_t i) HWY_ATTR {
    return hn::LoadU(Block(), reinterpret_cast<const float*>(records[i]) + from);
  };
  if constexpr (kGroup == kWeighed) {
    return hn::Combine(floats, block(k + kSummed), block(k));
  } else {
    return block(k);
  }
}

/// Four floats of each of kGroup records, a column a vector.
struct Columns {
  hn::Vec<Group> a, b, c, d;
};

/// Columns of four rows, in each block of four floats for itself.
HWY_INLINE Columns transposed(hn::Vec<Group> a, hn::Vec<Group> b, hn::Vec<Group> c, hn::Vec<Group> d) {
  const Group floats;
  const Pairs pairs;
  const auto ab_low = hn::BitCast(pairs, hn::InterleaveLower(floats, a, b));
  const auto cd_low = hn::BitCast(pairs, hn::InterleaveLower(floats, c, d));
  const auto ab_high = hn::BitCast(pairs, hn::InterleaveUpper(floats, a, b));
  const auto cd_high = hn::BitCast(pairs, hn::InterleaveUpper(floats, c, d));
  return {hn::BitCast(floats, hn::InterleaveLower(pairs, ab_low, cd_low)),
          hn::BitCast(floats, hn::InterleaveUpper(pairs, ab_low, cd_low)),
          hn::BitCast(floats, hn::InterleaveLower(pairs, ab_high, cd_high)),
          hn::BitCast(floats, hn::InterleaveUpper(pairs, ab_high, cd_high))};
}

/// The first eight floats of kGroup records: x, y, z of the place and of the normal, R, and one that is not used.
struct Weighed {
  Columns first, second;
};
template <class Floats8Or4>
HWY_INLINE Weighed columns(Floats8Or4 floats, const Record* const* records) {
  const auto row = [&](std::size_t k, std::size_t from)
                       HWY_ATTR { return blocks_of(floats, records, k, from); };
  return {transposed(row(0, 0), row(1, 0), row(2, 0), row(3, 0)),
          transposed(row(0, 4), row(1, 4), row(2, 4), row(3, 4))};
}

/// `likely_split_sphere_weight` (core/interpolation.h) of kGroup records, operation by operation.
HWY_INLINE hn::Vec<Group> weights_of(const SurfacePoint& x, float a, const Record* const* records) {
  static_assert(offsetof(Record, p) == 0 && offsetof(Record, n) == 3 * sizeof(float) &&
                offsetof(Record, R) == 6 * sizeof(float) && sizeof(Record) >= 8 * sizeof(float));
  const Group floats;
  const auto all = [&](float v) { return hn::Set(floats, v); };
  const auto dot = [&](auto ax, auto ay, auto az, auto bx, auto by, auto bz) {
    return hn::Add(hn::Add(hn::Mul(ax, bx), hn::Mul(ay, by)), hn::Mul(az, bz));
  };
  const auto xx = all(x.p.x), xy = all(x.p.y), xz = all(x.p.z);
  const auto nx = all(x.n.x), ny = all(x.n.y), nz = all(x.n.z);
  const auto one = all(1.0f), tolerance = all(-kInFrontTolerance);
  const auto [first, second] = columns(floats, records);
  const auto dx = hn::Sub(xx, first.a), dy = hn::Sub(xy, first.b), dz = hn::Sub(xz, first.c);
  const auto rx = first.d, ry = second.a, rz = second.b, radius = second.c;
  const auto bend = hn::Sub(one, hn::Min(dot(nx, ny, nz, rx, ry, rz), one));
  const auto error = hn::Add(hn::Div(hn::Sqrt(dot(dx, dy, dz, dx, dy, dz)), radius), hn::Sqrt(bend));
  const auto front = hn::Mul(all(0.5f), dot(dx, dy, dz, hn::Add(nx, rx), hn::Add(ny, ry), hn::Add(nz, rz)));
  const auto valid = hn::And(hn::Lt(error, all(a)), hn::Ge(front, hn::Mul(tolerance, radius)));
  const auto weight = hn::Div(one, hn::Max(error, all(kMinError)));
  return hn::IfThenElseZero(valid, weight);
}

void weigh_records(const SurfacePoint& x, float a, const Record* const* records, std::uint32_t n,
                   float* weights) {
  for (std::uint32_t i = 0; i < n; i += kGroup)
    hn::StoreU(weights_of(x, a, records + i), Group(), weights + i);
}

/// Red, green, blue and a one of each record of blocks_of.
template <class Floats8Or4>
HWY_INLINE hn::Vec<Floats8Or4> colours_of(Floats8Or4 floats, const Record* const* records, std::size_t k) {
  constexpr std::size_t kE = offsetof(Record, E) / sizeof(float);
  static_assert(offsetof(Record, E) % sizeof(float) == 0 && sizeof(Record) >= (kE + 4) * sizeof(float));
  // What stands behind the irradiance is no float.
  HWY_ALIGN static constexpr std::uint32_t kIsColour[kWeighed] = {1, 1, 1, 0, 1, 1, 1, 0};
  const hn::RebindToUnsigned<Floats8Or4> words;
  const auto is_colour = hn::RebindMask(floats, hn::Ne(hn::Load(words, kIsColour), hn::Zero(words)));
  return hn::IfThenElse(is_colour, blocks_of(floats, records, k, kE), hn::Set(floats, 1.0f));
}

/// The sum of a group's blocks.
template <class Floats8Or4>
HWY_INLINE hn::Vec<Block> sum_of_blocks(Floats8Or4, hn::Vec<Floats8Or4> blocks) {
  if constexpr (kGroup == kWeighed) {
    return hn::Add(hn::LowerHalf(Block(), blocks), hn::UpperHalf(Block(), blocks));
  } else {
    return blocks;
  }
}

/// Adds four floats to sums of double precision.
template <class Doubles, class Floats4>
HWY_INLINE void add_to(WeightedSums& sums, hn::Vec<Floats4> terms) {
  const Doubles doubles;
  const auto add = [&](std::size_t from, auto some) HWY_ATTR {
    double* to = sums.data() + from;
    hn::StoreU(hn::Add(hn::LoadU(doubles, to), hn::PromoteTo(doubles, some)), doubles, to);
  };
  if constexpr (hn::MaxLanes(Doubles()) == 4) {
    add(0, terms);
  } else {
    const hn::Half<Floats4> half;
    add(0, hn::LowerHalf(half, terms));
    add(2, hn::UpperHalf(half, terms));
  }
}

/// Weights are added as vectors of red, green, blue and the weight itself. Those behind the last record are 0, which
/// changes no sum.
std::uint32_t add_records(const SurfacePoint& x, float a, const Record* const* records, std::uint32_t n,
                          WeightedSums& sums) {
  const Group floats;
  auto sum = hn::Zero(Block());
  std::size_t valid = 0;
  for (std::uint32_t i = 0; i < n; i += kGroup) {
    const Record* const* group = records + i;
    const auto is_record = hn::FirstN(floats, std::min<std::size_t>(n - i, kGroup));
    const auto weight = hn::IfThenElseZero(is_record, weights_of(x, a, group));
    valid += hn::CountTrue(floats, hn::Gt(weight, hn::Zero(floats)));
    auto blocks = hn::Mul(hn::Broadcast<0>(weight), colours_of(floats, group, 0));
    blocks = hn::Add(blocks, hn::Mul(hn::Broadcast<1>(weight), colours_of(floats, group, 1)));
    blocks = hn::Add(blocks, hn::Mul(hn::Broadcast<2>(weight), colours_of(floats, group, 2)));
    blocks = hn::Add(blocks, hn::Mul(hn::Broadcast<3>(weight), colours_of(floats, group, 3)));
    sum = hn::Add(sum, sum_of_blocks(floats, blocks));
  }
  add_to<hn::CappedTag<double, 4>, Block>(sums, sum);
  return static_cast<std::uint32_t>(valid);
}
#endif

}  // namespace HWY_NAMESPACE
}  // namespace icbench
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace icbench {

HWY_EXPORT(filter_lanes);
HWY_EXPORT(weigh_records);
HWY_EXPORT(add_records);

namespace {

/// The kernels for the best of the targets that are allowed now.
LaneKernels chosen_kernels() {
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  return {HWY_DYNAMIC_DISPATCH(filter_lanes), HWY_DYNAMIC_DISPATCH(weigh_records),
          HWY_DYNAMIC_DISPATCH(add_records)};
}

}  // namespace

LaneKernels SimdLanes::best() noexcept {
  static const LaneKernels kernels = chosen_kernels();
  return kernels;
}

std::vector<NamedLaneKernels> lane_kernels() {
  std::vector<NamedLaneKernels> all;
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    all.push_back({hwy::TargetName(target), chosen_kernels()});
  }
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  return all;
}

}  // namespace icbench
#endif
