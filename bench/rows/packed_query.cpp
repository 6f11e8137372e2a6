// Queries of the packed octree: against the structure of the thesis, and its own parts against each other.
#include "caches/registry.h"
#include "rows/query_ratio.h"
#include "rows/rows.h"

namespace icbench {

std::unique_ptr<Experiment> packed_query_over_ward(const Machine& machine, std::string_view workload) {
  return std::make_unique<QueryRatio<WaitFree<>, PackedWaitFree<>>>(machine, workload);
}

std::unique_ptr<Experiment> packed_query_over_twin(const Machine& machine) {
  return std::make_unique<QueryRatio<PackedWaitFree<>, PackedSequential<>>>(machine);
}

std::unique_ptr<Experiment> packed_snapshot_query(const Machine& machine) {
  return std::make_unique<QueryRatio<PackedWaitFreeSnapshot<>, PackedWaitFree<>>>(machine);
}

std::unique_ptr<Experiment> packed_scalar_over_simd(const Machine& machine, std::string_view workload) {
  using Scalar = Direct<Packed<StdSync, AtFirstSight, ScalarLanes>>;
  return std::make_unique<QueryRatio<Scalar, PackedWaitFree<>>>(machine, workload);
}

}  // namespace icbench
