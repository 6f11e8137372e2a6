// One trial: one workload on one cache by one pinned team, timed, counted and validated.
#pragma once

#include <chrono>
#include <cstdint>
#include <ctime>
#include <optional>
#include <span>
#include <string>
#include <type_traits>

#include "core/counters.h"
#include "core/random.h"
#include "core/types.h"
#include "harness/calibrated_work.h"
#include "harness/histogram.h"
#include "harness/thread_team.h"
#include "harness/ticks.h"
#include "harness/time_account.h"
#include "render/ray_tracer.h"

namespace icbench {

class Timeline;

/// What a trial runs with.
struct TrialSetup {
  ThreadTeam& team;
  const Work& work;
  std::uint64_t seed = 0;  ///< of the repetition; equal for all caches, so that they see the same operations
  std::uint32_t latency_every = 16;  ///< one operation in so many is timed, at random; 1 times all, 0 none
  /// A timed operation begins when all before it is done, and ends before anything after it begins: its latency by
  /// itself. Slows the trial; not with accounts.
  bool is_in_order = false;
  /// Of the team's threads, if their time is to be accounted for; all operations are timed then.
  std::span<ThreadAccount> accounts{};
  Timeline* timeline = nullptr;  ///< takes the accounts' spans
  unsigned latencies_from = 0;   ///< threads below are left out of the latencies

  ThreadAccount* account(unsigned thread) const noexcept {
    return thread < accounts.size() ? &accounts[thread] : nullptr;
  }
};

/// Operations and random numbers of a repetition: the same for all caches and thread counts.
inline std::uint64_t repetition_seed(std::uint64_t seed, unsigned repetition) noexcept {
  return hash_keys(seed, repetition, 8);
}

/// What came out. A trial that was not valid has `error` set, and its times mean nothing.
struct TrialOutcome {
  std::string error;  ///< empty, or one line that says what the cache did wrong

  double wall_ns = 0.0;          ///< from the first thread's begin to the end of end_frame
  double merge_ns = 0.0;         ///< of that, end_frame
  double merge_cpu_ns = 0.0;     ///< processor time of that, a part of cpu_ns
  double start_skew_ns = 0.0;    ///< from the first thread's begin to the last one's
  double cpu_ns = 0.0;           ///< processor time of the team
  std::uint64_t operations = 0;  ///< queries and inserts
  Counts counts;
  std::uint64_t records = 0;  ///< stored at the end
  std::size_t bytes = 0;      ///< the cache's memory at the end
  Histogram query_ticks;
  Histogram insert_ticks;
  double checksum = 0.0;  ///< of traces: sum of the queries' answers, so that no compiler drops them
  TimeBreakdown time;     ///< total 0 where no accounts were given
  std::vector<ThreadTime> threads;  ///< when each began and ended, of trials in which they do so once

  // Ray-traced.
  RayCounts rays;
  double rmse = 0.0, relmse = 0.0,
         mean_ratio = 0.0;  ///< indirect radiance against the reference at the same hits

  // Of traces.
  std::uint64_t queries = 0;    ///< the render's; counts have what was asked for its neighbours' sake, too
  std::uint64_t stand_ins = 0;  ///< records made where the render made none
  bool same_records = false;    ///< at the end of every frame, as in the render, bit for bit
};

/// Waiting that a session has counted so far, ns; 0 for sessions that count none.
template <class Session>
std::uint64_t waited_ns(const Session& session) noexcept {
  if constexpr (requires { session.lock_wait_ns(); }) {
    return session.lock_wait_ns();
  } else {
    return 0;
  }
}

/// Decides which operations are timed: on average one in `every`, at random distances so that no rhythm of
/// the workload is sampled; all of them for an account.
class LatencySampler {
 public:
  LatencySampler(std::uint32_t every, std::uint64_t seed, ThreadAccount* account = nullptr,
                 bool is_in_order = false) noexcept
      : every_(account != nullptr ? 1 : every),
        random_(seed),
        account_(account),
        is_in_order_(is_in_order && account == nullptr) {
    rewind();
  }

