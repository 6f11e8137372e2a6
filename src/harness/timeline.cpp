#include "harness/timeline.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <string>

namespace icbench {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::string_view kWait = "wait for a lock", kBarrier = "idle at a barrier", kMerge = "end of frame";

std::string_view name_of(Doing doing) noexcept {
  switch (doing) {
    case Doing::query:
      return "query";
    case Doing::insert:
      return "insert";
    case Doing::record:
      return "compute a record";
    case Doing::other:
      return "other";
  }
  return "other";
}

std::string_view category_of(std::string_view name) noexcept {
  if (name == "query" || name == "insert") return "cache";
  if (name == "compute a record") return "work";
  if (name == kWait || name == kBarrier) return "wait";
  return name == kMerge ? "merge" : "other";
}

/// Microseconds with a nanosecond's resolution.
double us(double ns) noexcept { return static_cast<double>(static_cast<std::int64_t>(ns + 0.5)) / 1000.0; }

}  // namespace

void Timeline::add_region(const TeamTimes& times, std::span<ThreadAccount> accounts, double merge_ns) {
  threads_ = std::max(threads_, static_cast<unsigned>(accounts.size()));
  std::int64_t first = std::numeric_limits<std::int64_t>::max(),
               last = std::numeric_limits<std::int64_t>::min();
  for (const ThreadTime& t : times.threads) {
    first = std::min(first, t.begin_ns);
    last = std::max(last, t.end_ns);
  }
  for (unsigned i = 0; i < accounts.size(); ++i) {
    ThreadAccount& account = accounts[i];
    const double skew = static_cast<double>(times.threads[i].begin_ns - first);
    const double idle = static_cast<double>(last - times.threads[i].end_ns) + merge_ns;
    const double begin = so_far_ns_ + skew;
    if (skew > 0.0) events_.push_back({kBarrier, i, so_far_ns_, skew});
    for (const Span& s : account.log().spans()) {
      const double at = begin + rate_.to_ns(ticks_between(account.begin_ticks(), s.begin));
      events_.push_back({name_of(s.doing), i, at, rate_.to_ns(s.length), rate_.to_ns(s.off)});
      if (s.waited != 0) events_.push_back({kWait, i, at, rate_.to_ns(s.waited), 0.0, true});
    }
    if (idle > 0.0) {
      events_.push_back(
          {kBarrier, i, so_far_ns_ + static_cast<double>(times.threads[i].end_ns - first), idle});
    }
    left_out_ += account.log().left_out();
    least_ns_ = std::max(least_ns_, rate_.to_ns(account.log().least()));
    account.log().clear();
  }
  const double wall = static_cast<double>(times.wall_ns());
  events_.push_back({kMerge, threads_, so_far_ns_ + wall, merge_ns});
  so_far_ns_ += wall + merge_ns;
  if (events_.size() > most_) keep_the_longest();
}

// An event within another goes with it, and counts as one.
void Timeline::keep_the_longest() {
  std::vector<double> lengths;
  for (const TimelineEvent& e : events_)
    if (!e.is_within) lengths.push_back(e.length_ns);
  // Half of those that there may be, so that their waits have room.
  const std::size_t keep = std::min(lengths.size(), most_ / 2);
  std::nth_element(lengths.begin(), lengths.begin() + static_cast<std::ptrdiff_t>(keep - 1), lengths.end(),
                   std::greater<>());
  const double least = lengths[keep - 1];
  // Of those that are just as long as that there may be more than have room.
  std::size_t room = keep - static_cast<std::size_t>(std::count_if(lengths.begin(), lengths.end(),
                                                                   [least](double l) { return l > least; }));
  std::vector<TimelineEvent> kept;
  bool is_kept = false;
  for (const TimelineEvent& e : events_) {
    if (!e.is_within) {
      is_kept = e.length_ns > least || (e.length_ns == least && room > 0);
      if (is_kept && e.length_ns == least) --room;
    }
    if (is_kept)
      kept.push_back(e);
    else
      ++left_out_;
  }
  events_ = std::move(kept);
  least_ns_ = std::max(least_ns_, least);
}

Json Timeline::to_json(std::string_view title, const Json& about) const {
  Json list = Json::array();
  const auto metadata = [&](std::string_view what, unsigned row, const Json& value) {
    list.push_back({{"name", what}, {"ph", "M"}, {"pid", 1}, {"tid", row}, {"args", value}});
  };
  metadata("process_name", 0, {{"name", title}});
  for (unsigned i = 0; i <= threads_; ++i) {
    metadata("thread_name", i,
             {{"name", i < threads_ ? fmt::format("thread {}", i) : std::string("ends of frames")}});
    metadata("thread_sort_index", i, {{"sort_index", i}});
  }
  for (const TimelineEvent& e : events_) {
    Json event = {
        {"name", e.name},       {"cat", category_of(e.name)}, {"ph", "X"}, {"pid", 1}, {"tid", e.row},
        {"ts", us(e.begin_ns)}, {"dur", us(e.length_ns)}};
    if (e.off_ns > 0.0) event["args"]["off_processor_us"] = us(e.off_ns);
    list.push_back(std::move(event));
  }
  Json other = about;
  other["threads"] = threads_;
  other["spans_left_out"] = left_out_;
  other["shorter_spans_may_be_missing_ns"] = us(1000.0 * least_ns_);
  return {{"traceEvents", std::move(list)}, {"displayTimeUnit", "ns"}, {"otherData", std::move(other)}};
}

}  // namespace icbench
