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
#include "workload/memory.h"
#include "workload/names.h"
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
  require_writable("--out", path);
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
    j["accuracy"] = shortest_decimal(r.a);
    j["seconds_indirect"] = p.seconds_indirect;
    j["records"] = p.records;
    j["queries"] = p.counts.queries;
    j["hits"] = p.counts.hits;
    j["full"] = p.counts.full;
  }
  j["image"] = std::filesystem::path(o.out).filename().string();
  return j;
}

void render_command(const RenderOptions& o) {
  require_known("scene", o.scene, kScenes);
  require_known("integrator", o.integrator, kIntegrators);
  const IntegratorEntry& integrator = find_integrator(o.integrator);
  const CacheEntry& cache = find_cache(o.cache);
  const auto [width, height] = parse_size(o.size);
  const TileOrder tiles = parse_tile_order(o.tiles);
  const Placement placement = placement_of(o.placement);
  require_image_path(o.out);
  if (!o.json.empty()) require_writable("--json", o.json);

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
  require_memory(fmt::format("a picture of {}", o.size), picture_bytes(request));
  // Never finished, only wiped: the last line is the one on standard output, once everything is written.
  Progress progress("render", picture_work(request));
  request.progress = [&](double work) { progress.advance(work); };
  const PictureOutcome outcome =
      integrator.needs_cache ? cache.picture(request) : render_plain_picture(request);
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
  const auto add_text = [&](const char* name, std::string& value, const char* help) {
    return render->add_option(name, value, help)->capture_default_str();
  };
  add_text("--scene", o->scene, "Scene; see icbench list scenes")->type_name("NAME");
  add_text("--integrator", o->integrator, "Integrator; see icbench list integrators")->type_name("NAME");
  add_text("--cache", o->cache, "Cache, for the integrators that use one; see icbench list\ncaches")
      ->type_name("NAME");
  add_whole(render, "--threads", o->threads, 1u, kMaxThreads,
            "Threads, 1 to 8192 (default: one a processing unit)")
      ->default_str("");
  add_text("--placement", o->placement, "How threads are pinned: compact, scatter or none");
  add_text("--size", o->size, "WIDTHxHEIGHT, pixels");
  add_whole(render, "--spp", o->spp, 1u, 1u << 24, "Primary samples per pixel");
  add_whole(render, "--rays", o->rays, 1u, 1u << 20, "Gather rays per record");
  add_positive(render, "--accuracy", o->accuracy, 1.0f,
               "Accuracy a of the cache, at most 1; smaller is finer");
  add_text("--tiles", o->tiles, "Order of the tiles: scanline, morton or random");
  add_whole(render, "--seed", o->seed, std::uint64_t{0}, ~std::uint64_t{0}, "Seed of all random numbers");
  add_positive(render, "--exposure", o->exposure, 1e6f,
               "PNG only: radiance is multiplied by this, then 1 is white");
  add_text("--out", o->out, "Picture: .exr (exact) or .png (for viewing)")->type_name("FILE");
  render->add_option("--json", o->json, "Also write what it cost to this file")->type_name("FILE");
  render->callback([o] { render_command(*o); });
}

}  // namespace icbench
