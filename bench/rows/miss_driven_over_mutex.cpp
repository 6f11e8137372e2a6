// What a lock around the cache costs when threads are many and records cheap.
#include <algorithm>

#include "caches/registry.h"
#include "rows/rows.h"
#include "rows/throughput_ratio.h"

namespace icbench {

std::unique_ptr<Experiment> miss_driven_over_mutex(const Machine& machine) {
  return std::make_unique<ThroughputRatio<WaitFree, GlobalMutexCache>>(
      machine, "miss_driven:cost=1", std::min(4 * machine.units(), kMaxThreads));
}

}  // namespace icbench
