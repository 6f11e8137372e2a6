#include "simulate/program.h"

#include <utility>

namespace icbench {
namespace {

class SyntheticProgram final : public SimulatedProgram {
 public:
  SyntheticProgram(const SyntheticPlan& plan, unsigned threads, std::uint64_t seed)
      : plan_(plan), streams_(plan.streams(threads, seed)), segments_(1) {
    SimulatedSegment& all = segments_.front();
    all.is_dealt = all.is_fresh = true;
    for (unsigned t = 0; t < threads; ++t) all.chunks.push_back({streams_.begin[t], streams_.begin[t + 1]});
    all.given.assign(plan.records().begin(), plan.records().begin() + plan.prefilled());
  }

  const std::vector<SimulatedSegment>& segments() const override { return segments_; }
  SimulatedOperation operation(std::uint32_t i) const override {
    const std::uint32_t operation = streams_.operations[i];
    SimulatedOperation out;
    if ((operation & Streams::kInsert) != 0) return out;
    out.query = &plan_.points()[operation];
    out.inserts = plan_.spec().kind == WorkloadKind::miss_driven;
    out.work_ns = out.inserts ? 1000.0 * plan_.spec().cost_us : 0.0;
    return out;
  }
  Record record(std::uint32_t i) const override {
    const std::uint32_t operation = streams_.operations[i];
    return (operation & Streams::kInsert) != 0 ? plan_.records()[operation & Streams::kIndex]
                                               : plan_.record_at(streams_, i);
  }
  CacheConfig config(unsigned threads) const override { return plan_.config(threads); }

 private:
  const SyntheticPlan& plan_;
  Streams streams_;
  std::vector<SimulatedSegment> segments_;
};

class TraceProgram final : public SimulatedProgram {
 public:
  explicit TraceProgram(const TracePlan& plan)
      : plan_(plan), work_(plan.work_units(Work(WorkCalibration{}))) {  // a unit is a nanosecond there
    const Trace& trace = plan.trace();
    for (const Trace::Range epoch : plan.epochs()) {
      bool is_fresh = true;
      for (std::uint32_t f = epoch.begin; f < epoch.end; ++f) {
        for (std::uint32_t s = trace.frames[f].segments.begin; s < trace.frames[f].segments.end; ++s) {
          SimulatedSegment& segment = segments_.emplace_back();
          segment.is_fresh = std::exchange(is_fresh, false);
          const Trace::Range given = trace.frames[epoch.begin].first;
          for (std::uint32_t i = given.begin; segment.is_fresh && i < given.end; ++i)
            segment.given.push_back(trace.records[i].record);
          for (std::uint32_t t = trace.segments[s].begin; t < trace.segments[s].end; ++t)
            segment.chunks.push_back({trace.tiles[t].begin, trace.tiles[t].end});
          if (s + 1 == trace.frames[f].segments.end) segment.ends = &trace.frames[f];
        }
      }
    }
  }

  const std::vector<SimulatedSegment>& segments() const override { return segments_; }
  SimulatedOperation operation(std::uint32_t i) const override {
    const Trace& trace = plan_.trace();
    const TracedRecord& origin = trace.records[plan_.origin(i)];
    const bool was_hit = plan_.is_stand_in(i);
    SimulatedOperation out;
    out.query = &trace.points[i];
    out.refuses_answer = plan_.makes_a_record(i, true);
    if (!plan_.makes_a_record(i, false)) return out;
    out.work_ns = static_cast<double>(work_[plan_.origin(i)]);
    out.asks_neighbours = (origin.flags & TracedRecord::kAskedNeighbours) != 0;
    out.inserts = was_hit || origin.result == InsertResult::inserted;
    return out;
  }
  Record record(std::uint32_t i) const override { return plan_.record(i); }
  CacheConfig config(unsigned threads) const override { return plan_.config(threads); }

 private:
  const TracePlan& plan_;
  std::vector<std::uint64_t> work_;
  std::vector<SimulatedSegment> segments_;
};

}  // namespace

std::unique_ptr<SimulatedProgram> simulated_program(const SyntheticPlan& plan, unsigned threads,
                                                    std::uint64_t seed) {
  return std::make_unique<SyntheticProgram>(plan, threads, seed);
}

std::unique_ptr<SimulatedProgram> simulated_program(const TracePlan& plan) {
  return std::make_unique<TraceProgram>(plan);
}

}  // namespace icbench
