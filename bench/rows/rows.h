// All rows of bench/targets, in the order in which they are printed.
#pragma once

#include <vector>

#include "rows/row.h"

namespace icbench {

std::unique_ptr<Experiment> query_over_twin(const Machine& machine);
std::unique_ptr<Experiment> read_only_scaling(const Machine& machine);
std::unique_ptr<Experiment> miss_driven_over_mutex(const Machine& machine);
std::unique_ptr<Experiment> snapshot_query(const Machine& machine);
std::unique_ptr<Experiment> snapshot_mix(const Machine& machine);
std::unique_ptr<Experiment> snapshot_latency(const Machine& machine, std::uint32_t inserts_per_second);
std::unique_ptr<Experiment> gather_over_bare_rays(const Machine& machine);
std::unique_ptr<Experiment> cached_mean_ratio(const Machine& machine);
std::unique_ptr<Experiment> checker_speed(const Machine& machine);
std::unique_ptr<Experiment> vpl_gather_over_bare_rays(const Machine& machine);

/// All rows, in the order in which they are printed.
std::vector<Row> all_rows();

}  // namespace icbench
