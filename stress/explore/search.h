// Which schedules to run: a depth-first search over who steps next and what it reads, that runs one schedule of each
// kind instead of all.
//
// Two schedules are of one kind if program order, what every load reads, and the order of the stores to each location
// are the same: then every thread does the same in both, and the same races and answers come of it. So two neighbouring
// steps of different threads may change places unless they are at one location and both write, or one reads what the
// other has just written. (A load that read an older store may change places with a store: that store could not hide
// anything.)
//
//   Without a bound: dynamic partial-order reduction (Flanagan and Godefroid 2005) with source sets (Abdulla, Aronis,
//   Jonsson, Sagonas 2014) and sleep sets (Godefroid 1996). When a step o is done that could have preceded an earlier
//   one, e, of another thread, and would have changed it, the search lets something start in the place of e that leads
//   to o. That is so if the two are at one location, nothing in between puts o after e, and o may write: e could read
//   it, or its store be the later one. It is not so if e writes and o is a load: o in front of e reads an older store,
//   which is among its choices behind e. A thread that was tried at a node sleeps below its later siblings, with all it
//   could have read there; it wakes for stores that are new since.
//
//   With a bound on preemptions (a switch away from a thread that could go on): bounded partial-order reduction (Coons,
//   Musuvathi, McKinley 2013). Going back to e can cost a preemption that going back to the start of its thread's turn
//   does not, so both are tried; no happens-before shortens the list of conflicts, any two steps at one location of
//   which one may write are one, and nothing sleeps.
//
// A thread that waits in a loop (Sync::wait_turn) is left waiting if it has changed nothing in that turn of the loop:
// whatever it would do when it goes on, it also does in the schedule in which it came to the loop later. So only waits
// that never end are of interest; the rest is cut short. One that has changed something goes on when what it waits for
// may have come (a reader that has taken its mark back and marks itself again): once, then it is left waiting all the
// same, and what it would do after a second such turn is not looked at.
//
// Both are compared with the search of all schedules in tests/stress_explore_test.cpp.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "stress/explore/memory.h"

namespace icbench::stress::explore {

struct SearchOptions {
  std::optional<unsigned> preemptions;  ///< most of them in one schedule; none: unbounded
  std::uint64_t most_schedules = UINT64_MAX;
  bool reduce = true;  ///< false: all schedules, for comparison
};

/// What a search has covered.
struct Coverage {
  std::uint64_t schedules = 0;
  /// Cut short: nothing was left in them that another schedule had not shown.
  std::uint64_t redundant = 0;
  bool complete = false;  ///< no schedule is left, within the bound
};

/// A schedule: who stepped, and how many stores behind the latest it read.
struct Decision {
  std::uint8_t thread;
  std::uint8_t age;
  bool operator==(const Decision&) const = default;
};
using Schedule = std::vector<Decision>;

/// As text, short: "12t1.3r2" is twelve steps by the rule (the same thread as before, or the first that can go on if
/// that cannot; the latest store), then thread 1 steps; three by the rule, then one that reads two stores before the
/// latest.
std::string encode(std::span<const Decision> schedule, std::span<const std::uint8_t> ruled_thread);

/// A deviation from the rule, after `skip` steps that follow it.
struct Deviation {
  std::uint32_t skip = 0;
  std::optional<std::uint8_t> thread;
  std::uint8_t age = 0;
};
/// What `encode` has made; nothing if it is not of that form.
std::optional<std::vector<Deviation>> decode(std::string_view text);

/// The next step of a thread.
struct Pending {
  bool is_live = false;  ///< the thread has one
  Access access;
  Location location = 0;
};

/// The stack of decisions. One execution after the other asks `decide` for each step and tells what it did by `done`.
class Search {
 public:
  enum class Verdict : std::uint8_t {
    step,       ///< `thread` and `index` say what
    finished,   ///< no thread is live
    blocked,    ///< threads are live but none can step
    redundant,  ///< whatever follows has been seen
  };
  struct Next {
    Verdict verdict;
    std::uint8_t thread = 0;
    std::uint16_t index = 0;
  };

  explicit Search(const SearchOptions& options) : options_(options) {}

  void begin_execution() noexcept { depth_ = 0; }
  Next decide(const Memory& memory, std::span<const Pending> pending);
  void done(const Effect& effect, const VectorClock& past) noexcept;
  /// Turns to the next schedule; false if none is left.
  bool advance();

  /// The execution so far, for `encode`.
  void schedule(Schedule& decisions, std::vector<std::uint8_t>& ruled) const;

  static std::uint8_t thread_by_rule(std::uint32_t enabled, std::optional<std::uint8_t> last) noexcept;

 private:
  using Mask = std::uint32_t;

  struct Step {
    bool is_live = false, may_write = false, is_total = false;
    Access::Kind kind = Access::Kind::load;
    Location location = 0;
    std::uint16_t stores = 0;  ///< at its location
    Choices choices;
  };
  struct Node {
    std::array<Step, kMaxThreads> next;
    /// Choices below this index have been covered elsewhere; 0: awake.
    std::array<std::uint16_t, kMaxThreads> asleep_below{};
    std::array<VectorClock, kMaxThreads> past;
    Mask enabled = 0, backtrack = 0, tried = 0, waiting = 0;
    std::uint8_t thread = 0;   ///< the one being tried
    std::uint8_t choice = 0;   ///< of its choices
    std::uint8_t by_rule = 0;  ///< who would step by the rule of `encode`
    std::uint8_t preemptions = 0;
    bool wrote = false;         ///< what the step tried did
    std::uint32_t ordinal = 0;  ///< number of the step in its thread
    VectorClock past_after;     ///< of the thread, with the step
  };

  /// Threads in a loop that waits: for something that has not come, or that has.
  static constexpr Mask kWaiting = 1, kWoken = 2;

  bool sleeps() const noexcept { return options_.reduce && !options_.preemptions; }
  std::optional<std::uint8_t> last_thread(unsigned depth) const noexcept;
  unsigned preemptions_of(unsigned depth, std::uint8_t thread) const noexcept;
  bool is_affordable(unsigned depth, std::uint8_t thread) const noexcept;
  std::optional<std::uint8_t> first_awake(const Node& n, std::uint8_t thread, unsigned from) const noexcept;
  bool try_thread(unsigned depth, std::uint8_t thread) noexcept;
  void fill(Node& n, const Memory& memory, std::span<const Pending> pending) const noexcept;
  void inherit_sleep(Node& n) const noexcept;
  bool conflict(const Node& event, const Step& next) const noexcept;
  bool is_race(unsigned event, std::uint8_t thread, const Step& step, const VectorClock& past) const noexcept;
  void find_races(unsigned depth, bool is_blocked) noexcept;
  void find_races_bounded(unsigned depth) noexcept;
  void go_back(unsigned event, unsigned depth, std::uint8_t thread, const VectorClock& past) noexcept;
  void go_back_bounded(unsigned at, std::uint8_t thread) noexcept;

  SearchOptions options_;
  std::vector<Node> nodes_;
  unsigned size_ = 0;   ///< nodes in use
  unsigned depth_ = 0;  ///< of the execution
};

}  // namespace icbench::stress::explore
