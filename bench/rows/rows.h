// All rows of bench/targets, in the order in which they are printed.
#pragma once

#include <vector>

#include "rows/row.h"

namespace icbench {

struct Validation;

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

/// Queries of the packed octree on a read-only workload: of wait_free over them, of the wait-free one over its
/// unsynchronised twin, of linearizable over regular ones, of scalar code over vectors, and single over batched.
std::unique_ptr<Experiment> packed_query_over_ward(const Machine& machine, std::string_view workload);
/// Of wait_free over what is left for a query to whom the valid records are told: more cannot be won.
std::unique_ptr<Experiment> told_query_over_ward(const Machine& machine, std::string_view workload);
/// Of a scalar octree of whole records over them, and of them over the same records frozen.
std::unique_ptr<Experiment> packed_query_over_replicated(const Machine& machine, std::string_view workload);
/// Of the rivals from oneTBB over them.
std::unique_ptr<Experiment> packed_query_over_tbb_hash_grid(const Machine& machine,
                                                            std::string_view workload);
std::unique_ptr<Experiment> packed_query_over_append_log(const Machine& machine, std::string_view workload);
std::unique_ptr<Experiment> packed_query_over_frozen(const Machine& machine, std::string_view workload);
std::unique_ptr<Experiment> packed_query_over_twin(const Machine& machine, std::string_view workload);
std::unique_ptr<Experiment> packed_snapshot_query(const Machine& machine, std::string_view workload);
std::unique_ptr<Experiment> packed_scalar_over_simd(const Machine& machine, std::string_view workload);
/// The same of their tests of lanes and records alone.
std::unique_ptr<Experiment> packed_scalar_over_vector_kernels(const Machine& machine,
                                                              std::string_view workload);
/// The same of tidied records (caches/tidy.h) on both sides; then a query before tidying over one after it, and tidying
/// over inserting.
std::unique_ptr<Experiment> tidied_query_over_ward(const Machine& machine, std::string_view workload);
std::unique_ptr<Experiment> tidied_query_over_replicated(const Machine& machine, std::string_view workload);
std::unique_ptr<Experiment> tidied_query_over_frozen(const Machine& machine, std::string_view workload);
std::unique_ptr<Experiment> tidied_scalar_over_simd(const Machine& machine, std::string_view workload);
std::unique_ptr<Experiment> untidied_query_over_tidied(const Machine& machine, std::string_view workload);
std::unique_ptr<Experiment> packed_tidy_over_insert(const Machine& machine, std::string_view workload);
std::unique_ptr<Experiment> packed_single_over_batch(const Machine& machine, std::string_view workload);
/// Its inserts over those of wait_free, and its memory over 150 bytes a record: what is handed out, and what the system
/// has put behind it.
std::unique_ptr<Experiment> packed_insert_over_ward(const Machine& machine, std::uint32_t records);
std::unique_ptr<Experiment> packed_memory(const Machine& machine, std::uint32_t records);
std::unique_ptr<Experiment> packed_memory_resident(const Machine& machine, std::uint32_t records);
/// Throughput of its linearizable queries over that of regular ones, and of wait-free access over that of a rival, by
/// its registry name.
std::unique_ptr<Experiment> packed_snapshot_mix(const Machine& machine);
std::unique_ptr<Experiment> packed_over_rival(const Machine& machine, std::string_view cache);

/// Of its queries while all other units insert over the same while they do not.
std::unique_ptr<Experiment> packed_insert_latency(const Machine& machine, std::uint32_t inserts_per_second);
std::unique_ptr<Experiment> packed_read_only_scaling(const Machine& machine);
/// Of a rendered frame of Cornell box, 256 rays a record, what is spent in the cache.
std::unique_ptr<Experiment> packed_frame_share(const Machine& machine);
/// With four threads a processing unit: throughput over that with one, the slowest query of a thousand likewise, and
/// that over the median.
enum class Oversubscription { throughput, slowest, spread };
std::unique_ptr<Experiment> packed_oversubscribed(const Machine& machine, Oversubscription figure);

/// Time of a frame of the moving Cornell box whose cache operations are captured, over that of one left alone.
std::unique_ptr<Experiment> trace_slowdown(const Machine& machine, std::string_view integrator);

/// Share of wall time x threads that the parts of a sweep's time breakdown do not explain.
std::unique_ptr<Experiment> breakdown_sum(const Machine& machine);

/// Median error of the simulator against measured trials: `figure` is one of those of throughput, records and waiting.
std::unique_ptr<Experiment> simulator_error(const Machine& machine, double Validation::*figure);
std::unique_ptr<Experiment> simulator_speed(const Machine& machine);

/// All rows, in the order in which they are printed.
std::vector<Row> all_rows();

}  // namespace icbench
