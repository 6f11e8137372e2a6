// How far the simulator is from what it simulates, on the cores that there are.
#include <iterator>
#include <memory>
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

/// A sample takes a minute and has all three figures, so the rows share them: whichever comes first measures.
std::vector<Validation>& validations() {
  static std::vector<Validation> all;
  return all;
}

class SimulatorError : public Experiment {
 public:
  SimulatorError(const Machine& machine, double Validation::*figure) : machine_(machine), figure_(figure) {}

  Sample sample() override {
    if (machine_.units() < 2) return kSingleUnit;
    while (validations().size() <= next_) validate();
    return {validations()[next_++].*figure_};
  }
  bool starts_warm() const override { return true; }

 private:
  void validate() {
    constexpr unsigned kRounds = 3;
    const auto tell_nobody = [](const std::string&) {};
    if (simulation_ == nullptr) {
      simulation_ = std::make_unique<Simulation>(
          request_of(machine_), machine_.topology,
          calibrate_machine(machine_.topology, nlohmann::ordered_json::object()));
      simulation_->complete_calibration(tell_nobody);
    }
    const auto points =
        compare_in_rounds(*simulation_, machine_.topology, kRounds, !validations().empty(), tell_nobody);
    validations().push_back(validation_of(*simulation_, points));
  }

  Machine machine_;
  double Validation::*figure_;
  std::unique_ptr<Simulation> simulation_;
  std::size_t next_ = 0;
};

}  // namespace

std::unique_ptr<Experiment> simulator_error(const Machine& machine, double Validation::*figure) {
  return std::make_unique<SimulatorError>(machine, figure);
}

}  // namespace icbench
