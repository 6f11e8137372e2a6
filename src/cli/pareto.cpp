// icbench pareto: speed against error of every method over its parameters, into a results file, and what is on the
// front to standard output.
#include "workload/pareto.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>

#include "cli/command.h"
#include "cli/frame_options.h"
#include "cli/options.h"
#include "files/json_file.h"
#include "files/memory.h"
#include "harness/environment.h"
#include "harness/progress.h"
#include "harness/statistics.h"
#include "image/metrics/flip.h"

namespace icbench {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct ParetoOptions {
  std::string scene = "cornell_box", out = "pareto.json", size = "256x256", methods = "all",
              cache = "wait_free";
  std::string grid = "full", images;
  unsigned repetitions = 5, threads = 0;
  std::uint32_t reference_spp = 1024, frame = 0;
  std::uint64_t seed = 1;
  bool resume = false;
  const CLI::App* given_to = nullptr;
};

/// Samples of `path` whose times are the budgets for which pictures are written.
constexpr double kBudgets[] = {16, 64};
/// Beside them: what they are.
constexpr const char* kImageIndex = "images.json";

std::vector<const ParetoMethod*> methods_of(const std::string& text) {
  std::vector<const ParetoMethod*> out;
  const std::vector<ParetoMethod>& known = pareto_methods();
  if (text == "all") {
    for (const ParetoMethod& method : known) out.push_back(&method);
    return out;
  }
  const std::vector<std::string> names = split_list("--methods", text);
  require_distinct("--methods", names);
  for (const std::string& name : names) out.push_back(&find_named("method", name, known));
  return out;
}

/// How a scene is called in results: a file by its name alone.
std::string label_of(const std::string& scene) {
  return scene.find('/') == scene.npos ? scene : fs::path(scene).filename().string();
}

/// Medians of what was measured of a setting.
struct Medians {
  double seconds, relmse, flip;
};

std::map<std::string, Medians> medians_of(const std::vector<Json>& rows) {
  std::map<std::string, std::map<std::string, std::vector<double>>> values;
  for (const Json& row : rows) {
    for (const char* field : {"seconds_indirect", "relmse", "flip"}) {
      values[row.at("name")][field].push_back(row.at(field));
    }
  }
  std::map<std::string, Medians> out;
  for (auto& [name, of] : values) {
    out[name] = {median(of["seconds_indirect"]), median(of["relmse"]), median(of["flip"])};
  }
  return out;
}

/// The front, a line for each of its points, by rising time.
void print_front(const std::map<std::string, Medians>& medians) {
  std::vector<std::pair<std::string, Medians>> points(medians.begin(), medians.end());
  std::sort(points.begin(), points.end(),
            [](const auto& a, const auto& b) { return a.second.seconds < b.second.seconds; });
  std::vector<double> seconds, relmse;
  for (const auto& [name, m] : points) {
    seconds.push_back(m.seconds);
    relmse.push_back(m.relmse);
  }
  const std::vector<bool> front = pareto_front(seconds, relmse);
  fmt::print("on the front, seconds of indirect light against relMSE:\n");
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (front[i]) fmt::print("{:>10.4g} s  {:<10.4g} {}\n", seconds[i], relmse[i], points[i].first);
  }
}

/// Exposure under which 95 % of the pixels are at most as bright as 0.9 of white.
float exposure_for(const Image& image) {
  std::vector<double> brightness;
  for (const glm::vec3& L : image.pixels) brightness.push_back(std::max({L.x, L.y, L.z}));
  const double bright = quantile(brightness, 0.95);
  return bright > 0.0 ? static_cast<float>(0.9 / bright) : 1.0f;
}

