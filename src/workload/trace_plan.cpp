#include "workload/trace_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "caches/direct.h"
#include "caches/packed_octree.h"
#include "workload/trace_trial.h"

namespace icbench {
namespace {

using PlanCache = Direct<Packed<PlainSync>, NoCounters>;

}  // namespace

std::uint64_t trace_checksum(const WorkloadSpec& spec) {
  if (spec.file.empty()) {
    throw std::runtime_error(fmt::format(
        "workload '{}' names no file; give trace:file=PATH, which icbench trace capture writes", spec.name));
  }
  return read_trace_header(spec.file).checksum;
}

std::unique_ptr<TracePlan> plan_of_trace(const WorkloadSpec& spec, double scale) {
  Trace trace = read_trace(spec.file);
  if (spec.checksum != 0 && trace.checksum != spec.checksum)
    throw std::runtime_error(
        fmt::format("the trace '{}' has changed since the run began; start anew", spec.file));
  try {
    return std::make_unique<TracePlan>(std::move(trace), scale, spec.as_captured);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(
        fmt::format("cannot use the trace '{}': {}; capture it anew", spec.file, error.what()));
  }
}

TracePlan::TracePlan(Trace trace, double scale, bool as_captured)
    : trace_(std::move(trace)), scale_(scale), as_captured_(as_captured), origins_(trace_.points.size()) {
  for (std::uint32_t f = 0; f < trace_.frames.size(); ++f) {
    if (f != 0 && trace_.frames[f].start == FrameStart::stay) {
      ++epochs_.back().end;
    } else {
      epochs_.push_back({f, f + 1});
    }
  }
  for (const Trace::Range epoch : epochs_) find_origins(epoch);
}

Trace::Range TracePlan::operations(Trace::Range frames) const noexcept {
  // Tiles follow each other as their frames do, and so do operations.
  const std::uint32_t first = trace_.frames[frames.begin].segments.begin;
  const std::uint32_t last = trace_.frames[frames.end - 1].segments.end;
  if (first == last) return {};
  const std::uint32_t first_tile = trace_.segments[first].begin, last_tile = trace_.segments[last - 1].end;
  if (first_tile == last_tile) return {};
  return {trace_.tiles[first_tile].begin, trace_.tiles[last_tile - 1].end};
}

void TracePlan::find_origins(Trace::Range epoch) {
  const Trace::Range all = operations(epoch), first = trace_.frames[epoch.begin].first;
  std::vector<std::uint32_t> places;
  for (std::uint32_t i = first.begin; i < first.end; ++i) places.push_back(i);
  for (std::uint32_t i = all.begin; i < all.end; ++i) {
    origins_[i] = trace_.made[i] == Trace::kHit ? kStandIn : trace_.made[i];
    if (trace_.made[i] != Trace::kHit) places.push_back(trace_.made[i]);
  }
  std::erase_if(places, [&](auto place) { return trace_.records[place].result != InsertResult::inserted; });
  std::vector<float> radii;
  for (const std::uint32_t place : places) radii.push_back(trace_.records[place].record.R);
  std::sort(radii.begin(), radii.end());

  // Looked up by error term, with the same radius for all: the weights would favour large radii, and stand-ins made of
  // those answer more queries than the renderer's own records do. First a small radius, which few records share, then,
  // for points that it does not reach from any, the largest, with which all are valid where they were.
  std::vector<std::uint32_t> left;
  for (std::uint32_t i = all.begin; i < all.end; ++i)
    if (origins_[i] == kStandIn) left.push_back(i);
  for (const bool is_last : {false, true}) {
    if (left.empty()) return;
    if (radii.empty()) break;
    CacheConfig config = trace_.context.config;
    config.max_sessions = 1;
    config.capacity = capacity_for(places.size(), 1);
    PlanCache cache(config);
    auto session = cache.open_session(0);
    for (const std::uint32_t place : places) {
      Record r = trace_.records[place].record;
      r.R = is_last ? radii.back() : radii[radii.size() / 2];
      r.id = place;
      session.insert(r);
    }
    struct Nearest {
      float weight = 0.0f;
      std::uint32_t place = 0;
    };
    std::erase_if(left, [&](std::uint32_t i) {
      Nearest nearest;
      session.visit(trace_.points[i],
                    RecordCallback{[](void* context, const Record& r, float weight) noexcept {
                                     auto& best = *static_cast<Nearest*>(context);
                                     if (weight > best.weight || (weight == best.weight && r.id < best.place))
                                       best = {weight, r.id};
                                   },
                                   &nearest});
      if (nearest.weight > 0.0f) origins_[i] = nearest.place | kStandIn;
      return nearest.weight > 0.0f;
    });
  }
  if (!left.empty()) {
    throw std::runtime_error(fmt::format(
        "the trace contradicts itself: operation {} was answered where no record is valid", left.front()));
  }
}

Record TracePlan::record(std::uint32_t operation) const noexcept {
  Record r = trace_.records[origin(operation)].record;
  if (!is_stand_in(operation)) return r;
  const SurfacePoint& x = trace_.points[operation];
  r.p = x.p;
  r.n = x.n;
  r.id = operation;
  return r;
}

std::vector<std::uint64_t> TracePlan::work_units(const Work& work) const {
  // Records that a frame began with have no cost of their own: that of the middle one of those that have.
  std::vector<std::uint64_t> costs;
  for (const TracedRecord& r : trace_.records)
    if (r.cost_ns != 0) costs.push_back(r.cost_ns);
  std::uint64_t middle = 0;
  if (!costs.empty()) {
    const auto at = costs.begin() + static_cast<std::ptrdiff_t>(costs.size() / 2);
    std::nth_element(costs.begin(), at, costs.end());
    middle = *at;
  }
  std::vector<std::uint64_t> units;
  units.reserve(trace_.records.size());
  for (const TracedRecord& r : trace_.records)
    units.push_back(work.units_for_ns(scale_ * static_cast<double>(r.cost_ns != 0 ? r.cost_ns : middle)));
  return units;
}

std::vector<SurfacePoint> TracePlan::samples(Trace::Range frames) const {
  const Trace::Range all = operations(frames);
  std::vector<SurfacePoint> out =
      sample_points(std::span(trace_.points).subspan(all.begin, all.end - all.begin), 32);
  std::erase_if(out, [&](const SurfacePoint& x) { return !is_askable(x, trace_.context.config.bounds); });
  return out;
}

CacheConfig TracePlan::config(unsigned threads) const {
  std::uint64_t most = 0;
  for (const Trace::Range epoch : epochs_) {
    const Trace::Range all = operations(epoch), first = trace_.frames[epoch.begin].first;
    most = std::max<std::uint64_t>(most, std::uint64_t{all.end} - all.begin + first.end - first.begin);
  }
  CacheConfig config = trace_.context.config;
  config.max_sessions = threads;
  config.capacity = capacity_for(most, threads);  // at worst every query makes a record
  return config;
}

std::uint64_t TracePlan::records_of_one_thread() const {
  const std::vector<std::uint64_t> no_work(trace_.records.size());
  std::vector<unsigned char> accepted(trace_.points.size());
  std::uint64_t records = 0;
  for (const Trace::Range epoch : epochs_) {
    PlanCache cache(config(1));
    auto session = cache.open_session(0);
    TraceWorker worker(LatencySampler(0, 0));
    const Trace::Range first = trace_.frames[epoch.begin].first;
    for (std::uint32_t i = first.begin; i < first.end; ++i) session.insert(trace_.records[i].record);
    for (std::uint32_t f = epoch.begin; f < epoch.end; ++f)
      for (std::uint32_t s = trace_.frames[f].segments.begin; s < trace_.frames[f].segments.end; ++s)
        for (std::uint32_t t = trace_.segments[s].begin; t < trace_.segments[s].end; ++t)
          replay_tile(session, *this, trace_.tiles[t], no_work, worker, accepted);
    records += worker.inserted + first.end - first.begin;
  }
  return records;
}

}  // namespace icbench
