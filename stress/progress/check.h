// Holds what a cache declares of its progress against its steps under adversarial schedules (stress/README.md,
// Progress).
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/cache.h"
#include "stress/progress/subject.h"
#include "stress/progress/trial.h"

namespace icbench::stress {

struct ProgressOptions {
  std::uint64_t seed = 1;
  bool is_long = false;  ///< more random schedules, and every pair of stopped operations in every setting
};

/// Numbers of interfering inserts in the series.
inline constexpr std::array<std::uint32_t, 5> kInterference = {0, 1, 10, 100, 1000};

struct InterferenceSteps {
  std::uint32_t inserts;
  std::uint64_t steps;
};

/// One operation of one cache.
struct ProgressResult {
  std::string cache;
  std::string operation;  ///< one of kAskedNames
  ProgressGuarantee declared = ProgressGuarantee::blocking;
  std::string bound;              ///< in words; empty if the operation is not declared wait-free
  std::uint64_t bound_steps = 0;  ///< of the operation that took most steps
  std::uint64_t most_steps = 0;
  /// Most steps with so many whole inserts by another fiber (kInterference), over all ways tried of dealing them out
  /// between the operation's steps; with none only, where there is no other.
  std::vector<InterferenceSteps> steps_by_interference;
  std::uint64_t stop_positions = 0;      ///< places in which the operation was stopped forever
  std::uint64_t blocking_positions = 0;  ///< of these, the places in which that kept others from ending
  std::uint64_t operations = 0;          ///< whose steps were counted
  std::uint64_t schedules = 0;           ///< trials made
  bool holds = true;                     ///< what is declared was not seen violated
  std::string note;                      ///< one line: what was seen of it
  std::string witness;                   ///< several lines, for a broken condition of consistency; else empty

  std::string_view verdict() const noexcept { return holds ? "holds" : "violated"; }
};

/// Insert, query and batch of queries of one cache.
std::array<ProgressResult, kAskedNames.size()> check_progress(const ProgressSubject& subject,
                                                              const ProgressOptions& options);

}  // namespace icbench::stress
