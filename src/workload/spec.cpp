#include "workload/spec.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <functional>
#include <stdexcept>

#include "core/names.h"
#include "scene/registry.h"

namespace icbench {
namespace {

struct Synthetic {
  std::string_view name;
  std::string_view description;
  WorkloadKind kind;
  std::uint32_t operations;
  std::uint32_t inserts_per_1000;
};

constexpr Synthetic kSynthetic[] = {
    {"read_only", "queries on a filled cache", WorkloadKind::read_only, 100'000, 0},
    {"insert_only", "inserts into an empty cache", WorkloadKind::insert_only, 100'000, 1000},
    {"mix_99_1", "99 % queries, 1 % inserts on a filled cache", WorkloadKind::mix, 100'000, 10},
    {"mix_90_10", "90 % queries, 10 % inserts on a filled cache", WorkloadKind::mix, 100'000, 100},
    {"mix_50_50", "half queries, half inserts on a filled cache", WorkloadKind::mix, 100'000, 500},
    {"miss_driven", "query; on a miss compute for a set time and insert; starts empty",
     WorkloadKind::miss_driven, 100'000, 0},
};

[[noreturn]] void fail(std::string_view workload, const std::string& what) {
  throw std::runtime_error(fmt::format("workload '{}': {}", workload, what));
}

double parse_number(std::string_view workload, std::string_view key, std::string_view value, double low,
                    double high, bool whole) {
  double number = 0.0;
  const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), number);
  if (error != std::errc{} || end != value.data() + value.size() || !(number >= low && number <= high) ||
      (whole && number != std::floor(number))) {
    fail(workload,
         fmt::format("{}={} is not a {}number from {} to {}", key, value, whole ? "whole " : "", low, high));
  }
  return number;
}

struct Parameter {
  std::string_view key;
  std::string default_value;
  std::function<void(WorkloadSpec&, std::string_view value)> set;
};

/// The parameters of a workload, in canonical order.
std::vector<Parameter> parameters_of(const WorkloadSpec& s, std::string_view text) {
  const auto number = [text](std::string_view key, double low, double high, bool whole, auto member) {
    return [=](WorkloadSpec& spec, std::string_view value) {
      using Field = std::remove_reference_t<decltype(spec.*member)>;
      spec.*member = static_cast<Field>(parse_number(text, key, value, low, high, whole));
    };
  };
  std::vector<Parameter> known;
  if (s.kind == WorkloadKind::ray_traced) {
    known.push_back({"integrator", "irradiance_cache", [text](WorkloadSpec& spec, std::string_view value) {
                       if (value != "path" && value != "irradiance_cache") {
                         fail(text, fmt::format("integrator={} is neither irradiance_cache nor path", value));
                       }
                       spec.path = value == "path";
                     }});
    known.push_back({"rays", fmt::to_string(s.rays), number("rays", 1, 1 << 20, true, &WorkloadSpec::rays)});
    known.push_back({"a", fmt::to_string(s.a), number("a", 0.001, 1, false, &WorkloadSpec::a)});
    known.push_back({"spp", fmt::to_string(s.spp), number("spp", 1, 1 << 20, true, &WorkloadSpec::spp)});
    known.push_back(
        {"size", fmt::format("{}x{}", s.width, s.height), [text](WorkloadSpec& spec, std::string_view value) {
           const std::size_t x = value.find('x');
           if (x == value.npos) fail(text, fmt::format("size={} is not of the form WxH", value));
           spec.width =
               static_cast<std::uint32_t>(parse_number(text, "size", value.substr(0, x), 1, 16384, true));
           spec.height =
               static_cast<std::uint32_t>(parse_number(text, "size", value.substr(x + 1), 1, 16384, true));
         }});
    known.push_back({"tiles", "morton", [](WorkloadSpec& spec, std::string_view value) {
                       spec.tiles = parse_tile_order(value);
                     }});
    return known;
  }
  known.push_back({"order", "uniform", [text](WorkloadSpec& spec, std::string_view value) {
                     if (value == "uniform") {
                       spec.order = PointOrder::uniform;
                     } else if (value == "hot_spot") {
                       spec.order = PointOrder::hot_spot;
                     } else if (value == "coherent") {
                       spec.order = PointOrder::coherent;
                     } else {
                       fail(text, fmt::format("order={} is none of uniform, hot_spot, coherent", value));
                     }
                   }});
  if (s.kind == WorkloadKind::miss_driven) {
    known.push_back(
        {"cost", fmt::to_string(s.cost_us), number("cost", 0, 1e6, false, &WorkloadSpec::cost_us)});
  } else {
    known.push_back(
        {"records", fmt::to_string(s.records), number("records", 1, 1 << 24, true, &WorkloadSpec::records)});
  }
  if (s.kind != WorkloadKind::insert_only) {
    known.push_back({"operations", fmt::to_string(s.operations),
                     number("operations", 1, 1 << 28, true, &WorkloadSpec::operations)});
  }
  known.push_back({"a", fmt::to_string(s.a), number("a", 0.001, 1, false, &WorkloadSpec::a)});
  known.push_back({"scene", s.scene, [](WorkloadSpec& spec, std::string_view value) {
                     make_scene(value);  // throws for an unknown name
                     spec.scene = value;
                   }});
  return known;
}

std::vector<std::string_view> base_names() {
  std::vector<std::string_view> names;
  for (const Synthetic& s : kSynthetic) names.push_back(s.name);
  for (const SceneEntry& s : kScenes) names.push_back(s.name);
  return names;
}

WorkloadSpec base_spec(std::string_view base, std::string_view text) {
  WorkloadSpec spec;
  spec.name = base;
  for (const Synthetic& s : kSynthetic) {
    if (s.name != base) continue;
    spec.kind = s.kind;
    spec.operations = s.operations;
    spec.inserts_per_1000 = s.inserts_per_1000;
    return spec;
  }
  for (const SceneEntry& s : kScenes) {
    if (s.name != base) continue;
    spec.kind = WorkloadKind::ray_traced;
    spec.scene = base;
    return spec;
  }
  fail(text, unknown_name("workload", base, base_names()));
}

}  // namespace

std::string_view to_string(WorkloadKind kind) noexcept {
  switch (kind) {
    case WorkloadKind::read_only:
      return "read_only";
    case WorkloadKind::insert_only:
      return "insert_only";
    case WorkloadKind::mix:
      return "mix";
    case WorkloadKind::miss_driven:
      return "miss_driven";
    case WorkloadKind::ray_traced:
      return "ray_traced";
  }
  return "unknown";
}

WorkloadSpec parse_workload(std::string_view text) {
  const std::size_t colon = text.find(':');
  const std::string_view base = text.substr(0, colon);
  WorkloadSpec spec = base_spec(base, text);
  const std::vector<Parameter> known = parameters_of(spec, text);
  std::vector<std::string> given(known.size());
  for (std::string_view rest = colon == text.npos ? "" : text.substr(colon + 1); !rest.empty();) {
    const std::size_t end = rest.find(':');
    const std::string_view pair = rest.substr(0, end);
    rest = end == rest.npos ? "" : rest.substr(end + 1);
    const std::size_t equals = pair.find('=');
    if (equals == pair.npos) fail(text, fmt::format("'{}' is not of the form key=value", pair));
    const std::string_view key = pair.substr(0, equals), value = pair.substr(equals + 1);
    bool found = false;
    for (std::size_t i = 0; i < known.size(); ++i) {
      if (known[i].key != key) continue;
      known[i].set(spec, value);
      given[i] = pair;
      found = true;
    }
    if (!found) {
      std::vector<std::string_view> keys;
      for (const Parameter& p : known) keys.push_back(p.key);
      fail(text, unknown_name("parameter", key, keys));
    }
  }
  for (const std::string& parameter : given) {
    if (!parameter.empty()) spec.name += ":" + parameter;
  }
  return spec;
}

std::vector<WorkloadEntry> list_workloads() {
  std::vector<WorkloadEntry> entries;
  const auto add = [&](std::string_view name, std::string description) {
    const WorkloadSpec spec = base_spec(name, name);
    std::string parameters;
    for (const Parameter& p : parameters_of(spec, name)) {
      parameters += fmt::format("{}{}={}", parameters.empty() ? "" : " ", p.key, p.default_value);
    }
    entries.push_back({std::string(name), std::move(description), std::move(parameters)});
  };
  for (const Synthetic& s : kSynthetic) add(s.name, std::string(s.description));
  for (const SceneEntry& s : kScenes) add(s.name, fmt::format("ray-traced: {}", s.description));
  return entries;
}

}  // namespace icbench
