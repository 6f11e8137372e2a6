// Every scenario on every cache under every schedule, and what must be caught that way.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "stress/explore/subject.h"

namespace icbench::stress::explore {

enum class Extent : std::uint8_t { off, brief, full };

struct ExploreOptions {
  Extent extent = Extent::brief;        ///< `full` has more scenarios, and more schedules for each
  std::optional<unsigned> preemptions;  ///< most in one schedule; none: unbounded
  std::vector<std::string> caches;      ///< by name; empty: all
};

/// One scenario on one cache.
struct Exploration {
  std::string cache, scenario;
  unsigned threads = 0;
  std::optional<unsigned> preemptions;
  Stamping stamping = Stamping::stamped;
  Coverage coverage;
  Check check = Check::integrity;  ///< the strictest that the cache promises; what it implies is checked too
  std::uint64_t violations = 0;    ///< schedules that violate any of them
  std::string witness;             ///< of the first
  std::string replay;              ///< its id
};

/// One broken cache.
struct ExploredControl {
  std::string control, fault;
  Check check = Check::integrity;  ///< must be violated
  bool is_caught = false;
  std::uint64_t schedules = 0;  ///< up to and with the one that shows it
  std::string witness, replay;
};

/// What is explored next, such as "wait_free install".
using ExploreProgress = std::function<void(const std::string& what)>;

/// Caches that the engine cannot drive are left out.
std::vector<Exploration> explore_all(const ExploreOptions& options, const ExploreProgress& progress);

/// Each until it is caught, or no schedule is left. Ends by itself, whatever the bound.
std::vector<ExploredControl> explore_controls(const ExploreOptions& options, const ExploreProgress& progress);

/// How often the two together report progress, at most.
std::size_t exploration_count(const ExploreOptions& options);

/// Names of the caches that explore_all leaves out, but for those of one thread and the one that keeps nothing.
std::vector<std::string> exempt_caches(const ExploreOptions& options);

/// A replayed schedule in words: every step, the end, what is violated. An id is "cache:scenario:stamping:schedule".
/// Fails with one line if there is no such schedule.
struct Replay {
  std::string text;
  bool is_violated = false;  ///< of what the cache promises, or a control must violate
};
Replay replay(const std::string& id);

}  // namespace icbench::stress::explore
