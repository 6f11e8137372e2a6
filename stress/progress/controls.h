// Lists that the check of progress must see through, and one that it must see growing as it may.
#pragma once

#include <algorithm>
#include <array>
#include <span>
#include <string_view>
#include <vector>

#include "stress/progress/check.h"

namespace icbench::stress {

struct ProgressControl {
  std::string_view name;
  std::string_view fault;
  std::string_view operation;  ///< in which it must show
  bool is_violation;           ///< else it is what is declared, and must be seen growing
  ProgressSubject subject;
};

std::span<const ProgressControl> all_progress_controls();

struct ProgressControlOutcome {
  bool seen = false;
  std::array<ProgressResult, kAskedNames.size()> results;

  /// Of that operation.
  const ProgressResult& of(std::string_view operation) const noexcept {
    return *std::find_if(results.begin(), results.end(),
                         [&](const ProgressResult& r) { return r.operation == operation; });
  }
};

ProgressControlOutcome run_progress_control(const ProgressControl& control, const ProgressOptions& options);

}  // namespace icbench::stress
