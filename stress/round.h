// One round of stress on a cache: threads run random operations on it, epoch after epoch, and what happened
// is recorded as a history.
//
// Records carry a unique id and, as irradiance, the number of the last update and two hashes of everything
// else in them, so that a torn or stale record shows itself. Queries go through `visit`, the traversal that
// every query takes, and some through `visit_batch`: each of a batch is a query of its own that lasts as long as the
// batch. Recording costs two stamps a call and writes to buffers of the thread's own, which are there before the epoch
// begins.
#pragma once

#include <fmt/format.h>

#include <array>
#include <barrier>
#include <memory>
#include <span>
#include <stdexcept>
#include <string_view>
#include <system_error>
#include <thread>
#include <vector>

#include "core/cache.h"
#include "core/random.h"
#include "stress/clock.h"
#include "stress/delay_sync.h"
#include "stress/history.h"

namespace icbench::stress {

/// What a round is like; lengths in operations are sums over all threads.
struct Shape {
  std::string_view name;
  std::uint32_t places;
  std::span<const float> radii;  ///< metres, in the unit cube
  std::uint32_t epoch_operations;
  std::uint32_t insert_percent;
  std::uint32_t clear_every;       ///< epochs from clear to clear, >= 1
  std::uint32_t capacity_percent;  ///< of the inserts expected between clears
};

/// All shapes: few places and records of many sizes (many concurrent pairs, several lists to a query), a tree
/// that is young again and again (races to install), many places (a large tree), and a pool too small.
std::span<const Shape> all_shapes();

struct RoundPlan {
  const Shape* shape = nullptr;
  std::uint32_t threads = 1;
  std::uint32_t operations = 0;  ///< in all; rounded to whole epochs
  std::uint64_t seed = 0;
  ClockSource clock = ClockSource::counter;
  std::uint32_t delay_every = 0;  ///< one atomic step in so many is delayed; 0 for none
};

/// Where queries ask and which records are valid there, by the predicate that caches and oracle share.
class Landscape {
 public:
  Landscape(const Shape& shape, std::uint64_t seed, float a);

  const SurfacePoint& place(std::uint32_t i) const noexcept { return places_[i]; }
  const ValidityTable& validity() const noexcept { return validity_; }
  /// Record `id` of a kind, as it is after `update` updates.
  Record record(std::uint32_t kind, std::uint32_t id, std::uint32_t update) const noexcept;

 private:
  std::vector<SurfacePoint> places_;
  std::vector<float> radii_;
  ValidityTable validity_;
};

/// The irradiance that vouches for the rest of the record after `update` updates.
Irradiance seal(const Record& r, std::uint32_t update) noexcept;

/// `r.id`, with kTorn if the record is not as it was written last.
inline std::uint32_t shown_id(const Record& r, std::uint32_t update) noexcept {
  return r.id >= kTorn || r.E != seal(r, update) ? r.id | kTorn : r.id;
}

/// Whether update number `update` drops record `id`. Every third update drops none: what it changes has to reach all
/// copies of a record all the same.
inline bool is_dropped(std::uint32_t id, std::uint32_t update) noexcept {
  return update % 3 != 0 && hash_keys(id, update) % 4 == 0;
}

/// Most queries of a batch: more than any cache has under way at once.
inline constexpr std::uint32_t kMostBatch = 20;

/// One thread's record of one epoch.
class ThreadLog {
 public:
  /// Room for `operations` whose queries see at most `most_seen` records each, if that can be had; `has_room`
  /// tells a thread when to stop early.
  void reserve(std::uint32_t operations, std::uint32_t most_seen) {
    constexpr std::uint64_t kUsuallySeen = 128;
    const std::uint64_t usual = operations * std::min<std::uint64_t>(kUsuallySeen, most_seen);
    most_seen_ = most_seen;
    operations_.resize(operations);
    seen_.resize(usual + most_seen);
    restart();
  }
  void restart() noexcept { operations_used_ = seen_used_ = seen_first_ = 0; }

