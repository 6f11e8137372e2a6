// Where the time of a trial goes: every thread stamps the begin and the end of its operations, and its processor clock
// after every stretch that was long.
//
// The parts are measured, not inferred: time between stamps (ticks.h) is that of an operation or of what lies between
// two of them; of an operation's, what its session counted before locks is waiting; of any stretch, what the wall clock
// shows more than the thread's processor clock (CLOCK_THREAD_CPUTIME_ID) is time off the processor. Barriers come from
// the team's own clock readings, merges from the process's processor clock. What all of them leave of wall time x
// threads is reported as unexplained.
//
// How exact. A stamp is off by tens of nanoseconds (ticks.h). The processor clock costs a system call, 0.3 to 1.3
// microseconds, so it is read only after stretches of kLong and more: time off the processor is exact in sum, and a
// stretch shorter than kLong is taken to have run through, its loss falling to the next long one. That a hypervisor
// took the processor away shows only where the system accounts for stolen time. Waiting on a processor is spinning; off
// it, a thread that wants a lock is asleep in the lock's queue or was preempted, which the processor clock cannot tell
// apart. Stamping every operation slows it down by two stamps: some 40 to 60 ns, most of it between operations
// (`other`).
//
// Costs without: none on the path of an operation; a trial that is not asked for this stamps what it samples for
// latency, as ever.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "core/sync.h"
#include "harness/perf_counters.h"
#include "harness/thread_team.h"
#include "harness/ticks.h"

namespace icbench {

class HeldThread;

/// What a thread does between two stamps.
enum class Doing : std::uint8_t {
  query,
  insert,
  record,  ///< from a query that missed to the insert that follows
  other    ///< between operations otherwise
};

/// Ticks of a thread's stamped stretches, each tick in one part.
struct ThreadTicks {
  std::uint64_t query = 0;      ///< on a processor, in queries, not before a lock
  std::uint64_t insert = 0;     ///< the same in inserts
  std::uint64_t record = 0;     ///< on a processor, computing records
  std::uint64_t other = 0;      ///< on a processor, between operations otherwise
  std::uint64_t lock_wait = 0;  ///< on a processor, before a lock: spinning
  std::uint64_t wanting = 0;    ///< off the processor, before a lock
  /// Off the processor, in an operation otherwise: holding a lock, if there is one.
  std::uint64_t holding = 0;
  std::uint64_t displaced = 0;  ///< off the processor, between operations
  std::uint64_t records = 0;    ///< stretches of Doing::record: a number, not a time

  std::uint64_t sum() const noexcept {
    return query + insert + record + other + lock_wait + wanting + holding + displaced;
  }

  /// A stretch of `length`, of which `off` were off the processor, and in an operation `waited` before locks. Time off
  /// the processor falls to the waiting first. `off` and `waited` beyond `length` are not counted.
  void add(Doing doing, std::uint64_t length, std::uint64_t waited, std::uint64_t off) noexcept {
    off = std::min(off, length);
    if (doing == Doing::record || doing == Doing::other) {
      (doing == Doing::record ? record : other) += length - off;
      displaced += off;
      records += doing == Doing::record;
      return;
    }
    waited = std::min(waited, length);
    const std::uint64_t asleep = std::min(off, waited);
    wanting += asleep;
    lock_wait += waited - asleep;
    // What was off beyond the waiting cannot be more than what is left of the stretch: off <= length.
    holding += off - asleep;
    (doing == Doing::query ? query : insert) += length - waited - (off - asleep);
  }
};

/// Time of a trial by what it was spent on, ns summed over all threads. The parts do not overlap.
struct TimeBreakdown {
  double work = 0.0;          ///< computing records
  double query = 0.0;         ///< in queries, on a processor and not before a lock
  double insert = 0.0;        ///< in inserts, likewise
  double merge = 0.0;         ///< processor time of the ends of frames
  double lock_wait = 0.0;     ///< before a lock, on a processor
  double wanting = 0.0;       ///< before a lock, off the processor
  double holding = 0.0;       ///< in an operation otherwise, off the processor
  double displaced = 0.0;     ///< between operations, off the processor
  double barrier = 0.0;       ///< idle: before its begin, after its end, and while others merge
  double other = 0.0;         ///< between operations otherwise: pixels of a renderer, the loop, the stamps
  double total = 0.0;         ///< wall time x threads, measured apart from all of these
  std::uint64_t records = 0;  ///< computed

  double sum() const noexcept {
    return work + query + insert + merge + lock_wait + wanting + holding + displaced + barrier + other;
  }

