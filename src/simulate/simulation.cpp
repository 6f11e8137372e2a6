#include "simulate/simulation.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "core/random.h"
#include "harness/environment.h"
#include "scene/registry.h"
#include "simulate/engine.h"
#include "workload/names.h"
#include "workload/sweep.h"

namespace icbench {

std::vector<SimulationPoint> simulation_points(const SimulationRequest& request) {
  std::vector<SimulationPoint> out;
  for (std::size_t w = 0; w < request.workloads.size(); ++w) {
    for (const std::string& name : request.caches) {
      const CacheEntry& cache = find_cache(name);
      for (const unsigned cores : request.cores) {
        if (!cache.traits.single_thread || cores == 1) out.push_back({w, &cache, cores});
      }
    }
  }
  return out;
}

void require_simulated(const SimulationRequest& request) {
  for (const WorkloadSpec& spec : request.workloads) {
    if (spec.kind == WorkloadKind::ray_traced) {
      throw std::runtime_error(fmt::format(
          "workload '{}' traces rays, which take no virtual time; capture it with icbench trace capture "
          "and simulate trace:file=PATH",
          spec.name));
    }
    if (spec.kind == WorkloadKind::trace) trace_checksum(spec);
  }
  for (const std::string& name : request.caches) mechanism_of(find_cache(name).traits);
  if (simulation_points(request).empty()) {
    throw std::runtime_error(
        "there is nothing to simulate: caches for a single thread run with --cores 1 only");
  }
}

struct Simulation::PlanData {
  std::size_t workload = 0;
  std::unique_ptr<SyntheticPlan> synthetic;
  std::unique_ptr<TracePlan> trace;
  std::map<std::uint64_t, std::uint64_t> records_of_one_thread;  // by seed
};

Simulation::~Simulation() = default;

Simulation::Simulation(SimulationRequest request, const Topology& topology, Calibration calibration)
    : request_(std::move(request)), topology_(topology), calibration_(std::move(calibration)) {
  require_simulated(request_);
  request_.machine.transfers = request_.transfers.value_or(calibration_.transfers);
}

std::string Simulation::name_of(const SimulationPoint& p) const {
  return fmt::format("simulate/{}/{}/threads:{}", request_.workloads[p.workload].name, p.cache->traits.name,
                     p.cores);
}

Simulation::PlanData& Simulation::plan(std::size_t workload) {
  if (plan_ != nullptr && plan_->workload == workload) return *plan_;
  plan_.reset();
  const WorkloadSpec& spec = request_.workloads[workload];
  auto made = std::make_unique<PlanData>();
  made->workload = workload;
  if (spec.kind == WorkloadKind::trace) {
    made->trace = std::make_unique<TracePlan>(read_trace(spec.file), spec.scale);
  } else {
    made->synthetic = std::make_unique<SyntheticPlan>(spec, RayTracer(make_scene(spec.scene)), request_.seed);
  }
  plan_ = std::move(made);
  return *plan_;
}

void Simulation::complete_calibration(const std::function<void(const std::string&)>& tell) {
  std::unique_ptr<ThreadTeam> one, two;
  std::optional<Work> work;
  for (std::size_t w = 0; w < request_.workloads.size(); ++w) {
    WorkloadSpec spec = request_.workloads[w];
    const std::string key = workload_key(spec);
    CalibratedPlan calibrated{nullptr, nullptr, key};
    std::unique_ptr<SyntheticPlan> without_work;
    std::unique_ptr<TracePlan> trace_without_work;
    for (const std::string& name : request_.caches) {
      const CacheEntry& cache = find_cache(name);
      if (calibration_.costs.contains(key_of(name, key))) continue;
      if (calibration_.host_name != request_.host_name) {
        throw std::runtime_error(
            fmt::format("calibration '{}' is of machine '{}' and has no costs of {} under '{}'; measure them "
                        "there, or give "
                        "--recalibrate",
                        request_.calibration_path, calibration_.host_name, name, spec.name));
      }
      tell(fmt::format("{}, {}", spec.name, name));
      if (one == nullptr) {
        one = std::make_unique<ThreadTeam>(topology_, Placement::compact, 1);
        if (topology_.units().size() >= 2)
          two = std::make_unique<ThreadTeam>(topology_, Placement::compact, 2);
        work = Work::calibrate();
      }
      if (spec.kind == WorkloadKind::trace && trace_without_work == nullptr) {
        trace_without_work = std::make_unique<TracePlan>(read_trace(spec.file), 0.0);
        calibrated.trace = trace_without_work.get();
      } else if (spec.kind == WorkloadKind::miss_driven && without_work == nullptr) {
        spec.cost_us = 0.0;
        without_work =
            std::make_unique<SyntheticPlan>(spec, RayTracer(make_scene(spec.scene)), request_.seed);
        calibrated.synthetic = without_work.get();
      } else if (spec.kind != WorkloadKind::trace && spec.kind != WorkloadKind::miss_driven) {
        calibrated.synthetic = plan(w).synthetic.get();
      }
      calibration_.costs[key_of(name, key)] =
          calibrate_cache(cache, calibrated, *one, two.get(), *work, calibration_, request_.seed);
      write_calibration(calibration_, request_.calibration_path);
    }
  }
}

Entry Simulation::run(const SimulationPoint& point, unsigned repetition) {
  const WorkloadSpec& spec = request_.workloads[point.workload];
  PlanData& data = plan(point.workload);
  const std::uint64_t seed = hash_keys(request_.seed, repetition, 8);  // as Sweep's
  MachineModel machine = request_.machine;
  machine.cores = point.cores;
  const Mechanism mechanism = mechanism_of(point.cache->traits);
  const auto program =
      data.trace ? simulated_program(*data.trace) : simulated_program(*data.synthetic, point.cores, seed);
  const CacheConfig config = program->config(point.cores);
  const auto cache = mechanism.locks_nodes ? make_logged_node_locks(config) : point.cache->stepped(config);
  const std::string key = key_of(point.cache->traits.name, workload_key(spec));
  const CacheCosts& costs = calibration_.costs.at(key);
  const SimulatedOutcome o =
      simulate(*program, *cache, {machine, calibration_.waits, costs, mechanism, seed});

  Entry entry;
  entry.name = name_of(point);
  entry.repetition_index = repetition;
  entry.threads = point.cores;
  entry.real_time = 1e-6 * o.wall_ns;
  entry.cpu_time = 1e-6 * o.busy_ns;
  entry.time_unit = "ms";
  entry.items_per_second = 1e9 * static_cast<double>(o.operations) / o.wall_ns;
  auto& c = entry.counters;
  c["simulated"] = true;
  c["validated_to_threads"] = calibration_.validation && calibration_.validation->holds_for(key)
                                  ? calibration_.validation->threads
                                  : 0;
  c["calibration"] = request_.calibration_path;
  c["cache"] = point.cache->traits.name;
  c["workload"] = spec.name;
  c["workload_kind"] = to_string(spec.kind);
  c["structure"] = point.cache->traits.structure;
  c["mechanism"] = point.cache->traits.mechanism;
  c["consistency"] = to_string(point.cache->traits.consistency);
  c["placement"] = "compact";
  c["oversubscribed"] = false;
  c["cores"] = point.cores;
  c["scene"] = data.trace ? data.trace->trace().context.scene : spec.scene;
  const double thread_ns = o.wall_ns * point.cores;
  c["utilisation"] = std::min(1.0, o.busy_ns / thread_ns);
  c["merge_ms"] = 1e-6 * o.merge_ns;
  c["queries"] = o.queries;
  c["hits"] = o.hits;
  c["inserts"] = o.inserts;
  c["records"] = o.records;
  c["records_read_per_query"] = o.records_read_per_query;
  c["records_valid_per_query"] = o.records_valid_per_query;
  c["lock_wait_share"] = o.lock_wait_ns / thread_ns;
  c["lock_acquisitions"] = o.lock_acquisitions;
  c["lock_contended"] = o.lock_contended;
  c["work_share"] = o.work_ns / thread_ns;
  c["transfer_share"] = o.transfer_ns / thread_ns;
  c["records_digest"] = fmt::format("{:016x}", o.digest);
  const bool keeps = point.cache->traits.consistency != Consistency::none;
  if (keeps && (spec.kind == WorkloadKind::miss_driven || spec.kind == WorkloadKind::trace)) {
    const auto [at, is_new] = data.records_of_one_thread.try_emplace(data.trace ? 0 : seed, 0);
    if (is_new) {
      at->second =
          data.trace ? data.trace->records_of_one_thread() : data.synthetic->records_of_one_thread(seed);
    }
    c["redundant_records"] = static_cast<std::int64_t>(o.records) - static_cast<std::int64_t>(at->second);
  }
  if (data.trace) {
    c["integrator"] = data.trace->trace().context.integrator;
    c["record_cost_scale"] = spec.scale;
    c["same_records"] = keeps && o.same_records;
  } else {
    c["order"] = to_string(spec.order);
    c["accuracy"] = shortest_decimal(spec.a);
    if (spec.kind == WorkloadKind::miss_driven) c["record_cost_us"] = spec.cost_us;
  }
  return entry;
}

}  // namespace icbench
