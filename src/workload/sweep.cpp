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
#include "workload/trial_entry.h"

namespace icbench {

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
  // By the streams' number and seed.
  std::map<std::pair<unsigned, std::uint64_t>, std::uint64_t> records_of_one_thread;
};

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

bool Sweep::makes_redundant_records(const SweepPoint& point) const {
  const WorkloadKind kind = request_.workloads[point.workload].kind;
  return point.cache->traits.consistency != Consistency::none &&
         (kind == WorkloadKind::miss_driven || kind == WorkloadKind::ray_traced ||
          kind == WorkloadKind::trace);
}

Entry Sweep::run(const SweepPoint& point, unsigned repetition, Timeline* timeline) {
  const WorkloadSpec& spec = request_.workloads[point.workload];
  PlanData& data = plan(point.workload);
  TrialSetup setup{team(point.threads), work_, repetition_seed(request_.seed, repetition),
                   request_.latency_every};
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
  add_subject(c, point.cache, spec);
  if (data.trace) c["scene"] = data.trace->trace().context.scene;
  c["placement"] = to_string(request_.placement);
  c["oversubscribed"] = topology_.oversubscribed(point.threads);
  const double units = static_cast<double>(std::min<std::size_t>(point.threads, topology_.units().size()));
  c["utilisation"] = std::min(1.0, o.cpu_ns / (o.wall_ns * units));
  c["merge_ms"] = 1e-6 * o.merge_ns;
  c["start_skew_ms"] = 1e-6 * o.start_skew_ns;

  double redundant = 0.0;
  if (point.cache != nullptr) {
    add_counts(c, o, point.threads);
    if (data.trace) c["queries"] = o.queries;
    if (makes_redundant_records(point)) {
      const std::uint64_t needed = records_of_one_thread(data, point.threads, data.trace ? 0 : setup.seed);
      const auto more = static_cast<std::int64_t>(o.records) - static_cast<std::int64_t>(needed);
      c["redundant_records"] = more;
      redundant = static_cast<double>(more);
    }
    add_latency(c, "query", o.query_ticks, tick_rate_);
    add_latency(c, "insert", o.insert_ticks, tick_rate_);
  }
  if (request_.breakdown) add_breakdown(c, o.time, redundant, accounts);
  if (data.ray_traced) {
    add_ray_traced(c, spec, data.ray_traced->reference(), o);
  } else if (data.trace) {
    add_trace(c, spec, data.trace->trace(), o);
  } else {
    add_synthetic(c, spec);
  }
  return entry;
}

}  // namespace icbench
