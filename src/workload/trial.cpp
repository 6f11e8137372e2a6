#include "workload/trial.h"

#include "harness/timeline.h"

namespace icbench {

void account_for(const TrialSetup& setup, const TeamTimes& times, const FrameEnd& end, TrialOutcome& out) {
  if (setup.accounts.empty()) return;
  out.time.add_region(times, end.wall_ns, end.cpu_ns);
  if (setup.timeline != nullptr) setup.timeline->add_region(times, setup.accounts, end.wall_ns);
}

}  // namespace icbench
