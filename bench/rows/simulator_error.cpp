// How far the simulator is from what it simulates, on the cores that there are.
#include <iterator>
#include <nlohmann/json.hpp>
#include <vector>

#include "rows/rows.h"
#include "simulate/validation.h"

namespace icbench {
namespace {

SimulationRequest request_of(const Machine& machine) {
  SimulationRequest r;
  for (const char* workload : kValidatedWorkloads) r.workloads.push_back(parse_workload(workload));
  r.caches.assign(std::begin(kUsualCaches), std::end(kUsualCaches));
  r.cores = validated_cores(machine.topology);
  std::erase(r.cores, 1u);  // which counts nothing
  r.seed = machine.seed;
  return r;
}

class SimulatorError : public Experiment {
 public:
  SimulatorError(const Machine& machine, double Validation::*figure)
      : machine_(machine),
        figure_(figure),
        simulation_(request_of(machine), machine.topology,
                    calibrate_machine(machine.topology, nlohmann::ordered_json::object())) {
    simulation_.complete_calibration([](const std::string&) {});
  }

  Sample sample() override {
    constexpr unsigned kRounds = 3;
    const auto points = compare_in_rounds(simulation_, machine_.topology, kRounds, [](const std::string&) {});
    return {validation_of(simulation_, points).*figure_};
  }

 private:
  Machine machine_;
  double Validation::*figure_;
  Simulation simulation_;
};

}  // namespace

std::unique_ptr<Experiment> simulator_error(const Machine& machine, double Validation::*figure) {
  return std::make_unique<SimulatorError>(machine, figure);
}

}  // namespace icbench
