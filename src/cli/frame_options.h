// What `icbench render` and `icbench animate` share: options, set-up and the figures they report.
#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "harness/thread_team.h"
#include "render/ray_tracer.h"
#include "workload/frame_renderer.h"

namespace icbench {

struct FrameOptions {
  std::string scene = "cornell_box", integrator = "irradiance_cache", cache = "wait_free", size = "256x256";
  std::string json, tiles = "morton", placement = "compact", interpolation = "split_sphere";
  unsigned threads = 0;
  std::uint32_t spp = 1, rays = 256, vpls = 256;
  std::uint32_t light_samples = 0;  ///< 0: as many as make 16 for a pixel
  std::uint32_t paths = 1;
  float cell_size = 8.0f;
  float accuracy = 0.2f, exposure = 1.0f;
  std::uint64_t seed = 1;
  bool deterministic = false, overture = false;
  std::optional<bool> leak_guard;
  const CLI::App* given_to = nullptr;  ///< the subcommand that was given them; null: none was
};

/// Adds the options to a subcommand; `o` holds their defaults and must outlive the parsing.
void add_frame_options(CLI::App* app, FrameOptions& o);

/// The scene, the threads and the renderer that the options ask for.
class FrameSetup {
 public:
  /// Throws std::runtime_error with one line for options that cannot be met.
  explicit FrameSetup(const FrameOptions& o);

  /// Lines on standard error: what the scene's file has that is left out or stands for something else, and which
  /// options were given and have no effect on the integrator. To be called once nothing is refused any more.
  void tell_notes() const;

  /// Throws std::runtime_error with one line if the scene has no such frame.
  void require_frame(std::uint32_t number) const;

  RayTracer& rays() noexcept { return *rays_; }
  FrameRequest& request() noexcept { return *request_; }

  /// What was asked for, as it stands in JSON.
  nlohmann::ordered_json asked() const;

 private:
  const FrameOptions& options_;
  std::unique_ptr<ThreadTeam> team_;
  std::unique_ptr<RayTracer> rays_;
  std::unique_ptr<FrameRequest> request_;
  std::vector<std::string> notes_;
};

/// Names records that found no room in the cache; throws CheckFailed if --deterministic could not be kept for them, for
/// which did was chance.
void judge_room(const FrameRequest& request, const CacheUse& use);

/// A line on standard error if there are far fewer virtual point lights than were asked for: the picture then goes by
/// chance.
void tell_few_vpls(const FrameRequest& request, const PassFigures& pass);

/// Adds the figures of a frame, or of several together, to `j`; those that the integrator has.
void add_cost(nlohmann::ordered_json& j, const IntegratorEntry& integrator, const FrameCost& cost);

}  // namespace icbench
