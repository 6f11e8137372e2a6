// Mechanisms on one structure, the packed octree: what strictness costs when all units read and write, and what a lock
// costs when threads are many and records cheap.
#include <algorithm>

#include "caches/registry.h"
#include "rows/rows.h"
#include "rows/throughput_ratio.h"

namespace icbench {

std::unique_ptr<Experiment> packed_snapshot_mix(const Machine& machine) {
  return std::make_unique<ThroughputRatio<PackedWaitFreeSnapshot, PackedWaitFree>>(
      machine, "mix_90_10:operations=200000", machine.units());
}

std::unique_ptr<Experiment> packed_over_lock(const Machine& machine, std::string_view cache) {
  constexpr std::string_view kWorkload = "miss_driven:cost=1";
  const unsigned threads = std::min(4 * machine.units(), kMaxThreads);
  if (cache == PackedGlobalMutex<>::kTraits.name)
    return std::make_unique<ThroughputRatio<PackedWaitFree, PackedGlobalMutex>>(machine, kWorkload, threads);
  if (cache == PackedSharedMutex<>::kTraits.name)
    return std::make_unique<ThroughputRatio<PackedWaitFree, PackedSharedMutex>>(machine, kWorkload, threads);
  if (cache == PackedSpinRwMutex<>::kTraits.name)
    return std::make_unique<ThroughputRatio<PackedWaitFree, PackedSpinRwMutex>>(machine, kWorkload, threads);
  throw std::runtime_error("no row compares with cache " + std::string(cache));
}

}  // namespace icbench
