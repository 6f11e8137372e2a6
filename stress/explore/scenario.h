// Small programs on a cache that the explorer runs under every schedule, and what their answers are judged by.
//
// A scenario says what each thread does; nearly all that happens is at one place in a corner, so that a query looks
// into one cell of each level and steps are few. Where it matters that a record is known in several cells there are two
// places to the left and right of where cells meet. Records come in four sizes: size 0 belongs in the root, 1, 2 and 3
// one, two and five levels below, where nodes are installed on the way. (The packed octree keeps what is small and
// alone up to two levels above: of the first three only records that find the root crowded leave it.)
//
// Two ways of telling what preceded what:
//
//   stamped    an operation ends by an acq_rel addition to a counter and begins by an acquire load of it, which may be
//              old. What a call reads has returned before it, and what was done there is known here: real time is
//              happens-before, and the checks are those of recorded histories. The counter also orders what the cache
//              failed to order between operations that do not overlap.
//   unstamped  nothing but the cache orders the threads. Operations of different threads count as overlapping; those of
//              one thread follow each other. Histories order operations by two stamps, and two chains that overlap
//              throughout cannot be written so: each thread in turn is the chain, with all others overlapping it.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <unordered_set>
#include <vector>

#include "stress/checker.h"
#include "stress/explore/engine.h"
#include "stress/history.h"

namespace icbench::stress::explore {

struct Scenario {
  std::string_view name;
  /// Per thread its operations: "i1" inserts a record of size 1, "q" queries, "bb" queries twice in one batch; "x1"
  /// inserts a record that is valid to the left and to the right, "l" and "r" query there; separated by blanks.
  std::array<std::string_view, kMaxThreads> threads;
  /// Sessions have drawn their tickets and memory, as in the middle of a run: fewer steps.
  bool is_warm;
  unsigned before;                  ///< records of size 0 that are there already
  bool is_long;                     ///< for the long form only
  std::string_view structure = {};  ///< of the caches that it is about; empty: all
  unsigned nearby = 0;  ///< records of size 0 that are there already, in the same cells but not valid here
  /// Of the cache, where that decides how it is built; 0: for the records there are.
  std::uint32_t capacity = 0;
  bool prefaults = false;  ///< the first thread begins by taking memory ahead, and touching it
};

std::span<const Scenario> all_scenarios();
/// By name; nullptr if there is none such.
const Scenario* find_scenario(std::string_view name);
bool is_about(const Scenario& s, const CacheTraits& traits) noexcept;
unsigned thread_count(const Scenario& s) noexcept;

enum class Stamping : std::uint8_t { stamped, unstamped };
inline constexpr std::array<std::string_view, 2> kStampingNames = {"stamped", "unstamped"};
constexpr std::string_view name_of(Stamping s) noexcept {
  return kStampingNames[static_cast<std::size_t>(s)];
}

/// The records and queries of scenarios.
class Stage {
 public:
  static constexpr std::uint32_t kSizes = 4, kPlaces = 5;
  /// Where scenarios happen, where sessions warm up, in the cells of the former but out of its records' reach, and on
  /// either side of where the cells one level below the root meet.
  static constexpr std::uint32_t kHere = 0, kElsewhere = 1, kNearby = 2, kLeft = 3, kRight = 4;

  Stage();
  const SurfacePoint& place(std::uint32_t i) const noexcept { return places_[i]; }
  Record record(std::uint32_t kind, std::uint32_t id) const noexcept;
  static constexpr std::uint32_t kind(std::uint32_t place, std::uint32_t size) noexcept {
    return place * kSizes + size;
  }
  const ValidityTable& validity() const noexcept { return validity_; }

 private:
  std::array<SurfacePoint, kPlaces> places_;
  ValidityTable validity_;
};

/// One operation and what came of it.
struct LoggedOperation {
  static constexpr unsigned kMostSeen = 160;

  bool is_query = false;
  bool is_in_batch = false;  ///< a query in one call with the one before it
  std::uint32_t where = 0;   ///< kind or place
  std::uint32_t id = 0;      ///< of an insert
  Stamp call = 0, ret = 0;
  InsertResult result = InsertResult::inserted;
  std::uint32_t seen_count = 0;
  std::array<std::uint32_t, kMostSeen> seen{};

  void see(std::uint32_t shown) noexcept {
    if (seen_count < kMostSeen) seen[seen_count++] = shown;
  }
};

/// Everything that one execution showed.
struct ExecutionLog {
  std::vector<LoggedOperation> before;  ///< done when the threads start
  std::vector<std::vector<LoggedOperation>> threads;
  std::vector<LoggedOperation> rest;  ///< queries when all is done
  std::vector<std::uint32_t> contents;
  std::vector<std::uint32_t> after_clear;

  std::uint32_t ids() const noexcept;
};

/// Judges executions, each history once.
class Verdicts {
 public:
  Verdicts(const Stage& stage, Stamping stamping) : stage_(stage), stamping_(stamping) {}

  /// What is violated, as bits 1 << Check, with a witness each; `ending` alone says so if it did not finish.
  struct Verdict {
    std::uint32_t violated = 0;
    std::array<std::string, kCheckNames.size()> witness;
  };
  /// Nothing where a history like this one has been judged before and nothing is violated.
  Verdict judge(const ExecutionLog& log, const Ending& ending);

 private:
  History history(const ExecutionLog& log, std::optional<std::size_t> chain) const;

  const Stage& stage_;
  Stamping stamping_;
  std::unordered_set<std::string> harmless_;
  std::string key_;
};

}  // namespace icbench::stress::explore
