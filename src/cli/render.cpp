// icbench render: one picture, with what it cost.
#include <fmt/format.h>

#include <filesystem>
#include <memory>

#include "caches/cache_file.h"
#include "cli/command.h"
#include "cli/frame_options.h"
#include "cli/options.h"
#include "files/json_file.h"
#include "files/memory.h"
#include "harness/progress.h"
#include "image/image.h"
#include "workload/names.h"

namespace icbench {
namespace {

struct RenderOptions : FrameOptions {
  std::string out = "render.exr", residual_out;
  std::string load_cache, save_cache;
  std::uint32_t frame = 0;
  float residual = 0.0f;  ///< 0: not asked for
  bool is_unbiased = false;
};

std::string extension_of(const std::string& path) { return std::filesystem::path(path).extension().string(); }

void require_paths(const RenderOptions& o) {
  const std::string extension = extension_of(o.out);
  if (extension != ".exr" && extension != ".png") {
    throw std::runtime_error(fmt::format("--out '{}' must end in .exr or .png", o.out));
  }
  if (o.residual == 0.0f && (o.is_unbiased || !o.residual_out.empty())) {
    throw std::runtime_error(
        fmt::format("{} needs --residual SHARE, the part of the pixels to be path-traced",
                    o.is_unbiased ? "--unbiased" : "--residual-out"));
  }
  if (o.is_unbiased && extension != ".exr") {
    throw std::runtime_error(fmt::format(
        "--out '{}': an --unbiased picture has negative values, which a PNG cannot hold; use .exr", o.out));
  }
  std::vector<GivenFile> written = {{"--out", o.out}, {"--residual-out", o.residual_out}, {"--json", o.json}};
  require_apart(written, {{"--scene", o.scene}, {"--load-cache", o.load_cache}});
  written.push_back({"--save-cache", o.save_cache});  // which may be where the cache was loaded from
  require_apart(written, {{"--scene", o.scene}});
  require_writable("--out", o.out);
  if (!o.save_cache.empty()) require_writable("--save-cache", o.save_cache);
  if (o.residual_out.empty()) return;
  if (extension_of(o.residual_out) != ".exr") {
    throw std::runtime_error(
        fmt::format("--residual-out '{}' must end in .exr: the layer has negative values", o.residual_out));
  }
  require_writable("--residual-out", o.residual_out);
}

/// A value as a share of another, null where there is no such share.
nlohmann::ordered_json share(double value, double of) {
  return of > 0.0 ? nlohmann::ordered_json(value / of) : nlohmann::ordered_json();
}

void add_residual(nlohmann::ordered_json& j, const RenderOptions& o, const FrameCost& cost) {
  const ResidualFigures& f = *cost.residual;
  j["residual_share"] = shortest_decimal(o.residual);
  j["residual_samples"] = f.samples;
  // Where no pixel was drawn nothing is known, which is not 0.
  const auto known = [](double value, std::uint64_t samples) {
    return samples != 0 ? nlohmann::ordered_json(value) : nlohmann::ordered_json();
  };
  const auto known_share = [&](double value, double of) {
    return f.samples != 0 ? share(value, of) : nlohmann::ordered_json();
  };
  j["residual_mean"] = known(f.all.mean, f.samples);
  j["residual_standard_error"] = known(f.all.error, f.samples);
  j["residual_mean_share"] = known_share(f.all.mean, f.cached);
  j["residual_standard_error_share"] = known_share(f.all.error, f.cached);
  for (std::size_t c = 0; c < 3; ++c) {
    j["residual_mean_rgb"].push_back(known(f.rgb[c].mean, f.samples));
    j["residual_standard_error_rgb"].push_back(known(f.rgb[c].error, f.samples));
    j["residual_mean_share_rgb"].push_back(known_share(f.rgb[c].mean, f.cached_rgb[c]));
    j["residual_standard_error_share_rgb"].push_back(known_share(f.rgb[c].error, f.cached_rgb[c]));
  }
  j["residual_mean_square"] = known(f.square.mean, f.samples);
  j["residual_mean_square_standard_error"] = known(f.square.error, f.samples);
  nlohmann::ordered_json& blocks = j["residual_blocks"];
  blocks = {{"edge", f.edge}, {"columns", f.columns}, {"rows", f.rows}, {"samples", f.block_samples}};
  for (std::size_t i = 0; i < f.blocks.size(); ++i) {
    blocks["mean"].push_back(known(f.blocks[i].mean, f.block_samples[i]));
    blocks["standard_error"].push_back(known(f.blocks[i].error, f.block_samples[i]));
  }
  j["indirect_mean"] = f.cached;
  j["residual_seconds"] = cost.seconds_residual;
  j["residual_rays"] = cost.rays_residual.total();
  j["unbiased"] = o.is_unbiased;
}

std::string told(const ResidualFigures& f) {
  if (f.samples == 0)
    return "true less rendered indirect light: not known, no pixel was drawn; ask for a larger --residual\n";
  const std::string of_mean = f.cached > 0.0
                                  ? fmt::format(" ({:+.3g} % +- {:.2g} % of the pass's mean)",
                                                100.0 * f.all.mean / f.cached, 100.0 * f.all.error / f.cached)
                                  : "";
  return fmt::format("true less rendered indirect light, mean: {:+.3g} +- {:.2g} W/(m^2 sr){}\n", f.all.mean,
                     f.all.error, of_mean);
}

/// What the records of a picture are of.
CacheContent content_of(const RenderOptions& o, const Scene& scene) {
  return {light_key(scene, o.frame), fmt::format("{}, frame {}", o.scene, o.frame)};
}

std::vector<Record> load_records(const RenderOptions& o, const Scene& scene) {
  CacheFile file;
  if (const Failure failed = file.open(o.load_cache)) throw std::runtime_error(*failed);
  const CacheContent here = content_of(o, scene);
  if (file.content().key != here.key || file.config().bounds.lower != scene.bounds.lower ||
      file.config().bounds.upper != scene.bounds.upper) {
    throw std::runtime_error(
        fmt::format("--load-cache '{}' holds records of {}, not of {} as it is here; save one of this",
                    o.load_cache, file.content().text.empty() ? "something else" : file.content().text,
                    here.text.substr(0, kMostContentText)));
  }
  require_memory(fmt::format("a cache of {} records", file.records()), file.records() * sizeof(Record));
  std::vector<Record> records;
  records.reserve(static_cast<std::size_t>(file.records()));
  if (const Failure failed = file.for_each_record([&](const Record& r) { records.push_back(r); }))
    throw std::runtime_error(*failed);
  return records;
}

void require_plain_records(const RenderOptions& o, const FrameRenderer& renderer) {
  const std::string_view option = !o.load_cache.empty()   ? "--load-cache"
                                  : !o.save_cache.empty() ? "--save-cache"
                                                          : "";
  if (option.empty() || renderer.keeps_plain_records()) return;
  throw std::runtime_error(fmt::format(
      "{}: a file holds records that are all there is to them, as irradiance_cache makes them "
      "by split_sphere or bounded, unguarded (--no-leak-guard), and instant_caching by split_sphere",
      option));
}

void save_records(const RenderOptions& o, const FrameRequest& request, const CacheContent& content,
                  unsigned threads, const FrameRenderer& renderer) {
  const Failure failed = save_records(o.save_cache, cache_config(request, threads), content,
                                      [&](const auto& f) { renderer.for_each_record(f); });
  if (failed) throw std::runtime_error(*failed);
}

void render_command(const RenderOptions& o) {
  require_paths(o);
  FrameSetup setup(o);
  setup.request().residual_share = o.residual;
  setup.request().keeps_residual = o.is_unbiased || !o.residual_out.empty();
  require_memory(fmt::format("a picture of {}", o.size), frame_bytes(setup.request()));
  setup.require_frame(o.frame);
  const CacheContent content = content_of(o, setup.rays().scene());
  if (!o.load_cache.empty() && o.cache == "null")
    tell_without_effect("icbench", "--load-cache", "on null, which keeps no records");
  if (!o.load_cache.empty()) setup.request().records = load_records(o, setup.rays().scene());
  // Never finished, only wiped: the last line is the one on standard output, once everything is written.
  Progress progress("render", frame_work(setup.request()));
  setup.request().progress = [&](double work) { progress.advance(work); };
  FrameRenderer renderer(setup.request());
  require_plain_records(o, renderer);
  setup.tell_notes();
  if (extension_of(o.out) == ".exr" && o.given_to->count("--exposure") > 0)
    tell_without_effect("icbench", "--exposure", "on EXR pictures");
  const FrameCost cost = renderer.render(o.frame);
  tell_few_vpls(setup.request(), cost.pass);
  Image picture = renderer.picture();
  if (o.is_unbiased) renderer.add_residual(picture);
  write_image(o.out, picture, {ExrSample::float_bits, o.exposure, o.is_unbiased});
  if (!o.residual_out.empty()) {
    Image layer = make_image(picture.width, picture.height);
    renderer.add_residual(layer);
    write_image(o.residual_out, layer, {ExrSample::float_bits, 1.0f, true});
  }
  if (!o.save_cache.empty()) save_records(o, setup.request(), content, cost.threads, renderer);
  const IntegratorEntry& integrator = setup.request().integrator;
  nlohmann::ordered_json json = setup.asked();
  json["frame"] = o.frame;
  add_cost(json, integrator, cost);
  if (!o.load_cache.empty()) json["records_loaded"] = cost.records_taken;
  if (cost.residual) add_residual(json, o, cost);
  json["image"] = std::filesystem::path(o.out).filename().string();
  if (!o.json.empty()) write_json(o.json, json);
  if (tells_figures(o.json)) {
    fmt::print("{}: {:.2f} s, {:.1f} million rays a second{}\n", o.out, cost.seconds,
               1e-6 * static_cast<double>(cost.rays.total()) / cost.seconds,
               integrator.needs_cache()
                   ? fmt::format(", {} record{}", cost.pass.records, cost.pass.records == 1 ? "" : "s")
                   : "");
    if (cost.residual) fmt::print("{}", told(*cost.residual));
  }
  judge_room(setup.request(), cost.pass.use);
}

}  // namespace

void add_render(CLI::App& app) {
  const auto o = std::make_shared<RenderOptions>();
  o->spp = 16;
  CLI::App* render = app.add_subcommand("render", "Render a picture (EXR or PNG)");
  add_frame_options(render, *o);
  add_whole(render, "--frame", o->frame, 0u, 1u << 24, "Frame of an animated scene, counted from 0");
  render->add_option("--out", o->out, "Picture: .exr (exact) or .png (for viewing)")
      ->capture_default_str()
      ->type_name("FILE");
  add_file(render, "--load-cache", o->load_cache,
           "Begin with the records of this file: of the same scene and\nframe, from any camera");
  add_file(render, "--save-cache", o->save_cache, "Keep the records that were made, for --load-cache");
  add_positive(render, "--residual", o->residual, 1.0f,
               "Also path trace this share of the pixels, chosen at random, to\nmeasure the bias of the "
               "indirect light")
      ->type_name("SHARE")
      ->default_str("");
  add_file(render, "--residual-out", o->residual_out,
           "Write true less rendered light, to add to the picture: .exr, with\nnegative values");
  render->add_flag("--unbiased", o->is_unbiased,
                   "Add it to --out: unbiased in every pixel, noisier, with negative\nvalues; .exr only");
  render->callback([o] { render_command(*o); });
}

}  // namespace icbench