/// Writes for each budget the best that every method makes in that time, with its FLIP map, and images.json, which
/// tells what they are.
void write_images(const ParetoOptions& o, ParetoStudy& study, const std::vector<ParetoPoint>& points,
                  const std::map<std::string, Medians>& medians) {
  const fs::path folder = o.images;
  const Image truth = study.reference_view();
  const WriteOptions look{ExrSample::float_bits, exposure_for(truth)};
  write_image(folder / "reference.png", truth, look);
  Json index{{"scene", label_of(o.scene)}, {"exposure", look.exposure}, {"reference", "reference.png"}};
  for (const double budget : kBudgets) {
    const auto is_budget = [&](const ParetoPoint& p) {
      return p.method->name == "path" && p.values.front() == budget;
    };
    const auto at = std::find_if(points.begin(), points.end(), is_budget);
    const double seconds = medians.at(study.name_of(*at)).seconds;
    // Of the settings of a method that the budget pays the best: on the method's own front the nearest below.
    std::map<std::string_view, const ParetoPoint*> nearest;
    for (const ParetoPoint& p : points) {
      const ParetoPoint*& best = nearest[p.method->name];
      const Medians& mine = medians.at(study.name_of(p));
      if (mine.seconds <= seconds &&
          (best == nullptr || mine.relmse < medians.at(study.name_of(*best)).relmse)) {
        best = &p;
      }
    }
    Json pictures = Json::array();
    for (const ParetoMethod& method : pareto_methods()) {
      const auto found = nearest.find(method.name);
      if (found == nearest.end()) continue;
      Json picture{{"method", method.name}};
      if (const ParetoPoint* p = found->second; p != nullptr) {
        const Medians& m = medians.at(study.name_of(*p));
        const Image image = study.view(*p);
        Image map;
        flip(truth, image, &map, {});
        const std::string stem = fmt::format("{}_{}", budget, method.name);
        write_image(folder / (stem + ".png"), image, look);
        write_image(folder / (stem + "_error.png"), paint_flip(map, truth));
        picture.update({{"setting", setting_of(*p)},
                        {"seconds", m.seconds},
                        {"relmse", m.relmse},
                        {"flip", m.flip},
                        {"image", stem + ".png"},
                        {"map", stem + "_error.png"}});
      }
      pictures.push_back(picture);
    }
    index["budgets"].push_back({{"spp", budget}, {"seconds", seconds}, {"pictures", pictures}});
  }
  write_json(folder / kImageIndex, index);
}

/// Throws unless pictures can be made and put there.
void prepare_images(const ParetoOptions& o, const std::vector<ParetoPoint>& points) {
  for (const double budget : kBudgets) {
    const bool is_there = std::any_of(points.begin(), points.end(), [&](const ParetoPoint& p) {
      return p.method->name == "path" && p.values.front() == budget;
    });
    if (!is_there) throw std::runtime_error("--images takes its times from path; add path to --methods");
  }
  std::error_code error;
  fs::create_directories(o.images, error);
  if (error || !fs::is_directory(o.images, error)) {
    throw std::runtime_error(
        fmt::format("--images '{}': cannot make this folder; name one that can be written", o.images));
  }
  require_writable("--images", fs::path(o.images) / kImageIndex);
}

