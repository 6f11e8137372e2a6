// icbench compare A B: error metrics of image B against the reference A.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "cli/options.h"
#include "core/names.h"
#include "image/file.h"
#include "image/image.h"
#include "image/metrics/registry.h"

namespace icbench {
namespace {

struct CompareOptions {
  std::string reference, image;
  std::vector<std::string> metrics = {"rmse", "relmse", "mean_ratio"};
  std::string json, map;
};

std::vector<const Metric*> find_metrics(const std::vector<std::string>& names) {
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

void make_folder(const std::string& path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (error) throw std::runtime_error(fmt::format("cannot make the folder '{}': {}", path, error.message()));
}

void compare(const CompareOptions& options) {
  const std::vector<const Metric*> metrics = find_metrics(options.metrics);
  if (!options.json.empty()) require_writable("--json", options.json);
  const Image reference = read_image(options.reference);
  const Image image = read_image(options.image);
  if (!options.map.empty()) make_folder(options.map);

  nlohmann::ordered_json json = {{"reference", options.reference},
                                 {"image", options.image},
                                 {"width", reference.width},
                                 {"height", reference.height}};
  for (const Metric* metric : metrics) {
    Image map;
    const bool is_mapped = metric->has_map && !options.map.empty();
    for (const MetricValue& part : metric->compute(reference, image, is_mapped ? &map : nullptr)) {
      if (!std::isfinite(part.value)) {
        throw std::runtime_error(fmt::format("{}: the values are too large to compare", metric->name));
      }
      auto& figure = json[std::string(metric->name)];
      (part.name.empty() ? figure : figure[std::string(part.name)]) = part.value;
      fmt::print("{}{}{} {:.9g}\n", metric->name, part.name.empty() ? "" : ".", part.name, part.value);
    }
    if (is_mapped) write_image(std::filesystem::path(options.map) / fmt::format("{}.exr", metric->name), map);
  }
  if (!options.json.empty()) write_file(options.json, json.dump(2) + "\n");
}

}  // namespace

/// Registers the subcommand; its callback throws std::runtime_error with one line.
void add_compare(CLI::App& app) {
  const auto options = std::make_shared<CompareOptions>();
  std::string help = "Metrics, separated by commas:";
  for (const Metric& metric : kMetrics) help += fmt::format("\n{}\n  {}", metric.name, metric.closer);
  CLI::App* command = app.add_subcommand("compare", "Error metrics of an image against a reference");
  command->add_option("A", options->reference, "Reference image, .exr or .png")
      ->type_name("FILE")
      ->required();
  command->add_option("B", options->image, "Image to judge, .exr or .png, of the same size")
      ->type_name("FILE")
      ->required();
  command->add_option("--metrics", options->metrics, help)
      ->type_name("LIST")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->capture_default_str();
  command->add_option("--json", options->json, "Write the figures to this file")->type_name("FILE");
  command->add_option("--map", options->map, "Write error maps into this folder, one METRIC.exr each")
      ->type_name("FOLDER");
  command->callback([options] { compare(*options); });
}

}  // namespace icbench
