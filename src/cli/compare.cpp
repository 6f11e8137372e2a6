// icbench compare A B: error metrics of image B against the reference A, or of the frames of folder B against
// those of folder A.
#include "cli/compare.h"

#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "cli/options.h"
#include "core/names.h"
#include "files/json_file.h"
#include "files/memory.h"
#include "image/image.h"
#include "image/metrics/flicker.h"
#include "image/metrics/registry.h"

namespace icbench {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct CompareOptions {
  std::string reference, image, metrics = "rmse,relmse,mean_ratio,flip";
  std::string json, map;
  Viewing viewing;
  const CLI::App* given_to = nullptr;
};

/// Options of one metric's observer.
constexpr std::pair<const char*, std::string_view> kViewingOptions[] = {{"--luminance-scale", "hdrvdp"},
                                                                        {"--distance", "hdrvdp"},
                                                                        {"--display-pixels", "hdrvdp"},
                                                                        {"--display-size", "hdrvdp"},
                                                                        {"--pixels-per-degree", "flip"}};

void tell_viewing_without_effect(const CompareOptions& o, const std::vector<const Metric*>& metrics) {
  for (const auto& [option, metric] : kViewingOptions) {
    const bool is_used = std::any_of(metrics.begin(), metrics.end(),
                                     [name = metric](const Metric* each) { return each->name == name; });
    if (!is_used && o.given_to->count(option) > 0)
      tell_without_effect("icbench", option, fmt::format("without --metrics {}", metric));
  }
}

std::vector<const Metric*> find_metrics(const std::string& list) {
  const std::vector<std::string> names = split_list("--metrics", list);
  require_distinct("--metrics", names);
  std::vector<const Metric*> found;
  for (const std::string& name : names) {
    const Metric* metric = find_metric(name);
    if (!metric) {
      std::vector<std::string_view> known;
      for (const Metric& each : kMetrics) known.push_back(each.name);
      throw std::runtime_error(unknown_name("metric", name, known));
    }
    found.push_back(metric);
  }
  return found;
}

/// What tells a frame from the others of its folder: its name behind frame_, without leading zeros.
std::string digits_of(const fs::path& frame) {
  const std::string text = frame.stem().string().substr(std::string_view("frame_").size());
  return text.substr(std::min(text.find_first_not_of('0'), text.size()));
}

/// The images named frame_*.exr in a folder, or where there are none frame_*.png; in the order of their
/// numbers.
std::vector<fs::path> frames_of(const std::string& folder) {
  std::vector<fs::path> frames;
  for (const char* extension : {".exr", ".png"}) {
    std::error_code error;
    for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
      const fs::path& path = it->path();
      if (path.filename().string().starts_with("frame_") && path.extension() == extension)
        frames.push_back(path);
    }
    if (error)
      throw std::runtime_error(fmt::format("cannot list the folder '{}': {}", folder, error.message()));
    if (!frames.empty()) break;
  }
  if (frames.empty()) {
    throw std::runtime_error(fmt::format(
        "the folder '{}' holds no frame_*.exr or frame_*.png; icbench animate --out writes such folders",
        folder));
  }
  std::sort(frames.begin(), frames.end(), [](const fs::path& a, const fs::path& b) {
    const std::string x = digits_of(a), y = digits_of(b);
    return std::tuple(x.size(), x) < std::tuple(y.size(), y);
  });
  return frames;
}

/// Makes the folder, and throws unless files can be put there.
void make_folder(const fs::path& path) {
  std::error_code error;
  fs::create_directories(path, error);
  if (!error && !fs::is_directory(path, error)) error = std::make_error_code(std::errc::not_a_directory);
  if (error) {
    throw std::runtime_error(
        fmt::format("--map: cannot make the folder '{}': {}", path.string(), error.message()));
  }
  if (access(path.c_str(), W_OK | X_OK) != 0) {
    throw std::runtime_error(
        fmt::format("--map '{}': no permission to write there; choose another place", path.string()));
  }
}

/// Figures of one pair of images, named "metric" or "metric.part".
struct Figure {
  std::string_view metric, part;
  std::optional<double> value;

  std::string name() const { return fmt::format("{}{}{}", metric, part.empty() ? "" : ".", part); }
  std::string text(int digits) const { return value ? fmt::format("{:.{}g}", *value, digits) : "none"; }
};

