// A pinned team as a renderer's crew, with a tracer for each worker.
#pragma once

#include <memory>
#include <vector>

#include "core/sync.h"
#include "harness/thread_team.h"
#include "render/crew.h"

namespace icbench {

class TeamCrew final : public Crew {
 public:
  TeamCrew(ThreadTeam& team, const RayTracer& rays) : team_(team), slots_(team.size()) {
    team.run([&](unsigned t) { slots_[t] = std::make_unique<Slot>(rays); });
  }

  unsigned size() const noexcept override { return team_.size(); }
  void run(const std::function<void(unsigned, Tracer&)>& f) override { time(f); }

  /// As run, and tells how long it took.
  template <class F>
  TeamTimes time(F&& f) {
    return team_.run([&](unsigned t) { f(t, slots_[t]->tracer); });
  }

  /// Traced so far.
  RayCounts rays() const noexcept {
    RayCounts sum;
    for (const auto& slot : slots_) sum += slot->tracer.counts;
    return sum;
  }

 private:
  // Counted on by its worker with every ray.
  struct alignas(kNoSharing) Slot {
    explicit Slot(const RayTracer& rays) noexcept : tracer(rays) {}
    Tracer tracer;
  };

  ThreadTeam& team_;
  std::vector<std::unique_ptr<Slot>> slots_;  // each made by its worker
};

}  // namespace icbench
