// Every broken cache is seen failing, by the check that its fault violates.
#include <gtest/gtest.h>

#include <ostream>
#include <string>
#include <vector>

#include "stress/controls.h"

namespace icbench::stress {

static void PrintTo(const Control& control, std::ostream* out) { *out << control.name; }

namespace {

/// Those that histories can show on this processor.
std::vector<Control> required_controls() {
  std::vector<Control> required(all_controls().begin(), all_controls().end());
  std::erase_if(required, [](const Control& control) { return control.needs_weak_memory; });
  return required;
}

class StressControls : public ::testing::TestWithParam<Control> {};

TEST_P(StressControls, AreSeenFailing) {
  CampaignOptions options;
  options.use_tsc = tsc_is_usable();
  const ControlOutcome outcome = run_control(GetParam(), options);
  EXPECT_TRUE(outcome.seen) << GetParam().fault;
  EXPECT_FALSE(outcome.totals.judgement[GetParam().check].witness.empty());
}

INSTANTIATE_TEST_SUITE_P(All, StressControls, ::testing::ValuesIn(required_controls()),
                         [](const auto& at) { return std::string(at.param.name); });

}  // namespace
}  // namespace icbench::stress
