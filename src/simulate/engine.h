// A trial in virtual time: the cache's real operations, in the order in which virtual threads come to them.
//
// Discrete events. Every virtual thread has a core of its own and a clock; the thread with the least time is next, ties
// go to the lower number. Its operation runs whole, on the real cache and in its own session, and then costs what the
// calibration says, the transfers of lines included. So each thread sees what it would see at its time: a query sees
// what was inserted until it begins; an insert happens when it ends; a record is published when its computation and its
// insert are over, and who asks before misses and computes one too. Copies of what a session does not share
// (local_write) are the cache's own business, since sessions are real.
//
// Exact: what is stored and seen, given the times; one virtual core leaves the records of one real thread, bit for bit.
// Modelled: times. Locks as in locks.h, shared words as in machine.h; locks per node or region by the addresses that
// the real operation locked; a merge that the cache does in parallel as if every core merged its own session's records.
// Not modelled: threads beyond cores, caches and memory bandwidth that cores share, other programs, what the kernel
// does now and then; compare-and-swaps that fail.
//
// Deterministic: equal inputs give equal outcomes, bit for bit, with one mathematical library. Costs: about a
// microsecond an event beside the real operations; two events for an operation under a lock, one for others. One thread
// at a time.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "core/counters.h"
#include "simulate/costs.h"
#include "simulate/program.h"
#include "workload/stepped_cache.h"

namespace icbench {

/// What of a cache the engine has to know beside its code.
struct Mechanism {
  LockKind lock = LockKind::none;
  /// Locks of parts, which the cache reports (LockLog): held one after the other, or all until the operation is over.
  enum class NodeLocks : std::uint8_t { none, in_turn, together } node_locks = NodeLocks::none;
  bool has_clock = false;  ///< one word that queries read and inserts write
  bool has_tail = false;   ///< one word that every insert writes
  /// Until end_frame; queries slow down with its own records, or with all it sees.
  bool sees_own_only = false;
  bool searches_own = false;  ///< a query tests its own records one after the other
  enum class Merge : std::uint8_t { none, parallel, serial } merge = Merge::none;
};

/// Whether there is a model of the cache's mechanism.
bool has_model(const CacheTraits& traits) noexcept;

/// By the mechanism that a cache declares. Throws std::runtime_error with one line for one that has no model.
Mechanism mechanism_of(const CacheTraits& traits);

/// Words that the operation in hand has locked, in its order; of the one real thread.
struct LockLog {
  static std::vector<const void*>& words();
};

/// The cache with those traits, which has locks of parts, with ones that tell the LockLog.
std::unique_ptr<SteppedCache> make_logged_node_locks(const CacheTraits& traits, const CacheConfig& config);

struct SimulatedOutcome {
  double wall_ns = 0.0;  ///< as TrialOutcome's
  double merge_ns = 0.0;
  double busy_ns = 0.0;       ///< of all threads, on a processor: all but sleeping and being done
  double lock_wait_ns = 0.0;  ///< of all threads, from finding a lock taken to having it
  double work_ns = 0.0;       ///< of all threads, computing records
  double transfer_ns = 0.0;   ///< of all threads, waiting for cache lines inside operations
  double query_ns = 0.0;      ///< by costs of queries and visits alone, of all threads
  double insert_ns = 0.0;     ///< by those of inserts
  std::uint64_t visits = 0;   ///< queries, and those that only look at what there is
  std::uint64_t operations = 0;
  std::uint64_t queries = 0, hits = 0, inserts = 0, refused = 0;
  std::uint64_t lock_acquisitions = 0, lock_contended = 0;
  std::uint64_t records = 0;  ///< stored at the end of each epoch, summed
  std::uint64_t digest = 0;   ///< of the records at the end (RecordsDigest)
  bool same_records = true;   ///< after every traced frame those of the trace
  double records_read_per_query = 0.0, records_valid_per_query = 0.0;
};

struct SimulatedSetup {
  const MachineModel& machine;
  const WaitCosts& waits;
  const CacheCosts& costs;
  Mechanism mechanism;
  std::uint64_t seed;
};

/// Runs `program` on `cache`, which was made for it with as many sessions as the machine has cores.
SimulatedOutcome simulate(const SimulatedProgram& program, SteppedCache& cache, const SimulatedSetup& setup);

}  // namespace icbench
