// What all caches share: sessions, their table, the pool of record tickets, and names put together at compile
// time.
//
// A cache provides visit(state, x, f) and insert(state, r) on its own per-session State; Session puts the
// checks of bad input, the interpolating query and the counters in front, once for all caches. `query` is
// `visit` with the Interpolator, so a test that records what visit was shown tests the code that ships. The same holds
// of `query_batch` and `visit_batch` (core/cache.h, BatchSession): one visit after the other, or, in caches that have a
// visit_batch(state, points, visitors), up to kBatch side by side.
//
// Step bounds. A step is one operation on an atomic word, a read-modify-write included. A structure that is wait-free
// says in numbers what that means: an insert of r takes at most insert_steps(r) steps; a visit reads how far each list
// reaches once, of kMostLists lists at most, and takes at most kVisitSteps and, for a list that reached to `extent`
// then, list_steps(extent). kInsertBound and kVisitBound say the same in words. A batch takes at most the sum of its
// visits, and reads as many lists as they may together. The caches on top add what is their own; stress/README.md tells
// how the bounds are checked.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "core/at_end.h"
#include "core/cache.h"
#include "core/parallel.h"
#include "core/setup_error.h"
#include "core/sync.h"

namespace icbench {

/// Queries that a structure or a cache can have under way at once: 1 if it has no visit_batch.
template <class Structure>
constexpr std::size_t batch_of() noexcept {
  if constexpr (requires { Structure::kBatch; }) {
    return Structure::kBatch;
  } else {
    return 1;
  }
}

/// Handle by which one thread uses a cache. Cheap to copy; use it in one thread at a time.
template <class Cache, class State>
class Session {
 public:
  Session(Cache& cache, State& state) noexcept : cache_(&cache), state_(&state) {}

  template <class F>
  void visit(const SurfacePoint& x, F&& f) noexcept {
    state_->counters.template add<&Counts::queries>(1);
    if (!is_askable(x, cache_->config().bounds)) {
      state_->counters.template add<&Counts::invalid_queries>(1);
      return;
    }
    cache_->visit(*state_, x, f);
  }

  std::optional<Irradiance> query(const SurfacePoint& x) noexcept {
    Interpolator interpolator;
    visit(x, interpolator);
    const std::optional<Irradiance> E = interpolator.result();
    state_->counters.template add<&Counts::hits>(E.has_value());
    return E;
  }

  /// `visit` for each of `points`, with visitors[i] for points[i] (core/cache.h, BatchSession).
  template <class Visitors>
  void visit_batch(std::span<const SurfacePoint> points, Visitors&& visitors) noexcept {
    if constexpr (kAtOnce > 1) {
      for (std::size_t i = 0; i < points.size(); i += kAtOnce)
        visit_some(points.subspan(i, std::min(kAtOnce, points.size() - i)), i, visitors);
    } else {
      for (std::size_t i = 0; i < points.size(); ++i) visit(points[i], visitors[i]);
    }
  }

  /// `query` for each of `points`.
  void query_batch(std::span<const SurfacePoint> points, std::span<std::optional<Irradiance>> out) noexcept {
    if constexpr (kAtOnce > 1) {
      for (std::size_t i = 0; i < points.size(); i += kAtOnce) {
        const std::size_t n = std::min(kAtOnce, points.size() - i);
        std::array<Interpolator, kAtOnce> interpolators;
        visit_some(points.subspan(i, n), 0, interpolators);
        for (std::size_t k = 0; k < n; ++k) {
          out[i + k] = interpolators[k].result();
          state_->counters.template add<&Counts::hits>(out[i + k].has_value());
        }
      }
    } else {
      for (std::size_t i = 0; i < points.size(); ++i) out[i] = query(points[i]);
    }
  }

  InsertResult insert(const Record& r) noexcept {
    auto& counters = state_->counters;
    if (!is_storable(r, cache_->config().bounds)) {
      counters.template add<&Counts::rejected>(1);
      return InsertResult::rejected;
    }
    if (!cache_->insert(*state_, r)) {
      counters.template add<&Counts::full>(1);
      return InsertResult::full;
    }
    counters.template add<&Counts::inserted>(1);
    return InsertResult::inserted;
  }

  void prefault(std::uint32_t n) noexcept { cache_->prefault(*state_, n); }

