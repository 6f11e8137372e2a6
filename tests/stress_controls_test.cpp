// Every broken cache is seen failing, by the check that its fault violates.
#include <gtest/gtest.h>

#include "stress/controls.h"

namespace icbench::stress {
namespace {

class StressControls : public ::testing::TestWithParam<std::size_t> {};

TEST_P(StressControls, AreSeenFailing) {
  const Control& control = all_controls()[GetParam()];
  if (control.needs_weak_memory) GTEST_SKIP() << "shows only where stores are reordered";
  CampaignOptions options;
  options.use_tsc = tsc_is_usable();
  const ControlOutcome outcome = run_control(control, options);
  EXPECT_TRUE(outcome.seen) << control.fault;
  EXPECT_FALSE(outcome.totals.judgement[control.check].witness.empty());
}

INSTANTIATE_TEST_SUITE_P(All, StressControls, ::testing::Range(std::size_t{0}, all_controls().size()),
                         [](const auto& at) { return std::string(all_controls()[at.param].name); });

}  // namespace
}  // namespace icbench::stress
