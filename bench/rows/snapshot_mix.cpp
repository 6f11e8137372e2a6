// What strictness costs when all units read and write: linearizable queries against regular ones, and the
// clock that all inserts of the stricter cache share.
#include "caches/registry.h"
#include "rows/rows.h"
#include "rows/throughput_ratio.h"

namespace icbench {

std::unique_ptr<Experiment> snapshot_mix(const Machine& machine) {
  return std::make_unique<ThroughputRatio<WaitFreeSnapshot, WaitFree>>(machine, "mix_90_10:operations=200000",
                                                                       machine.units());
}

}  // namespace icbench
