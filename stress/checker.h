// Decides, exactly and in near-linear time, which conditions of the specification a history meets.
//
// Cost: O(n log n + s + v + k) for n operations, s ids shown, v = the sum over records of the places at which
// they are valid, k overlapping pairs of operations, at most n (P - 1) for P threads. 10^6 operations of four
// threads take about a second. The rule and its proof are in stress/README.md.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/cache.h"
#include "stress/history.h"

namespace icbench::stress {

enum class Check : std::uint8_t { integrity, regular, per_record_linearizable, linearizable, frame };

inline constexpr std::array<std::string_view, 5> kCheckNames = {
    "integrity", "regular", "per_record_linearizable", "linearizable", "frame"};

constexpr std::string_view name_of(Check check) noexcept {
  return kCheckNames[static_cast<std::size_t>(check)];
}

/// Whether a cache that declares `consistency` promises to pass `check`.
constexpr bool promises(Consistency consistency, Check check) noexcept {
  switch (check) {
    case Check::integrity:
      return true;
    case Check::regular:
      return consistency >= Consistency::regular;
    case Check::per_record_linearizable:
      return consistency >= Consistency::per_record_linearizable;
    case Check::linearizable:
      return consistency == Consistency::linearizable;
    case Check::frame:
      return consistency == Consistency::frame;
  }
  return false;
}

/// What one check found.
struct Finding {
  /// Integrity: faulty records. Regular, per-record, frame: pairs of a query and a record that it must not
  /// have seen, or must not have missed. Linearizable: epochs that have no linearization.
  std::uint64_t violations = 0;
  std::string witness;  ///< the first violation, several lines; empty if there is none
  std::vector<std::uint32_t> witness_operations;  ///< the operations in it, by index in the history
};

struct Judgement {
  std::array<Finding, kCheckNames.size()> findings;
  std::uint64_t operations = 0;
  /// Pairs of a query and an insert that overlapped in time, the record valid where the query asked.
  std::uint64_t concurrent_pairs = 0;

  const Finding& operator[](Check check) const noexcept { return findings[static_cast<std::size_t>(check)]; }
  Finding& operator[](Check check) noexcept { return findings[static_cast<std::size_t>(check)]; }
  bool holds(Check check) const noexcept { return (*this)[check].violations == 0; }
};

/// Judges all conditions at once.
Judgement judge(const History& history);

}  // namespace icbench::stress
