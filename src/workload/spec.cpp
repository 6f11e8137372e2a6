#include "workload/spec.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <functional>
#include <stdexcept>
#include <utility>

#include "caches/session.h"
#include "core/names.h"
#include "scene/registry.h"
#include "workload/names.h"

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

constexpr std::string_view kTrace = "trace";
constexpr double kMostScale = 1e6;

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
  return number + 0.0;  // -0 is 0, and has its name
}

struct Parameter {
  std::string_view key;
  std::function<void(WorkloadSpec&, std::string_view value)> set;
  std::function<std::string(const WorkloadSpec&)> get;  // canonical text of the value
};

/// A parameter whose values are names: `parse` finds the one called that, or throws with the known ones.
template <class Value>
Parameter named(std::string_view text, std::string_view key, Value WorkloadSpec::*member,
                std::vector<std::pair<std::string_view, Value>> values) {
  const auto set = [=](WorkloadSpec& spec, std::string_view value) {
    std::vector<std::string_view> names;
    for (const auto& [name, meaning] : values) {
      if (name == value) {
        spec.*member = meaning;
        return;
      }
      names.push_back(name);
    }
    fail(text, unknown_name(key, value, names));
  };
  const auto get = [=](const WorkloadSpec& spec) {
    for (const auto& [name, meaning] : values) {
      if (meaning == spec.*member) return std::string(name);
    }
    return std::string();
  };
  return {key, set, get};
}

/// The same of enumerators that have names everywhere.
template <class Enum>
Parameter enumerated(std::string_view text, std::string_view key, Enum WorkloadSpec::*member,
                     std::initializer_list<Enum> values) {
  std::vector<std::pair<std::string_view, Enum>> named_values;
  for (const Enum value : values) named_values.emplace_back(to_string(value), value);
  return named(text, key, member, std::move(named_values));
}

/// The parameters of a workload, in canonical order.
std::vector<Parameter> parameters_of(const WorkloadSpec& s, std::string_view text) {
  std::vector<Parameter> known;
  const auto add_number = [&](std::string_view key, double low, double high, bool whole, auto member) {
    using Field = std::remove_reference_t<decltype(s.*member)>;
    const auto set = [=](WorkloadSpec& spec, std::string_view value) {
      spec.*member =
          static_cast<std::remove_const_t<Field>>(parse_number(text, key, value, low, high, whole));
    };
    known.push_back({key, set, [=](const WorkloadSpec& spec) { return fmt::to_string(spec.*member); }});
  };
  if (s.kind == WorkloadKind::ray_traced) {
    known.push_back(enumerated(text, "integrator", &WorkloadSpec::method,
                               {Method::irradiance_cache, Method::path, Method::hash_cells}));
    add_number("rays", 1, 1 << 20, true, &WorkloadSpec::rays);
    add_number("a", shortest_decimal(kMinAccuracy), 1, false, &WorkloadSpec::a);
    add_number("spp", 1, 1 << 20, true, &WorkloadSpec::spp);
    add_number("cell", 1e-3, 1e4, false, &WorkloadSpec::cell);
    const auto set_size = [text](WorkloadSpec& spec, std::string_view value) {
      const std::size_t x = value.find('x');
      if (x == value.npos) fail(text, fmt::format("size={} is not of the form WIDTHxHEIGHT", value));
      const auto side = [&](std::string_view digits) {
        return static_cast<std::uint32_t>(parse_number(text, "size", digits, 1, 16384, true));
      };
      spec.width = side(value.substr(0, x));
      spec.height = side(value.substr(x + 1));
    };
    known.push_back({"size", set_size,
                     [](const WorkloadSpec& spec) { return fmt::format("{}x{}", spec.width, spec.height); }});
    known.push_back(enumerated(text, "tiles", &WorkloadSpec::tiles,
                               {TileOrder::scanline, TileOrder::morton, TileOrder::random}));
    return known;
  }
  if (s.kind == WorkloadKind::trace) {
    known.push_back({"file", [](WorkloadSpec& spec, std::string_view value) { spec.file = value; },
                     [](const WorkloadSpec& spec) { return spec.file; }});
    add_number("scale", 0, kMostScale, false, &WorkloadSpec::scale);
    known.push_back(
        named(text, "records", &WorkloadSpec::as_captured, {{"as_missed", false}, {"as_captured", true}}));
    return known;
  }
  known.push_back(enumerated(text, "order", &WorkloadSpec::order,
                             {PointOrder::uniform, PointOrder::hot_spot, PointOrder::coherent}));
  if (s.kind == WorkloadKind::miss_driven) {
    add_number("cost", 0, 1e6, false, &WorkloadSpec::cost_us);
  } else {
    add_number("records", 1, 1 << 24, true, &WorkloadSpec::records);
  }
  if (s.starts_filled()) {
    known.push_back(named(text, "layout", &WorkloadSpec::tidied, {{"as_inserted", false}, {"tidied", true}}));
  }
  if (s.kind != WorkloadKind::insert_only) {
    add_number("operations", 1, 1 << 28, true, &WorkloadSpec::operations);
  }
  add_number("a", shortest_decimal(kMinAccuracy), 1, false, &WorkloadSpec::a);
  std::vector<std::pair<std::string_view, std::string>> scenes;
  for (const SceneEntry& e : kScenes) scenes.emplace_back(e.name, e.name);
  known.push_back(named(text, "scene", &WorkloadSpec::scene, std::move(scenes)));
  return known;
}

