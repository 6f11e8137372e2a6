#include "harness/time_account.h"

#include <time.h>

#include <limits>

#include "harness/held_thread.h"

namespace icbench {
namespace {

std::int64_t thread_cpu_ns() noexcept {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<std::int64_t>(t.tv_sec) * 1'000'000'000 + t.tv_nsec;
}

}  // namespace

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
  perf_.start();
  if (held_ != nullptr && is_victim_) held_->attach();
  after_miss_ = false;
  cpu_ns_ = thread_cpu_ns();
  begin_ = last_ = read_at_ = ticks();
}

void ThreadAccount::end() noexcept {
  const std::uint64_t now = ticks();
  stretch(Doing::other, last_, now, 0);
  last_ = now;
  perf_.stop();
  if (held_ != nullptr) held_->ended();
}

std::uint64_t ThreadAccount::take_off(std::uint64_t length) noexcept {
  const std::int64_t cpu = thread_cpu_ns();
  const std::uint64_t now = ticks();
  const double off_ns =
      static_cast<double>(now - read_at_) * ns_per_tick_ - static_cast<double>(cpu - cpu_ns_);
  read_at_ = now;
  cpu_ns_ = cpu;
  pending_ += static_cast<std::int64_t>(off_ns / ns_per_tick_);
  if (pending_ <= 0) return 0;
  const std::uint64_t off = std::min(length, static_cast<std::uint64_t>(pending_));
  pending_ -= static_cast<std::int64_t>(off);
  return off;
}

void ThreadAccount::mark(bool in_operation) noexcept { held_->mark(in_operation); }

}  // namespace icbench
