// What publication by atomics costs a reader: the same structure with and without them, on one thread.
#include "caches/registry.h"
#include "rows/query_ratio.h"
#include "rows/rows.h"

namespace icbench {

std::unique_ptr<Experiment> query_over_twin(const Machine& machine) {
  return std::make_unique<QueryRatio<WaitFree<>, Sequential<>>>(machine);
}

}  // namespace icbench
