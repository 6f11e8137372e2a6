// icbench repeatability: how far pictures of one seed lie apart because several threads fill a cache, into a results
// file, and in short to standard output.
#include "workload/repeatability.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>

#include "cli/cache_list.h"
#include "cli/command.h"
#include "cli/frame_options.h"
#include "cli/options.h"
#include "files/memory.h"
#include "files/standard_streams.h"
#include "harness/environment.h"
#include "harness/progress.h"
#include "harness/statistics.h"

namespace icbench {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct RepeatabilityOptions {
  FrameOptions frame;
  std::string caches = "all", out = "repeatability.json";
  std::vector<unsigned> threads;
  std::uint32_t number = 0, reference_spp = 256;
  unsigned repetitions = 5;
  bool resume = false;
};

/// One, all processing units, and four times as many.
std::vector<unsigned> default_threads(const Topology& topology) {
  const auto units = static_cast<unsigned>(topology.units().size());
  std::vector<unsigned> out{1};
  if (units > 1) out.push_back(units);
  out.push_back(std::min(4 * units, kMaxThreads));
  return out;
}

/// Throws unless there is an integrator of that name, and one that uses a cache.
void require_cached(const std::string& name) {
  if (find_integrator(name).needs_cache()) return;
  std::vector<std::string_view> known;
  for (const IntegratorEntry& entry : kIntegrators)
    if (entry.needs_cache()) known.push_back(entry.name);
  throw std::runtime_error(fmt::format("--integrator {} uses no cache that threads could share; use {}", name,
                                       fmt::join(known, ", ")));
}

/// A line for each point: what threads changed, by the medians.
void print_summary(const std::vector<Json>& rows) {
  std::vector<std::string> order;
  std::map<std::string, std::map<std::string, std::vector<double>>> values;
  for (const Json& row : rows) {
    const std::string name = row.at("name");
    if (!values.contains(name)) order.push_back(name);
    for (const char* field : {"rms_to_single_share_of_mean", "rms_to_single_share_of_error",
                              "rms_to_last_run_share_of_mean", "redundant_records"}) {
      if (!row.contains(field) || !row.at(field).is_number()) continue;
      const double value = row.at(field);
      if (std::isfinite(value)) values[name][field].push_back(value);  // of an error of 0 nothing is a share
    }
  }
  std::sort(order.begin(), order.end());
  const auto percent = [](const std::vector<double>& v) {
    return v.empty() ? std::string("-") : fmt::format("{:.3g} %", 100.0 * median(v));
  };
  fmt::print("{:>10} {:>14} {:>13} {:>10}\n{:>10} {:>14} {:>13} {:>10}\n", "from one", "share of the",
             "run to run", "redundant", "thread", "error", "", "records");
  for (const std::string& name : order) {
    auto& v = values[name];
    fmt::print("{:>10} {:>14} {:>13} {:>10.0f}  {}\n", percent(v["rms_to_single_share_of_mean"]),
               percent(v["rms_to_single_share_of_error"]), percent(v["rms_to_last_run_share_of_mean"]),
               median(v["redundant_records"]), name);
  }
}

void repeatability_command(const RepeatabilityOptions& o) {
  require_cached(o.frame.integrator);
  const std::vector<const CacheEntry*> caches = caches_of(o.caches);
  require_apart({{"--out", o.out}}, {{"--scene", o.frame.scene}});
  FrameOptions frame = o.frame;
  frame.threads = 1;  // of what all teams share
  FrameSetup setup(frame);
  setup.require_frame(o.number);
  const Topology topology = Topology::of_this_process();
  const std::vector<unsigned> threads = o.threads.empty() ? default_threads(topology) : o.threads;
  const std::vector<RepeatabilityPoint> points = repeatability_points(caches, threads);
  const std::string scene = fs::path(o.frame.scene).filename().string();
  const RepeatabilityRequest request{
      setup.request(), scene, o.number, parse_placement(o.frame.placement), o.repetitions, o.reference_spp};
  require_memory(fmt::format("{} pictures of {}", points.size(), o.frame.size),
                 repeatability_bytes(request, points.size()));
  setup.tell_notes();

  RunInfo info;
  info.command_line = command_line();
  info.seed = o.frame.seed;
  info.placement = request.placement;
  info.thread_counts = threads;
  const Json context = environment(topology, info);
  Json configuration = setup.asked();
  configuration.erase("threads");
  configuration.erase("cache");
  configuration.erase("light_samples");
  configuration.update(Json{{"command", "repeatability"},
                            {"scene_key", key_text(picture_key(setup.rays().scene(), o.number))},
                            {"caches", names_of(caches)},
                            {"thread_counts", threads},
                            {"placement", o.frame.placement},
                            {"tiles", o.frame.tiles},
                            {"repetitions", o.repetitions},
                            {"reference_spp", o.reference_spp},
                            {"frame", o.number},
                            {"environment", environment_identity(context)}});
  ResultsWriter results(o.out, context, configuration, o.resume ? OnExisting::resume : OnExisting::replace);
  for (const CacheEntry* cache : caches) {
    if (cache->traits.single_thread && threads != std::vector{1u})
      tell("note: {} serves one thread, and is measured with one\n", cache->traits.name);
  }

  Progress preparing("reference", RepeatabilityStudy::reference_work(request));
  RepeatabilityStudy study(request, topology, [&](double work) { preparing.advance(work); });
  Progress progress("repeatability", static_cast<double>(points.size() * o.repetitions));
  std::vector<Json> rows = results.rows();
  for (unsigned repetition = 0; repetition < o.repetitions; ++repetition) {
    // A run is compared with the same one on fewer threads, so the counts of a cache keep their order.
    std::vector<const CacheEntry*> order = caches;
    Pcg32 random(hash_keys(o.frame.seed, repetition, 13));
    std::shuffle(order.begin(), order.end(), random);
    for (const CacheEntry* cache : order) {
      for (const RepeatabilityPoint& point : points) {
        if (point.cache != cache) continue;
        const std::string name = study.name_of(point);
        if (results.is_completed(name, repetition)) {
          progress.skip(1);
          continue;
        }
        const Entry entry = study.run(point, repetition);
        results.add(entry);
        rows.emplace_back(entry.counters)["name"] = name;
        progress.advance(1, name);
      }
    }
  }
  results.finish();
  if (tells_figures(o.out)) print_summary(rows);
  progress.finish();
}

}  // namespace

