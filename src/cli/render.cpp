// icbench render: one picture, with what it cost.
#include <fmt/format.h>

#include <filesystem>
#include <memory>

#include "cli/command.h"
#include "cli/frame_options.h"
#include "cli/options.h"
#include "harness/progress.h"
#include "image/file.h"
#include "image/image.h"

namespace icbench {
namespace {

struct RenderOptions : FrameOptions {
  std::string out = "render.exr";
  std::uint32_t frame = 0;
};

void require_image_path(const std::string& path) {
  const std::string extension = std::filesystem::path(path).extension().string();
  if (extension != ".exr" && extension != ".png") {
    throw std::runtime_error(fmt::format("--out '{}' must end in .exr or .png", path));
  }
  require_writable("--out", path);
}

void render_command(const RenderOptions& o) {
  require_image_path(o.out);
  FrameSetup setup(o);
  const std::uint32_t frames = setup.rays().scene().frames;
  if (o.frame >= frames) {
    throw std::runtime_error(fmt::format("--frame {}: scene '{}' has {} frame{}, counted from 0", o.frame,
                                         o.scene, frames, frames == 1 ? "" : "s"));
  }
  // Never finished, only wiped: the last line is the one on standard output, once everything is written.
  Progress progress("render", frame_work(setup.request()));
  setup.request().progress = [&](double work) { progress.advance(work); };
  FrameRenderer renderer(setup.request());
  const FrameCost cost = renderer.render(o.frame);
  write_image(o.out, renderer.picture(), {ExrSample::float_bits, o.exposure});
  const IntegratorEntry& integrator = setup.request().integrator;
  nlohmann::ordered_json json = setup.asked();
  json["frame"] = o.frame;
  add_cost(json, integrator, cost);
  json["image"] = std::filesystem::path(o.out).filename().string();
  if (!o.json.empty()) write_file(o.json, json.dump(2) + "\n");
  fmt::print("{}: {:.2f} s, {:.1f} million rays a second{}\n", o.out, cost.seconds,
             1e-6 * static_cast<double>(cost.rays.total()) / cost.seconds,
             integrator.needs_cache() ? fmt::format(", {} records", cost.pass.records) : "");
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
  render->callback([o] { render_command(*o); });
}

}  // namespace icbench
