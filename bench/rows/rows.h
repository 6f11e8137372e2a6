// All rows of bench/targets, in the order in which they are printed.
#pragma once

#include <array>

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
    // The price of strictness: linearizable queries over regular ones, on the same structure.
    Row{"snapshot_query_over_wait_free",
        "time of a wait_free_snapshot query / of a wait_free one; read-only, 10^5 records, 1 thread",
        Relation::at_most, 1.08, snapshot_query},
    Row{"snapshot_mix_over_wait_free",
        "throughput of wait_free_snapshot / of wait_free; mix 90/10 on all processing units",
        Relation::at_least, 0.85, snapshot_mix},
    Row{"snapshot_latency_1000",
        "median latency of a query while all other units insert 10^3 records a second: wait_free_snapshot / "
        "wait_free (1.15 is this suite's own choice)",
        Relation::at_most, 1.15, [](const Machine& machine) { return snapshot_latency(machine, 1'000); }},
    Row{"snapshot_latency_10000",
        "median latency of a query while all other units insert 10^4 records a second: wait_free_snapshot / "
        "wait_free (1.15 is this suite's own choice)",
        Relation::at_most, 1.15, [](const Machine& machine) { return snapshot_latency(machine, 10'000); }},
    Row{"snapshot_latency_100000",
        "median latency of a query while all other units insert 10^5 records a second: wait_free_snapshot / "
        "wait_free (1.15 is this suite's own choice)",
        Relation::at_most, 1.15, [](const Machine& machine) { return snapshot_latency(machine, 100'000); }},
    Row{"snapshot_latency_1000000",
        "median latency of a query while all other units insert 10^6 records a second: wait_free_snapshot / "
        "wait_free (1.15 is this suite's own choice)",
        Relation::at_most, 1.15, [](const Machine& machine) { return snapshot_latency(machine, 1'000'000); }},
    Row{"gather_over_bare_rays",
        "rays a second of the hemisphere gather / of a bare loop of single Embree rays over the same rays",
        Relation::at_least, 0.7, gather_over_bare_rays},
    Row{"cached_mean_at_least",
        "mean of cached Cornell box / of the path-traced one, indirect light at equal hits",
        Relation::at_least, 0.99, cached_mean_ratio},
    Row{"cached_mean_at_most",
        "mean of cached Cornell box / of the path-traced one, indirect light at equal hits",
        Relation::at_most, 1.01, cached_mean_ratio},
    Row{"checker_speed",
        "operations judged a second, histories of 4 threads on one core / 500,000: 10^6 in two seconds",
        Relation::at_least, 1.0, checker_speed},
};

}  // namespace icbench
