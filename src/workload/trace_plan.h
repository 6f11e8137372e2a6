// A trace that is to be replayed: what each query makes if it misses.
//
// A query that missed in the render too makes the record it made there. One that was answered there made none, but may
// miss in a replay: another thread has not come by yet, or the cache keeps its inserts from it. The record that the
// renderer would have computed is not in the trace. In its stead, one is made at the query's point with the radius, the
// irradiance and the cost of the record that lies nearest (by the error term of core/interpolation.h for one radius),
// among all that the render had made when its records went; its id is the operation's number. So counts, costs and
// where records lie are nearly those of a render; irradiance is not, and no picture can be made of it.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/cache.h"
#include "harness/calibrated_work.h"
#include "workload/spec.h"
#include "workload/trace_file.h"

namespace icbench {

class TracePlan {
 public:
  /// `scale`: of the records' costs; 1 as they were, 0 none. `as_captured`: records are made where the render made
  /// them, and nowhere else, whatever queries answer. Throws std::runtime_error with one line if the trace contradicts
  /// itself: a query was answered where no record is valid.
  TracePlan(Trace trace, double scale, bool as_captured = false);

  const Trace& trace() const noexcept { return trace_; }
  double scale() const noexcept { return scale_; }

  /// Index into the trace's records of what `operation` made, or would have cost.
  std::uint32_t origin(std::uint32_t operation) const noexcept { return origins_[operation] & ~kStandIn; }
  bool is_stand_in(std::uint32_t operation) const noexcept { return (origins_[operation] & kStandIn) != 0; }
  /// Whether it computes a record, though valid records are there or not: in the render the renderer refused these, or
  /// another thread was as late.
  bool makes_a_record(std::uint32_t operation, bool is_answered) const noexcept {
    if (as_captured_) return !is_stand_in(operation);
    return !is_answered || (!is_stand_in(operation) &&
                            (trace_.records[origin(operation)].flags & TracedRecord::kRefusedAnswer) != 0);
  }
  /// What it inserts then.
  Record record(std::uint32_t operation) const noexcept;

  /// Work for each of the trace's records.
  std::vector<std::uint64_t> work_units(const Work& work) const;

  /// Frames [begin, end) between which records do not go.
  const std::vector<Trace::Range>& epochs() const noexcept { return epochs_; }
  /// Operations of frames [begin, end).
  Trace::Range operations(Trace::Range frames) const noexcept;

  /// Some points of these frames that can be asked for.
  std::vector<SurfacePoint> samples(Trace::Range frames) const;

  /// As it was, but for the threads and room for every record that may come.
  CacheConfig config(unsigned threads) const;

  /// Records that one thread leaves behind, summed over the epochs.
  std::uint64_t records_of_one_thread() const;

 private:
  static constexpr std::uint32_t kStandIn = 1u << 31;

  void find_origins(Trace::Range epoch);

  Trace trace_;
  double scale_;
  bool as_captured_;
  std::vector<Trace::Range> epochs_;
  std::vector<std::uint32_t> origins_;  // by operation; kStandIn: it was answered
};

/// The plan of a trace's workload. Throws std::runtime_error with one line if the file cannot be used, or is another than
/// when the run began.
std::unique_ptr<TracePlan> plan_of_trace(const WorkloadSpec& spec, double scale);

/// Of the file of a trace's workload. Throws std::runtime_error with one line if it cannot be read.
std::uint64_t trace_checksum(const WorkloadSpec& spec);

}  // namespace icbench
