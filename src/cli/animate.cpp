// icbench animate: the frames of an animated scene one after the other, by one renderer that keeps its state, with
// what each cost.
//
// A frame's file appears whole or not at all, so that a run which is killed leaves whole frames only.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <vector>

#include "cli/command.h"
#include "cli/frame_options.h"
#include "cli/options.h"
#include "files/json_file.h"
#include "files/output_file.h"
#include "files/standard_streams.h"
#include "harness/progress.h"
#include "image/image.h"
#include "image/webp_animation.h"

namespace icbench {
namespace {

namespace fs = std::filesystem;

struct AnimateOptions : FrameOptions {
  std::string out = "animation", format = "png";
  std::uint32_t frames = 0, every = 1;
};

constexpr std::string_view kPreview = "preview.webp";
constexpr std::string_view kFormats[] = {"exr", "png", "none"};

fs::path frame_path(const AnimateOptions& o, std::uint32_t frame) {
  return fs::path(o.out) / fmt::format("frame_{:04}.{}", frame, o.format);
}

/// What is written to the folder.
std::set<fs::path> files_of(const AnimateOptions& o, const std::vector<std::uint32_t>& frames) {
  std::set<fs::path> ours{fs::path(o.out) / kPreview};
  for (const std::uint32_t frame : frames) ours.insert(frame_path(o, frame));
  return ours;
}

/// Throws if the folder has frames that this run would leave there, among its own, or if figures would end in one.
void require_no_others(const AnimateOptions& o, const std::set<fs::path>& ours) {
  const fs::path in_folder = fs::path(o.out) / fs::path(o.json).filename();
  if (ours.contains(in_folder) && is_same_file(o.json, in_folder))
    throw std::runtime_error(fmt::format("--json '{}' is a file of --out too; name another", o.json));
  std::error_code error;
  for (fs::directory_iterator it(o.out, error), end; !error && it != end; it.increment(error)) {
    const std::string name = it->path().filename().string(), extension = it->path().extension().string();
    if (!name.starts_with("frame_") || (extension != ".exr" && extension != ".png")) continue;
    if (ours.contains(it->path())) continue;
    throw std::runtime_error(
        fmt::format("--out '{}': {} there is of another animation; remove its frames or name another folder",
                    o.out, name));
  }
}

/// Makes the folder for the frames, unless there is one.
void prepare_folder(const std::string& out) {
  std::error_code error;
  fs::create_directories(out, error);
  if (error || !fs::is_directory(out, error)) {
    throw std::runtime_error(
        fmt::format("--out '{}': cannot make this folder; name one that can be written", out));
  }
  require_writable("--out", fs::path(out) / kPreview);
}

void add(FrameCost& sum, const FrameCost& cost) {
  sum.seconds += cost.seconds;
  sum.seconds_indirect += cost.seconds_indirect;
  sum.rays += cost.rays;
  PassFigures& to = sum.pass;
  const PassFigures& from = cost.pass;
  to.use += from.use;
  to.records = from.records;  // those at the end
  to.records_kept += from.records_kept;
  to.records_updated += from.records_updated;
  to.records_dropped += from.records_dropped;
  to.light_paths += from.light_paths;  // of each frame, as those that are traced anew
  to.light_paths_retraced += from.light_paths_retraced;
  to.bytes_beside_cache = from.bytes_beside_cache;
  to.bytes_of_details = from.bytes_of_details;
  to.vpls_in_use = from.vpls_in_use;
  to.lock_wait_ns += from.lock_wait_ns;
  sum.threads = cost.threads;
}

void animate_command(const AnimateOptions& o) {
  if (std::find(std::begin(kFormats), std::end(kFormats), o.format) == std::end(kFormats)) {
    throw std::runtime_error(unknown_name("format", o.format, kFormats));
  }
  const bool keeps = o.format != "none";
  require_apart({{"--json", o.json}}, {{"--scene", o.scene}});
  FrameSetup setup(o);
  const std::uint32_t frames = o.frames != 0 ? o.frames : setup.rays().scene().frames;
  const IntegratorEntry& integrator = setup.request().integrator;

  std::vector<std::uint32_t> rendered;
  for (std::uint32_t frame = 0; frame < frames; frame += std::min(o.every, std::max(frames - 1 - frame, 1u)))
    rendered.push_back(frame);
  const std::set<fs::path> ours = keeps ? files_of(o, rendered) : std::set<fs::path>();
  Descriptor alone;
  if (keeps) {
    prepare_folder(o.out);
    alone = lock_folder(o.out);
    require_no_others(o, ours);
  }

  setup.tell_notes();
  if (frames > 1 && !setup.rays().scene().is_animated())
    tell("note: '{}' is a still: its {} frames show the same\n", o.scene, frames);
  if (!keeps && o.given_to->count("--exposure") > 0)
    tell_without_effect("icbench", "--exposure", "without pictures");
  Progress progress("animate", static_cast<double>(rendered.size()) * frame_work(setup.request()));
  setup.request().progress = [&](double work) { progress.advance(work); };
  FrameRenderer renderer(setup.request());
  std::optional<WebpAnimation> preview;
  if (keeps) {
    preview.emplace(setup.request().width, setup.request().height, o.exposure);
    // Those of an earlier run, or a killed one would leave frames of two animations.
    std::error_code none;
    for (const fs::path& file : ours) fs::remove(file, none);
    if (fs::is_regular_file(o.json, none))
      fs::remove(o.json, none);  // and its figures beside those of this one
  }

  FrameCost total;
  nlohmann::ordered_json per_frame = nlohmann::ordered_json::array();
  for (const std::uint32_t frame : rendered) {
    const FrameCost cost = renderer.render(frame);
    if (frame == 0) tell_few_vpls(setup.request(), cost.pass);
    if (keeps) {
      write_image(frame_path(o, frame), renderer.picture(), {ExrSample::float_bits, o.exposure});
      preview->add(renderer.picture());
    }
    add(total, cost);
    add_cost(per_frame.emplace_back(nlohmann::ordered_json{{"frame", frame}}), integrator, cost);
  }
  if (keeps) preview->write(fs::path(o.out) / kPreview);
  nlohmann::ordered_json json = setup.asked();
  json["frame_count"] = rendered.size();
  add_cost(json, integrator, total);
  json["frames"] = std::move(per_frame);
  if (!o.json.empty()) write_json(o.json, json);
  if (tells_figures(o.json)) {
    fmt::print("{}: {} frame{} in {:.2f} s, {:.3f} s of them for the integrator's own pass\n",
               keeps ? o.out : o.scene, rendered.size(), rendered.size() == 1 ? "" : "s", total.seconds,
               total.seconds_indirect);
  }
  judge_room(setup.request(), total.pass.use);
}

}  // namespace

void add_animate(CLI::App& app) {
  const auto o = std::make_shared<AnimateOptions>();
  CLI::App* animate = app.add_subcommand("animate", "Render an animated scene frame by frame");
  add_frame_options(animate, *o);
  add_whole(animate, "--frames", o->frames, 1u, 1u << 24, "Frames from 0 on (default: the scene's)")
      ->default_str("");
  add_whole(animate, "--every", o->every, 1u, 1u << 24, "Of these every Nth, from the first on, and the last")
      ->capture_default_str();
  animate
      ->add_option(
          "--format", o->format,
          "Of frame_0000 and so on: exr, png, or none to measure only; with\nframes comes preview.webp")
      ->capture_default_str();
  animate->add_option("--out", o->out, "Folder for the frames; made if it is missing")
      ->capture_default_str()
      ->type_name("DIR");
  animate->callback([o] { animate_command(*o); });
}

}  // namespace icbench
