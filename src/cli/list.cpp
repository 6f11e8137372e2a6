// icbench list: what can be named elsewhere.
#include <fmt/format.h>

#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "cli/command.h"
#include "core/names.h"
#include "image/metrics/registry.h"
#include "render/integrators.h"
#include "scene/registry.h"
#include "workload/dispatch.h"
#include "workload/names.h"
#include "workload/spec.h"

namespace icbench {
namespace {

using Json = nlohmann::ordered_json;

Json caches() {
  Json out = Json::array();
  for (const CacheEntry& e : all_caches()) {
    const CacheTraits& t = e.traits;
    out.push_back({{"name", t.name},
                   {"structure", t.structure},
                   {"mechanism", t.mechanism},
                   {"insert", to_string(t.insert)},
                   {"query", to_string(t.query)},
                   {"consistency", to_string(t.consistency)},
                   {"single_thread", t.single_thread},
                   {"can_tidy", e.can_tidy},
                   {"source", t.source}});
  }
  return out;
}

Json scenes() {
  Json out = Json::array();
  for (const SceneEntry& e : kScenes) {
    out.push_back({{"name", e.name},
                   {"analytic", e.analytic},
                   {"accuracy", shortest_decimal(e.accuracy)},
                   {"description", e.description}});
  }
  return out;
}

Json integrators() {
  Json out = Json::array();
  for (const IntegratorEntry& e : kIntegrators) {
    out.push_back({{"name", e.name}, {"needs_cache", e.needs_cache()}, {"description", e.description}});
  }
  return out;
}

Json interpolations() {
  Json out = Json::array();
  for (const InterpolationEntry& e : kInterpolations)
    out.push_back({{"name", e.name}, {"description", e.description}});
  return out;
}

Json workloads() {
  Json out = Json::array();
  for (const WorkloadEntry& e : list_workloads()) {
    out.push_back({{"name", e.name}, {"description", e.description}, {"parameters", e.parameters}});
  }
  return out;
}

Json metrics() {
  Json out = Json::array();
  for (const Metric& m : kMetrics)
    out.push_back({{"name", m.name}, {"closer", m.closer}, {"source", m.source}});
  return out;
}

std::string cell(const Json& value) {
  return value.is_string()    ? value.get<std::string>()
         : value.is_boolean() ? (value.get<bool>() ? "yes" : "no")
                              : value.dump();
}

/// Columns as wide as their widest cell, the last one ragged.
std::string table(const Json& rows) {
  if (rows.empty()) return {};
  std::vector<std::string> keys;
  for (const auto& [key, value] : rows.front().items()) keys.push_back(key);
  std::vector<std::size_t> widths;
  for (const std::string& key : keys) {
    std::size_t width = key.size();
    for (const Json& row : rows) width = std::max(width, cell(row.at(key)).size());
    widths.push_back(key == keys.back() ? 0 : width);
  }
  std::string out;
  const auto add_line = [&](auto&& text) {
    for (std::size_t i = 0; i < keys.size(); ++i)
      out += fmt::format("{:<{}}{}", text(keys[i]), widths[i], i + 1 == keys.size() ? "\n" : "  ");
  };
  add_line([](const std::string& key) { return key; });
  for (const Json& row : rows) add_line([&](const std::string& key) { return cell(row.at(key)); });
  return out;
}

struct Listing {
  std::string_view name;
  Json (*make)();
};
constexpr Listing kListings[] = {{"caches", caches},           {"scenes", scenes},
                                 {"integrators", integrators}, {"interpolations", interpolations},
                                 {"workloads", workloads},     {"metrics", metrics}};

}  // namespace

void add_list(CLI::App& app) {
  struct Options {
    std::string what;
    bool json = false;
  };
  const auto options = std::make_shared<Options>();
  CLI::App* list =
      app.add_subcommand("list", "List caches, scenes, integrators, interpolations, workloads or metrics");
  list->add_option("WHAT", options->what,
                   "caches, scenes, integrators, interpolations, workloads or\nmetrics")
      ->type_name("")
      ->required();
  list->add_flag("--json", options->json, "As JSON, for programs");
  list->callback([options] {
    std::vector<std::string_view> known;
    for (const Listing& listing : kListings) {
      known.push_back(listing.name);
      if (listing.name != options->what) continue;
      const Json rows = listing.make();
      const std::string text = options->json ? rows.dump(2) + "\n" : table(rows);
      std::fputs(text.c_str(), stdout);  // the program tells in the end if it did not arrive
      return;
    }
    throw std::runtime_error(unknown_name("listing", options->what, known));
  });
}

}  // namespace icbench
