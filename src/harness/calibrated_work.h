// Simulated work: what a renderer does between two cache operations, as a fixed number of instructions.
//
// A unit is one step of a dependent chain (multiply, add, shift, xor: about 6 cycles of latency), which
// neither compiler nor processor can shorten, and which touches no memory. A thread that is held up, or runs
// on a slower core, still executes the same instructions: unlike a timed wait, the work cannot hide
// contention.
//
// Calibration tells how many units take how long on this machine when nothing disturbs; it is recorded with the
// results, and a run that is resumed goes on with it, so that all of its trials do the same work.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>

namespace icbench {

/// Executes `units` steps from the seed `x` and returns the chain's end, a function of both arguments.
inline std::uint64_t do_work(std::uint64_t units, std::uint64_t x = 1) noexcept {
  for (std::uint64_t i = 0; i < units; ++i) {
    x = x * 0xd1342543de82ef95ULL + 0x9e3779b97f4a7c15ULL;
    x ^= x >> 29;
    // The value is opaque after every step, so that no run of steps can be folded into one, or dropped.
    asm volatile("" : "+r"(x));
  }
  return x;
}

struct WorkCalibration {
  double ns_per_unit = 1.0;         ///< fastest try, > 0: the undisturbed machine
  double median_ns_per_unit = 1.0;  ///< median try; far above ns_per_unit on a machine that is busy otherwise
  std::uint64_t units_per_try = 0;
  unsigned tries = 0;

  nlohmann::ordered_json to_json() const;
  /// What `to_json` gave. Throws std::runtime_error, one line, if it is damaged.
  static WorkCalibration from_json(const nlohmann::ordered_json& json);
};

class Work {
 public:
  explicit Work(const WorkCalibration& calibration) noexcept : calibration_(calibration) {}
  /// Times several tries on the calling thread, some 30 ms in all.
  static Work calibrate();

  /// Units that take `ns` nanoseconds, rounded to the nearest; 0 for negative values and NaN, saturates at
  /// 2^63.
  std::uint64_t units_for_ns(double ns) const noexcept;
  const WorkCalibration& calibration() const noexcept { return calibration_; }

 private:
  WorkCalibration calibration_;
};

}  // namespace icbench
