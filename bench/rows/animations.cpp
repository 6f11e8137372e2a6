#include "rows/animations.h"

#include "core/names.h"
#include "image/metrics/hdrvdp.h"
#include "scene/registry.h"
#include "workload/frame_renderer.h"

namespace icbench {
namespace {

// An integrator at work on a scene of its own: go_to tells each what changed since its last frame.
class Studio {
 public:
  Studio(const Machine& machine, std::string_view integrator, const Setting& setting, std::uint64_t seed,
         std::uint32_t light_samples = 1)
      : rays_(make_scene(setting.scene)),
        team_(machine.topology, Placement::compact, machine.units()),
        renderer_({.rays = rays_,
                   .team = team_,
                   .integrator = find_integrator(integrator),
                   .cache = find_cache("packed_wait_free"),
                   .width = kAnimationWidth,
                   .height = kAnimationHeight,
                   .light_samples = light_samples,
                   .vpls = setting.vpls,
                   .a = accuracy_of(setting),
                   .interpolation = Interpolation::gradients,
                   .seed = seed}) {}

  FrameCost render(std::uint32_t frame) { return renderer_.render(frame); }
  const Image& picture() const { return renderer_.picture(); }

 private:
  RayTracer rays_;
  ThreadTeam team_;
  FrameRenderer renderer_;
};

enum class Ratio { over_temporal, temporal_over };

class IndirectTimes : public Experiment {
 public:
  IndirectTimes(const Machine& machine, std::string_view integrator, const Animation& animation, Ratio ratio)
      : other_(machine, integrator, animation.setting, machine.seed),
        temporal_(machine, "temporal_instant_caching", animation.setting, machine.seed),
        ratio_(ratio) {
    // The first frame does not count. Instant global illumination keeps nothing of it, and takes most of a minute.
    if (integrator != "instant_gi") other_.render(0);
    temporal_.render(0);
  }

  Sample sample() override {
    const auto [other, temporal] = in_turns(
        frame_, [&] { return other_.render(frame_).seconds_indirect; },
        [&] { return temporal_.render(frame_).seconds_indirect; });
    ++frame_;
    return {ratio_ == Ratio::over_temporal ? other / temporal : temporal / other};
  }
  bool starts_warm() const override { return true; }

 private:
  Studio other_, temporal_;
  Ratio ratio_;
  std::uint32_t frame_ = 1;
};

class TemporalVisible : public Experiment {
 public:
  TemporalVisible(const Machine& machine, const Setting& setting) : machine_(machine), setting_(setting) {}

  Sample sample() override {
    const std::uint64_t seed = hash_keys(machine_.seed, count_++);
    Studio temporal(machine_, "temporal_instant_caching", setting_, seed, kJudgedLightSamples);
    for (std::uint32_t frame = 0; frame <= kLast; ++frame) temporal.render(frame);
    Studio instant(machine_, "instant_gi", setting_, seed, kJudgedLightSamples);
    instant.render(kLast);
    return {first_of(hdrvdp(instant.picture(), temporal.picture(), nullptr, {}))};
  }
  bool starts_warm() const override { return true; }

 private:
  static constexpr std::uint32_t kLast = 5;

  Machine machine_;
  Setting setting_;
  std::uint64_t count_ = 0;
};

class TemporalMemory : public Experiment {
 public:
  explicit TemporalMemory(const Machine& machine)
      : temporal_(machine, "temporal_instant_caching", kAnimations[0].setting, machine.seed) {}

  Sample sample() override {
    const PassFigures figures = temporal_.render(frame_++).pass;
    return {static_cast<double>(figures.bytes_beside_cache - figures.bytes_of_details) /
            static_cast<double>(figures.records) / (64.0 + static_cast<double>(figures.vpls_in_use) / 8.0)};
  }

 private:
  Studio temporal_;
  std::uint32_t frame_ = 0;
};

}  // namespace

float accuracy_of(const Setting& setting) { return find_named("scene", setting.scene, kScenes).accuracy; }

std::unique_ptr<Experiment> over_temporal(const Machine& machine, std::string_view integrator,
                                          const Animation& animation) {
  return std::make_unique<IndirectTimes>(machine, integrator, animation, Ratio::over_temporal);
}

std::unique_ptr<Experiment> temporal_over(const Machine& machine, std::string_view integrator,
                                          const Animation& animation) {
  return std::make_unique<IndirectTimes>(machine, integrator, animation, Ratio::temporal_over);
}

std::unique_ptr<Experiment> temporal_visible(const Machine& machine, const Setting& setting) {
  return std::make_unique<TemporalVisible>(machine, setting);
}

std::unique_ptr<Experiment> temporal_memory(const Machine& machine) {
  return std::make_unique<TemporalMemory>(machine);
}

}  // namespace icbench