void pareto_command(const ParetoOptions& o) {
  if (o.grid != "full" && o.grid != "coarse") {
    constexpr std::string_view kGrids[] = {"full", "coarse"};
    throw std::runtime_error(unknown_name("grid", o.grid, kGrids));
  }
  const std::vector<const ParetoMethod*> methods = methods_of(o.methods);
  const std::vector<ParetoPoint> points = pareto_points(methods, o.grid == "coarse");
  require_apart({{"--out", o.out}, {"--images", o.images.empty() ? "" : fs::path(o.images) / kImageIndex}},
                {{"--scene", o.scene}});
  if (!o.images.empty()) prepare_images(o, points);
  FrameOptions frame;
  frame.scene = o.scene;
  frame.size = o.size;
  frame.cache = o.cache;
  frame.threads = o.threads;
  FrameSetup setup(frame);
  setup.require_frame(o.frame);
  const ParetoRequest request{setup.request(), label_of(o.scene), o.frame,
                              o.repetitions,   o.reference_spp,   o.seed};
  require_memory(fmt::format("{} settings at {}", points.size(), o.size),
                 pareto_bytes(request, points.size()));
  setup.tell_notes();
  const auto uses_cache = [](const ParetoMethod* m) { return m->integrator.needs_cache(); };
  if (o.given_to->count("--cache") > 0 && std::none_of(methods.begin(), methods.end(), uses_cache))
    tell_without_effect("icbench", "--cache", "on these methods");

  const Topology topology = Topology::of_this_process();
  const unsigned threads = setup.request().team.size();
  RunInfo info;
  info.command_line = command_line();
  info.seed = o.seed;
  info.thread_counts = {threads};
  Json context = environment(topology, info);
  context["relmse_of"] = "pictures scaled by 1 / mean luminance of the reference";
  std::vector<std::string> settings;
  for (const ParetoPoint& p : points) settings.push_back(fmt::format("{}/{}", p.method->name, setting_of(p)));
  const Json configuration{{"command", "pareto"},
                           {"scene", o.scene},
                           {"scene_key", key_text(picture_key(setup.rays().scene(), o.frame))},
                           {"size", o.size},
                           {"settings", settings},
                           {"cache", o.cache},
                           {"threads", threads},
                           {"repetitions", o.repetitions},
                           {"reference_spp", o.reference_spp},
                           {"frame", o.frame},
                           {"seed", o.seed},
                           {"environment", environment_identity(context)}};
  if (!o.images.empty()) {
    const fs::path folder = fs::weakly_canonical(fs::absolute(o.out)).parent_path();
    context["images"] = fs::weakly_canonical(fs::absolute(o.images)).lexically_relative(folder).string();
  }
  ResultsWriter results(o.out, context, configuration, o.resume ? OnExisting::resume : OnExisting::replace);
  if (!o.images.empty()) {
    results.note("images", context["images"]);
    // Until all are written anew: an index of earlier pictures would be taken for one of these.
    std::error_code none;
    fs::remove(fs::path(o.images) / kImageIndex, none);
  }

  Progress preparing("reference", ParetoStudy::reference_work(request));
  ParetoStudy study(request, [&](double work) { preparing.advance(work); });
  std::vector<Json> rows = results.rows();
  Progress progress("pareto", static_cast<double>(points.size() * o.repetitions));
  for (unsigned repetition = 0; repetition < o.repetitions; ++repetition) {
    std::vector<ParetoPoint> order = points;
    Pcg32 random(hash_keys(o.seed, repetition, 12));
    std::shuffle(order.begin(), order.end(), random);
    for (const ParetoPoint& point : order) {
      const std::string name = study.name_of(point);
      if (results.is_completed(name, repetition)) {
        progress.skip(1);
        continue;
      }
      const Entry entry = study.run(point, repetition);
      results.add(entry);
      Json& row = rows.emplace_back(entry.counters);
      row["name"] = name;
      progress.advance(1, name);
    }
  }
  const std::map<std::string, Medians> medians = medians_of(rows);
  if (!o.images.empty()) write_images(o, study, points, medians);
  results.finish();
  if (tells_figures(o.out)) print_front(medians);
  progress.finish();
}

}  // namespace

void add_pareto(CLI::App& app) {
  const auto o = std::make_shared<ParetoOptions>();
  CLI::App* pareto =
      app.add_subcommand("pareto",
                         "Measure speed against error of every method over its parameters.\n"
                         "relMSE is of pictures scaled by 1 / mean luminance of the reference.");
  o->given_to = pareto;
  const auto add_text = [&](const char* name, std::string& value, const char* help) {
    return pareto->add_option(name, value, help)->capture_default_str();
  };
  add_text("--scene", o->scene, "Scene, or a file; as for icbench render")->type_name("NAME|FILE");
  std::string known = "Methods, separated by commas, or all:";
  for (const ParetoMethod& method : pareto_methods()) known += fmt::format("\n{}", method.name);
  pareto->add_option("--methods", o->methods, known)->capture_default_str()->type_name("LIST");
  add_text("--grid", o->grid, "Values of their parameters: full, or coarse, which is every other");
  add_text("--cache", o->cache, "Cache, for the methods that use one");
  add_text("--size", o->size, "WIDTHxHEIGHT, pixels");
  add_whole(pareto, "--repetitions", o->repetitions, 1u, 100'000u,
            "Independent runs of every setting; two and more tell bias\nfrom variance");
  add_whole(pareto, "--reference-spp", o->reference_spp, 2u, 1u << 24,
            "Samples per pixel of the path-traced references");
  add_whole(pareto, "--frame", o->frame, 0u, 1u << 24, "Frame of an animated scene, counted from 0");
  add_whole(pareto, "--seed", o->seed, std::uint64_t{0}, ~std::uint64_t{0}, "Seed of all random numbers");
  add_whole(pareto, "--threads", o->threads, 1u, kMaxThreads,
            "Threads, 1 to 8192 (default: one a processing unit)")
      ->default_str("");
  add_text("--out", o->out, "Results (JSON); written as the work goes on")->type_name("FILE");
  pareto->add_flag("--resume", o->resume, "Go on with the interrupted run of --out");
  pareto
      ->add_option(
          "--images", o->images,
          "Also write pictures with error maps, of what each method\nmakes in the time of path with 16 "
          "and with 64 samples")
      ->check(is_named)
      ->type_name("DIR");
  pareto->callback([o] { pareto_command(*o); });
}

}  // namespace icbench
