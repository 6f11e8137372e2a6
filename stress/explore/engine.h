// Runs a small program of two to four threads under every schedule that matters, or under one schedule again.
//
// The threads are fibers of one thread of the system (stress/fibers.h). Whenever one is about to touch an atomic word,
// the search decides who goes on; memory then answers by the model (stress/explore/memory.h). Code between two such
// steps runs in one go: what it does to plain memory is either ordered with everything else, or reported as a data
// race.
//
// The state between executions is the program's own: `prepare` brings it back to where it began. A thread that is
// abandoned in the middle (after a race, or when all wait for each other) leaves it as it is; `prepare` is told so.
#pragma once

#include <functional>
#include <string>

#include "stress/explore/memory.h"
#include "stress/explore/search.h"
#include "stress/fibers.h"

namespace icbench::stress::explore {

/// How an execution ended.
struct Ending {
  enum class Kind : std::uint8_t { finished, blocked, raced };
  Kind kind = Kind::finished;
  std::string what;  ///< one line, unless it finished
};

struct Program {
  unsigned threads = 2;  ///< at most kMaxThreads
  /// Before every execution; `is_dirty` if the last one was abandoned.
  std::function<void(bool is_dirty)> prepare;
  std::function<void(unsigned thread)> body;  ///< must not throw, nor own what only unwinding would give back
  /// After every execution that the search counts; false ends the search.
  std::function<bool(const Ending&)> judge;
};

/// One line of a trace: what a thread did.
struct TraceLine {
  unsigned thread;
  std::string text;
};

class Engine {
 public:
  explicit Engine(unsigned most_threads = kMaxThreads) : fibers_(most_threads) {}

  /// Fails with one line if the program is too large for the model.
  Coverage explore(const Program& program, const SearchOptions& options);

  /// One execution by the rule of `encode` but for the deviations; nothing if they do not fit the program. Fills
  /// `trace`.
  std::optional<Ending> replay(const Program& program, std::span<const Deviation> deviations,
                               std::vector<TraceLine>& trace);

  /// The execution that was judged last, as text.
  std::string schedule_text() const;

  /// What policies and locks call; only inside an execution.
  static bool is_inside() noexcept { return current_ != nullptr && Fibers::is_inside(); }
  static Engine& current() noexcept { return *current_; }
  Effect access(const Access& a);
  void touch(const void* begin, std::size_t bytes, bool writes);
  void zero(const void* begin, std::size_t bytes);
  void begin_waiting() noexcept { memory_.begin_waiting(Fibers::running()); }
  void wait_for_news() noexcept { memory_.await_newer(Fibers::running()); }
  /// A line of the trace, if there is one; `text` makes it.
  template <class Text>
  void note(Text&& text) {
    if (trace_ != nullptr) trace_->push_back({Fibers::running(), text()});
  }

 private:
  static constexpr unsigned kNobody = kMaxThreads;
  static constexpr unsigned kMostSteps = 4096;

  Ending run(const Program& program);
  void choose() noexcept;
  void choose_replayed() noexcept;
  void choose_anyhow() noexcept;
  void stop(Ending::Kind kind, std::string what);
  void end_with(const Race& race);  ///< does not return
  void trace_step(unsigned thread, const Access& a, const Effect& effect, Location l);

  Fibers fibers_;
  Memory memory_;
  std::array<Pending, kMaxThreads> pending_;
  unsigned threads_ = 0;
  unsigned next_ = kNobody;
  unsigned next_index_ = 0;
  unsigned steps_ = 0;
  bool is_starting_ = false;
  bool is_off_record_ = false;  ///< goes on to the end only to leave the program's state in order
  bool is_abandoned_ = false;
  bool has_failed_ = false;  ///< too large
  Ending ending_;
  Search* search_ = nullptr;
  Schedule last_schedule_;
  std::vector<std::uint8_t> last_ruled_;

  // Replay.
  std::span<const Deviation> deviations_;
  std::uint32_t skipped_ = 0;
  std::optional<std::uint8_t> last_thread_;
  std::vector<TraceLine>* trace_ = nullptr;

  static constinit inline thread_local Engine* current_ = nullptr;
};

}  // namespace icbench::stress::explore