  bool has_room() const noexcept {
    return operations_used_ < operations_.size() && seen_.size() - seen_used_ >= most_seen_;
  }
  /// A cache that shows more than there can be is faulty already by what is kept.
  void see(std::uint32_t id) noexcept {
    if (seen_used_ < seen_.size()) seen_[seen_used_++] = id;
  }

  /// Queries that there is room for in one batch.
  std::uint32_t batch_room() const noexcept {
    return static_cast<std::uint32_t>(std::min<std::size_t>(
        {kMostBatch, operations_.size() - operations_used_, (seen_.size() - seen_used_) / most_seen_}));
  }
  /// Query `i` of a batch has a stretch of its own of what is free: they may be shown their records in turns.
  void see(std::size_t i, std::uint32_t id) noexcept {
    if (batch_seen_[i] < most_seen_) seen_[seen_used_ + i * most_seen_ + batch_seen_[i]++] = id;
  }
  /// The batch has returned.
  void add_batch(Stamp call, Stamp ret, std::uint32_t thread,
                 std::span<const std::uint32_t> places) noexcept {
    const std::size_t first = seen_used_;
    for (std::size_t i = 0; i < places.size(); ++i) {
      for (std::uint32_t k = 0; k < batch_seen_[i]; ++k)
        seen_[seen_used_++] = seen_[first + i * most_seen_ + k];
      batch_seen_[i] = 0;
      add_query(call, ret, thread, places[i]);
    }
  }

  void add_query(Stamp call, Stamp ret, std::uint32_t thread, std::uint32_t place) noexcept {
    operations_[operations_used_++] = {call,
                                       ret,
                                       thread,
                                       place,
                                       seen_first_,
                                       seen_used_ - seen_first_,
                                       Operation::Type::query,
                                       InsertResult::inserted};
    seen_first_ = seen_used_;
  }
  void add_insert(Stamp call, Stamp ret, std::uint32_t thread, std::uint32_t kind, std::uint32_t id,
                  InsertResult result) noexcept {
    operations_[operations_used_++] = {call, ret, thread, kind, id, 0, Operation::Type::insert, result};
  }

  void append_to(History& history) const;

 private:
  std::vector<Operation> operations_;
  std::vector<std::uint32_t> seen_;
  std::uint32_t operations_used_ = 0;
  std::uint32_t seen_used_ = 0;
  std::uint32_t seen_first_ = 0;
  std::uint32_t most_seen_ = 0;
  std::array<std::uint32_t, kMostBatch> batch_seen_{};  // by the queries of a batch
};

/// A history and what its table of validity belongs to.
struct RoundRecord {
  std::unique_ptr<Landscape> landscape;
  History history;
};

/// The sizes that follow from a plan.
struct RoundSizes {
  explicit RoundSizes(const RoundPlan& plan);

  std::uint32_t epochs;
  std::uint32_t thread_operations;  ///< per epoch
  std::uint32_t capacity;
  std::uint32_t most_seen;  ///< records that can be there at once
};

/// Runs a round on `Cache`. Quiescent points are barriers: end_frame, contents, a query at every place, now
/// and then update_records, clear and, of caches that can, tidy.
template <class Cache>
class Round {
  using Session = typename Cache::Session;

 public:
  explicit Round(const RoundPlan& plan)
      : plan_(plan),
        sizes_(plan),
        landscape_(std::make_unique<Landscape>(*plan.shape, plan.seed, CacheConfig{}.a)),
        cache_({.capacity = sizes_.capacity, .max_sessions = plan.threads}),
        clock_(plan.clock),
        logs_(plan.threads),
        barrier_(static_cast<std::ptrdiff_t>(plan.threads) + 1) {
    for (ThreadLog& log : logs_) log.reserve(sizes_.thread_operations, sizes_.most_seen);
    quiescent_log_.reserve(1, sizes_.most_seen);
    for (std::uint32_t t = 0; t < plan.threads; ++t) sessions_.push_back(cache_.open_session(t));
  }

