#include "harness/time_account.h"

#include <limits>

#include "harness/held_thread.h"

namespace icbench {

void TimeBreakdown::add_region(const TeamTimes& times, double merge_wall_ns, double merge_cpu_ns) {
  const auto threads = static_cast<double>(times.threads.size());
  std::int64_t first = std::numeric_limits<std::int64_t>::max(),
               last = std::numeric_limits<std::int64_t>::min();
  for (const ThreadTime& t : times.threads) {
    first = std::min(first, t.begin_ns);
    last = std::max(last, t.end_ns);
  }
  for (const ThreadTime& t : times.threads)
    barrier += static_cast<double>(t.begin_ns - first) + static_cast<double>(last - t.end_ns);
  // Merging may use more threads than the team has.
  const double merging = std::min(merge_cpu_ns, merge_wall_ns * threads);
  merge += merging;
  barrier += merge_wall_ns * threads - merging;
  total += threads * (static_cast<double>(times.wall_ns()) + merge_wall_ns);
}

void TimeBreakdown::add_thread(const ThreadTicks& t, const TickRate& rate) {
  work += rate.to_ns(t.record);
  query += rate.to_ns(t.query);
  insert += rate.to_ns(t.insert);
  other += rate.to_ns(t.other);
  lock_wait += rate.to_ns(t.lock_wait);
  wanting += rate.to_ns(t.wanting);
  holding += rate.to_ns(t.holding);
  displaced += rate.to_ns(t.displaced);
  records += t.records;
}

void SpanLog::make_room() noexcept {
  while (spans_.size() * 2 > capacity_) {
    least_ = std::max<std::uint64_t>(1, 2 * least_);
    const std::size_t before = spans_.size();
    std::erase_if(spans_, [&](const Span& s) { return s.length < least_; });
    left_out_ += before - spans_.size();
  }
}

void ThreadAccount::begin() noexcept {
  after_miss_ = false;
  pending_ = 0;
  begin_ = last_ = read_at_ = ticks();
  cpu_ns_ = thread_cpu_ns();
  perf_.start();
  if (is_victim_) held_->attach();
}

void ThreadAccount::end() noexcept {
  if (held_ != nullptr) held_->ended();
  perf_.stop();
  settle();
}

std::uint64_t ThreadAccount::enter(Doing operation, std::uint64_t waited_ns) noexcept {
  const bool is_record = operation == Doing::insert && after_miss_;
  if (stretch(is_record ? Doing::record : Doing::other, ticks(), 0)) settle();
  waited_ns_ = waited_ns;
  if (is_victim_) held_->mark(true);
  return last_;
}

void ThreadAccount::leave(Doing operation, std::uint64_t now, std::uint64_t waited_ns, bool missed) noexcept {
  if (is_victim_) held_->mark(false);
  std::uint64_t waited = 0;
  if (waited_ns != waited_ns_)
    waited = static_cast<std::uint64_t>(static_cast<double>(waited_ns - waited_ns_) / ns_per_tick_);
  // Looking at the processor clock is then part of what follows, and accounted for with it.
  const bool was_long = stretch(operation, now, waited);
  after_miss_ = missed;
  if (was_long) settle();
}

bool ThreadAccount::stretch(Doing doing, std::uint64_t now, std::uint64_t waited) noexcept {
  // Counters of two processors may be out of step, and a thread that is not pinned may change between them.
  const std::uint64_t length = ticks_between(last_, now);
  const bool is_long = length >= long_;
  const std::uint64_t off = is_long ? take_off(now, length) : 0;
  ticks_.add(doing, length, waited, off);
  if (keeps_spans_) log_.add({last_, length, std::min(waited, length), off, doing});
  last_ = std::max(last_, now);
  return is_long;
}

void ThreadAccount::settle() noexcept {
  while (stretch(Doing::other, ticks(), 0)) {
  }
}

// The stamp is older than the reading: being put off the processor as the system call returns is the next stretch's.
std::uint64_t ThreadAccount::take_off(std::uint64_t now, std::uint64_t length) noexcept {
  const std::int64_t cpu = thread_cpu_ns();
  const double off_ns =
      static_cast<double>(ticks_between(read_at_, now)) * ns_per_tick_ - static_cast<double>(cpu - cpu_ns_);
  read_at_ = std::max(read_at_, now);
  cpu_ns_ = cpu;
  pending_ += static_cast<std::int64_t>(off_ns / ns_per_tick_);
  if (pending_ <= 0) return 0;
  const std::uint64_t off = std::min(length, static_cast<std::uint64_t>(pending_));
  pending_ -= static_cast<std::int64_t>(off);
  return off;
}

}  // namespace icbench
