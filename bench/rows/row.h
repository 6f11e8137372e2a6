// A row of bench/targets: one performance figure of the project, as a ratio that is measured in one run.
//
// Adding a figure: one file in this folder with an Experiment, one entry in rows.h.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

#include "harness/calibrated_work.h"
#include "harness/statistics.h"
#include "harness/topology.h"
#include "workload/trial_entry.h"

namespace icbench {

/// What experiments share.
struct Machine {
  const Topology& topology;
  const Work& work;
  std::uint64_t seed;

  unsigned units() const noexcept { return static_cast<unsigned>(topology.units().size()); }
  /// Pins the calling thread to the first unit, where single-threaded figures are measured.
  void bind() const {
    if (const auto error = bind_this_thread(topology.units().front().os_index))
      throw std::runtime_error("cannot pin the measuring thread: " + error.message());
  }
};

/// Wall time of f(), seconds.
template <class F>
double seconds(F&& f) {
  const auto start = std::chrono::steady_clock::now();
  f();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// What both sides give, one called right after the other; in every other sample the second goes first, so that neither
/// always finds what the other left behind.
template <class F, class G>
auto in_turns(std::uint64_t sample, F&& first, G&& second) {
  using Both = std::pair<decltype(first()), decltype(second())>;
  if (sample % 2 != 0) {
    auto of_second = second();
    return Both{first(), std::move(of_second)};
  }
  auto of_first = first();
  return Both{std::move(of_first), second()};
}

/// One sample of a row: a ratio, or the reason why this one does not count.
struct Sample {
  double ratio = 0.0;
  std::string not_usable{};  ///< empty if the sample counts
};

/// Of rows that take two processing units or more, where there is one.
inline const Sample kSingleUnit{0.0, "this process may use a single processing unit"};

/// A prepared measurement. Each sample measures both sides of the ratio, one right after the other.
class Experiment {
 public:
  virtual ~Experiment() = default;
  /// Throws InvalidTrial if a cache broke its contract.
  virtual Sample sample() = 0;
  /// Whether the first sample is as good as the others: where no time is taken, or what is timed runs cold beforehand.
  virtual bool starts_warm() const { return false; }
};

struct Row {
  std::string name;
  std::string what;  ///< what is divided by what
  Relation relation;
  double target;
  std::function<std::unique_ptr<Experiment>(const Machine&)> make;
};

}  // namespace icbench
