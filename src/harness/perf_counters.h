// Hardware counters of a thread through Linux's perf_event_open, where the machine offers them: what a trial cost in
// cycles, misses and cache lines that came from another core.
//
// Virtual machines often offer none, containers may forbid them; then there are no fields and one line tells why.
// Every event is opened by itself, so that one which is missing does not hide the others; where there are more than the
// processor counts at once, the kernel takes turns and the values are scaled up by the time that was counted.
//
// Costs: a system call per event as the counting starts and stops, none while it runs.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

struct perf_event_attr;

namespace icbench {

struct PerfEvent {
  std::string_view name;  ///< of the field in results
  std::uint32_t type;     ///< as perf_event_attr has it
  std::uint64_t config;
  std::string_view what;  ///< in words, with the source where it depends on the processor
};

/// Events to be tried on this machine. `line_transfers` is there on processors on which a documented event counts loads
/// that another core's cache answered.
std::span<const PerfEvent> perf_events();
/// The same for a processor of that vendor, family and model, as /proc/cpuinfo tells them.
std::vector<PerfEvent> perf_events_of(std::string_view vendor, unsigned family, unsigned model);

/// Opens an event for the calling thread: perf_event_open(attr, 0, -1, -1, PERF_FLAG_FD_CLOEXEC). A descriptor, or -1
/// with errno.
using PerfOpen = int (*)(perf_event_attr&);
int perf_open_by_kernel(perf_event_attr& attr);

/// The counters of one thread.
class PerfGroup {
 public:
  PerfGroup() = default;
  PerfGroup(PerfGroup&& other) noexcept : counters_(std::move(other.counters_)) { other.counters_.clear(); }
  PerfGroup& operator=(PerfGroup&&) = delete;
  ~PerfGroup();

  /// Opens what can be opened of `events` for the calling thread. Never throws for events that are not offered.
  void open(std::span<const PerfEvent> events = perf_events(), PerfOpen how = perf_open_by_kernel);

  void start() noexcept;
  void stop() noexcept;

  /// Counted between start and stop so far; empty if the event was not offered, was never scheduled or cannot be read.
  std::optional<double> value(std::string_view name) const;

 private:
  struct Counter {
    std::string_view name;
    int fd;
  };
  std::vector<Counter> counters_;
};

/// What perf_event_open says to `events` on this machine.
struct PerfOffer {
  std::vector<std::string_view> names;  ///< of the events that can be counted
  std::string note;                     ///< one line on what cannot be and why; empty if all can
};
PerfOffer perf_offer(std::span<const PerfEvent> events = perf_events(), PerfOpen how = perf_open_by_kernel);

}  // namespace icbench
