#include "simulate/validation.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <stdexcept>

#include "harness/environment.h"
#include "harness/statistics.h"
#include "workload/sweep.h"

namespace icbench {
namespace {

// Of the records, and of the time: what errors are at least taken relative to.
constexpr double kFloor = 0.01;

double mean(std::span<const double> v) {
  return std::accumulate(v.begin(), v.end(), 0.0) / static_cast<double>(v.size());
}

/// Of moments, those in the middle: of each cache and workload by what a trial on one thread takes, of the machine by
/// what a line takes.
class UsualMoment {
 public:
  void add(const std::string& key, const Moment& moment) {
    costs_[key].push_back(moment);
    machine_.push_back(moment);
  }
  void put_into(Calibration& out) {
    if (machine_.empty()) return;
    const Moment& usual = middle(machine_, [](const Moment& m) { return m.transfers.ns[0]; });
    out.transfers = usual.transfers;
    out.waits = usual.waits;
    out.pace = usual.pace;
    for (auto& [key, moments] : costs_) {
      const Moment& one = middle(moments, [](const Moment& m) { return m.costs.trial_ns; });
      out.costs[key] = one.costs;
      // First sights go with transfers.
      if (one.transfers.ns[0] > 0.0)
        out.costs[key].operations.fresh_ns *= usual.transfers.ns[0] / one.transfers.ns[0];
    }
  }

 private:
  template <class F>
  static const Moment& middle(std::vector<Moment>& moments, F&& of) {
    const auto at = moments.begin() + static_cast<std::ptrdiff_t>((moments.size() - 1) / 2);
    std::nth_element(moments.begin(), at, moments.end(),
                     [&](const Moment& a, const Moment& b) { return of(a) < of(b); });
    return *at;
  }