  /// What this session has waited for locks since the counters were reset, nanoseconds; 0 without counters.
  std::uint64_t lock_wait_ns() const noexcept { return state_->counters.counts().lock_wait_ns; }

 private:
  static constexpr std::size_t kAtOnce = batch_of<Cache>();

  /// The visitors of those points of a batch that can be asked.
  template <class Visitors>
  struct Chosen {
    Visitors& visitors;
    const std::size_t* which;
    decltype(auto) operator[](std::size_t i) const noexcept { return visitors[which[i]]; }
  };

  /// `visit` for as many points as the cache can have under way at once, or fewer; visitors[first] is the first's.
  template <class Visitors>
  void visit_some(std::span<const SurfacePoint> points, std::size_t first, Visitors& visitors) noexcept {
    auto& counters = state_->counters;
    counters.template add<&Counts::queries>(points.size());
    std::array<SurfacePoint, kAtOnce> askable;
    std::array<std::size_t, kAtOnce> which;
    std::size_t n = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (!is_askable(points[i], cache_->config().bounds)) continue;
      askable[n] = points[i];
      which[n++] = first + i;
    }
    counters.template add<&Counts::invalid_queries>(points.size() - n);
    cache_->visit_batch(*state_, std::span<const SurfacePoint>(askable).first(n),
                        Chosen<Visitors>{visitors, which.data()});
  }

  Cache* cache_;
  State* state_;
};

/// The per-session states of a cache, each on cache lines of its own.
template <class State>
class SessionTable {
 public:
  SessionTable(const CacheConfig& config, bool single_thread)
      : size_(config.max_sessions), slots_(std::make_unique<Slot[]>(config.max_sessions)) {
    if (single_thread && config.max_sessions > 1) {
      fail_setup("this cache serves a single thread; set max_sessions to 1 or choose a shared cache");
    }
  }

  /// State of session `thread`; fails at set-up if there is none such.
  State& operator[](std::uint32_t thread) {
    if (thread >= size_) fail_setup("open_session: thread index is not below max_sessions");
    return slots_[thread].state;
  }

  template <class F>
  void for_each(F&& f) {
    for (std::uint32_t i = 0; i < size_; ++i) f(slots_[i].state);
  }
  template <class F>
  void for_each(F&& f) const {
    for (std::uint32_t i = 0; i < size_; ++i) f(static_cast<const State&>(slots_[i].state));
  }

  std::uint32_t size() const noexcept { return size_; }
  std::size_t bytes() const noexcept { return size_ * sizeof(Slot); }

  Counts counts() const {
    Counts sum;
    for_each([&](const State& s) { sum += s.counters.counts(); });
    return sum;
  }

  void reset_counters() {
    for_each([](State& s) { s.counters.reset(); });
  }

 private:
  struct alignas(kNoSharing) Slot {
    State state;
  };

  std::uint32_t size_;
  std::unique_ptr<Slot[]> slots_;
};

/// Bytes that a structure has whatever is in it, beside what its workspaces allocate.
template <class Structure>
std::size_t fixed_bytes(const Structure& structure) noexcept {
  if constexpr (requires { structure.fixed_bytes(); }) {
    return structure.fixed_bytes();
  } else {
    return 0;
  }
}

/// Most steps of a visit to a wait-free structure, list by list as far as each reached.
template <class Structure>
constexpr std::uint64_t visit_steps(std::span<const std::uint32_t> extents) noexcept {
  std::uint64_t steps = Structure::kVisitSteps;
  for (const std::uint32_t extent : extents) steps += Structure::list_steps(extent);
  return steps;
}

/// Counts records against a capacity without sharing a word on every insert: sessions draw tickets in
/// batches.
///
/// At most `capacity` tickets are out. An insert is refused only when every ticket has been drawn; up to
/// kTicketBatch - 1 of those may lie unused in each other session.
template <class Sync>
class TicketOffice {
 public:
  /// One session's tickets in hand.
  struct Purse {
    std::uint32_t tickets = 0;
  };

  explicit TicketOffice(std::uint32_t capacity) noexcept : capacity_(capacity) {}

  /// Most steps that `insert` adds to those of `store`: one load and one fetch_add.
  static constexpr std::uint32_t kSteps = 2;
  static constexpr std::string_view kBound = " + 2 for the ticket";

