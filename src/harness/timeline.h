// A trial as a timeline: rows are threads, spans are what they did, in the Trace Event format of JSON that Perfetto and
// chrome://tracing open ("Trace Event Format", the Chromium project: complete events "X" with ts and dur in
// microseconds, metadata events "M" for names).
//
// Bounded: of each thread the longest spans are kept (SpanLog), and of all of them together at most `events`; how many
// were left out, and how short they were, stands in the file. A wait lies within its operation; it is drawn from the
// operation's begin, where a lock around a whole cache is taken; locks of nodes are taken on the way.
#pragma once

#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <string_view>
#include <vector>

#include "harness/time_account.h"

namespace icbench {

/// One event on a thread's row, nanoseconds since the first region began.
struct TimelineEvent {
  std::string_view name;
  unsigned row = 0;  ///< thread; the number of threads: the end of a frame
  double begin_ns = 0.0;
  double length_ns = 0.0;
  double off_ns = 0.0;     ///< of these, off the processor
  bool is_within = false;  ///< lies within the event before it
};

class Timeline {
 public:
  /// Events to be kept, all threads together: kLeastEvents at least.
  static constexpr std::size_t kLeastEvents = 100, kMostEvents = 10'000'000;

  Timeline(std::size_t events, const TickRate& rate) : most_(events), rate_(rate) {}

  /// Spans that an account of one of `threads` is to keep of a region.
  std::size_t spans_of(unsigned threads) const noexcept { return most_ / 2 / threads + 16; }

  /// A region has ended; takes what its accounts kept and empties their logs.
  void add_region(const TeamTimes& times, std::span<ThreadAccount> accounts, double merge_ns);

  const std::vector<TimelineEvent>& events() const noexcept { return events_; }

  /// The file. `about`: what it shows; becomes the process's name and, whole, otherData.
  nlohmann::ordered_json to_json(std::string_view title, const nlohmann::ordered_json& about) const;

 private:
  void keep_the_longest();

  std::size_t most_;
  TickRate rate_;
  unsigned threads_ = 0;
  double so_far_ns_ = 0.0;  // regions before the next one
  double least_ns_ = 0.0;   // shorter spans may be missing
  std::uint64_t left_out_ = 0;
  std::vector<TimelineEvent> events_;
};

}  // namespace icbench
