#include "workload/sweep.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "caches/session.h"
#include "core/random.h"
#include "files/memory.h"
#include "harness/timeline.h"
#include "scene/registry.h"
#include "workload/names.h"
#include "workload/stepped_cache.h"

namespace icbench {
namespace {

/// Operations and random numbers of a repetition: equal for all caches and thread counts.
std::uint64_t seed_of(const SweepRequest& request, unsigned repetition) {
  return hash_keys(request.seed, repetition, 8);
}

struct Percentile {
  std::string_view name;
  double share;
  bool always;
};
constexpr Percentile kPercentiles[] = {
    {"p10", 0.1, true},    {"p25", 0.25, true},      {"p50", 0.5, true},       {"p75", 0.75, true},
    {"p90", 0.9, true},    {"p95", 0.95, true},      {"p99", 0.99, true},      {"p995", 0.995, false},
    {"p999", 0.999, true}, {"p9995", 0.9995, false}, {"p9999", 0.9999, false}, {"p99999", 0.99999, false}};

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

namespace {

/// Where all time of a trial went, as shares of wall time x threads, and what the hardware counted.
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

}  // namespace

struct Sweep::SceneData {
  explicit SceneData(const std::string& name) : rays(make_scene(name)) {}
  RayTracer rays;
};

struct Sweep::ViewData {
  PrimaryHits primary;
  Reference reference;
};

struct Sweep::PlanData {
  std::size_t workload;
  std::unique_ptr<SyntheticPlan> synthetic;
  std::unique_ptr<RayTracedPlan> ray_traced;
  std::unique_ptr<TracePlan> trace;
  std::map<std::pair<unsigned, std::uint64_t>, std::uint64_t>
      records_of_one_thread;  // by the streams' number and seed
};

std::uint64_t trace_checksum(const WorkloadSpec& spec) {
  if (spec.file.empty()) {
    throw std::runtime_error(fmt::format(
        "workload '{}' names no file; give trace:file=PATH, which icbench trace capture writes", spec.name));
  }
  return read_trace_header(spec.file).checksum;
}

Sweep::~Sweep() = default;

Sweep::Sweep(SweepRequest request, const Topology& topology)
    : request_(std::move(request)),
      topology_(topology),
      work_(Work::calibrate()),
      tick_rate_(calibrate_ticks()) {
  std::size_t points_in_all = 0;
  for (std::size_t w = 0; w < request_.workloads.size(); ++w) points_in_all += points(w, 0).size();
  for (WorkloadSpec& spec : request_.workloads) {
    if (spec.kind == WorkloadKind::trace && spec.checksum == 0) spec.checksum = trace_checksum(spec);
    if (spec.kind != WorkloadKind::ray_traced) continue;
    // Hits, the reference and its halves, and the trial's own image.
    constexpr std::uint64_t kBytesPerPixel = sizeof(Hit) + 4 * sizeof(glm::vec3);
    require_memory(fmt::format("workload '{}'", spec.name),
                   std::uint64_t{spec.width} * spec.height * kBytesPerPixel);
  }
  for (std::size_t w = 0; w < request_.workloads.size(); ++w) require_room(w);
  if (points_in_all == 0) {
    throw std::runtime_error(
        "this sweep has no point: caches for a single thread run with --threads 1 only, those that cannot "
        "be tidied (icbench list caches) without layout=tidied only");
  }
}

void Sweep::require_room(std::size_t workload) const {
  const WorkloadSpec& spec = request_.workloads[workload];
  if (spec.kind == WorkloadKind::trace || spec.kind == WorkloadKind::ray_traced) return;
  std::map<const CacheEntry*, unsigned> most;  // threads
  for (const SweepPoint& p : points(workload, 0)) most[p.cache] = std::max(most[p.cache], p.threads);
  for (const auto& [cache, threads] : most) {
    CacheConfig config = SyntheticPlan::config(spec, threads);
    config.bounds = {glm::vec3(0.0f), glm::vec3(1.0f)};  // whatever they are
    try {
      const auto made = cache->stepped(config);
      for (unsigned t = 0; t < threads; ++t) made->session(t);
    } catch (const std::exception& e) {
      throw std::runtime_error(fmt::format("workload '{}' with {} and {} threads: {}", spec.name,
                                           cache->traits.name, threads, e.what()));
    }
  }
}

std::vector<SweepPoint> Sweep::points(std::size_t workload, unsigned repetition) const {
  std::vector<SweepPoint> out;
  for (const unsigned threads : request_.threads) {
    if (!request_.workloads[workload].uses_cache()) {
      out.push_back({workload, nullptr, threads});
      continue;
    }
    for (const std::string& name : request_.caches) {
      const CacheEntry& cache = find_cache(name);
      if (can_run(cache, request_.workloads[workload], threads)) out.push_back({workload, &cache, threads});
    }
  }
  Pcg32 random(hash_keys(request_.seed, workload, repetition));
  std::shuffle(out.begin(), out.end(), random);
  return out;
}

std::string Sweep::name_of(const SweepPoint& p) const {
  return fmt::format("sweep/{}/{}/threads:{}", request_.workloads[p.workload].name, p.cache_name(),
                     p.threads);
}

const RayTracer& Sweep::tracer(const std::string& scene) {
  auto& slot = scenes_[scene];
  if (slot == nullptr) slot = std::make_unique<SceneData>(scene);
  return slot->rays;
}

const Sweep::ViewData& Sweep::view(const WorkloadSpec& spec) {
  auto& slot = views_[fmt::format("{} {}x{}", spec.scene, spec.width, spec.height)];
  if (slot == nullptr) {
    const RayTracer& rays = tracer(spec.scene);
    slot = std::make_unique<ViewData>();
    slot->primary = centre_hits(rays, static_cast<int>(spec.width), static_cast<int>(spec.height));
    slot->reference =
        make_reference(rays, slot->primary, request_.reference_spp, hash_keys(request_.seed, 9));
  }
  return *slot;
}

Sweep::PlanData& Sweep::plan(std::size_t workload) {
  if (plan_ != nullptr && plan_->workload == workload) return *plan_;
  plan_.reset();  // the last workload's memory goes before the next one's comes
  const WorkloadSpec& spec = request_.workloads[workload];
  auto made = std::make_unique<PlanData>();
  made->workload = workload;
  if (spec.kind == WorkloadKind::trace) {
    made->trace = plan_of_trace(spec, spec.scale);
  } else if (spec.kind == WorkloadKind::ray_traced) {
    const ViewData& data = view(spec);
    made->ray_traced = std::make_unique<RayTracedPlan>(spec, tracer(spec.scene), data.primary, data.reference,
                                                       request_.seed);
  } else {
    made->synthetic = std::make_unique<SyntheticPlan>(spec, tracer(spec.scene), request_.seed);
  }
  plan_ = std::move(made);
  return *plan_;
}

std::uint64_t Sweep::records_of_one_thread(PlanData& plan, unsigned threads, std::uint64_t seed) {
  const unsigned streams = plan.synthetic ? plan.synthetic->streams_of_one_thread(threads) : 1;
  const auto [at, is_new] = plan.records_of_one_thread.try_emplace({streams, seed}, 0);
  if (is_new) {
    at->second = plan.ray_traced ? plan.ray_traced->records_of_one_thread(seed)
                 : plan.trace    ? plan.trace->records_of_one_thread()
                                 : plan.synthetic->records_of_one_thread(streams, seed);
  }
  return at->second;
}

ThreadTeam& Sweep::team(unsigned threads) {
  auto& slot = teams_[threads];
  if (slot == nullptr) slot = std::make_unique<ThreadTeam>(topology_, request_.placement, threads);
  return *slot;
}

Entry Sweep::run(const SweepPoint& point, unsigned repetition, Timeline* timeline) {
  const WorkloadSpec& spec = request_.workloads[point.workload];
  PlanData& data = plan(point.workload);
  TrialSetup setup{team(point.threads), work_, seed_of(request_, repetition), request_.latency_every};
  std::vector<ThreadAccount> accounts;
  if (request_.breakdown || timeline != nullptr) {
    accounts.reserve(point.threads);
    for (unsigned t = 0; t < point.threads; ++t)
      accounts.emplace_back(tick_rate_, timeline == nullptr ? 0 : timeline->spans_of(point.threads));
    if (request_.breakdown) setup.team.run([&](unsigned t) { accounts[t].count_hardware(); });
    setup.accounts = accounts;
    setup.timeline = timeline;
  }
  TrialOutcome o = point.cache == nullptr ? run_uncached_trial(*data.ray_traced, setup)
                   : data.ray_traced      ? point.cache->ray_traced(*data.ray_traced, setup)
                   : data.trace           ? point.cache->trace(*data.trace, setup)
                                          : point.cache->synthetic(*data.synthetic, setup);
  for (const ThreadAccount& account : accounts) o.time.add_thread(account.thread_ticks(), tick_rate_);
  if (point.cache == nullptr) o.time.work += std::exchange(o.time.other, 0.0);  // nothing but paths
  if (!o.error.empty()) {
    throw InvalidTrial(fmt::format("{} (repetition {}): {}", name_of(point), repetition, o.error));
  }

  Entry entry = entry_of(name_of(point), request_.repetitions, repetition, point.threads, o);
  entry.items_per_second = 1e9 * static_cast<double>(o.operations) / o.wall_ns;

  auto& c = entry.counters;
  c["cache"] = point.cache_name();
  c["workload"] = spec.name;
  c["workload_kind"] = to_string(spec.kind);
  c["structure"] = point.cache == nullptr ? "none" : point.cache->traits.structure;
  c["mechanism"] = point.cache == nullptr ? "none" : point.cache->traits.mechanism;
  c["consistency"] = to_string(point.cache == nullptr ? Consistency::none : point.cache->traits.consistency);
  c["placement"] = to_string(request_.placement);
  c["oversubscribed"] = topology_.oversubscribed(point.threads);
  c["scene"] = data.trace ? data.trace->trace().context.scene : spec.scene;
  const double units = static_cast<double>(std::min<std::size_t>(point.threads, topology_.units().size()));
  c["utilisation"] = std::min(1.0, o.cpu_ns / (o.wall_ns * units));
  c["merge_ms"] = 1e-6 * o.merge_ns;
  c["start_skew_ms"] = 1e-6 * o.start_skew_ns;

  if (point.cache != nullptr) {
    c["queries"] = data.trace ? o.queries : o.counts.queries;
    c["hits"] = o.counts.hits;
    c["inserts"] = o.counts.inserted;
    c["records"] = o.records;
    c["records_read_per_query"] = o.counts.queries == 0 ? 0.0
                                                        : static_cast<double>(o.counts.records_read) /
                                                              static_cast<double>(o.counts.queries);
    c["records_valid_per_query"] = o.counts.queries == 0 ? 0.0
                                                         : static_cast<double>(o.counts.records_valid) /
                                                               static_cast<double>(o.counts.queries);
    c["lock_wait_share"] = static_cast<double>(o.counts.lock_wait_ns) / (o.wall_ns * point.threads);
    c["lock_acquisitions"] = o.counts.lock_acquisitions;
    c["lock_contended"] = o.counts.lock_contended;
    c["cas_attempts"] = o.counts.cas_attempts;
    c["cas_failures"] = o.counts.cas_failures;
    c["nodes_discarded"] = o.counts.nodes_discarded;
    if (o.records != 0) c["bytes_per_record"] = static_cast<double>(o.bytes) / static_cast<double>(o.records);
    const bool keeps = point.cache->traits.consistency != Consistency::none;
    double redundant = 0.0;
    if (keeps && (spec.kind == WorkloadKind::miss_driven || spec.kind == WorkloadKind::ray_traced ||
                  spec.kind == WorkloadKind::trace)) {
      const std::int64_t more =
          static_cast<std::int64_t>(o.records) -
          static_cast<std::int64_t>(records_of_one_thread(data, point.threads, data.trace ? 0 : setup.seed));
      c["redundant_records"] = more;
      redundant = static_cast<double>(more);
    }
    if (request_.breakdown) add_breakdown(c, o.time, redundant, accounts);
    add_latency(c, "query", o.query_ticks, tick_rate_);
    add_latency(c, "insert", o.insert_ticks, tick_rate_);
  }
  if (point.cache == nullptr && request_.breakdown) add_breakdown(c, o.time, 0.0, accounts);
  if (spec.kind == WorkloadKind::ray_traced) {
    c["integrator"] = to_string(spec.method);
    c["width"] = spec.width;
    c["height"] = spec.height;
    c["order"] = to_string(spec.tiles);
    if (!spec.uses_cache()) {
      c["spp"] = spec.spp;
      if (spec.method == Method::hash_cells) c["cell_size"] = shortest_decimal(spec.cell);
    } else {
      c["rays_per_record"] = spec.rays;
      c["accuracy"] = shortest_decimal(spec.a);
    }
    c["rays"] = o.rays.total();
    c["seconds_indirect"] = 1e-9 * o.wall_ns;
    c["rmse"] = o.rmse;
    c["relmse"] = o.relmse;
    c["mean_ratio"] = o.mean_ratio;
    c["reference_relmse"] = data.ray_traced->reference().relmse;
    c["reference_spp"] = data.ray_traced->reference().spp;
  } else if (data.trace) {
    const Trace& trace = data.trace->trace();
    c["integrator"] = trace.context.integrator;
    c["width"] = trace.context.width;
    c["height"] = trace.context.height;
    c["frame_count"] = trace.frames.size();
    c["captured_cache"] = trace.context.cache;
    c["captured_threads"] = trace.context.config.max_sessions;
    c["record_cost_scale"] = spec.scale;
    c["stand_ins"] = o.stand_ins;
    c["same_records"] = o.same_records;
  } else {
    c["order"] = to_string(spec.order);
    c["accuracy"] = shortest_decimal(spec.a);
    if (spec.starts_filled()) c["layout"] = spec.tidied ? "tidied" : "as_inserted";
    if (spec.kind == WorkloadKind::miss_driven) c["record_cost_us"] = spec.cost_us;
  }
  return entry;
}

}  // namespace icbench
