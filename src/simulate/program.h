// What virtual threads run: the operations of a synthetic plan or of a trace, in one form for both.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/cache.h"
#include "workload/synthetic_plan.h"
#include "workload/trace_plan.h"

namespace icbench {

/// One operation: a query and what its miss leads to, or an insert.
struct SimulatedOperation {
  const SurfacePoint* query = nullptr;  ///< null: the insert of record()
  double work_ns = 0.0;                 ///< of a miss
  bool refuses_answer = false;          ///< it misses although there are valid records
  bool asks_neighbours = false;         ///< a miss asks once more before it inserts
  bool inserts = false;                 ///< a miss inserts record()
};

/// Operations between two quiescent points.
struct SimulatedSegment {
  std::vector<Trace::Range> chunks;  ///< of operations; a chunk is run by one thread
  bool is_dealt = false;             ///< chunk t is thread t's; else whoever is free takes the next one
  bool is_fresh = false;             ///< the cache is emptied before, and gets `given`
  std::vector<Record> given;
  const Trace::Frame* ends = nullptr;  ///< the traced frame that ends with it
};

class SimulatedProgram {
 public:
  virtual ~SimulatedProgram() = default;
  virtual const std::vector<SimulatedSegment>& segments() const = 0;
  virtual SimulatedOperation operation(std::uint32_t i) const = 0;
  virtual Record record(std::uint32_t i) const = 0;
  virtual CacheConfig config(unsigned threads) const = 0;
};

/// As run_synthetic_trial runs it with the same `seed`. `plan` must outlive it.
std::unique_ptr<SimulatedProgram> simulated_program(const SyntheticPlan& plan, unsigned threads,
                                                    std::uint64_t seed);
/// As run_trace_trial does.
std::unique_ptr<SimulatedProgram> simulated_program(const TracePlan& plan);

}  // namespace icbench
