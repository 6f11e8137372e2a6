// How much of Embree's speed is left to a gather from virtual point lights: its shadow rays against the same rays in
// bare loops of single rays and of packets, whichever is fastest.
#include <algorithm>

#include "render/vpl_gather.h"
#include "rows/animations.h"
#include "rows/rows.h"
#include "scene/registry.h"
#include "workload/ray_traced_plan.h"

namespace icbench {
namespace {

constexpr int kSide = 24;  // pixels a side of the image at whose hits is gathered

class VplGatherOverBareRays : public Experiment {
 public:
  explicit VplGatherOverBareRays(const Machine& machine)
      : rays_(make_scene(kAnimations[0].setting.scene)),
        tracer_(rays_),
        vpls_(rays_, {kAnimations[0].setting.vpls, machine.seed}),
        clamp_(vpl_clamp(rays_.scene().bounds)) {
    trace_all(vpls_, tracer_);
    for (const Hit& hit : centre_hits(rays_, kSide, kSide).hits) {
      if (reflects(rays_, hit)) points_.push_back(hit);
    }
    log_ = record_vpl_rays(rays_, points_, vpls_.vpls());
    machine.bind();
  }

  Sample sample() override {
    const auto gather_all = [&] {
      for (const Hit& hit : points_) sum_ += gather_vpls(tracer_, hit, vpls_.vpls(), clamp_, Packing::fast);
    };
    const auto fastest_bare = [&] {
      return std::min({seconds([&] { hits_ += rays_.bare_trace(log_); }),
                       seconds([&] { hits_ += rays_.bare_occluded(log_, 8); }),
                       seconds([&] { hits_ += rays_.bare_occluded(log_, 16); })});
    };
    const auto [gather, bare] = in_turns(
        count_++, [&] { return seconds(gather_all); }, fastest_bare);
    return {bare / gather};
  }

 private:
  RayTracer rays_;
  Tracer tracer_;
  VplSet vpls_;
  float clamp_;
  std::vector<Hit> points_;
  std::vector<TracedRay> log_;
  std::uint64_t hits_ = 0;
  Irradiance sum_{0.0f};
  std::uint64_t count_ = 0;
};

}  // namespace

std::unique_ptr<Experiment> vpl_gather_over_bare_rays(const Machine& machine) {
  return std::make_unique<VplGatherOverBareRays>(machine);
}

}  // namespace icbench
