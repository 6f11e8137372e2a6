// The irradiance cache concept: what every cache offers, what it promises, and how it is configured.
//
// A renderer opens one session per thread, and from then on all operations go through the sessions:
//
//   WaitFree<> cache({.bounds = scene_bounds, .capacity = 100'000, .max_sessions = 8});
//   auto session = cache.open_session(thread_index);
//   if (auto E = session.query(x)) use(*E);
//   else session.insert(gather(x));
//
// Operations on sessions may run concurrently, each session in one thread at a time. Everything on the cache
// itself (frames, clear, update_records, for_each_record) is quiescent: the caller makes sure, through
// synchronisation of its own, that no session operation is in flight.
#pragma once

#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "core/counters.h"
#include "core/interpolation.h"
#include "core/large_pages.h"
#include "core/types.h"

namespace icbench {

/// Progress of one operation (Herlihy & Shavit). `wait_free` operations document a step bound at their
/// definition.
enum class ProgressGuarantee : std::uint8_t { blocking, lock_free, wait_free };

constexpr std::string_view to_string(ProgressGuarantee progress) noexcept {
  switch (progress) {
    case ProgressGuarantee::blocking:
      return "blocking";
    case ProgressGuarantee::lock_free:
      return "lock_free";
    case ProgressGuarantee::wait_free:
      return "wait_free";
  }
  return "unknown";
}

/// What a query promises to see; the specification is the set of records, the value follows from it.
/// Integrity (nothing lost, duplicated, torn, invented or resurrected) is promised by every cache on top.
enum class Consistency : std::uint8_t {
  none,     ///< the cache keeps nothing
  frame,    ///< own inserts at once, everybody's after end_frame
  regular,  ///< all inserts that returned before the query was called, none called after it returned
  per_record_linearizable,  ///< regular, and what one query saw no later query misses
  linearizable              ///< an atomic snapshot
};

constexpr std::string_view to_string(Consistency consistency) noexcept {
  switch (consistency) {
    case Consistency::none:
      return "none";
    case Consistency::frame:
      return "frame";
    case Consistency::regular:
      return "regular";
    case Consistency::per_record_linearizable:
      return "per_record_linearizable";
    case Consistency::linearizable:
      return "linearizable";
  }
  return "unknown";
}

/// What a cache declares about itself; every check and plot starts from this.
struct CacheTraits {
  std::string_view name;
  std::string_view structure;  ///< rows of one structure compare mechanisms
  std::string_view mechanism;
  ProgressGuarantee insert;
  ProgressGuarantee query;
  Consistency consistency;
  bool single_thread;             ///< at most one session
  std::string_view source;        ///< publication, or "this project"
  bool waits_in_library = false;  ///< what blocks is a library's container, which no check can stop half way
};

struct CacheConfig {
  /// Records and queries outside are refused; octrees reckon with the bounds of what is shown.
  Bounds bounds{};
  /// Coarsest accuracy that will be asked for; fixes the extents records are stored under.
  float a_max = 0.5f;
  float a = 0.5f;  ///< accuracy of queries, kMinAccuracy <= a <= a_max; smaller is finer
  /// Records that fit for certain, by one session; by several: capacity_for.
  std::uint32_t capacity = 1 << 20;
  std::uint32_t max_sessions = 1;                   ///< threads that will open a session
  LargePages large_pages = LargePages::when_large;  ///< of octrees; large is a capacity over 65,536 records
};

/// Tickets for records are drawn by sessions in batches of this size (caches/session.h).
inline constexpr std::uint32_t kTicketBatch = 64;

/// Most sessions a cache can serve.
inline constexpr std::uint32_t kMaxSessions = 8192;

/// Most records a cache can promise room for: pool indices are 32 bits.
inline constexpr std::uint32_t kMaxCapacity = 1u << 26;

/// Whether the memory of a cache is to be asked for on large pages: unless told, where it fills several of them, so that
/// they are worth the time it takes to clear one.
inline LargePages large_pages_of(LargePages asked, std::uint32_t records) noexcept {
  return asked == LargePages::when_large && records <= 1u << 16 ? LargePages::never : asked;
}
inline LargePages large_pages_of(const CacheConfig& config) noexcept {
  return large_pages_of(config.large_pages, config.capacity);
}

/// A capacity that holds `records` for certain, although every session may be left with tickets it does not use; the
/// greatest there is if that is less.
inline std::uint32_t capacity_for(std::uint64_t records, std::uint32_t sessions) noexcept {
  if (records > kMaxCapacity) return kMaxCapacity;
  const std::uint64_t wanted = records + std::uint64_t{sessions} * kTicketBatch;
  return wanted < kMaxCapacity ? static_cast<std::uint32_t>(wanted) : kMaxCapacity;
}

/// One clear line if the configuration cannot be used, else nullptr.
inline const char* config_error(const CacheConfig& c) noexcept {
  if (!is_finite(c.bounds.lower) || !is_finite(c.bounds.upper)) return "cache bounds must be finite";
  if (!c.bounds.contains(c.bounds.lower)) return "cache bounds: lower must not exceed upper in any axis";
  if (!is_finite(c.bounds.upper - c.bounds.lower)) return "cache bounds are too large for single precision";
  if (!std::isgreaterequal(c.a, kMinAccuracy) || !std::islessequal(c.a, c.a_max))
    return "cache accuracy a must lie in [0.002, a_max]";
  if (!std::islessequal(c.a_max, 10.0f)) return "cache accuracy a_max must not exceed 10";
  if (c.capacity == 0 || c.capacity > kMaxCapacity) return "cache capacity must lie in [1, 67108864] records";
  if (c.max_sessions == 0 || c.max_sessions > kMaxSessions) return "cache max_sessions must lie in [1, 8192]";
  return nullptr;
}

template <class S>
concept CacheSession = requires(S s, const SurfacePoint& x, const Record& r,
                                std::span<const SurfacePoint> points,
                                std::span<std::optional<Irradiance>> out, std::uint32_t n) {
  // Calls f(const Record&, float weight) for every record valid at x, each once; order unspecified.
  {
    s.visit(x, [](const Record&, float) noexcept {})
  }
  noexcept;
  // The interpolated irradiance; nullopt exactly when no record is valid at x.
  { s.query(x) }
  noexcept->std::same_as<std::optional<Irradiance>>;
  // query for each of `points`; `out` has the same length. The packed octree has sixteen under way at once, for which
  // it takes some 75 kB of stack; a query alone takes less than 64.
  { s.query_batch(points, out) }
  noexcept;
  { s.insert(r) }
  noexcept->std::same_as<InsertResult>;
  // Takes and touches memory for about n inserts, so that page faults fall outside a measured region. What one session
  // has taken is no other's until the cache is cleared, but the others' room is not less for it: all sessions together
  // can take as much so as `capacity` inserts are expected to need; more is not done.
  { s.prefault(n) }
  noexcept;
};

/// What a visitor looks like; for concepts.
struct AnyVisitor {
  void operator()(const Record&, float) const noexcept {}
};

/// A session that takes many visits in one call, as all sessions of caches/session.h do: a structure that can have
/// several under way at once lets one go on while another waits for memory.
///
/// visit_batch(points, visitors) calls visitors[i](record, weight) for every record valid at points[i], each once, and
/// returns when all are done. `visitors`: a span, or whatever else can be indexed so. Any number of points, none
/// included; those at which a query is refused are counted and shown nothing.
///
///   Order. A visitor sees its records in the order in which `visit` would show them if the cache held what it does
///   now. Calls to different visitors may take turns in any way, all in the caller's thread.
///
///   Consistency. Each visit of a batch is a query of its own: it takes effect by itself, as the cache declares of a
///   query, between the call of visit_batch and its return, and in no order among those of the batch. The batch as a
///   whole is no snapshot: two of its visits may see different states, in a linearizable cache too.
///
///   Steps and progress. At most the sum of what its visits may take one by one; wait-free if they are. A lock
///   around the structure may be held for several visits together.
template <class S>
concept BatchSession = CacheSession<S> &&
    requires(S s, std::span<const SurfacePoint> points, std::span<AnyVisitor> visitors) {
  { s.visit_batch(points, visitors) }
  noexcept;
};

template <class C>
concept IrradianceCache = requires(C c, const C& view, const CacheConfig& config, std::uint32_t thread) {
  { C::kTraits } -> std::convertible_to<CacheTraits>;
  requires std::constructible_from<C, const CacheConfig&>;
  requires CacheSession<typename C::Session>;
  // Once per thread, 0 <= thread < max_sessions; the session survives frames and clear; the cache owns its
  // memory.
  { c.open_session(thread) } -> std::same_as<typename C::Session>;
  {c.begin_frame()};
  {c.end_frame()};
  // Forgets every record.
  {c.clear()};
  // f(Record&) -> UpdateResult for every copy of every record, in parallel (f must stand that). Position, normal and id
  // stay, the radius may not grow; what cannot be stored as f left it (is_storable) is dropped. Invalidates references
  // to records. If f throws, some records are updated and some are not, and each is there once or gone.
  {c.update_records([](Record&) noexcept { return UpdateResult::keep; })};
  // f(const Record&) for every record once, one after the other.
  {view.for_each_record([](const Record&) {})};
  // Bytes handed out to records and nodes so far. Resident is more where large pages are used in part, or memory was
  // touched ahead.
  { view.memory_bytes() } -> std::same_as<std::size_t>;
  // Contention counters summed over all sessions; all zero when the cache is built with NoCounters.
  { view.counters() } -> std::same_as<Counts>;
  {c.reset_counters()};
};

/// A cache that can put what it holds in order. tidy() lays its records out in memory in the order of space, so that
/// queries of neighbouring points read neighbouring memory. It takes as long as inserting them once to three times, and
/// is worth that where they came in another order and are asked for long. Quiescent. Sessions stay as they are, and so
/// do records and what queries see; what they add up to may differ by rounding, since the order does.
template <class C>
concept TidyCache = IrradianceCache<C> && requires(C c) {
  {c.tidy()};
};

}  // namespace icbench