void put(Json& json, const Figure& figure) {
  Json& place = json[std::string(figure.metric)];
  (figure.part.empty() ? place : place[std::string(figure.part)]) =
      figure.value ? Json(*figure.value) : Json();
}

/// Throws if a figure is none of this world's numbers.
void require_finite(const Figure& figure) {
  if (figure.value && !std::isfinite(*figure.value))
    throw std::runtime_error(fmt::format("{}: the values are too large to compare", figure.name()));
}

/// Means over frames of a figure, of those frames that have it.
struct MeanFigure {
  Figure figure;
  int frames = 0;

  void add(const Figure& one) {
    if (!one.value) return;
    figure.value = figure.value.value_or(0.0) + *one.value;
    ++frames;
  }
  Figure mean() const {
    Figure out = figure;
    if (out.value) *out.value /= frames;
    return out;
  }
};

/// Where the maps of one pair of images go: one file, less its extension, for each metric; empty for none.
using MapPlace = std::function<fs::path(const Metric&)>;

std::vector<Figure> figures_of(const Image& reference, const Image& image,
                               const std::vector<const Metric*>& metrics, const Viewing& viewing,
                               const MapPlace& map_place) {
  std::vector<Figure> figures;
  for (const Metric* metric : metrics) {
    Image map;
    const bool is_mapped = metric->has_map && map_place;
    for (const MetricValue& part : metric->compute(reference, image, is_mapped ? &map : nullptr, viewing)) {
      figures.push_back({metric->name, part.name, part.value});
      require_finite(figures.back());
    }
    if (!is_mapped) continue;
    const std::string place = map_place(*metric).string();
    write_image(place + ".exr", map);
    if (metric->paint) write_image(place + ".png", metric->paint(map, reference));
  }
  return figures;
}

Json viewing_json(const Viewing& viewing) {
  return {{"luminance_scale", viewing.luminance_scale},
          {"distance", viewing.distance},
          {"display_pixels", {viewing.display_pixels_x, viewing.display_pixels_y}},
          {"display_size", {viewing.display_width, viewing.display_height}},
          {"pixels_per_degree", pixels_per_degree(viewing).x},
          {"flip_pixels_per_degree", viewing.flip_pixels_per_degree}};
}

/// What both kinds of comparison begin their JSON with.
Json heading(const CompareOptions& options, const Image& reference) {
  return {{"reference", options.reference},
          {"image", options.image},
          {"width", reference.width},
          {"height", reference.height},
          {"viewing", viewing_json(options.viewing)}};
}

/// Throws unless there is memory for the images and for the metric that takes most.
void require_memory_for(const Image& reference, const std::vector<const Metric*>& metrics) {
  int most = 0;
  for (const Metric* metric : metrics) most = std::max(most, metric->bytes);
  require_memory(fmt::format("comparing images of {} x {}", reference.width, reference.height),
                 reference.pixels.size() * static_cast<std::uint64_t>(most));
}

/// Throws if figures would end in a frame, or maps in a folder of frames.
void require_folders_apart(const CompareOptions& options, const std::vector<const Metric*>& metrics,
                           const std::vector<fs::path>& references, const std::vector<fs::path>& images) {
  for (const auto& [name, frames] : {std::pair{"A", &references}, std::pair{"B", &images}})
    for (const fs::path& frame : *frames) require_apart({{"--json", options.json}}, {{name, frame}});
  if (options.map.empty()) return;
  for (const Metric* metric : metrics) {
    const fs::path folder = fs::path(options.map) / metric->name;
    for (const std::string& frames : {options.reference, options.image}) {
      std::error_code none;
      if (metric->has_map && fs::equivalent(folder, frames, none)) {
        throw std::runtime_error(
            fmt::format("--map '{}' would put maps of {} among the frames of '{}'; name another", options.map,
                        metric->name, frames));
      }
    }
  }
}

Json compare_images(const CompareOptions& options, const std::vector<const Metric*>& metrics, bool prints) {
  std::vector<GivenFile> written = {{"--json", options.json}};
  MapPlace map_place;
  if (!options.map.empty()) {
    map_place = [&](const Metric& metric) { return fs::path(options.map) / metric.name; };
    for (const Metric* metric : metrics) {
      for (const char* extension : {".exr", ".png"})
        if (metric->has_map) written.push_back({"--map", map_place(*metric).string() + extension});
    }
  }
  require_apart(written, {{"A", options.reference}, {"B", options.image}});
  const Image reference = read_image(options.reference);
  require_memory_for(reference, metrics);
  const Image image = read_image(options.image);
  if (!options.map.empty()) make_folder(options.map);
  Json json = heading(options, reference);
  for (const Figure& figure : figures_of(reference, image, metrics, options.viewing, map_place)) {
    if (prints) fmt::print("{} {}\n", figure.name(), figure.text(9));
    put(json, figure);
  }
  return json;
}

