// How long the simulator takes for a machine that is not there.
#include <algorithm>
#include <ctime>
#include <iterator>
#include <nlohmann/json.hpp>

#include "rows/rows.h"
#include "simulate/validation.h"

namespace icbench {
namespace {

constexpr double kMinute = 60.0;

/// Processor seconds of this process in f(): all its threads', so no more than those of one core.
template <class F>
double processor_seconds(F&& f) {
  const std::clock_t start = std::clock();
  f();
  return static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
}

class SimulatorSpeed : public Experiment {
 public:
  explicit SimulatorSpeed(const Machine& machine)
      : simulation_(request_of(machine), machine.topology,
                    calibrate_machine(machine.topology, nlohmann::ordered_json::object())) {
    simulation_.complete_calibration([](const std::string&) {});
  }

  Sample sample() override {
    double worst = 0.0;
    for (const SimulationPoint& point : simulation_.points())
      worst = std::max(worst, processor_seconds([&] { simulation_.run(point, round_); }));
    ++round_;
    return {worst / kMinute};
  }

 private:
  static SimulationRequest request_of(const Machine& machine) {
    SimulationRequest r;
    r.workloads.push_back(parse_workload("miss_driven:cost=10:operations=1000000"));
    r.caches.assign(std::begin(kUsualCaches), std::end(kUsualCaches));
    r.cores = {256};
    r.seed = machine.seed;
    return r;
  }

  Simulation simulation_;
  unsigned round_ = 0;
};

}  // namespace

std::unique_ptr<Experiment> simulator_speed(const Machine& machine) {
  return std::make_unique<SimulatorSpeed>(machine);
}

}  // namespace icbench
