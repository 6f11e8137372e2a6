#include "cli/frame_options.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "cli/command.h"
#include "cli/options.h"
#include "files/memory.h"
#include "files/standard_streams.h"
#include "render/hidden_lamps.h"
#include "scene/registry.h"
#include "workload/names.h"

namespace icbench {
namespace {

// Estimates of direct light that a pixel gets together, unless asked otherwise: its noise is then no louder than what
// is compared.
constexpr std::uint32_t kLightSamples = 16;

std::uint32_t light_samples_of(const FrameOptions& o) {
  return o.light_samples != 0 ? o.light_samples : std::max(1u, kLightSamples / o.spp);
}

/// An option that not every integrator has a use for.
struct ParticularOption {
  const char* name;
  bool (*is_used_by)(const IntegratorEntry&);
};

bool adds_direct_light(const IntegratorEntry& i) { return i.name != "path"; }  // whose paths have it
bool uses_vpls(const IntegratorEntry& i) { return i.uses_vpls; }
bool uses_cells(const IntegratorEntry& i) { return i.uses_cells; }
bool uses_cache(const IntegratorEntry& i) { return i.needs_cache(); }
bool gathers_hemispheres(const IntegratorEntry& i) { return i.needs_cache() && !i.uses_vpls; }

constexpr ParticularOption kParticularOptions[] = {
    {"--cache", uses_cache},         {"--accuracy", uses_cache},      {"--interpolation", uses_cache},
    {"--deterministic", uses_cache}, {"--overture", uses_cache},      {"--rays", gathers_hemispheres},
    {"--leak-guard", uses_cache},    {"--no-leak-guard", uses_cache}, {"--vpls", uses_vpls},
    {"--cell-size", uses_cells},     {"--paths", uses_cells},         {"--light-samples", adds_direct_light}};

void warn_of_options_without_effect(const FrameOptions& o, const IntegratorEntry& integrator) {
  if (o.given_to == nullptr) return;
  std::vector<const char*> idle;
  for (const ParticularOption& option : kParticularOptions) {
    // Not all subcommands have all.
    const CLI::Option* const known = o.given_to->get_option_no_throw(option.name);
    if (!option.is_used_by(integrator) && known != nullptr && known->count() > 0) idle.push_back(option.name);
  }
  if (!idle.empty())
    tell("icbench: {} {} no effect on {}\n", fmt::join(idle, ", "), idle.size() == 1 ? "has" : "have",
         integrator.name);
}

}  // namespace

void add_frame_options(CLI::App* app, FrameOptions& o) {
  o.given_to = app;
  const auto add_text = [&](const char* name, std::string& value, const char* help) {
    return app->add_option(name, value, help)->capture_default_str();
  };
  add_text("--scene", o.scene, "Scene; see icbench list scenes; or a file (glTF, .rad, what assimp\nreads)")
      ->type_name("NAME|FILE");
  add_text("--integrator", o.integrator, "Integrator; see icbench list integrators")->type_name("NAME");
  add_text("--cache", o.cache, "Cache, for the integrators that use one; see icbench list\ncaches")
      ->type_name("NAME");
  add_whole(app, "--threads", o.threads, 1u, kMaxThreads,
            "Threads, 1 to 8192 (default: one a processing unit)")
      ->default_str("");
  add_text("--placement", o.placement, "How threads are pinned: compact, scatter or none");
  add_text("--size", o.size, "WIDTHxHEIGHT, pixels");
  add_whole(app, "--spp", o.spp, 1u, 1u << 24,
            "Primary samples per pixel: one through its centre, more\nspread over it");
  add_whole(app, "--light-samples", o.light_samples, 1u, 1u << 16,
            "Estimates of direct light per primary sample (default: 16 for a\npixel)")
      ->default_str("");
  add_whole(app, "--rays", o.rays, 1u, 1u << 20, "irradiance_cache: gather rays per record");
  add_whole(app, "--vpls", o.vpls, 1u, 1u << 16, "Virtual point lights, for the integrators that use them");
  add_positive(app, "--accuracy", o.accuracy, 1.0f, "Accuracy a of the cache, 0.002 to 1; smaller is finer",
               kMinAccuracy);
  add_text("--interpolation", o.interpolation,
           "How records are interpolated; see icbench list interpolations")
      ->type_name("NAME");
  CLI::Option* guard = app->add_flag_callback(
      "--leak-guard", [&o] { o.leak_guard = true; },
      "Test by short rays that no thin wall stands before a record (the\ndefault of irradiance_cache but for "
      "split_sphere)");
  app->add_flag_callback(
         "--no-leak-guard", [&o] { o.leak_guard = false; }, "Never test that")
      ->excludes(guard);
  add_positive(app, "--cell-size", o.cell_size, 1e4f,
               "hash_cells: edge of a cell, pixels (a power of two metres\nbelow it)");
  add_whole(app, "--paths", o.paths, 1u, 1u << 20, "hash_cells: light paths from each visible point");
  app->add_flag(
      "--deterministic", o.deterministic,
      "The same picture and records for any number of threads and\nany cache that has room; status 1 "
      "where it has not");
  app->add_flag("--overture", o.overture,
                "Make all records of a sample of the pixels first, then its\npicture");
  add_text("--tiles", o.tiles, "Order of the tiles: scanline, morton or random");
  add_whole(app, "--seed", o.seed, std::uint64_t{0}, ~std::uint64_t{0}, "Seed of all random numbers");
  add_positive(app, "--exposure", o.exposure, 1e6f,
               "Not for EXR: radiance is multiplied by this, then 1 is white");
  add_file(app, "--json", o.json, "Also write what it cost to this file");
}

FrameSetup::FrameSetup(const FrameOptions& o) : options_(o) {
  const IntegratorEntry& integrator = find_integrator(o.integrator);
  const CacheEntry& cache = find_cache(o.cache);
  const InterpolationEntry& interpolation = find_interpolation(o.interpolation);
  if (integrator.uses_vpls && integrator.needs_cache() && !is_for_vpls(interpolation.level)) {
    std::vector<std::string_view> known;
    for (const InterpolationEntry& entry : kInterpolations)
      if (is_for_vpls(entry.level)) known.push_back(entry.name);
    throw std::runtime_error(fmt::format("--interpolation {}: {} knows {}", o.interpolation, o.integrator,
                                         fmt::join(known, " and ")));
  }
  const auto [width, height] = parse_size(o.size);
  const TileOrder tiles = parse_tile_order(o.tiles);
  const Placement placement = parse_placement(o.placement);
  if (!o.json.empty()) require_writable("--json", o.json);

  const Topology topology = Topology::of_this_process();
  unsigned threads = o.threads != 0 ? o.threads : static_cast<unsigned>(topology.units().size());
  if (integrator.needs_cache() && cache.traits.single_thread) {
    if (o.threads > 1) {
      throw std::runtime_error(
          fmt::format("cache '{}' serves one thread; use --threads 1 or a shared cache", o.cache));
    }
    threads = 1;
  }
  team_ = std::make_unique<ThreadTeam>(topology, placement, threads);
  Scene scene = make_scene(o.scene, &notes_);
  rays_ = std::make_unique<RayTracer>(std::move(scene));
  if (const std::size_t dropped = rays_->scene().dropped_triangles; dropped != 0) {
    notes_.push_back(
        fmt::format("{} triangle{} without a surface, or too small beside the whole scene, left out", dropped,
                    dropped == 1 ? "" : "s"));
  }
  // Less is what corners of lamps that stand on something may have.
  if (const auto hidden = hidden_lamps(*rays_); hidden && hidden->share > 0.01) {
    notes_.push_back(fmt::format(
        "lamps lie in the plane of another surface (mesh '{}'), which {:.0f} % of the rays to them meet; "
        "move them off it",
        rays_->scene().meshes[hidden->mesh].name, 100.0 * hidden->share));
  }
  request_ = std::make_unique<FrameRequest>(FrameRequest{
      .rays = *rays_,
      .team = *team_,
      .integrator = integrator,
      .cache = cache,
      .width = width,
      .height = height,
      .spp = o.spp,
      .light_samples = light_samples_of(o),
      .gather = o.rays,
      .vpls = o.vpls,
      .a = o.accuracy,
      .interpolation = interpolation.level,
      .tiles = tiles,
      .seed = o.seed,
      .cell_size = o.cell_size,
      .paths = o.paths,
      .deterministic = o.deterministic,
      .overture = o.overture,
      .leak_guard = o.leak_guard,
  });
  require_memory(fmt::format("a picture of {}", o.size), frame_bytes(*request_));
}

void FrameSetup::tell_notes() const {
  for (const std::string& note : notes_) tell("note: {}\n", note);
  warn_of_options_without_effect(options_, request_->integrator);
}

void FrameSetup::require_frame(std::uint32_t number) const {
  const std::uint32_t frames = rays_->scene().frames;
  if (number < frames) return;
  throw std::runtime_error(fmt::format("--frame {}: scene '{}' has {} frame{}, counted from 0", number,
                                       options_.scene, frames, frames == 1 ? "" : "s"));
}

nlohmann::ordered_json FrameSetup::asked() const {
  const FrameRequest& r = *request_;
  nlohmann::ordered_json j = {{"scene", options_.scene},
                              {"integrator", options_.integrator},
                              {"threads", team_->size()},
                              {"width", r.width},
                              {"height", r.height},
                              {"spp", r.spp},
                              {"seed", r.seed}};
  if (adds_direct_light(r.integrator)) j["light_samples"] = r.light_samples;
  if (r.integrator.needs_cache()) {
    j["cache"] = options_.cache;
    j["accuracy"] = shortest_decimal(r.a);
    j["interpolation"] = options_.interpolation;
    j["deterministic"] = r.deterministic;
    j["overture"] = r.overture;
    j["leak_guard"] = guards_against_leaks(r);
  }
  if (r.integrator.uses_cells) {
    j["cell_size"] = shortest_decimal(r.cell_size);
    j["paths"] = r.paths;
  }
  if (r.integrator.uses_vpls) {
    j["vpls"] = r.vpls;
  } else if (r.integrator.needs_cache()) {
    j["rays_per_record"] = r.gather;
  }
  return j;
}

void judge_room(const FrameRequest& request, const CacheUse& use) {
  if (!request.integrator.needs_cache() || use.full == 0) return;
  const bool keeps_none = request.cache.traits.name == "null";
  const char* const remedy = keeps_none ? "'null' keeps none: take another cache"
                                        : "take a coarser --accuracy, fewer --spp or a larger --size";
  if (request.deterministic) {
    throw CheckFailed(
        fmt::format("{} records found no room in the cache, so the picture depends on the threads in spite "
                    "of --deterministic; {}",
                    use.full, remedy));
  }
  if (!keeps_none)
    tell("note: {} records found no room in the cache and served one pixel each; {}\n", use.full, remedy);
}

void tell_few_vpls(const FrameRequest& request, const PassFigures& pass) {
  if (!request.integrator.uses_vpls || 2 * pass.vpls_in_use >= request.vpls) return;
  constexpr std::string_view kWhy =
      "light seldom reaches a surface, and how bright the picture is goes by chance";
  tell("note: {} virtual point lights of {}: {}\n", pass.vpls_in_use, request.vpls, kWhy);
}

void add_cost(nlohmann::ordered_json& j, const IntegratorEntry& integrator, const FrameCost& cost) {
  j["seconds"] = cost.seconds;
  j["seconds_indirect"] = cost.seconds_indirect;
  j["rays"] = cost.rays.total();
  j["shadow_rays"] = cost.rays.occlusion;
  const PassFigures& p = cost.pass;
  if (integrator.needs_cache()) {
    j["records"] = p.records;
    j["queries"] = p.use.queries;
    j["hits"] = p.use.hits;
    j["full"] = p.use.full;
    j["records_kept"] = p.records_kept;
    j["records_updated"] = p.records_updated;
    j["records_dropped"] = p.records_dropped;
    j["bytes_beside_cache"] = p.bytes_beside_cache;
    j["bytes_of_details"] = p.bytes_of_details;
    j["lock_wait_share"] =
        1e-9 * static_cast<double>(p.lock_wait_ns) / (cost.seconds_indirect * cost.threads);
    j["leak_tests"] = p.use.leaks.rays;
    j["leaks_stopped"] = p.use.leaks.stopped;
  }
  if (integrator.uses_cells) {
    j["cells"] = p.records;
    j["full"] = p.use.full;
  }
  if (integrator.uses_vpls) {
    j["light_paths"] = p.light_paths;
    j["light_paths_retraced"] = p.light_paths_retraced;
    j["vpls_in_use"] = p.vpls_in_use;
  }
}

}  // namespace icbench
