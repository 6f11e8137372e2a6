// icbench render: one picture, with what it cost.
#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "cli/command.h"
#include "cli/options.h"
#include "core/names.h"
#include "harness/progress.h"
#include "image/file.h"
#include "image/image.h"
#include "scene/registry.h"
#include "workload/dispatch.h"
#include "workload/picture.h"

namespace icbench {
namespace {

struct RenderOptions {
  std::string scene = "cornell_box", integrator = "irradiance_cache", cache = "wait_free", size = "256x256";
  std::string out = "render.exr", json, tiles = "morton", placement = "compact";
  unsigned threads = 0;
  std::uint32_t spp = 16, rays = 256;
  float accuracy = 0.2f, exposure = 1.0f;
  std::uint64_t seed = 1;
};

void require_image_path(const std::string& path) {
  const std::string extension = std::filesystem::path(path).extension().string();
  if (extension != ".exr" && extension != ".png") {
    throw std::runtime_error(fmt::format("--out '{}' must end in .exr or .png", path));
  }
  std::filesystem::path folder = std::filesystem::path(path).parent_path();
  if (folder.empty()) folder = ".";
  if (!std::filesystem::is_directory(folder)) {
    throw std::runtime_error(
        fmt::format("--out '{}': there is no folder '{}'; make it first", path, folder.string()));
  }
}

nlohmann::ordered_json figures(const RenderOptions& o, const PictureRequest& r, const PictureOutcome& p) {
  nlohmann::ordered_json j = {{"scene", o.scene},         {"integrator", o.integrator},
                              {"threads", r.team.size()}, {"width", r.width},
                              {"height", r.height},       {"spp", r.spp},
                              {"seed", r.seed},           {"seconds", p.seconds},
                              {"rays", p.rays.total()},   {"shadow_rays", p.rays.occlusion}};
  if (r.integrator.needs_cache) {
    j["cache"] = o.cache;
    j["rays_per_record"] = r.gather;
    j["accuracy"] = r.a;
    j["seconds_indirect"] = p.seconds_indirect;
    j["records"] = p.records;
    j["queries"] = p.counts.queries;
    j["hits"] = p.counts.hits;
  }
  j["image"] = std::filesystem::path(o.out).filename().string();
  return j;
}

void render_command(const RenderOptions& o) {
  const IntegratorEntry& integrator = find_integrator(o.integrator);
  const CacheEntry& cache = find_cache(o.cache);
  const auto [width, height] = parse_size(o.size);
  const TileOrder tiles = parse_tile_order(o.tiles);
  const Placement placement = parse_placement(o.placement);
  if (!(o.accuracy > 0.0f && o.accuracy <= 1.0f)) throw std::runtime_error("--accuracy must lie in (0, 1]");
  if (!(o.exposure > 0.0f && o.exposure <= 1e6f)) throw std::runtime_error("--exposure must lie in (0, 1e6]");
  require_image_path(o.out);

  const Topology topology = Topology::of_this_process();
  unsigned threads = o.threads != 0 ? o.threads : static_cast<unsigned>(topology.units().size());
  if (integrator.needs_cache && cache.traits.single_thread) {
    if (o.threads > 1) {
      throw std::runtime_error(
          fmt::format("cache '{}' serves one thread; use --threads 1 or a shared cache", o.cache));
    }
    threads = 1;
  }
  ThreadTeam team(topology, placement, threads);
  const RayTracer rays(make_scene(o.scene));
  PictureRequest request{rays, team, integrator, width, height, o.spp, o.rays, o.accuracy, tiles, o.seed, {}};
  Progress progress("render", picture_work(request));
  request.progress = [&](double work) { progress.advance(work); };
  const PictureOutcome outcome =
      integrator.needs_cache ? cache.picture(request) : render_plain_picture(request);
  progress.finish();
  write_image(o.out, outcome.picture, {ExrSample::float_bits, o.exposure});
  const nlohmann::ordered_json json = figures(o, request, outcome);
  if (!o.json.empty()) write_file(o.json, json.dump(2) + "\n");
  fmt::print("{}: {:.2f} s, {:.1f} million rays a second{}\n", o.out, outcome.seconds,
             1e-6 * static_cast<double>(outcome.rays.total()) / outcome.seconds,
             integrator.needs_cache ? fmt::format(", {} records", outcome.records) : "");
}

}  // namespace

void add_render(CLI::App& app) {
  const auto o = std::make_shared<RenderOptions>();
  CLI::App* render = app.add_subcommand("render", "Render a picture (EXR or PNG)");
  render->add_option("--scene", o->scene, "Scene; see icbench list scenes")->capture_default_str();
  render->add_option("--integrator", o->integrator, "Integrator; see icbench list integrators")
      ->capture_default_str();
  render->add_option("--cache", o->cache, "Cache, for the integrators that use one")->capture_default_str();
  render->add_option("--threads", o->threads, "Threads (default: one a processing unit)")
      ->check(CLI::Range(1u, kMaxThreads));
  render->add_option("--placement", o->placement, "compact | scatter | none")->capture_default_str();
  render->add_option("--size", o->size, "WIDTHxHEIGHT, pixels")->capture_default_str();
  render->add_option("--spp", o->spp, "Primary samples per pixel")
      ->check(CLI::Range(1, 1 << 24))
      ->capture_default_str();
  render->add_option("--rays", o->rays, "Gather rays per record")
      ->check(CLI::Range(1, 1 << 20))
      ->capture_default_str();
  render->add_option("--accuracy", o->accuracy, "Accuracy a of the cache, (0, 1]; smaller is finer")
      ->capture_default_str();
  render->add_option("--tiles", o->tiles, "Tile order: scanline | morton | random")->capture_default_str();
  render->add_option("--seed", o->seed, "Seed of all random numbers")->capture_default_str();
  render->add_option("--exposure", o->exposure, "PNG only: radiance is multiplied by this, then 1 is white")
      ->capture_default_str();
  render->add_option("--out", o->out, "Picture, .exr (exact) or .png (for viewing)")->capture_default_str();
  render->add_option("--json", o->json, "Also write what it cost");
  render->callback([o] { render_command(*o); });
}

}  // namespace icbench
