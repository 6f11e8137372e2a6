// How fast histories are judged: real ones of four threads, a quarter of the operations from each shape of stress.
#include <vector>

#include "caches/registry.h"
#include "rows/rows.h"
#include "stress/checker.h"
#include "stress/round.h"

namespace icbench {
namespace {

constexpr std::uint32_t kOperations = 1'000'000;
constexpr double kDemanded = 500'000.0;  // operations a second: 10^6 in two

class CheckerSpeed : public Experiment {
 public:
  explicit CheckerSpeed(const Machine& machine) {
    const auto shapes = stress::all_shapes();
    for (const stress::Shape& shape : shapes) {
      stress::RoundPlan plan;
      plan.shape = &shape;
      plan.threads = 4;
      plan.operations = kOperations / static_cast<std::uint32_t>(shapes.size());
      plan.seed = machine.seed;
      histories_.push_back(stress::run_round<WaitFreeSnapshot<>>(plan));
    }
    machine.bind();
  }

  Sample sample() override {
    std::uint64_t operations = 0;
    const double took = seconds([&] {
      for (const stress::RoundRecord& round : histories_) {
        const stress::Judgement judgement = stress::judge(round.history);
        if (!judgement.holds(stress::Check::linearizable))
          throw InvalidTrial("wait_free_snapshot is not linearizable: " +
                             judgement[stress::Check::linearizable].witness);
        operations += judgement.operations;
      }
    });
    return {static_cast<double>(operations) / took / kDemanded};
  }

 private:
  std::vector<stress::RoundRecord> histories_;
};

}  // namespace

std::unique_ptr<Experiment> checker_speed(const Machine& machine) {
  return std::make_unique<CheckerSpeed>(machine);
}

}  // namespace icbench
