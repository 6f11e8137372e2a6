#include "harness/calibrated_work.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <stdexcept>

#include "harness/statistics.h"

namespace icbench {
namespace {

double time_ns(std::uint64_t units, std::uint64_t seed) {
  const auto before = std::chrono::steady_clock::now();
  const std::uint64_t end = do_work(units, seed);
  asm volatile("" ::"r"(end));  // the chain ends before the clock is read again
  const std::chrono::duration<double, std::nano> elapsed = std::chrono::steady_clock::now() - before;
  return elapsed.count();
}

}  // namespace

nlohmann::ordered_json WorkCalibration::to_json() const {
  return {{"ns_per_unit", ns_per_unit},
          {"median_ns_per_unit", median_ns_per_unit},
          {"units_per_try", units_per_try},
          {"tries", tries}};
}

WorkCalibration WorkCalibration::from_json(const nlohmann::ordered_json& json) {
  try {
    WorkCalibration c;
    json.at("ns_per_unit").get_to(c.ns_per_unit);
    json.at("median_ns_per_unit").get_to(c.median_ns_per_unit);
    json.at("units_per_try").get_to(c.units_per_try);
    json.at("tries").get_to(c.tries);
    if (c.ns_per_unit > 0.0) return c;
  } catch (const nlohmann::json::exception&) {
    // Told below.
  }
  throw std::runtime_error("the context of the results is damaged at 'work_calibration'; drop --resume");
}

Work Work::calibrate() {
  // Long against the clock's resolution, short against a scheduler's time slice; the first pass wakes the
  // core.
  constexpr std::uint64_t kUnits = 200'000;
  time_ns(10 * kUnits, 1);
  std::array<double, 25> tries;
  for (std::size_t i = 0; i < tries.size(); ++i) tries[i] = time_ns(kUnits, i) / static_cast<double>(kUnits);
  // A clock too coarse to see a try would give 0, and then infinitely many units.
  constexpr double kLeast = 1e-3;
  const double fastest = std::max(*std::min_element(tries.begin(), tries.end()), kLeast);
  return Work({fastest, std::max(median(tries), kLeast), kUnits, static_cast<unsigned>(tries.size())});
}

std::uint64_t Work::units_for_ns(double ns) const noexcept {
  const double units = std::round(ns / calibration_.ns_per_unit);
  if (!(units > 0.0)) return 0;
  return units >= 0x1p63 ? std::uint64_t{1} << 63 : static_cast<std::uint64_t>(units);
}

}  // namespace icbench