/// Whether a parameter of ray-traced workloads makes a difference to an integrator.
bool uses(Method method, std::string_view key) {
  if (key == "rays" || key == "a") return method == Method::irradiance_cache;
  if (key == "spp") return method != Method::irradiance_cache;
  return key != "cell" || method == Method::hash_cells;
}

std::vector<std::string_view> base_names() {
  std::vector<std::string_view> names;
  for (const Synthetic& s : kSynthetic) names.push_back(s.name);
  for (const SceneEntry& s : kScenes) names.push_back(s.name);
  names.push_back(kTrace);
  return names;
}

WorkloadSpec base_spec(std::string_view base) {
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
  if (base == kTrace) {
    spec.kind = WorkloadKind::trace;
    return spec;
  }
  throw std::runtime_error(unknown_name("workload", base, base_names()));
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
    case WorkloadKind::trace:
      return "trace";
  }
  return "unknown";
}

WorkloadSpec trace_workload(const std::string& file, double scale, bool as_captured) {
  WorkloadSpec spec = base_spec(kTrace);
  spec.file = file;
  spec.scale = scale;
  spec.as_captured = as_captured;
  spec.name =
      fmt::format("{}:file={}:scale={}{}", kTrace, file, scale, as_captured ? ":records=as_captured" : "");
  return spec;
}

WorkloadSpec parse_workload(std::string_view text) {
  const std::size_t colon = text.find(':');
  const std::string_view base = text.substr(0, colon);
  WorkloadSpec spec = base_spec(base);
  const std::vector<Parameter> known = parameters_of(spec, text);
  std::vector<bool> given(known.size());
  for (std::size_t end = colon; end != text.npos;) {
    const std::size_t begin = end + 1;
    end = text.find(':', begin);
    const std::string_view pair = text.substr(begin, end - begin);
    const std::size_t equals = pair.find('=');
    if (equals == pair.npos) fail(text, fmt::format("'{}' is not of the form key=value", pair));
    const std::string_view key = pair.substr(0, equals);
    const auto at =
        std::find_if(known.begin(), known.end(), [&](const Parameter& p) { return p.key == key; });
    if (at == known.end()) {
      std::vector<std::string_view> keys;
      for (const Parameter& p : known) keys.push_back(p.key);
      fail(text, unknown_name("parameter", key, keys));
    }
    const auto index = static_cast<std::size_t>(at - known.begin());
    if (given[index]) fail(text, fmt::format("{} is given twice", key));
    given[index] = true;
    at->set(spec, pair.substr(equals + 1));
  }
  for (std::size_t i = 0; i < known.size(); ++i) {
    if (!given[i]) continue;
    spec.name += fmt::format(":{}={}", known[i].key, known[i].get(spec));
    if (spec.kind == WorkloadKind::ray_traced && !uses(spec.method, known[i].key))
      spec.idle.emplace_back(known[i].key);
  }
  // Every session may hold a batch of tickets that it does not use.
  constexpr std::uint64_t kMost = kMaxCapacity - std::uint64_t{kMaxSessions} * kTicketBatch;
  if (const std::uint64_t n = std::uint64_t{spec.prefilled()} + spec.inserts(); n > kMost) {
    fail(text,
         fmt::format("it stores {} records, a cache at most {}; lower operations or records", n, kMost));
  }
  return spec;
}

std::vector<WorkloadEntry> list_workloads() {
  std::vector<WorkloadEntry> entries;
  const auto add = [&](std::string_view name, std::string description) {
    const WorkloadSpec spec = base_spec(name);
    std::string parameters;
    for (const Parameter& p : parameters_of(spec, name)) {
      parameters += fmt::format("{}{}={}", parameters.empty() ? "" : " ", p.key, p.get(spec));
    }
    entries.push_back({std::string(name), std::move(description), std::move(parameters)});
  };
  for (const Synthetic& s : kSynthetic) add(s.name, std::string(s.description));
  for (const SceneEntry& s : kScenes) add(s.name, fmt::format("ray-traced: {}", s.description));
  add(kTrace, "what a render asked of its cache, from icbench trace capture");
  return entries;
}

}  // namespace icbench
