// All rows of bench/targets, in the order in which they are printed.
#pragma once

#include <array>

#include "rows/row.h"

namespace icbench {

std::unique_ptr<Experiment> query_over_twin(const Machine& machine);
std::unique_ptr<Experiment> read_only_scaling(const Machine& machine);
std::unique_ptr<Experiment> miss_driven_over_mutex(const Machine& machine);
std::unique_ptr<Experiment> gather_over_bare_rays(const Machine& machine);
std::unique_ptr<Experiment> cached_mean_ratio(const Machine& machine);

inline constexpr std::array kRows{
    Row{"wait_free_query_over_twin",
        "time of a wait_free query / of its unsynchronised twin; read-only, 10^5 records, 1 thread",
        Relation::at_most, 1.15, query_over_twin},
    Row{"wait_free_read_only_scaling",
        "read-only throughput of wait_free on all N processing units / N times that on one",
        Relation::at_least, 0.95, read_only_scaling},
    Row{"wait_free_over_global_mutex",
        "miss-driven throughput at 1 us a record, 4 threads a unit: wait_free / global_mutex",
        Relation::at_least, 1.6, miss_driven_over_mutex},
    Row{"gather_over_bare_rays",
        "rays a second of the hemisphere gather / of a bare loop of single Embree rays over the same rays",
        Relation::at_least, 0.7, gather_over_bare_rays},
    Row{"cached_mean_at_least",
        "mean of cached Cornell box / of the path-traced one, indirect light at equal hits",
        Relation::at_least, 0.99, cached_mean_ratio},
    Row{"cached_mean_at_most",
        "mean of cached Cornell box / of the path-traced one, indirect light at equal hits",
        Relation::at_most, 1.01, cached_mean_ratio},
};

}  // namespace icbench
