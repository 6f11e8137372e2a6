// How much of Embree's speed is left when rays are generated, hits shaded and paths continued around it.
#include "render/gather.h"
#include "rows/rows.h"
#include "scene/registry.h"
#include "workload/ray_traced_plan.h"

namespace icbench {
namespace {

constexpr int kSide = 24;             // pixels a side of the image whose hits are gathered at
constexpr std::uint32_t kRays = 256;  // a record

class GatherOverBareRays : public Experiment {
 public:
  explicit GatherOverBareRays(const Machine& machine)
      : rays_(make_scene("cornell_box")), tracer_(rays_), seed_(machine.seed) {
    for (const Hit& hit : centre_hits(rays_, kSide, kSide).hits) {
      if (reflects(rays_, hit)) points_.push_back(hit);
    }
    log_ = record_gather_rays(rays_, points_, strata_, seed_);
    machine.bind();
  }

  Sample sample() override {
    std::uint64_t traced = 0;
    const auto [gather, bare] = in_turns(
        count_++, [&] { return seconds([&] { traced = gather_all(tracer_, points_, strata_, seed_); }); },
        [&] { return seconds([&] { hits_ += rays_.bare_trace(log_); }); });
    return {static_cast<double>(traced) / gather / (static_cast<double>(log_.size()) / bare)};
  }

 private:
  RayTracer rays_;
  Tracer tracer_;
  std::uint64_t seed_;
  Strata strata_ = Strata::for_rays(kRays);
  std::vector<Hit> points_;
  std::vector<TracedRay> log_;
  std::uint64_t hits_ = 0;
  std::uint64_t count_ = 0;
};

}  // namespace

std::unique_ptr<Experiment> gather_over_bare_rays(const Machine& machine) {
  return std::make_unique<GatherOverBareRays>(machine);
}

}  // namespace icbench