void add_repeatability(CLI::App& app) {
  const auto o = std::make_shared<RepeatabilityOptions>();
  FrameOptions& f = o->frame;
  CLI::App* command =
      app.add_subcommand("repeatability", "Measure how far apart threads move pictures of one seed");
  f.given_to = command;
  const auto add_text = [&](const char* name, std::string& value, const char* help) {
    return command->add_option(name, value, help)->capture_default_str();
  };
  add_text("--scene", f.scene, "Scene, or a file; as for icbench render")->type_name("NAME|FILE");
  add_text("--integrator", f.integrator, "Integrator, one that uses a cache")->type_name("NAME");
  add_text("--caches", o->caches,
           "Caches, separated by commas; all leaves out brute_force, the\noracle; see icbench list caches")
      ->type_name("LIST");
  command
      ->add_option_function<std::string>(
          "--threads", [o](const std::string& text) { o->threads = parse_threads(text); },
          "Thread counts, 1 to 8192, separated by commas (default: one, the\nprocessing units, four times "
          "these)")
      ->type_name("LIST");
  add_text("--placement", f.placement, "How threads are pinned: compact, scatter or none");
  add_text("--size", f.size, "WIDTHxHEIGHT, pixels");
  add_whole(command, "--rays", f.rays, 1u, 1u << 20, "irradiance_cache: gather rays per record");
  add_whole(command, "--vpls", f.vpls, 1u, 1u << 16,
            "Virtual point lights, for the integrators that use them");
  add_positive(command, "--accuracy", f.accuracy, 1.0f,
               "Accuracy a of the cache, 0.002 to 1; smaller is finer", kMinAccuracy);
  add_text("--interpolation", f.interpolation,
           "How records are interpolated; see icbench list interpolations")
      ->type_name("NAME");
  command->add_flag("--deterministic", f.deterministic,
                    "Pictures as icbench render --deterministic makes them: all\ndifferences are 0");
  add_text("--tiles", f.tiles, "Order of the tiles: scanline, morton or random");
  add_whole(command, "--repetitions", o->repetitions, 1u, 100'000u,
            "Runs of every cache on every number of threads, all of one seed");
  add_whole(command, "--reference-spp", o->reference_spp, 2u, 1u << 24,
            "Samples per pixel of the path-traced reference");
  add_whole(command, "--frame", o->number, 0u, 1u << 24, "Frame of an animated scene, counted from 0");
  add_whole(command, "--seed", f.seed, std::uint64_t{0}, ~std::uint64_t{0}, "Seed of all random numbers");
  add_text("--out,--json", o->out, "Results (JSON); written as the work goes on")->type_name("FILE");
  command->add_flag("--resume", o->resume, "Go on with the interrupted run of --out");
  command->callback([o] { repeatability_command(*o); });
}

}  // namespace icbench