  RoundRecord run() {
    history_.validity = &landscape_->validity();
    history_.ids = sizes_.epochs * plan_.threads * sizes_.thread_operations;
    {
      const std::vector<std::jthread> threads = start();
      for (std::uint32_t e = 0; e < sizes_.epochs; ++e) {
        cache_.begin_frame();
        barrier_.arrive_and_wait();  // the epoch begins
        barrier_.arrive_and_wait();  // and ends
        cache_.end_frame();
        finish_epoch(e);
        if constexpr (TidyCache<Cache>) {
          if (is_tidied(e)) cache_.tidy();
        }
      }
    }
    // What the last clear, update or tidying did shows only in another epoch, of no operations; there may have been no
    // other.
    cache_.begin_frame();
    cache_.end_frame();
    note_contents();
    query_at_rest();
    return {std::move(landscape_), std::move(history_)};
  }

 private:
  // Of the calls that query: about four queries in ten are then in batches, the others as short as ever.
  static constexpr std::uint32_t kBatchOneIn = 16;

  // Half the time, whatever else is done then.
  bool is_tidied(std::uint32_t e) const noexcept { return hash_keys(plan_.seed, e, 4) % 2 == 0; }
  // In half of the rounds at their end, too: where epochs are long there may be no other.
  bool is_cleared(std::uint32_t e) const noexcept {
    return (e + 1) % plan_.shape->clear_every == 0 ||
           (e + 1 == sizes_.epochs && hash_keys(plan_.seed, 5) % 2 == 0);
  }

  /// Throws std::runtime_error with one line if the system has no more threads; none is left behind.
  std::vector<std::jthread> start() {
    std::vector<std::jthread> threads;
    threads.reserve(plan_.threads);
    try {
      while (threads.size() < plan_.threads)
        threads.emplace_back([this, t = static_cast<std::uint32_t>(threads.size())] { work(t); });
    } catch (const std::system_error& error) {
      gives_up_ = true;  // published by the barrier
      // For this thread, and for those that are missing.
      for (std::size_t t = threads.size(); t <= plan_.threads; ++t) barrier_.arrive_and_drop();
      throw std::runtime_error(
          fmt::format("cannot create thread {} of {}: {}; use fewer --threads, or raise ulimit -u",
                      threads.size() + 1, plan_.threads, error.code().message()));
    }
    return threads;
  }

  void work(std::uint32_t t) {
    Delays::start(hash_keys(plan_.seed, t, 1), plan_.delay_every);
    Pcg32 random(hash_keys(plan_.seed, t, 2));
    Session session = sessions_[t];
    for (std::uint32_t e = 0; e < sizes_.epochs; ++e) {
      barrier_.arrive_and_wait();
      if (gives_up_) return;
      const std::uint32_t first_id = (e * plan_.threads + t) * sizes_.thread_operations;
      for (std::uint32_t i = 0; i < sizes_.thread_operations && logs_[t].has_room(); ++i) {
        if (random.below(100) < plan_.shape->insert_percent) {
          insert(session, t, random.below(landscape_->validity().kinds()), first_id + i);
        } else if (random.below(kBatchOneIn) == 0) {
          i += query_batch(session, t, random, sizes_.thread_operations - i) - 1;
        } else {
          query(session, logs_[t], t, random.below(landscape_->validity().places()));
        }
        Delays::step();
      }
      barrier_.arrive_and_wait();
    }
  }

  void insert(Session& session, std::uint32_t t, std::uint32_t kind, std::uint32_t id) noexcept {
    const Record r = landscape_->record(kind, id, update_);
    const Stamp call = clock_.before();
    const InsertResult result = session.insert(r);
    const Stamp ret = clock_.after();
    logs_[t].add_insert(call, ret, t, kind, id, result);
  }

  void query(Session& session, ThreadLog& log, std::uint32_t t, std::uint32_t place) noexcept {
    const SurfacePoint& x = landscape_->place(place);
    const std::uint32_t update = update_;
    const Stamp call = clock_.before();
    session.visit(x, [&](const Record& r, float) noexcept { log.see(shown_id(r, update)); });
    const Stamp ret = clock_.after();
    log.add_query(call, ret, t, place);
  }

