// How far simulated figures are from measured ones, on the cores that this machine has.
//
// In rounds. Each takes, of every point, the costs as they are now (two trials on one thread, two threads that wait for
// each other and that compute), a real trial, and a simulated one of the same operations at those costs. So what is
// judged is the model: a machine that has become slower since its calibration, as virtual ones do from minute to
// minute, is no error of it. What is simulated later has the calibration's costs, which are then those of the moments
// in the middle; how far off these make it is told beside.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "simulate/simulation.h"

namespace icbench {

/// What is simulated, and validated, unless something else is asked for.
inline constexpr const char* kUsualCaches[] = {"packed_global_mutex", "packed_queuing_mutex",
                                               "packed_shared_mutex", "packed_distributed_rw",
                                               "packed_local_write",  "packed_wait_free"};
inline constexpr const char* kValidatedWorkloads[] = {"miss_driven:cost=1", "miss_driven:cost=10",
                                                      "miss_driven:cost=100", "mix_90_10", "read_only"};

/// Figures of a point, a value a round.
struct Rounds {
  std::vector<double> throughput;  ///< operations a second
  std::vector<double> redundant, records;
  std::vector<double> waiting;  ///< for locks, of wall time x threads

  void add(const Entry& entry);
  double redundant_mean() const;  ///< counts add up
};

/// A point, measured and simulated in turns.
struct ComparedPoint {
  SimulationPoint point;
  std::vector<Entry> entries{};  ///< the rounds' simulated ones
  Rounds measured{}, simulated{};
  Rounds by_file{};  ///< simulated by the costs that the calibration takes on; of more than one thread

  /// Of `entries`, which are some, the one of the median throughput, so that its figures belong together; the slower
  /// one in the middle of an even number.
  const Entry& usual() const;

  /// Of the median of the rounds' ratios: what a round's two have in common, the machine's state, cancels.
  double throughput_error() const;
  /// The same by the calibration's costs.
  double file_error() const;
  /// Of means, over the measured one or 1 % of the records if that is more.
  double redundant_error() const;
  /// Of medians, over the measured one or 1 % of the time if that is more.
  double waiting_error() const;
};

/// 1, 2, 4, ... threads and one for each processing unit. Throws std::runtime_error with one line where there is but
/// one unit: what one thread does is what the costs are from.
std::vector<unsigned> validated_cores(const Topology& topology);

/// Throws std::runtime_error if the calibration is another machine's.
void require_this_machine(Simulation& simulation);

/// Every point of the simulation in that many rounds and, unless it was just run, a first one that is cold and does not
/// count; `tell` is told of each trial. The simulation's calibration takes on the costs of the moments in the middle.
/// Throws std::runtime_error if the calibration is another machine's, InvalidTrial if a cache broke its contract.
std::vector<ComparedPoint> compare_in_rounds(Simulation& simulation, const Topology& topology,
                                             unsigned rounds, bool is_warm,
                                             const std::function<void(const std::string&)>& tell);

/// Medians over the points with more than one thread: that one thread takes as long as it did, repeats no work and
/// waits for nobody, is no merit.
Validation validation_of(const Simulation& simulation, std::span<const ComparedPoint> points);

/// The results' row of a point: what was simulated and measured, and whether it is validated by `outcome`, of which it
/// is a part.
Entry row_of(const ComparedPoint& compared, const Validation& outcome);

}  // namespace icbench