/// Whether a frame's number is the next after another's.
bool follows(const fs::path& before, const fs::path& frame) {
  const auto number = [](const fs::path& path) { return number_of<std::uint64_t>("0" + digits_of(path)); };
  const auto first = number(before), second = number(frame);
  return first && second && *second == *first + 1;
}

/// Frame by frame, two images and a difference in memory.
Json compare_folders(const CompareOptions& options, const std::vector<const Metric*>& metrics, bool prints) {
  const std::vector<fs::path> references = frames_of(options.reference), images = frames_of(options.image);
  if (references.size() != images.size()) {
    throw std::runtime_error(
        fmt::format("the folders '{}' and '{}' hold {} and {} frames; they must hold the same",
                    options.reference, options.image, references.size(), images.size()));
  }
  for (std::size_t i = 0; i < references.size(); ++i) {
    if (digits_of(references[i]) == digits_of(images[i])) continue;
    throw std::runtime_error(
        fmt::format("'{}' and '{}' are no frame of one number; the folders must hold the same frames",
                    references[i].string(), images[i].string()));
  }
  require_folders_apart(options, metrics, references, images);
  if (!options.map.empty()) {
    make_folder(options.map);
    for (const Metric* metric : metrics) {
      if (metric->has_map) make_folder(fs::path(options.map) / metric->name);
    }
  }

  Json json, frames = Json::array();
  std::vector<MeanFigure> means;
  Flicker flicker;
  for (std::size_t i = 0; i < references.size(); ++i) {
    const Image reference = read_image(references[i]);
    if (i == 0) require_memory_for(reference, metrics);
    const Image image = read_image(images[i]);
    if (i == 0) json = heading(options, reference);
    MapPlace map_place;
    if (!options.map.empty()) {
      map_place = [&](const Metric& metric) {
        return fs::path(options.map) / metric.name / images[i].stem();
      };
    }
    std::vector<Figure> figures;
    try {
      flicker.add(reference, image, i != 0 && follows(images[i - 1], images[i]));
      figures = figures_of(reference, image, metrics, options.viewing, map_place);
    } catch (const std::runtime_error& error) {
      throw std::runtime_error(fmt::format("{}: {}", images[i].string(), error.what()));
    }
    Json frame = {{"reference", references[i].filename().string()}, {"image", images[i].filename().string()}};
    std::string line = images[i].filename().string();
    for (std::size_t f = 0; f < figures.size(); ++f) {
      put(frame, figures[f]);
      line += fmt::format("  {} {}", figures[f].name(), figures[f].text(6));
      if (i == 0) means.push_back({{figures[f].metric, figures[f].part, {}}});
      means[f].add(figures[f]);
    }
    if (prints) fmt::print("{}\n", line);
    frames.push_back(std::move(frame));
  }

  std::vector<Figure> totals;
  for (const MeanFigure& mean : means) totals.push_back(mean.mean());
  totals.push_back({"flicker", "", flicker.value()});
  for (const Figure& total : totals) {
    require_finite(total);
    if (prints) fmt::print("{} {}\n", total.name(), total.text(9));
    put(json, total);
  }
  json["frames"] = std::move(frames);
  return json;
}

void compare(const CompareOptions& options) {
  const std::vector<const Metric*> metrics = find_metrics(options.metrics);
  check_viewing(options.viewing);
  if (!options.json.empty()) require_writable("--json", options.json);
  std::error_code none;
  const bool is_folder = fs::is_directory(options.reference, none);
  if (is_folder != fs::is_directory(options.image, none)) {
    throw std::runtime_error(fmt::format("'{}' and '{}' must be two images or two folders of frames",
                                         options.reference, options.image));
  }
  const bool prints = tells_figures(options.json);
  const Json json =
      is_folder ? compare_folders(options, metrics, prints) : compare_images(options, metrics, prints);
  tell_viewing_without_effect(options, metrics);
  const auto has_map = [](const Metric* metric) { return metric->has_map; };
  if (!options.map.empty() && std::none_of(metrics.begin(), metrics.end(), has_map))
    tell_without_effect("icbench", "--map", "on metrics without maps");
  if (!options.json.empty()) write_json(options.json, json);
}

