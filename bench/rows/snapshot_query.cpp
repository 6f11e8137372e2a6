// What strictness costs a reader who is alone: linearizable queries against regular ones, on one thread.
#include "caches/registry.h"
#include "rows/query_ratio.h"
#include "rows/rows.h"

namespace icbench {

std::unique_ptr<Experiment> snapshot_query(const Machine& machine) {
  return std::make_unique<QueryRatio<WaitFreeSnapshot<>, WaitFree<>>>(machine);
}

}  // namespace icbench
