// A trial: one fresh cache, some fibers that operate on it, and what came of it.
//
// Every operation's steps are held to its bound when it ends (or when it is given up), and the trial as a whole is a
// history that is judged by what the cache declares. Operations of fibers that stopped for good are pending in it.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "stress/checker.h"
#include "stress/progress/subject.h"
#include "stress/round.h"

namespace icbench::stress {

/// What a fiber does in one call. A batch is kBatchQueries queries, each an operation of the history.
enum class Asked : std::uint8_t { insert, query, batch };
inline constexpr std::array<std::string_view, 3> kAskedNames = {"insert", "query", "query_batch"};
inline constexpr std::uint32_t kBatchQueries = 3;

struct Request {
  Asked type;
  /// Insert: kind of the record; query: place; batch: that of the first, then the ones behind.
  std::uint32_t where;
};

/// Records of a kind that are there before a trial begins.
struct Prefill {
  std::uint32_t kind;
  std::uint32_t records;
};

/// Calls of one type and their steps.
struct StepTally {
  std::uint64_t operations = 0;
  std::uint64_t most_steps = 0;
  std::uint64_t bound_of_most = 0;  ///< what the operation with the most steps was held to
  std::uint64_t exceeded = 0;       ///< operations over their bounds
  std::string witness;              ///< the first of them, one line

  /// Adds what one operation took.
  void add(std::uint64_t steps, std::uint64_t bound) noexcept;
  /// Accuses it.
  void accuse(std::string line);
  void add(const StepTally& other);
};

/// Room for records: for some 8,000, or 65,000, which takes longer to set up; or so little that every allocation goes
/// to a pool that has no whole piece left.
enum class Pool { usual, large, scarce };

class Trial {
 public:
  /// `sessions` - 1 fibers, and a session that has inserted the prefill; all of them one if `sessions` is 1.
  Trial(Stage& stage, const ProgressSubject& subject, const Landscape& landscape, std::uint32_t sessions,
        const std::vector<Prefill>& prefill, Pool pool);
  Trial(const Trial&) = delete;
  Trial& operator=(const Trial&) = delete;

  /// Puts fiber `i` on stage as session `i`, to do `count` requests.
  void start(unsigned i, std::uint32_t count, std::function<Request(std::uint32_t)> request);

  struct Outcome {
    std::array<StepTally, kAskedNames.size()> tallies;  ///< by Asked
    std::string broken;   ///< the first declared condition that does not hold; empty if all do
    std::string witness;  ///< of that
  };
  /// Fibers that have not ended are given up.
  Outcome finish();

 private:
  struct Logged {
    Operation operation;
    Asked call;  ///< of which it is, or is one
    std::vector<std::uint32_t> seen{};
  };

  void insert(std::uint32_t session, std::uint32_t kind);
  void query(std::uint32_t session, std::uint32_t place);
  void query_batch(std::uint32_t session, std::uint32_t place);
  void end(std::uint32_t session, std::size_t first);
  std::optional<std::uint64_t> bound(const Logged& call, const std::vector<std::uint32_t>& extents) const;
  void weigh(const Logged& call, std::uint64_t steps, const std::vector<std::uint32_t>& extents);
  void close_epoch();

  Stage& stage_;
  const Landscape& landscape_;
  Consistency consistency_;
  std::unique_ptr<CountedCache> cache_;
  std::vector<std::vector<Logged>> logs_;  ///< by session
  History history_;
  Stamp clock_ = 0;
  std::uint32_t next_id_ = 0;
  std::array<StepTally, kAskedNames.size()> tallies_;
};

}  // namespace icbench::stress
