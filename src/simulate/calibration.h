// The calibration: what this machine's operations, locks and cache lines cost, measured once and kept in a file.
//
// Of the machine: a line's transfer between two cores (where it has two), sleeping, waking, spinning, starting a
// thread. Of each cache and workload: queries and inserts by records that are there, on one core, their sum matched to
// a real trial, and what they take by themselves, which is what they hold a lock for; what it takes to read a record
// that another core has inserted, on two cores that take turns; and merging. Times are those of the thread's processor,
// or leave out what is far longer than the median, so that other programs on the machine disturb little.
//
// The file is JSON. One that is there is used as it is, whichever machine it is from, and gets costs that it lacks
// added, if it is from this one. What a simulation is worth, the file knows as well: the outcome of a validation.
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "harness/topology.h"
#include "simulate/costs.h"
#include "simulate/program.h"
#include "workload/dispatch.h"

namespace icbench {

/// How far simulated times were found to be from measured ones.
struct Validation {
  unsigned threads = 0;  ///< most that were measured
  /// How cores lay in the virtual machine; 0 in files of builds that did not tell.
  unsigned cores_per_complex = 0, cores_per_socket = 0;
  unsigned points = 0;  ///< caches x workloads x thread counts, of more than one thread
  unsigned records_points = 0, waiting_points = 0;  ///< of these, that can repeat work, that can wait
  double throughput_error = 0;                      ///< median of |simulated - measured| / measured
  /// Of redundant records, over the measured ones or 1 % of the records if that is more.
  double records_error = 0;
  /// Of waiting for locks, over the measured one or 1 % of the time if that is more.
  double waiting_error = 0;
  /// Of throughput, by the costs that the calibration has since, the middle of those of the moments.
  double file_error = 0;
  std::string date = {}, commit = {};  ///< the build that was validated
  /// Off by how much throughput was with most threads, by Simulation::validated_as: nothing is said of other caches,
  /// workloads and costs of records.
  std::map<std::string, double> errors = {};

  /// Whether the medians are at most kBar, that by the calibration's costs, which figures have, among them.
  bool holds() const noexcept;
  static constexpr double kBar = 0.10;
};

struct Calibration {
  std::string host_name, cpu_model, commit, date;
  Transfers transfers{};
  bool is_transfer_measured = false;
  WaitCosts waits{};
  WorkPace pace{};
  double harness_query_ns = 0.0;            ///< of a workload's own code around a query
  std::map<std::string, CacheCosts> costs;  ///< by key_of
  std::optional<Validation> validation;

  nlohmann::ordered_json to_json() const;
};

/// $XDG_CACHE_HOME/icbench, or ~/.cache/icbench: calibration.json there.
std::string default_calibration_path();

/// Throws std::runtime_error with one line if the file is there and is no calibration; nothing if it is not there.
std::optional<Calibration> read_calibration(const std::string& path);
/// Makes the folder that a calibration is to be in. Throws std::runtime_error with one line.
void make_folder_of(const std::string& path);
/// Replaces the file; makes its folder. Throws std::runtime_error with one line.
void write_calibration(const Calibration& calibration, const std::string& path);

// Several processes may measure into one file; what another has written since `calibration` was read stays.

/// Adds the costs of `key` to the file. Throws as write_calibration.
void add_costs(const Calibration& calibration, const std::string& key, const std::string& path);
/// Replaces the file, but for costs that `calibration` has not. Throws as write_calibration.
void write_validated(Calibration calibration, const std::string& path);

/// What waiting takes one thread; a few hundredths of a second.
void measure_waits(WaitCosts& out);

/// What depends on how far apart two cores are and on waking, of threads on two of them; about a tenth of a second.
/// On a virtual machine this changes from minute to minute, as its processors are moved about.
void measure_contention(ThreadTeam& two, Transfers& transfers, WaitCosts& waits);

/// In the mean of the team's threads, each of which computes for some 20 ms at once with the others.
double measured_pace(ThreadTeam& team, const Work& work);

/// All but costs of caches; about a second. `environment` is an environment record.
Calibration calibrate_machine(const Topology& topology, const nlohmann::ordered_json& environment);

/// A plan whose misses take no work, and how to know it again.
struct CalibratedPlan {
  const SyntheticPlan* synthetic = nullptr;
  const TracePlan* trace = nullptr;
  std::string key;  ///< of the workload: costs do not depend on how long records take
};

/// What a workload is known by among costs; a trace by its checksum, which must be known.
std::string workload_key(const WorkloadSpec& spec);
std::string key_of(std::string_view cache, const std::string& workload_key);

/// Costs of a cache; `one` has one thread, `two`, which may be null, has two on two cores. Throws
/// std::runtime_error if the cache broke its promise meanwhile.
CacheCosts calibrate_cache(const CacheEntry& cache, const CalibratedPlan& plan, ThreadTeam& one,
                           ThreadTeam* two, const Work& work, const Calibration& machine, std::uint64_t seed);

/// `costs`, measured earlier, as they are now, by two trials on one thread. Throws as calibrate_cache does.
CacheCosts costs_now(CacheCosts costs, const CacheEntry& cache, const CalibratedPlan& plan, ThreadTeam& one,
                     const Work& work, std::uint64_t seed);

}  // namespace icbench
