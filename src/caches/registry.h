// The list of caches. One line adds a cache to every workload, test, sweep and plot:
//
//   X(name, Type)   `name` is the cache's kTraits.name; `Type` is a class template over its Counters policy.
//
// The build reads the names from the lines below to give each cache translation units of its own.
#pragma once

#include "caches/append_log.h"
#include "caches/direct.h"
#include "caches/linear_list.h"
#include "caches/local_write.h"
#include "caches/locked.h"
#include "caches/null_cache.h"
#include "caches/packed_octree.h"
#include "caches/tbb_hash_grid.h"
#include "caches/ward_tree.h"

// clang-format off
#define ICBENCH_CACHES(X)           \
  X(null, NullCache)                \
  X(brute_force, BruteForce)        \
  X(sequential, Sequential)         \
  X(global_mutex, GlobalMutexCache) \
  X(global_spin, GlobalSpinCache)   \
  X(queuing_mutex, QueuingMutexCache) \
  X(shared_mutex, SharedMutexCache) \
  X(spin_rw_mutex, SpinRwMutexCache) \
  X(distributed_rw, DistributedRwCache) \
  X(node_lock, NodeLockCache)       \
  X(local_write, LocalWriteCache)   \
  X(wait_free, WaitFree)            \
  X(wait_free_snapshot, WaitFreeSnapshot) \
  X(packed_sequential, PackedSequential) \
  X(packed_global_mutex, PackedGlobalMutex) \
  X(packed_global_spin, PackedGlobalSpin) \
  X(packed_queuing_mutex, PackedQueuingMutex) \
  X(packed_shared_mutex, PackedSharedMutex) \
  X(packed_spin_rw_mutex, PackedSpinRwMutex) \
  X(packed_distributed_rw, PackedDistributedRw) \
  X(packed_node_lock, PackedNodeLock) \
  X(packed_local_write, PackedLocalWrite) \
  X(packed_wait_free, PackedWaitFree) \
  X(packed_wait_free_snapshot, PackedWaitFreeSnapshot) \
  X(tbb_hash_grid, TbbHashGridCache) \
  X(append_log, AppendLogCache)
// clang-format on

namespace icbench {

using PlainWardTree = WardTree<PlainSync>;

template <class Counters = NoCounters>
using BruteForce = Direct<LinearList<>, Counters>;
template <class Counters = NoCounters>
using Sequential = Direct<PlainWardTree, Counters>;
template <class Counters = NoCounters>
using GlobalMutexCache = Locked<PlainWardTree, GlobalMutex, Counters>;
template <class Counters = NoCounters>
using GlobalSpinCache = Locked<PlainWardTree, GlobalSpin<>, Counters>;
template <class Counters = NoCounters>
using QueuingMutexCache = Locked<PlainWardTree, QueuingMutex, Counters>;
template <class Counters = NoCounters>
using SharedMutexCache = Locked<PlainWardTree, SharedMutex, Counters>;
template <class Counters = NoCounters>
using SpinRwMutexCache = Locked<PlainWardTree, SpinRwMutex, Counters>;
template <class Counters = NoCounters>
using DistributedRwCache = Locked<PlainWardTree, DistributedRw<>, Counters>;
template <class Counters = NoCounters>
using NodeLockCache = Direct<WardTree<PlainSync, SpinNodeLock<>>, Counters>;
template <class Counters = NoCounters>
using LocalWriteCache = LocalWrite<WardTree<StdSync>, PlainWardTree, Counters>;
template <class Counters = NoCounters>
using WaitFree = Direct<WardTree<StdSync>, Counters>;
template <class Counters = NoCounters>
using WaitFreeSnapshot = Direct<WardTree<StdSync, NoNodeLock, Snapshot>, Counters>;

using PlainPacked = Packed<PlainSync>;

template <class Counters = NoCounters>
using PackedSequential = Direct<PlainPacked, Counters>;
template <class Counters = NoCounters>
using PackedGlobalMutex = Locked<PlainPacked, GlobalMutex, Counters>;
template <class Counters = NoCounters>
using PackedGlobalSpin = Locked<PlainPacked, GlobalSpin<>, Counters>;
template <class Counters = NoCounters>
using PackedQueuingMutex = Locked<PlainPacked, QueuingMutex, Counters>;
template <class Counters = NoCounters>
using PackedSharedMutex = Locked<PlainPacked, SharedMutex, Counters>;
template <class Counters = NoCounters>
using PackedSpinRwMutex = Locked<PlainPacked, SpinRwMutex, Counters>;
template <class Counters = NoCounters>
using PackedDistributedRw = Locked<PlainPacked, DistributedRw<>, Counters>;
template <class Counters = NoCounters>
using PackedNodeLock = Direct<Packed<PlainSync, AtFirstSight, SimdLanes, SpinNodeLock<>>, Counters>;
template <class Counters = NoCounters>
using PackedLocalWrite = LocalWrite<Packed<StdSync>, PlainPacked, Counters>;
template <class Counters = NoCounters>
using PackedWaitFree = Direct<Packed<StdSync>, Counters>;
template <class Counters = NoCounters>
using PackedWaitFreeSnapshot = Direct<Packed<StdSync, Snapshot>, Counters>;

template <class Counters = NoCounters>
using TbbHashGridCache = Direct<TbbHashGrid, Counters>;
template <class Counters = NoCounters>
using AppendLogCache = AppendLog<PlainPacked, StdSync, Counters>;

#define ICBENCH_CHECK(id, Type)                                                            \
  static_assert(IrradianceCache<Type<NoCounters>>, #id " does not model IrradianceCache"); \
  static_assert(BatchSession<Type<NoCounters>::Session>, #id " takes no batches");         \
  static_assert(Type<NoCounters>::kTraits.name == #id, "registry name and kTraits.name differ: " #id);
ICBENCH_CACHES(ICBENCH_CHECK)
#undef ICBENCH_CHECK

}  // namespace icbench
