#include "simulate/simulation.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "core/random.h"
#include "harness/environment.h"
#include "scene/registry.h"
#include "simulate/engine.h"
#include "workload/names.h"
#include "workload/trial_entry.h"

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
    if (spec.tidied) {
      throw std::runtime_error(fmt::format(
          "workload '{}' is laid out anew, which is not simulated; choose layout=as_inserted", spec.name));
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
  std::unique_ptr<SyntheticPlan> synthetic, synthetic_without_work;  // the second if it is another
  std::unique_ptr<TracePlan> trace, trace_without_work;
  // By the streams' number and seed.
  std::map<std::pair<unsigned, std::uint64_t>, std::uint64_t> records_of_one_thread;
};

/// Threads that measure.
struct Simulation::Teams {
  explicit Teams(const Topology& topology) : one(topology, Placement::compact, 1), work(Work::calibrate()) {
    if (topology.units().size() >= 2) two = std::make_unique<ThreadTeam>(topology, Placement::compact, 2);
  }
  ThreadTeam one;
  std::unique_ptr<ThreadTeam> two;  // where there are two units
  Work work;
};

Simulation::~Simulation() = default;

Simulation::Simulation(SimulationRequest request, const Topology& topology, Calibration calibration)
    : request_(std::move(request)), topology_(topology), calibration_(std::move(calibration)) {
  require_simulated(request_);
  for (WorkloadSpec& spec : request_.workloads)
    if (spec.kind == WorkloadKind::trace && spec.checksum == 0) spec.checksum = trace_checksum(spec);
  for (const WorkloadSpec& spec : request_.workloads) workload_keys_.push_back(workload_key(spec));
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
    made->trace = plan_of_trace(spec, spec.scale);
  } else {
    made->synthetic = std::make_unique<SyntheticPlan>(spec, RayTracer(make_scene(spec.scene)), request_.seed);
  }
  plan_ = std::move(made);
  return *plan_;
}

CalibratedPlan Simulation::plan_without_work(std::size_t workload) {
  PlanData& data = plan(workload);
  WorkloadSpec spec = request_.workloads[workload];
  CalibratedPlan out{nullptr, nullptr, workload_keys_[workload]};
  if (spec.kind == WorkloadKind::trace) {
    if (data.trace_without_work == nullptr) data.trace_without_work = plan_of_trace(spec, 0.0);
    out.trace = data.trace_without_work.get();
  } else if (spec.kind == WorkloadKind::miss_driven) {
    if (data.synthetic_without_work == nullptr) {
      spec.cost_us = 0.0;
      data.synthetic_without_work =
          std::make_unique<SyntheticPlan>(spec, RayTracer(make_scene(spec.scene)), request_.seed);
    }
    out.synthetic = data.synthetic_without_work.get();
  } else {
    out.synthetic = data.synthetic.get();
  }
  return out;
}

Simulation::Teams& Simulation::teams() {
  if (teams_ == nullptr) teams_ = std::make_unique<Teams>(topology_);
  return *teams_;
}

std::string Simulation::key(const SimulationPoint& point) const {
  return key_of(point.cache->traits.name, workload_keys_[point.workload]);
}

std::string Simulation::validated_as(const SimulationPoint& point) const {
  const WorkloadSpec& spec = request_.workloads[point.workload];
  if (spec.kind == WorkloadKind::miss_driven)
    return fmt::format("{} at {} us a record", key(point), spec.cost_us);
  if (spec.kind == WorkloadKind::trace) return fmt::format("{} at {} times its cost", key(point), spec.scale);
  return key(point);
}

bool Simulation::is_of_this_machine() const noexcept {
  return calibration_.host_name == request_.host_name && calibration_.cpu_model == request_.cpu_model;
}

const Validation* Simulation::validation_for(const SimulationPoint& point) const {
  const auto& known = calibration_.validation;
  const bool applies = known && known->holds() && known->commit == request_.commit &&
                       known->cores_per_complex == request_.machine.cores_per_complex &&
                       known->cores_per_socket == request_.machine.cores_per_socket && !request_.transfers &&
                       !request_.hand_over && known->errors.contains(validated_as(point));
  return applies ? &*known : nullptr;
}

