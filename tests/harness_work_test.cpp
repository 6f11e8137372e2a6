#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "harness/calibrated_work.h"
#include "harness/ticks.h"

namespace icbench {
namespace {

TEST(Work, ExecutesTheChainStepByStep) {
  std::uint64_t x = 17;
  for (std::uint64_t n = 0; n < 100; ++n) {
    ASSERT_EQ(do_work(n, 17), x);
    x = x * 0xd1342543de82ef95ULL + 0x9e3779b97f4a7c15ULL;
    x ^= x >> 29;
  }
}

TEST(Work, PiecesChainUpToTheWhole) { EXPECT_EQ(do_work(40, do_work(60, 5)), do_work(100, 5)); }

TEST(Work, UnitsFollowTheCalibration) {
  const Work work({2.5, 3.0, 1000, 5});
  EXPECT_EQ(work.units_for_ns(0.0), 0u);
  EXPECT_EQ(work.units_for_ns(2.5), 1u);
  EXPECT_EQ(work.units_for_ns(1.0), 0u);
  EXPECT_EQ(work.units_for_ns(1.5), 1u);
  EXPECT_EQ(work.units_for_ns(1e6), 400'000u);
}

TEST(Work, OddDurationsAreDefined) {
  const Work work({2.0, 2.0, 1000, 5});
  EXPECT_EQ(work.units_for_ns(-1.0), 0u);
  EXPECT_EQ(work.units_for_ns(std::numeric_limits<double>::quiet_NaN()), 0u);
  EXPECT_EQ(work.units_for_ns(std::numeric_limits<double>::infinity()), std::uint64_t{1} << 63);
}

TEST(Work, CalibrationIsUsableAndRecorded) {
  const Work work = Work::calibrate();
  const WorkCalibration& c = work.calibration();
  EXPECT_TRUE(std::isfinite(c.ns_per_unit));
  EXPECT_GT(c.ns_per_unit, 0.0);
  EXPECT_GE(c.median_ns_per_unit, c.ns_per_unit);
  EXPECT_GT(work.units_for_ns(1e9), 0u);
  EXPECT_EQ(c.to_json()["ns_per_unit"], c.ns_per_unit);
  EXPECT_EQ(c.to_json()["tries"], c.tries);
  EXPECT_EQ(WorkCalibration::from_json(c.to_json()).to_json(), c.to_json());
}

TEST(Work, ADamagedCalibrationIsRefused) {
  const auto good = WorkCalibration{2.0, 2.0, 1000, 5}.to_json();
  auto none = good, zero = good, text = good;
  none.erase("tries");
  zero["ns_per_unit"] = 0.0;
  text["ns_per_unit"] = "2";
  for (const auto& bad : {none, zero, text, nlohmann::ordered_json()})
    EXPECT_THROW(WorkCalibration::from_json(bad), std::runtime_error);
}

TEST(Ticks, NeverRunBackwardsOnOneThread) {
  std::uint64_t before = ticks();
  for (int i = 0; i < 10'000; ++i) {
    const std::uint64_t now = ticks();
    ASSERT_GE(now, before);
    before = now;
  }
}

TEST(Ticks, CalibrationIsUsableAndRecorded) {
  const TickRate rate = calibrate_ticks();
  EXPECT_TRUE(std::isfinite(rate.ns_per_tick));
  EXPECT_GT(rate.ns_per_tick, 0.0);
  EXPECT_GE(rate.spread, 0.0);
  EXPECT_DOUBLE_EQ(rate.to_ns(1000), 1000 * rate.ns_per_tick);
  EXPECT_EQ(rate.to_json()["source"], rate.source);
}

}  // namespace
}  // namespace icbench