  std::map<std::string, std::vector<Moment>> costs_;
  std::vector<Moment> machine_;
};

double throughput_off_by(const Rounds& simulated, const Rounds& measured) {
  std::vector<double> ratios;
  for (std::size_t i = 0; i < simulated.throughput.size(); ++i)
    ratios.push_back(simulated.throughput[i] / measured.throughput[i]);
  return ratios.empty() ? 0.0 : std::abs(median(ratios) - 1.0);
}

}  // namespace

void Rounds::add(const Entry& e) {
  throughput.push_back(e.items_per_second.value_or(0.0));
  redundant.push_back(e.counters.value("redundant_records", 0.0));
  records.push_back(e.counters.value("records", 0.0));
  waiting.push_back(e.counters.value("lock_wait_share", 0.0));
}

double Rounds::redundant_mean() const { return mean(redundant); }

const Entry& ComparedPoint::usual() const {
  std::vector<const Entry*> order;
  for (const Entry& e : entries) order.push_back(&e);
  const auto at = order.begin() + static_cast<std::ptrdiff_t>((order.size() - 1) / 2);
  std::nth_element(order.begin(), at, order.end(), [](const Entry* a, const Entry* b) {
    return a->items_per_second.value_or(0.0) < b->items_per_second.value_or(0.0);
  });
  return **at;
}

double ComparedPoint::throughput_error() const { return throughput_off_by(simulated, measured); }

double ComparedPoint::file_error() const { return throughput_off_by(by_file, measured); }

double ComparedPoint::redundant_error() const {
  return std::abs(simulated.redundant_mean() - measured.redundant_mean()) /
         std::max({std::abs(measured.redundant_mean()), kFloor * mean(measured.records), 1.0});
}

double ComparedPoint::waiting_error() const {
  return std::abs(median(simulated.waiting) - median(measured.waiting)) /
         std::max(median(measured.waiting), kFloor);
}

std::vector<unsigned> validated_cores(const Topology& topology) {
  const auto units = static_cast<unsigned>(topology.units().size());
  if (units < 2) {
    throw std::runtime_error(
        "a validation needs two processing units: what one thread does is what the costs are from");
  }
  std::vector<unsigned> out;
  for (unsigned n = 1; n < units; n *= 2) out.push_back(n);
  out.push_back(units);
  return out;
}

void require_this_machine(Simulation& simulation) {
  if (simulation.is_of_this_machine()) return;
  throw std::runtime_error(fmt::format(
      "calibration '{}' is of machine '{}' ({}), which this is not; validate it there, or give --recalibrate",
      simulation.request().calibration_path, simulation.calibration().host_name,
      simulation.calibration().cpu_model));
}

std::vector<ComparedPoint> compare_in_rounds(Simulation& simulation, const Topology& topology,
                                             unsigned rounds, bool is_warm,
                                             const std::function<void(const std::string&)>& tell) {
  const SimulationRequest& r = simulation.request();
  require_this_machine(simulation);
  SweepRequest real;
  real.workloads = r.workloads;
  real.caches = r.caches;
  real.threads = r.cores;
  real.seed = r.seed;
  real.repetitions = rounds;
  Sweep sweep(real, topology);
  std::map<std::string, std::size_t> index;
  std::vector<ComparedPoint> all;
  for (const SimulationPoint& point : simulation.points()) {
    index[simulation.name_of(point)] = all.size();
    all.push_back({point});
  }
  UsualMoment usual;
  for (std::size_t w = 0; w < r.workloads.size(); ++w) {
    for (unsigned i = is_warm ? 1 : 0; i <= rounds; ++i) {
      for (const SweepPoint& p : sweep.points(w, i)) {
        const SimulationPoint point{w, p.cache, p.threads};
        const std::string name = simulation.name_of(point);
        const Moment moment = simulation.measured_now(point, i);
        const Entry measured = sweep.run(p, i);
        if (i != 0) {
          usual.add(simulation.key(point), moment);
          ComparedPoint& compared = all[index.at(name)];
          compared.measured.add(measured);
          const Entry simulated = simulation.run(point, i, moment);
          compared.simulated.add(simulated);
          compared.entries.push_back(simulated);
        }
        tell(name);
      }
    }
  }
  usual.put_into(simulation.calibration());
  for (ComparedPoint& compared : all) {
    for (unsigned i = 1; i <= rounds && compared.point.cores != 1; ++i)
      compared.by_file.add(simulation.run(compared.point, i));
  }
  return all;
}

Validation validation_of(const Simulation& simulation, std::span<const ComparedPoint> points) {
  Validation out;
  std::vector<double> throughput, by_file, redundant, waiting;
  for (const ComparedPoint& c : points) {
    out.threads = std::max(out.threads, c.point.cores);
    if (c.point.cores == 1) continue;
    out.errors[simulation.validated_as(c.point)] =
        c.throughput_error();  // of the most threads, which come last
    throughput.push_back(c.throughput_error());
    by_file.push_back(c.file_error());
    if (c.usual().counters.contains("redundant_records")) redundant.push_back(c.redundant_error());
    if (c.usual().counters.value("lock_acquisitions", 0.0) > 0.0) waiting.push_back(c.waiting_error());
  }
  const auto or_none = [](const std::vector<double>& v) { return v.empty() ? 0.0 : median(v); };
  out.points = static_cast<unsigned>(throughput.size());
  out.records_points = static_cast<unsigned>(redundant.size());
  out.waiting_points = static_cast<unsigned>(waiting.size());
  out.file_error = or_none(by_file);
  out.throughput_error = or_none(throughput);
  out.records_error = or_none(redundant);
  out.waiting_error = or_none(waiting);
  out.cores_per_complex = simulation.request().machine.cores_per_complex;
  out.cores_per_socket = simulation.request().machine.cores_per_socket;
  out.date = date_now();
  out.commit = simulation.request().commit;
  return out;
}

Entry row_of(const ComparedPoint& compared, const Validation& outcome) {
  Entry row = compared.usual();
  auto& c = row.counters;
  // By this validation, not by one that was there when the rounds were simulated.
  c["validated_to_threads"] = outcome.holds() ? outcome.threads : 0;
  c.erase("validated_error");
  if (outcome.holds() && compared.point.cores != 1) c["validated_error"] = compared.throughput_error();
  c["rounds"] = compared.measured.throughput.size();
  c["measured_items_per_second"] = median(compared.measured.throughput);
  c["measured_redundant_records"] = compared.measured.redundant_mean();
  c["measured_lock_wait_share"] = median(compared.measured.waiting);
  c["error_items_per_second"] = compared.throughput_error();
  if (!compared.by_file.throughput.empty()) c["error_items_per_second_by_file"] = compared.file_error();
  c["error_redundant_records"] = compared.redundant_error();
  c["error_lock_wait_share"] = compared.waiting_error();
  return row;
}

}  // namespace icbench
