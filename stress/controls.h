// Negative controls: caches that do not keep what they declare, and must be seen failing. A run in which one
// goes unseen was too weak to say anything about the others.
#pragma once

#include <span>
#include <string_view>

#include "stress/campaign.h"
#include "stress/checker.h"
#include "stress/round.h"

namespace icbench::stress {

struct Control {
  std::string_view name;
  std::string_view fault;  ///< one line
  Check check;             ///< must be violated
  /// Share of rounds in which it must be; 0: one round is enough.
  double share;
  /// Only a processor that reorders what this one keeps in order, or does so more often, or a schedule explorer with
  /// weak memory, shows it: run and reported, but not required.
  bool needs_weak_memory;
  RoundRecord (*run)(const RoundPlan&);
};

std::span<const Control> all_controls();

struct ControlOutcome {
  bool seen = false;
  Totals totals;
};

/// Runs rounds with frequent delays, on 4 to 256 threads, until the control is seen failing, or gives up.
ControlOutcome run_control(const Control& control, const CampaignOptions& options);

}  // namespace icbench::stress
