#include "workload/trial_entry.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "caches/session.h"
#include "workload/names.h"

namespace icbench {
namespace {

struct Percentile {
  std::string_view name;
  double share;
  bool always;
};
constexpr Percentile kPercentiles[] = {
    {"p10", 0.1, true},    {"p25", 0.25, true},      {"p50", 0.5, true},       {"p75", 0.75, true},
    {"p90", 0.9, true},    {"p95", 0.95, true},      {"p99", 0.99, true},      {"p995", 0.995, false},
    {"p999", 0.999, true}, {"p9995", 0.9995, false}, {"p9999", 0.9999, false}, {"p99999", 0.99999, false}};

double share(std::uint64_t part, std::uint64_t whole) {
  return whole == 0 ? 0.0 : static_cast<double>(part) / static_cast<double>(whole);
}

}  // namespace

Entry entry_of(std::string name, unsigned repetitions, unsigned repetition, unsigned threads,
               const TrialOutcome& o) {
  Entry entry;
  entry.name = std::move(name);
  entry.repetitions = repetitions;
  entry.repetition_index = repetition;
  entry.threads = threads;
  entry.real_time = 1e-6 * o.wall_ns;
  entry.cpu_time = 1e-6 * o.cpu_ns;
  entry.time_unit = "ms";
  return entry;
}

void add_latency(nlohmann::ordered_json& out, std::string_view operation, const Histogram& h,
                 const TickRate& rate) {
  if (h.count() == 0) return;
  const auto put = [&](std::string_view what, std::uint64_t value) {
    out[fmt::format("latency_{}_{}_ns", operation, what)] = std::round(rate.to_ns(value) * 10.0) / 10.0;
  };
  for (const Percentile& p : kPercentiles) {
    // Beyond what so many samples tell lies the maximum alone; the usual ones are always there.
    if (p.always || static_cast<double>(h.count()) >= std::round(1.0 / (1.0 - p.share)))
      put(p.name, h.percentile(p.share));
  }
  put("max", h.max());
  out[fmt::format("latency_{}_samples", operation)] = h.count();
}

void add_subject(nlohmann::ordered_json& out, const CacheEntry* cache, const WorkloadSpec& spec) {
  constexpr CacheTraits kNone{
      "none", "none", "none", ProgressGuarantee::wait_free, ProgressGuarantee::wait_free, Consistency::none,
      false,  ""};
  const CacheTraits& traits = cache == nullptr ? kNone : cache->traits;
  out["cache"] = traits.name;
  out["workload"] = spec.name;
  out["workload_kind"] = to_string(spec.kind);
  out["structure"] = traits.structure;
  out["mechanism"] = traits.mechanism;
  out["consistency"] = to_string(traits.consistency);
  out["scene"] = spec.scene;
}

void add_counts(nlohmann::ordered_json& out, const TrialOutcome& o, unsigned threads) {
  out["queries"] = o.counts.queries;
  out["hits"] = o.counts.hits;
  out["inserts"] = o.counts.inserted;
  out["records"] = o.records;
  out["records_read_per_query"] = share(o.counts.records_read, o.counts.queries);
  out["records_valid_per_query"] = share(o.counts.records_valid, o.counts.queries);
  out["lock_wait_share"] = static_cast<double>(o.counts.lock_wait_ns) / (o.wall_ns * threads);
  out["lock_acquisitions"] = o.counts.lock_acquisitions;
  out["lock_contended"] = o.counts.lock_contended;
  out["cas_attempts"] = o.counts.cas_attempts;
  out["cas_failures"] = o.counts.cas_failures;
  out["nodes_discarded"] = o.counts.nodes_discarded;
  if (o.records != 0) out["bytes_per_record"] = static_cast<double>(o.bytes) / static_cast<double>(o.records);
}

void add_breakdown(nlohmann::ordered_json& out, const TimeBreakdown& t, double redundant_records,
                   std::span<const ThreadAccount> accounts) {
  const double redundant =
      t.records == 0 ? 0.0
                     : t.work * std::clamp(redundant_records / static_cast<double>(t.records), 0.0, 1.0);
  const auto put = [&](std::string_view what, double ns) {
    out[fmt::format("time_{}_share", what)] = ns / t.total;
  };
  put("work", t.work - redundant);
  put("redundant", redundant);
  put("query", t.query);
  put("insert", t.insert);
  put("merge", t.merge);
  put("lock_wait", t.lock_wait);
  put("descheduled_wanting", t.wanting);
  put("descheduled_holding", t.holding);
  put("descheduled_between", t.displaced);
  put("barrier", t.barrier);
  put("other", t.other);
  out["time_unexplained"] = 1.0 - t.sum() / t.total;
  for (const PerfEvent& event : perf_events()) {
    double sum = 0.0;
    bool is_whole = true;
    for (const ThreadAccount& a : accounts) {
      const std::optional<double> value = a.perf().value(event.name);
      is_whole &= value.has_value();
      sum += value.value_or(0.0);
    }
    if (is_whole) out[std::string(event.name)] = sum;
  }
}

void add_synthetic(nlohmann::ordered_json& out, const WorkloadSpec& spec) {
  out["order"] = to_string(spec.order);
  out["accuracy"] = shortest_decimal(spec.a);
  if (spec.starts_filled()) out["layout"] = spec.tidied ? "tidied" : "as_inserted";
  if (spec.kind == WorkloadKind::miss_driven) out["record_cost_us"] = spec.cost_us;
}

void add_ray_traced(nlohmann::ordered_json& out, const WorkloadSpec& spec, const Reference& reference,
                    const TrialOutcome& o) {
  out["integrator"] = to_string(spec.method);
  out["width"] = spec.width;
  out["height"] = spec.height;
  out["order"] = to_string(spec.tiles);
  if (spec.uses_cache()) {
    out["rays_per_record"] = spec.rays;
    out["accuracy"] = shortest_decimal(spec.a);
  } else {
    out["spp"] = spec.spp;
    if (spec.method == Method::hash_cells) out["cell_size"] = shortest_decimal(spec.cell);
  }
  out["rays"] = o.rays.total();
  out["seconds_indirect"] = 1e-9 * o.wall_ns;
  out["rmse"] = o.rmse;
  out["relmse"] = o.relmse;
  out["mean_ratio"] = o.mean_ratio;
  out["reference_relmse"] = reference.relmse;
  out["reference_spp"] = reference.spp;
}

void add_trace(nlohmann::ordered_json& out, const WorkloadSpec& spec, const Trace& trace,
               const TrialOutcome& o) {
  out["integrator"] = trace.context.integrator;
  out["width"] = trace.context.width;
  out["height"] = trace.context.height;
  out["frame_count"] = trace.frames.size();
  out["captured_cache"] = trace.context.cache;
  out["captured_threads"] = trace.context.config.max_sessions;
  out["record_cost_scale"] = spec.scale;
  out["stand_ins"] = o.stand_ins;
  out["same_records"] = o.same_records;
}

}  // namespace icbench