  /// The visitors of a batch.
  struct Watching {
    ThreadLog& log;
    std::uint32_t update;
    auto operator[](std::size_t i) const noexcept {
      return [this, i](const Record& r, float) noexcept { log.see(i, shown_id(r, update)); };
    }
  };

  /// Some queries, at most `most`, in one call; how many.
  std::uint32_t query_batch(Session& session, std::uint32_t t, Pcg32& random, std::uint32_t most) noexcept {
    ThreadLog& log = logs_[t];
    const std::uint32_t n = 1 + random.below(std::min(most, log.batch_room()));
    std::array<std::uint32_t, kMostBatch> places;
    std::array<SurfacePoint, kMostBatch> points;
    for (std::uint32_t i = 0; i < n; ++i) {
      places[i] = random.below(landscape_->validity().places());
      points[i] = landscape_->place(places[i]);
    }
    const Watching watching{log, update_};
    const Stamp call = clock_.before();
    session.visit_batch(std::span<const SurfacePoint>(points).first(n), watching);
    const Stamp ret = clock_.after();
    log.add_batch(call, ret, t, std::span<const std::uint32_t>(places).first(n));
    return n;
  }

  /// Notes what the threads did and what the cache holds now; then the queries at rest, an epoch of their
  /// own; and clears or updates it.
  void finish_epoch(std::uint32_t e) {
    note_contents();
    Epoch& rest = query_at_rest();
    if (is_cleared(e)) {
      cache_.clear();
      rest.clears = true;
      alive_.clear();
    } else if (e % 2 == 0) {
      rest.dropped = update();
    }
  }

  void note_contents() {
    Epoch epoch;
    epoch.first = static_cast<std::uint32_t>(history_.operations.size());
    for (ThreadLog& log : logs_) {
      log.append_to(history_);
      log.restart();
    }
    epoch.end = static_cast<std::uint32_t>(history_.operations.size());
    epoch.has_contents = true;
    cache_.for_each_record([&](const Record& r) { epoch.contents.push_back(shown_id(r, update_)); });
    for (std::uint32_t i = epoch.first; i != epoch.end; ++i) {
      const Operation& o = history_.operations[i];
      if (!o.is_query() && !o.is_refused()) alive_.push_back(o.first);
    }
    history_.epochs.push_back(std::move(epoch));
  }

  Epoch& query_at_rest() {
    Epoch rest;
    rest.first = static_cast<std::uint32_t>(history_.operations.size());
    for (std::uint32_t place = 0; place < plan_.shape->places; ++place) {
      quiescent_log_.restart();
      query(sessions_[0], quiescent_log_, plan_.threads, place);
      quiescent_log_.append_to(history_);
    }
    rest.end = static_cast<std::uint32_t>(history_.operations.size());
    return history_.epochs.emplace_back(std::move(rest));
  }

  std::vector<std::uint32_t> update() {
    ++update_;
    cache_.update_records([this](Record& r) noexcept {
      // A record that was faulty before must stay so.
      if (shown_id(r, update_ - 1) == r.id) r.E = seal(r, update_);
      return is_dropped(r.id, update_) ? UpdateResult::drop : UpdateResult::keep;
    });
    std::vector<std::uint32_t> dropped;
    std::erase_if(alive_, [&](std::uint32_t id) {
      if (!is_dropped(id, update_)) return false;
      dropped.push_back(id);
      return true;
    });
    return dropped;
  }

  RoundPlan plan_;
  RoundSizes sizes_;
  std::unique_ptr<Landscape> landscape_;
  Cache cache_;
  StressClock clock_;
  std::vector<Session> sessions_;
  std::vector<ThreadLog> logs_;
  ThreadLog quiescent_log_;
  std::barrier<> barrier_;
  bool gives_up_ = false;
  History history_;
  std::vector<std::uint32_t> alive_;  ///< accepted ids that were neither dropped nor cleared
  std::uint32_t update_ = 0;          ///< number of the last update; changes only at quiescent points
};

template <class Cache>
RoundRecord run_round(const RoundPlan& plan) {
  return Round<Cache>(plan).run();
}

}  // namespace icbench::stress
