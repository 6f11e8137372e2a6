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

std::unique_ptr<Experiment> packed_over_rival(const Machine& machine, std::string_view cache) {
  constexpr std::string_view kWorkload = "miss_driven:cost=1";
  const unsigned threads = std::min(4 * machine.units(), kMaxThreads);
  const auto over = [&]<template <class> class Lock>() -> std::unique_ptr<Experiment> {
    return std::make_unique<ThroughputRatio<PackedWaitFree, Lock>>(machine, kWorkload, threads);
  };
  if (cache == PackedGlobalMutex<>::kTraits.name) return over.template operator()<PackedGlobalMutex>();
  if (cache == PackedGlobalSpin<>::kTraits.name) return over.template operator()<PackedGlobalSpin>();
  if (cache == PackedQueuingMutex<>::kTraits.name) return over.template operator()<PackedQueuingMutex>();
  if (cache == PackedSharedMutex<>::kTraits.name) return over.template operator()<PackedSharedMutex>();
  if (cache == PackedSpinRwMutex<>::kTraits.name) return over.template operator()<PackedSpinRwMutex>();
  if (cache == PackedDistributedRw<>::kTraits.name) return over.template operator()<PackedDistributedRw>();
  if (cache == PackedNodeLock<>::kTraits.name) return over.template operator()<PackedNodeLock>();
  if (cache == TbbHashGridCache<>::kTraits.name) return over.template operator()<TbbHashGridCache>();
  if (cache == AppendLogCache<>::kTraits.name) return over.template operator()<AppendLogCache>();
  throw std::runtime_error("no row compares with cache " + std::string(cache));
}

}  // namespace icbench
