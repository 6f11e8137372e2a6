// The environment record: everything about machine, system, build and call that a reader needs to judge a
// number, as the `context` block of a results file.
//
// Keys of Google Benchmark, with its meanings, so that its tools read our files: date, host_name, executable,
// num_cpus, mhz_per_cpu, cpu_scaling_enabled, caches, load_avg, library_build_type. All others are ours;
// plots refuse to merge files whose environment_identity differs.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "harness/topology.h"

namespace icbench {

/// Version of the results files' layout; raised when a field changes its meaning.
inline constexpr int kSchemaVersion = 1;

/// What the environment record tells about this run.
struct RunInfo {
  std::vector<std::string> command_line;  ///< argv
  std::uint64_t seed = 0;
  Placement placement = Placement::compact;
  std::vector<unsigned> thread_counts;  ///< each in 1 .. kMaxThreads
};

/// The record. pin_map holds, per thread count, the processing units of threads 0, 1, ...: thread i sits on
/// entry i mod length; "unbound" without placement. Throws std::runtime_error if a count is out of range.
nlohmann::ordered_json environment(const Topology& topology, const RunInfo& run);

/// The part of an environment record that must agree before two sets of numbers are put side by side or a run
/// is resumed: machine, kernel, frequency governor, build.
nlohmann::ordered_json environment_identity(const nlohmann::ordered_json& environment);

/// The program that an environment is of: its commit, and, of what no commit tells, the hash of its file.
std::string program_of(const nlohmann::ordered_json& environment);

/// One, five and fifteen minute load averages; empty if the system has none.
std::vector<double> load_averages();

/// Local time with its offset, ISO 8601: "2024-05-01T13:37:00+02:00".
std::string date_now();

}  // namespace icbench
