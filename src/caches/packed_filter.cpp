#include "caches/packed_filter.h"

// Below the compiler's own target too, so that tests reach every width that the machine has.
#define HWY_COMPILE_ALL_ATTAINABLE
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "caches/packed_filter.cpp"
#include <hwy/foreach_target.h>  // first, compiles this file once for each kind of machine
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace icbench {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using Words = hn::CappedTag<std::uint32_t, kStripLanes>;
using Ints = hn::RebindToSigned<Words>;
using Floats = hn::RebindToFloat<Words>;
using Word = hn::Vec<Words>;
using Float = hn::Vec<Floats>;

// Whether a load under a mask leaves alone what is masked out. ThreadSanitizer does not see such loads.
#if defined(__SANITIZE_THREAD__)
#define ICBENCH_COPY_LANES 1
#elif defined(__has_feature)
#if __has_feature(thread_sanitizer)
#define ICBENCH_COPY_LANES 1
#endif
#endif
#if defined(ICBENCH_COPY_LANES) || !HWY_ARCH_X86
constexpr bool kHasMaskedLoads = false;
#else
constexpr bool kHasMaskedLoads = HWY_TARGET <= HWY_AVX2;  // the better targets have the smaller numbers
#endif
#undef ICBENCH_COPY_LANES

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

template <int kShift>
HWY_INLINE Float place_of(Word place) {
  const Words words;
  return hn::ConvertTo(Floats(),
                       hn::BitCast(Ints(), hn::And(hn::ShiftRight<kShift>(place), hn::Set(words, 1023u))));
}

template <int kShift>
HWY_INLINE Float normal_of(Word shape) {
  const auto high = hn::BitCast(Ints(), hn::ShiftLeft<24 - kShift>(shape));
  return hn::ConvertTo(Floats(), hn::ShiftRight<24>(high));
}

/// What `keeps` (caches/packed_lanes.h) takes from the query, in all lanes.
struct Query {
  explicit Query(const LaneQuery& q)
      : nx(hn::Set(Floats(), q.nx)),
        ny(hn::Set(Floats(), q.ny)),
        nz(hn::Set(Floats(), q.nz)),
        a(hn::Set(Floats(), q.a)),
        per_bend(hn::Set(Floats(), q.per_bend)) {}
  Float nx, ny, nz, a, per_bend;
};

/// `keeps`, operation by operation.
HWY_INLINE hn::Mask<Floats> keeps_of(const Query& q, const LanePoint& at, Word place, Word shape) {
  const Words words;
  const Floats floats;
  const Float dx = hn::Sub(hn::Set(floats, at.x), place_of<0>(place));
  const Float dy = hn::Sub(hn::Set(floats, at.y), place_of<10>(place));
  const Float dz = hn::Sub(hn::Set(floats, at.z), place_of<20>(place));
  const Float distance2 = hn::Add(hn::Add(hn::Mul(dx, dx), hn::Mul(dy, dy)), hn::Mul(dz, dz));
  const Float dot = hn::Add(hn::Add(hn::Mul(q.nx, normal_of<0>(shape)), hn::Mul(q.ny, normal_of<8>(shape))),
                            hn::Mul(q.nz, normal_of<16>(shape)));
  const Float bend = hn::Max(hn::Sub(hn::Set(floats, 1.0f - kNormalSlack), dot), hn::Zero(floats));
  const Float share = hn::Sub(q.a, hn::Mul(hn::Sqrt(bend), q.per_bend));
  const Word code = hn::ShiftRight<24>(shape);
  const Float expressed =
      hn::BitCast(floats, hn::Add(hn::ShiftLeft<kReachShift>(code), hn::Set(words, kReachBase)));
  const auto is_far = hn::RebindMask(floats, hn::Eq(code, hn::Set(words, kReachAlways)));
  const Float reach = hn::IfThenElse(is_far, hn::Set(floats, kFarReach), expressed);
  const Float most = hn::Add(hn::Mul(reach, share), hn::Set(floats, at.slack));
  return hn::And(hn::Gt(share, hn::Zero(floats)), hn::Lt(distance2, hn::Mul(most, most)));
}

// Without a branch on what the lanes hold: which of them are kept cannot be foreseen.
std::uint32_t filter_lanes(const LaneQuery& query, const LaneStrip* strips, std::uint32_t n, UnitIndex* out) {
  const Words words;
  const auto lanes = static_cast<std::uint32_t>(hn::Lanes(words));
  const Query q(query);
  std::uint32_t kept = 0;
  for (const LaneStrip* s = strips; s != strips + n; ++s) {
    for (std::uint32_t i = 0; i < kStripLanes; i += lanes) {
      const std::uint64_t bits = s->bits >> i & (~std::uint64_t{0} >> (64 - lanes));
      if (lanes < kStripLanes && bits == 0) continue;
      const auto mask = hn::LoadMaskBits(words, reinterpret_cast<const std::uint8_t*>(&bits));
      const Word place = load(s->words + i, bits, mask);
      const Word shape = load(s->words + s->stride + i, bits, mask);
      const Word index = load(s->words + 2 * s->stride + i, bits, mask);
      const auto keep = hn::And(mask, hn::RebindMask(words, keeps_of(q, *s->at, place, shape)));
      hn::StoreU(hn::Compress(index, keep), words, out + kept);  // the whole vector
      kept += static_cast<std::uint32_t>(hn::CountTrue(words, keep));
    }
  }
  return kept;
}

}  // namespace HWY_NAMESPACE
}  // namespace icbench
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace icbench {

HWY_EXPORT(filter_lanes);

namespace {

/// The filter for the best of the targets that are allowed now.
LaneFilter chosen_filter() {
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  return HWY_DYNAMIC_DISPATCH(filter_lanes);
}

}  // namespace

LaneFilter SimdLanes::best() noexcept {
  static const LaneFilter filter = chosen_filter();
  return filter;
}

std::vector<NamedLaneFilter> lane_filters() {
  std::vector<NamedLaneFilter> filters;
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    filters.push_back({hwy::TargetName(target), chosen_filter()});
  }
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  return filters;
}

}  // namespace icbench
#endif
