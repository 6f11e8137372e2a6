// Sweeps in virtual time: workloads x caches x cores, each a trial of the engine that becomes one row of results.
//
// Rows have the fields of sweeps that time and records give (plots/FIELDS.md), "simulate/" before their names,
// "simulated": true, and up to how many threads simulated times were validated on the machine of the calibration.
// Nothing that draws measurements takes them.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "harness/results.h"
#include "harness/topology.h"
#include "simulate/calibration.h"
#include "workload/spec.h"

namespace icbench {

/// Most virtual cores.
inline constexpr unsigned kMaxVirtualCores = 1024;

struct SimulationRequest {
  std::vector<WorkloadSpec> workloads;
  std::vector<std::string> caches;
  std::vector<unsigned> cores;
  MachineModel machine{};  ///< all but cores and transfers, which a point and the calibration give
  /// Instead of the calibration's; what is simulated so was not validated.
  std::optional<Transfers> transfers{};
  std::optional<HandOver> hand_over{};  ///< likewise
  std::uint64_t seed = 1;
  std::string calibration_path;      ///< empty: kept nowhere
  std::string host_name, cpu_model;  ///< of this machine
  std::string commit;                ///< of this program
};

struct SimulationPoint {
  std::size_t workload;
  const CacheEntry* cache;
  unsigned cores;
};

/// In order. Caches for a single thread appear with one core only.
std::vector<SimulationPoint> simulation_points(const SimulationRequest& request);

/// What the calibration says of a point, at one moment.
struct Moment {
  Transfers transfers;
  WaitCosts waits;
  WorkPace pace;
  CacheCosts costs;
};

class Simulation {
 public:
  /// Throws as require_simulated does.
  Simulation(SimulationRequest request, const Topology& topology, Calibration calibration);
  ~Simulation();

  const SimulationRequest& request() const noexcept { return request_; }
  Calibration& calibration() noexcept { return calibration_; }

  std::vector<SimulationPoint> points() const { return simulation_points(request_); }
  /// "simulate/WORKLOAD/CACHE/threads:N".
  std::string name_of(const SimulationPoint& point) const;

  /// What the calibration knows the costs of a point's cache and workload by.
  std::string key(const SimulationPoint& point) const;
  /// Whether the calibration's costs are of this machine, as far as names tell.
  bool is_of_this_machine() const noexcept;
  /// What a validation knows a point by, whatever its cores.
  std::string validated_as(const SimulationPoint& point) const;

  /// Costs that the calibration lacks are measured first, and the file is written; `tell` is told of what. Throws
  /// std::runtime_error if the calibration is another machine's.
  void complete_calibration(const std::function<void(const std::string& what)>& tell);

  /// One point; the operations are those of a sweep with the same seed in its repetition `repetition`.
  Entry run(const SimulationPoint& point, unsigned repetition = 0);
  /// The same by other costs.
  Entry run(const SimulationPoint& point, unsigned repetition, const Moment& moment);

  /// What the calibration, which must be complete, has of the point.
  Moment calibrated(const SimulationPoint& point) const;
  /// The same as it is now: by two trials on one thread, and two threads that wait for each other
  /// and that compute.
  Moment measured_now(const SimulationPoint& point, unsigned repetition);

 private:
  struct PlanData;
  struct Teams;
  PlanData& plan(std::size_t workload);
  /// Without work; of `plan` as far as it has none.
  CalibratedPlan plan_without_work(std::size_t workload);
  Teams& teams();
  /// Null if figures like the point's were not found near measured ones, by this build, at the costs and on the virtual
  /// machine that are used.
  const Validation* validation_for(const SimulationPoint& point) const;

  SimulationRequest request_;
  const Topology& topology_;
  Calibration calibration_;
  std::vector<std::string> workload_keys_;
  std::unique_ptr<PlanData> plan_;
  std::unique_ptr<Teams> teams_;
};

/// Throws std::runtime_error with one line for a workload or a cache that cannot be simulated, a trace that cannot be
/// read, or when no point is left.
void require_simulated(const SimulationRequest& request);

}  // namespace icbench