double parse_number(const std::string& option, std::string_view text) {
  const std::optional<double> number = number_of<double>(text);
  if (!number) throw std::runtime_error(fmt::format("{} '{}' is not a number", option, text));
  return *number;
}

/// An option for a number, whose range check_viewing knows.
void add_number(CLI::App* command, const std::string& name, double& value, const std::string& help) {
  command
      ->add_option_function<std::string>(
          name, [&value, name](const std::string& text) { value = parse_number(name, text); }, help)
      ->type_name("X")
      ->default_str(fmt::to_string(value));
}

void add_viewing(CLI::App* command, Viewing& viewing) {
  add_number(command, "--luminance-scale", viewing.luminance_scale,
             "hdrvdp: luminance of radiance 1, cd/m^2\n(lumens per watt; Radiance's for white light)");
  add_number(command, "--distance", viewing.distance, "hdrvdp: from the eye to the display, metres");
  command
      ->add_option_function<std::string>(
          "--display-pixels",
          [&viewing](const std::string& text) {
            const std::size_t x = text.find('x');
            if (x == text.npos) {
              throw std::runtime_error(fmt::format("--display-pixels '{}' is not of the form WxH", text));
            }
            viewing.display_pixels_x = parse_whole("--display-pixels", text.substr(0, x), 1, 1 << 20);
            viewing.display_pixels_y = parse_whole("--display-pixels", text.substr(x + 1), 1, 1 << 20);
          },
          "hdrvdp: pixels of the display")
      ->type_name("WxH")
      ->default_str(fmt::format("{}x{}", viewing.display_pixels_x, viewing.display_pixels_y));
  command
      ->add_option_function<std::string>(
          "--display-size",
          [&viewing](const std::string& text) {
            const std::size_t x = text.find('x');
            if (x == text.npos) {
              throw std::runtime_error(fmt::format("--display-size '{}' is not of the form WxH", text));
            }
            viewing.display_width = parse_number("--display-size", std::string_view(text).substr(0, x));
            viewing.display_height = parse_number("--display-size", std::string_view(text).substr(x + 1));
          },
          "hdrvdp: size of the display, metres")
      ->type_name("WxH")
      ->default_str(fmt::format("{}x{}", viewing.display_width, viewing.display_height));
  add_number(command, "--pixels-per-degree", viewing.flip_pixels_per_degree,
             "flip: pixels per degree of visual angle");
}

}  // namespace

void add_compare(CLI::App& app) {
  const auto options = std::make_shared<CompareOptions>();
  std::string help = "Metrics, separated by commas:";
  for (const Metric& metric : kMetrics) help += fmt::format("\n{}\n  {}", metric.name, metric.closer);
  CLI::App* command =
      app.add_subcommand("compare", "Error metrics of an image or an animation against a reference");
  command
      ->add_option("A", options->reference,
                   "Reference: an image, .exr or .png,\nor a folder of frame_*.exr or frame_*.png")
      ->type_name("PATH")
      ->required();
  command
      ->add_option("B", options->image,
                   "What to judge, of the same size and number of frames;\nfolders give the mean of every "
                   "metric and flicker,\n"
                   "the RMS change of B - A from each frame to the next; none\n"
                   "where no frame follows another")
      ->type_name("PATH")
      ->required();
  command->add_option("--metrics", options->metrics, help)->type_name("LIST")->capture_default_str();
  add_file(command, "--json", options->json, "Write the figures to this file");
  command
      ->add_option("--map", options->map,
                   "Write error maps into this folder: METRIC.exr, coloured\nones as METRIC.png too; of "
                   "folders METRIC/FRAME.exr")
      ->check(is_named)
      ->type_name("FOLDER");
  add_viewing(command, options->viewing);
  options->given_to = command;
  command->callback([options] { compare(*options); });
}

void run_compare(std::vector<std::string> arguments) {
  CLI::App app;
  add_compare(app);
  arguments.insert(arguments.begin(), "compare");
  std::reverse(arguments.begin(), arguments.end());  // as CLI11 takes them
  app.parse(std::move(arguments));
}

}  // namespace icbench
