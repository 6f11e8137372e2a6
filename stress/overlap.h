// Which queries and inserts of an epoch overlap in time: the only pairs whose order the answers decide.
#pragma once

#include <cstdint>
#include <vector>

#include "stress/history.h"

namespace icbench::stress {

struct Overlap {
  std::uint32_t query;   ///< index in History::operations
  std::uint32_t insert;  ///< not refused, its record valid where the query asked
};

/// Work space that is kept from one epoch to the next. O(n log n) for n operations, plus the pairs that
/// overlap: at most n (P - 1) where P operations are open at once, since whatever overlaps is found when the later one
/// is called. A thread has one operation open, or the queries of a batch.
class Overlaps {
 public:
  void collect(const History& history, const Epoch& epoch);

  /// In order of the query.
  const std::vector<Overlap>& pairs() const noexcept { return pairs_; }
  /// The operations of the epoch by call stamp, counted from its first.
  const std::vector<std::uint32_t>& by_call() const noexcept { return by_call_; }

 private:
  std::vector<Overlap> pairs_;
  std::vector<std::uint32_t> by_call_;
  std::vector<std::uint32_t> running_;  ///< operations that had not returned at the last call looked at
};

}  // namespace icbench::stress