  /// Runs `store`, which returns whether it stored a record, if there is a ticket for it. Wait-free: kSteps on top of
  /// `store`.
  template <class Store>
  bool insert(Purse& purse, Store&& store) noexcept {
    if (!draw(purse)) return false;
    if (store()) return true;
    ++purse.tickets;
    return false;
  }

  /// Starts again with `live` records stored; every purse must be emptied. Quiescent.
  void restart(std::uint64_t live) noexcept {
    drawn_.store(live,
                 std::memory_order_relaxed);  // relaxed: the caller's synchronisation orders quiescent points
  }

 private:
  bool draw(Purse& purse) noexcept {
    if (purse.tickets == 0) {
      // Relaxed: the count alone matters, nothing is published by it. The load bounds the overshoot of the
      // counter to one batch a session.
      if (drawn_.load(std::memory_order_relaxed) >= capacity_) return false;
      const std::uint32_t batch = Sync::may_take_pieces() ? kTicketBatch : 1;
      const std::uint64_t first = drawn_.fetch_add(batch, std::memory_order_relaxed);
      if (first >= capacity_) return false;
      purse.tickets = static_cast<std::uint32_t>(std::min<std::uint64_t>(batch, capacity_ - first));
    }
    --purse.tickets;
    return true;
  }

  const std::uint64_t capacity_;
  alignas(kNoSharing) typename Sync::template Atomic<std::uint64_t> drawn_{0};
};

/// `config`, or a failure at set-up with one line that says what is wrong with it.
inline const CacheConfig& checked(const CacheConfig& config) {
  if (const char* error = config_error(config)) fail_setup(error);
  return config;
}

/// Records that are in a structure. Quiescent.
template <class Structure>
std::uint64_t count_of(const Structure& structure) {
  std::uint64_t live = 0;
  structure.for_each([&](const Record&) { ++live; });
  return live;
}

/// What update_records does to a record: what f says, but one that cannot be stored as f left it (is_storable) goes,
/// and one at which f throws stays as it was.
template <class F>
auto keeping_storable(F& f, const Bounds& bounds) noexcept {
  return [&f, &bounds](Record& r) {
    const Record before = r;
    bool is_done = false;
    const AtEnd undo{[&] {
      if (!is_done) r = before;
    }};
    const UpdateResult asked = f(r);
    is_done = true;
    return is_storable(r, bounds) ? asked : UpdateResult::drop;
  };
}

/// Updates a structure, and in any case calls `then` before what that threw comes out of here.
template <class Structure, class F, class Then>
void update_and_then(Structure& structure, F&& f, Then&& then) {
  FirstException exception;
  exception.guard([&] { structure.update(f); });
  then();
  exception.rethrow();
}

/// Records that fit beside `live` ones where `fit` do from empty, if each takes the most that one does on average. What
/// is there may be just short of needing more, as lists before their next segment, so the next records may take what
/// these have spared: all count.
constexpr std::uint64_t room_beside(std::uint64_t live, std::uint64_t fit) noexcept {
  return fit > live ? fit - live : 0;
}

/// Keeps a structure's promise of room for `capacity` records after an update: if the nodes that dropped ones left
/// behind take the room of those to come, builds the structure anew. `structure.room(live)`: records that still fit for
/// certain beside `live`, whatever their places and whichever sessions insert them. `fresh_workspace` empties all
/// workspaces on the structure and returns one of them. Quiescent.
template <class Structure, class FreshWorkspace>
void keep_room(Structure& structure, std::uint32_t capacity, FreshWorkspace&& fresh_workspace) {
  const std::uint64_t live = count_of(structure);
  if (live + structure.room(live) >= capacity) return;
  std::vector<Record> records;
  records.reserve(live);
  structure.for_each([&](const Record& r) { records.push_back(r); });
  structure.clear();
  auto& workspace = fresh_workspace();
  NoCounters uncounted;
  for (const Record& r : records)
    structure.insert(workspace, r, uncounted);  // an empty pool has room for all
}

/// Concatenates names at compile time: `kJoined<kPrefix, kSuffix>` is a string_view of both.
template <const std::string_view&... kParts>
class JoinedName {
  static constexpr auto kChars = [] {
    std::array<char, (kParts.size() + ... + 1)> chars{};
    auto out = chars.begin();
    ((out = std::copy(kParts.begin(), kParts.end(), out)), ...);
    return chars;
  }();

 public:
  static constexpr std::string_view value{kChars.data(), kChars.size() - 1};
};

}  // namespace icbench