  /// Adds the clock readings of a region and of the end of its frame, ns.
  void add_region(const TeamTimes& times, double merge_wall_ns, double merge_cpu_ns);
  void add_thread(const ThreadTicks& ticks, const TickRate& rate);
};

/// One stretch of a thread's time.
struct Span {
  std::uint64_t begin = 0;   ///< ticks
  std::uint64_t length = 0;  ///< ticks
  std::uint64_t waited = 0;  ///< of these, before locks
  std::uint64_t off = 0;     ///< and off the processor
  Doing doing = Doing::other;
};

/// Keeps the spans that are long, whatever comes: when it is full, the least length that is kept goes up until at least
/// half the room is free. Nothing is allocated after construction.
class SpanLog {
 public:
  explicit SpanLog(std::size_t capacity = 0) : capacity_(capacity) { spans_.reserve(capacity); }

  void add(const Span& span) noexcept {
    if (span.length < least_) {
      ++left_out_;
      return;
    }
    if (spans_.size() == capacity_) make_room();
    if (span.length >= least_ && spans_.size() < capacity_) {
      spans_.push_back(span);
    } else {
      ++left_out_;
    }
  }

  const std::vector<Span>& spans() const noexcept { return spans_; }
  std::uint64_t left_out() const noexcept { return left_out_; }
  std::uint64_t least() const noexcept { return least_; }  ///< ticks; shorter spans are not kept
  void clear() noexcept {
    spans_.clear();
    left_out_ = least_ = 0;
  }

 private:
  void make_room() noexcept;

  std::size_t capacity_;
  std::vector<Span> spans_;
  std::uint64_t left_out_ = 0;
  std::uint64_t least_ = 0;
};

/// The account of one thread. begin and end, and all between, are called by it alone.
class alignas(kNoSharing) ThreadAccount {
 public:
  /// Stretches that are followed by a look at the processor clock. Nanoseconds.
  static constexpr double kLong = 20'000.0;

  /// `spans`: how many are kept for a timeline. `held`, if any, stops this thread if it is the `victim`.
  explicit ThreadAccount(const TickRate& rate, std::size_t spans = 0, HeldThread* held = nullptr,
                         bool is_victim = false)
      : ns_per_tick_(rate.ns_per_tick),
        long_(static_cast<std::uint64_t>(kLong / rate.ns_per_tick)),
        log_(spans),
        keeps_spans_(spans != 0),
        held_(held),
        is_victim_(is_victim) {}

  /// Opens hardware counters for the calling thread, to count from begin to end.
  void count_hardware() { perf_.open(); }

  void begin() noexcept;
  void end() noexcept;

  /// An operation begins; returns the stamp. `waited_ns`: what its session has counted before locks so far.
  std::uint64_t enter(Doing operation, std::uint64_t waited_ns) noexcept;
  /// It ended at stamp `now`, and waited as its session says now.
  void leave(Doing operation, std::uint64_t now, std::uint64_t waited_ns, bool missed) noexcept;

  const ThreadTicks& thread_ticks() const noexcept { return ticks_; }
  const PerfGroup& perf() const noexcept { return perf_; }
  SpanLog& log() noexcept { return log_; }
  std::uint64_t begin_ticks() const noexcept { return begin_; }  ///< of the last region

 private:
  /// Accounts for what lies between the last stamp and `now`, which becomes the last; returns whether it was long.
  bool stretch(Doing doing, std::uint64_t now, std::uint64_t waited) noexcept;
  /// Accounts for looking at the processor clock, again and again if that took long: a system call is where a thread is
  /// most often put off its processor.
  void settle() noexcept;
  /// Looks at the processor clock at stamp `now`: ticks of the stretch of `length` before it which the thread was off.
  std::uint64_t take_off(std::uint64_t now, std::uint64_t length) noexcept;

  double ns_per_tick_;
  std::uint64_t long_;
  std::uint64_t begin_ = 0, last_ = 0;  // stamps
  std::uint64_t waited_ns_ = 0;         // as the operation began
  std::uint64_t read_at_ = 0;           // stamp of the last look at the processor clock
  std::int64_t cpu_ns_ = 0;             // what it showed
  std::int64_t pending_ = 0;  // ticks off that no stretch has taken yet; below 0 by inexact readings only
  bool after_miss_ = false;
  ThreadTicks ticks_;
  SpanLog log_;
  bool keeps_spans_;
  HeldThread* held_;
  bool is_victim_;
  PerfGroup perf_;
};

}  // namespace icbench