  /// Runs `operation` on `session`: a query or an insert, as its result tells. Times it into `histogram` if it is its
  /// turn.
  template <class Session, class F>
  auto run(Histogram& histogram, const Session& session, F&& operation) noexcept {
    if (left_-- != 0) [[likely]] {
      return operation();
    }
    rewind();
    constexpr bool kInserts = std::is_same_v<decltype(operation()), InsertResult>;
    constexpr Doing kDoing = kInserts ? Doing::insert : Doing::query;
    const std::uint64_t start = account_ != nullptr ? account_->enter(kDoing, waited_ns(session)) : stamp();
    auto result = operation();
    const std::uint64_t end = stamp();
    histogram.record(ticks_between(start, end));
    if (account_ != nullptr) {
      bool missed = false;
      if constexpr (!kInserts) missed = !result;
      account_->leave(kDoing, end, waited_ns(session), missed);
    }
    return result;
  }

  ThreadAccount* account() const noexcept { return account_; }

 private:
  std::uint64_t stamp() const noexcept { return is_in_order_ ? ticks_in_order() : ticks(); }
  void rewind() noexcept { left_ = every_ == 0 ? ~0ull : random_.below(2 * every_ - 1); }

  std::uint32_t every_;
  std::uint64_t left_;
  Pcg32 random_;
  ThreadAccount* account_;
  bool is_in_order_;
};

/// Runs f on a thread, within its account if it has one.
template <class F>
void accounted(ThreadAccount* account, F&& f) {
  if (account != nullptr) account->begin();
  f();
  if (account != nullptr) account->end();
}

/// A session whose operations are sampled for latency; has the interface the integrators use.
template <class Session>
class TimedSession {
 public:
  TimedSession(Session session, std::uint32_t every, std::uint64_t seed,
               ThreadAccount* account = nullptr) noexcept
      : session_(session), sampler_(every, seed, account) {}

  /// Not timed: what it is given to do takes time of its own.
  template <class F>
  void visit(const SurfacePoint& x, F&& f) noexcept {
    session_.visit(x, f);
  }
  template <class Visitors>
  void visit_batch(std::span<const SurfacePoint> points, Visitors&& visitors) noexcept {
    session_.visit_batch(points, visitors);
  }
  std::optional<Irradiance> query(const SurfacePoint& x) noexcept {
    return sampler_.run(query_ticks, session_, [&] { return session_.query(x); });
  }
  InsertResult insert(const Record& r) noexcept {
    return sampler_.run(insert_ticks, session_, [&] { return session_.insert(r); });
  }

  Histogram query_ticks;
  Histogram insert_ticks;

 private:
  Session session_;
  LatencySampler sampler_;
};

/// Time of one end_frame: merging is part of a trial.
struct FrameEnd {
  double wall_ns = 0.0;
  double cpu_ns = 0.0;  ///< of all threads that merged
};

/// Times `end`, which ends a frame.
template <class F>
FrameEnd timed_end(F&& end_frame) {
  const std::clock_t cpu = std::clock();
  const auto start = std::chrono::steady_clock::now();
  end_frame();
  const auto end = std::chrono::steady_clock::now();
  return {std::chrono::duration<double, std::nano>(end - start).count(),
          1e9 * static_cast<double>(std::clock() - cpu) / CLOCKS_PER_SEC};
}

/// A region of an accounted trial has ended, frame and all.
void account_for(const TrialSetup& setup, const TeamTimes& times, const FrameEnd& end, TrialOutcome& out);

/// What every kind of trial reports of its cache and its team.
template <class Cache>
TrialOutcome outcome_of(const Cache& cache, const TeamTimes& times, const FrameEnd& end) {
  TrialOutcome out;
  out.merge_ns = end.wall_ns;
  out.merge_cpu_ns = end.cpu_ns;
  out.wall_ns = static_cast<double>(times.wall_ns()) + end.wall_ns;
  out.threads = times.threads;
  out.cpu_ns = static_cast<double>(times.cpu_ns()) + end.cpu_ns;
  out.start_skew_ns = static_cast<double>(times.start_skew_ns());
  out.counts = cache.counters();
  cache.for_each_record([&](const Record&) { ++out.records; });
  out.bytes = cache.memory_bytes();
  return out;
}

}  // namespace icbench
