// Queries of the packed octree: against the structure of the thesis, against what is left when nothing can change any
// more, and its own parts against each other.
#include "rows/read_only_structures.h"
#include "rows/rows.h"

namespace icbench {

std::unique_ptr<Experiment> packed_query_over_ward(const Machine& machine, std::string_view workload) {
  return std::make_unique<QueryRatio<WaitFree<>, PackedWaitFree<>>>(machine, workload);
}

std::unique_ptr<Experiment> told_query_over_ward(const Machine& machine, std::string_view workload) {
  return std::make_unique<QueryRatio<WaitFree<>, ToldRecords>>(machine, workload);
}

std::unique_ptr<Experiment> packed_query_over_replicated(const Machine& machine, std::string_view workload) {
  return std::make_unique<QueryRatio<ReplicatedOctree, PackedWaitFree<>>>(machine, workload);
}

std::unique_ptr<Experiment> packed_query_over_frozen(const Machine& machine, std::string_view workload) {
  return std::make_unique<QueryRatio<PackedWaitFree<>, PackedFrozen>>(machine, workload);
}

std::unique_ptr<Experiment> packed_query_over_tbb_hash_grid(const Machine& machine,
                                                            std::string_view workload) {
  return std::make_unique<QueryRatio<TbbHashGridCache<>, PackedWaitFree<>>>(machine, workload);
}

std::unique_ptr<Experiment> packed_query_over_append_log(const Machine& machine, std::string_view workload) {
  return std::make_unique<QueryRatio<AppendLogCache<>, PackedWaitFree<>>>(machine, workload);
}

std::unique_ptr<Experiment> packed_query_over_twin(const Machine& machine, std::string_view workload) {
  return std::make_unique<QueryRatio<PackedWaitFree<>, PackedSequential<>>>(machine, workload);
}

std::unique_ptr<Experiment> packed_snapshot_query(const Machine& machine, std::string_view workload) {
  return std::make_unique<QueryRatio<PackedWaitFreeSnapshot<>, PackedWaitFree<>>>(machine, workload);
}

namespace {

using Scalar = Direct<Packed<StdSync, AtFirstSight, ScalarLanes>>;

}  // namespace

std::unique_ptr<Experiment> packed_scalar_over_simd(const Machine& machine, std::string_view workload) {
  return std::make_unique<QueryRatio<Scalar, PackedWaitFree<>>>(machine, workload);
}

std::unique_ptr<Experiment> tidied_query_over_ward(const Machine& machine, std::string_view workload) {
  return std::make_unique<QueryRatio<Tidied<WaitFree<>>, Tidied<PackedWaitFree<>>>>(machine, workload);
}

std::unique_ptr<Experiment> tidied_query_over_replicated(const Machine& machine, std::string_view workload) {
  return std::make_unique<QueryRatio<ReplicatedInOrder, Tidied<PackedWaitFree<>>>>(machine, workload);
}

std::unique_ptr<Experiment> tidied_query_over_frozen(const Machine& machine, std::string_view workload) {
  return std::make_unique<QueryRatio<Tidied<PackedWaitFree<>>, PackedFrozen>>(machine, workload);
}

std::unique_ptr<Experiment> tidied_scalar_over_simd(const Machine& machine, std::string_view workload) {
  return std::make_unique<QueryRatio<Tidied<Scalar>, Tidied<PackedWaitFree<>>>>(machine, workload);
}

std::unique_ptr<Experiment> untidied_query_over_tidied(const Machine& machine, std::string_view workload) {
  return std::make_unique<QueryRatio<PackedWaitFree<>, Tidied<PackedWaitFree<>>>>(machine, workload);
}

}  // namespace icbench