void Simulation::complete_calibration(const std::function<void(const std::string&)>& tell) {
  for (std::size_t w = 0; w < request_.workloads.size(); ++w) {
    for (const std::string& name : request_.caches) {
      const SimulationPoint point{w, &find_cache(name), 1};
      if (calibration_.costs.contains(key(point))) continue;
      const std::string& workload = request_.workloads[w].name;
      if (!is_of_this_machine()) {
        throw std::runtime_error(fmt::format(
            "calibration '{}' is of machine '{}' ({}) and has no costs of {} under '{}'; measure "
            "them there, or give --recalibrate",
            request_.calibration_path, calibration_.host_name, calibration_.cpu_model, name, workload));
      }
      tell(fmt::format("{}, {}", workload, name));
      Teams& t = teams();
      calibration_.costs[key(point)] = calibrate_cache(*point.cache, plan_without_work(w), t.one, t.two.get(),
                                                       t.work, calibration_, request_.seed);
      if (!request_.calibration_path.empty()) add_costs(calibration_, key(point), request_.calibration_path);
    }
  }
}

Moment Simulation::calibrated(const SimulationPoint& point) const {
  return {calibration_.transfers, calibration_.waits, calibration_.pace, calibration_.costs.at(key(point))};
}

Moment Simulation::measured_now(const SimulationPoint& point, unsigned repetition) {
  Moment out = calibrated(point);
  Teams& t = teams();
  if (t.two != nullptr) {
    const double then = out.transfers.ns[0];
    measure_contention(*t.two, out.transfers, out.waits);
    if (then > 0.0) out.costs.operations.fresh_ns *= out.transfers.ns[0] / then;
  }
  out.pace.alone = measured_pace(t.one, t.work);
  if (t.two != nullptr) out.pace.together = measured_pace(*t.two, t.work);
  out.costs = costs_now(out.costs, *point.cache, plan_without_work(point.workload), t.one, t.work,
                        repetition_seed(request_.seed, repetition));
  return out;
}

Entry Simulation::run(const SimulationPoint& point, unsigned repetition) {
  return run(point, repetition, calibrated(point));
}

Entry Simulation::run(const SimulationPoint& point, unsigned repetition, const Moment& moment) {
  const WorkloadSpec& spec = request_.workloads[point.workload];
  PlanData& data = plan(point.workload);
  const std::uint64_t seed = repetition_seed(request_.seed, repetition);
  MachineModel machine = request_.machine;
  machine.cores = point.cores;
  machine.transfers = request_.transfers.value_or(moment.transfers);
  machine.pace = moment.pace;
  WaitCosts waits = moment.waits;
  if (request_.hand_over) request_.hand_over->apply_to(waits);
  const Mechanism mechanism = mechanism_of(point.cache->traits);
  const auto program =
      data.trace ? simulated_program(*data.trace) : simulated_program(*data.synthetic, point.cores, seed);
  const CacheConfig config = program->config(point.cores);
  const auto cache = mechanism.node_locks == Mechanism::NodeLocks::none
                         ? point.cache->stepped(config)
                         : make_logged_node_locks(point.cache->traits, config);
  const SimulatedOutcome o = simulate(*program, *cache, {machine, waits, moment.costs, mechanism, seed});

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
  const Validation* const validation = validation_for(point);
  c["validated_to_threads"] = validation != nullptr ? validation->threads : 0;
  if (validation != nullptr) c["validated_error"] = validation->errors.at(validated_as(point));
  c["calibration"] = request_.calibration_path;
  add_subject(c, point.cache, spec);
  if (data.trace) c["scene"] = data.trace->trace().context.scene;
  c["placement"] = "compact";
  c["oversubscribed"] = false;
  c["cores"] = point.cores;
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
    const unsigned streams = data.synthetic ? data.synthetic->streams_of_one_thread(point.cores) : 1;
    const auto [at, is_new] = data.records_of_one_thread.try_emplace({streams, data.trace ? 0 : seed}, 0);
    if (is_new) {
      at->second = data.trace ? data.trace->records_of_one_thread()
                              : data.synthetic->records_of_one_thread(streams, seed);
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
