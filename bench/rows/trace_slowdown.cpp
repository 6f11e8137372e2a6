// What capturing a trace costs a render.
#include "rows/rows.h"
#include "scene/registry.h"
#include "workload/frame_renderer.h"
#include "workload/trace_capture.h"

namespace icbench {
namespace {

constexpr int kEdge = 256;

// A renderer whose cache is empty at each frame: every frame of the scene moves something.
class Studio {
 public:
  Studio(const Machine& machine, std::string_view integrator, TraceRecorder* trace)
      : rays_(make_scene("cornell_box")),
        team_(machine.topology, Placement::compact, machine.units()),
        renderer_(request(machine, integrator, trace)) {}

  double seconds(std::uint32_t frame) { return renderer_.render(frame).seconds; }

 private:
  FrameRequest request(const Machine& machine, std::string_view integrator, TraceRecorder* trace) {
    FrameRequest r{.rays = rays_,
                   .team = team_,
                   .integrator = find_integrator(integrator),
                   .cache = find_cache("packed_wait_free"),
                   .width = kEdge,
                   .height = kEdge,
                   .seed = machine.seed};
    r.trace = trace;
    return r;
  }

  RayTracer rays_;
  ThreadTeam team_;
  FrameRenderer renderer_;
};

class TraceSlowdown : public Experiment {
 public:
  TraceSlowdown(const Machine& machine, std::string_view integrator)
      : recorder_(machine.units(), kEdge * kEdge),
        plain_(machine, integrator, nullptr),
        traced_(machine, integrator, &recorder_) {}

  Sample sample() override {
    const auto [plain, traced] = in_turns(
        frame_, [&] { return plain_.seconds(frame_); }, [&] { return traced_.seconds(frame_); });
    ++frame_;
    return {traced / plain};
  }

 private:
  TraceRecorder recorder_;
  Studio plain_, traced_;
  std::uint32_t frame_ = 0;
};

}  // namespace

std::unique_ptr<Experiment> trace_slowdown(const Machine& machine, std::string_view integrator) {
  return std::make_unique<TraceSlowdown>(machine, integrator);
}

}  // namespace icbench
