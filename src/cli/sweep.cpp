// icbench sweep: workloads x caches x threads, into a results file.
#include "workload/sweep.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <optional>
#include <utility>

#include "cli/cache_list.h"
#include "cli/command.h"
#include "cli/options.h"
#include "files/json_file.h"
#include "harness/environment.h"
#include "harness/perf_counters.h"
#include "harness/progress.h"
#include "harness/timeline.h"
#include "workload/names.h"

namespace icbench {
namespace {

struct SweepOptions {
  std::string caches = "all", workloads = "read_only,miss_driven", placement = "compact",
              out = "results.json";
  std::vector<unsigned> threads;
  unsigned repetitions = 7;
  std::uint64_t seed = 1;
  std::uint32_t latency_every = 16;
  std::uint32_t reference_spp = 1024;
  std::string timeline;  // no file: none
  std::uint32_t timeline_events = 100'000;
  bool breakdown = false, resume = false, dry_run = false, list = false;
  const CLI::App* given_to = nullptr;
};

SweepRequest request_of(const SweepOptions& o, const Topology& topology) {
  SweepRequest request;
  for (const std::string& text : split_list("--workloads", o.workloads)) {
    request.workloads.push_back(parse_workload(text));
  }
  request.caches = names_of(caches_of(o.caches));
  request.threads = o.threads;
  if (request.threads.empty())
    request.threads = default_thread_counts(static_cast<unsigned>(topology.units().size()));
  request.placement = parse_placement(o.placement);
  request.repetitions = o.repetitions;
  request.seed = o.seed;
  request.latency_every = o.breakdown ? 1 : o.latency_every;  // every operation is timed then
  request.reference_spp = o.reference_spp;
  request.breakdown = o.breakdown;
  for (WorkloadSpec& w : request.workloads)
    if (w.kind == WorkloadKind::trace) w.checksum = trace_checksum(w);
  std::vector<std::string> names;
  for (const WorkloadSpec& w : request.workloads) names.push_back(w.name);
  require_distinct("--workloads", names);
  return request;
}

/// Everything that must be equal for rows to belong into one file.
nlohmann::ordered_json configuration_of(const SweepRequest& r, const nlohmann::ordered_json& environment) {
  std::vector<std::string> workloads;
  for (const WorkloadSpec& w : r.workloads) workloads.push_back(w.name);
  nlohmann::ordered_json out = {{"command", "sweep"},
                                {"workloads", workloads},
                                {"caches", r.caches},
                                {"threads", r.threads},
                                {"placement", to_string(r.placement)},
                                {"repetitions", r.repetitions},
                                {"seed", r.seed},
                                {"latency_every", r.latency_every},
                                {"reference_spp", r.reference_spp},
                                {"environment", environment_identity(environment)}};
  if (r.breakdown) out["breakdown"] = true;
  for (const WorkloadSpec& w : r.workloads)
    if (w.kind == WorkloadKind::trace) out["traces"][w.name] = key_text(w.checksum);
  return out;
}

void tell_options_without_effect(const SweepOptions& o, const SweepRequest& request) {
  for (const WorkloadSpec& w : request.workloads)
    for (const std::string& key : w.idle)
      tell_without_effect("icbench", fmt::format("{} of workload '{}'", key, w.name),
                          fmt::format("on {}", to_string(w.method)));
  const auto is_given = [&](const char* option) { return o.given_to->count(option) > 0; };
  if (o.timeline.empty() && is_given("--timeline-events"))
    tell_without_effect("icbench", "--timeline-events", "without --timeline");
  if (o.breakdown && is_given("--latency-every"))
    tell_without_effect("icbench", "--latency-every", "with --breakdown, which times every operation");
  for (const char* mode : {"--dry-run", "--list"})
    for (const char* option : {"--resume", "--timeline"})
      if (is_given(mode) && is_given(option))
        tell_without_effect("icbench", option, fmt::format("with {}, which is of the whole sweep", mode));
  const auto is_rendered = [](const WorkloadSpec& w) { return w.kind == WorkloadKind::ray_traced; };
  if (is_given("--reference-spp") &&
      std::none_of(request.workloads.begin(), request.workloads.end(), is_rendered))
    tell_without_effect("icbench", "--reference-spp", "without a ray-traced workload");
}

/// The timeline of a trial, of its own point: nobody else's options decide what is drawn.
void write_timeline(const SweepOptions& o, const Sweep& sweep, const SweepPoint& point, const Entry& entry,
                    const Timeline& timeline) {
  nlohmann::ordered_json about = {{"workload", sweep.request().workloads[point.workload].name},
                                  {"cache", point.cache_name()},
                                  {"wall_ms", entry.real_time},
                                  {"command_line", command_line()}};
  write_json(o.timeline, timeline.to_json(entry.name, about), -1);
}

/// Runs a trial for its time alone.
void run_valid(Sweep& sweep, const SweepPoint& point) {
  try {
    sweep.run(point, 0);
  } catch (const InvalidTrial& e) {
    throw CheckFailed(e.what());
  }
}

/// Measures one trial of each workload, and one that keeps no records if there is one, since that may take a hundred
/// times as long; tells what the whole sweep would take.
void estimate(Sweep& sweep, const Topology& topology) {
  const SweepRequest& r = sweep.request();
  using Clock = std::chrono::steady_clock;
  const auto seconds_since = [](Clock::time_point t) {
    return std::chrono::duration<double>(Clock::now() - t).count();
  };
  double total = 0.0;
  std::size_t trials = 0;
  for (std::size_t w = 0; w < r.workloads.size(); ++w) {
    const std::vector<SweepPoint> points = sweep.points(w, 0);
    if (points.empty()) continue;
    const auto keeps_none = [](const SweepPoint& p) {
      return p.cache != nullptr && p.cache->traits.consistency == Consistency::none;
    };
    const auto [kept, dropped] = std::pair{std::find_if_not(points.begin(), points.end(), keeps_none),
                                           std::find_if(points.begin(), points.end(), keeps_none)};
    const auto start = Clock::now();
    run_valid(sweep, kept != points.end() ? *kept : *dropped);  // prepares the workload
    double workload = seconds_since(start);
    // A trial's time goes down with the processors its threads keep busy.
    const auto speed = [&](unsigned threads) {
      return static_cast<double>(std::min<std::size_t>(threads, topology.units().size()));
    };
    const auto on_one_unit = [&](auto point) {
      if (point == points.end()) return 0.0;
      const auto again = Clock::now();
      run_valid(sweep, *point);
      return seconds_since(again) * speed(point->threads);
    };
    const double keeping = on_one_unit(kept), dropping = on_one_unit(dropped);
    for (const SweepPoint& p : points)
      workload += r.repetitions * (keeps_none(p) ? dropping : keeping) / speed(p.threads);
    total += workload;
    trials += points.size() * r.repetitions;
    fmt::print("{:<44} {:>6} trials  {:>9}\n", r.workloads[w].name, points.size() * r.repetitions,
               format_duration(workload));
  }
  fmt::print("{:<44} {:>6} trials  {:>9}  (from one trial of each workload; slower caches take longer)\n",
             "in all", trials, format_duration(total));
}

void print_names(const Sweep& sweep) {
  for (std::size_t w = 0; w < sweep.request().workloads.size(); ++w)
    for (const SweepPoint& point : sweep.points(w, 0)) fmt::print("{}\n", sweep.name_of(point));
}

void sweep_command(const SweepOptions& o) {
  const Topology topology = Topology::of_this_process();
  const SweepRequest request = request_of(o, topology);
  RunInfo info;
  info.command_line = command_line();
  info.seed = o.seed;
  info.placement = request.placement;
  info.thread_counts = request.threads;
  nlohmann::ordered_json context = environment(topology, info);
  const nlohmann::ordered_json configuration = configuration_of(request, context);

  std::vector<GivenFile> traces;
  for (const WorkloadSpec& w : request.workloads) traces.push_back({"a workload's trace", w.file});
  require_apart({{"--out", o.out}, {"--timeline", o.timeline}}, traces);
  if (!o.timeline.empty()) {
    if (o.resume)
      throw std::runtime_error("--timeline draws the first repetition, so it must be run; drop --resume");
    require_writable("--timeline", o.timeline);
  }
  Sweep sweep(request, topology);
  if (!o.timeline.empty() && (request.workloads.size() != 1 || sweep.points(0, 0).size() != 1)) {
    throw std::runtime_error(
        "--timeline draws one workload with one cache on one number of threads; name one of each");
  }
  if (o.list || o.dry_run) {
    tell_options_without_effect(o, request);
    return o.list ? print_names(sweep) : estimate(sweep, topology);
  }
  context["work_calibration"] = sweep.work().calibration().to_json();
  context["tick_rate"] = sweep.tick_rate().to_json();
  if (o.breakdown) {
    const PerfOffer offer = perf_offer();
    context["hardware_counters"] = {{"events", offer.names}, {"note", offer.note}};
  }
  // Before anything is measured, so that a bad path or another configuration is told at once.
  ResultsWriter results(o.out, context, configuration, o.resume ? OnExisting::resume : OnExisting::replace);
  sweep.use(Work(WorkCalibration::from_json(results.context().at("work_calibration"))));
  tell_options_without_effect(o, request);

  std::size_t trials = 0;
  for (std::size_t w = 0; w < request.workloads.size(); ++w)
    trials += sweep.points(w, 0).size() * request.repetitions;
  Progress progress("sweep", static_cast<double>(trials));
  std::vector<std::string> invalid;
  std::optional<Timeline> timeline;
  if (!o.timeline.empty()) timeline.emplace(o.timeline_events, sweep.tick_rate());
  for (std::size_t w = 0; w < request.workloads.size(); ++w) {
    bool warm = false;
    for (unsigned repetition = 0; repetition < request.repetitions; ++repetition) {
      for (const SweepPoint& point : sweep.points(w, repetition)) {
        const std::string name = sweep.name_of(point);
        if (results.is_completed(name, repetition)) {
          progress.skip(1);
          continue;
        }
        try {
          if (!std::exchange(warm, true))
            sweep.run(point, repetition);  // the first trial of a workload runs cold
          // A trial of its own: drawing takes time, which a row should not have.
          if (timeline && repetition == 0)
            write_timeline(o, sweep, point, sweep.run(point, repetition, &*timeline), *timeline);
          results.add(sweep.run(point, repetition));
        } catch (const InvalidTrial& e) {
          invalid.push_back(e.what());
        }
        progress.advance(1, name);
      }
    }
  }
  if (!invalid.empty()) {
    throw CheckFailed(
        fmt::format("{} of {} trials were invalid and have no row, so '{}' stays incomplete; the first: {}",
                    invalid.size(), trials, o.out, invalid.front()));
  }
  results.finish();
  progress.finish();
}

}  // namespace

void add_sweep(CLI::App& app) {
  const auto o = std::make_shared<SweepOptions>();
  CLI::App* sweep = app.add_subcommand("sweep", "Measure workloads x caches x threads into a results file");
  sweep
      ->add_option("--caches", o->caches,
                   "Caches, separated by commas; all leaves out brute_force, the\n"
                   "oracle; see icbench list caches")
      ->type_name("LIST")
      ->capture_default_str();
  sweep
      ->add_option("--workloads", o->workloads,
                   "Workloads, separated by commas, with parameters as in\n"
                   "miss_driven:cost=10:a=0.2; see icbench list workloads")
      ->type_name("LIST")
      ->capture_default_str();
  sweep
      ->add_option_function<std::string>(
          "--threads", [o](const std::string& text) { o->threads = parse_threads(text); },
          "Thread counts, 1 to 8192, separated by commas (default: powers\n"
          "of two up to the processing units, these, and four times these;\n"
          "on 6 to 16 units also 3, 6, 12 and so on)")
      ->type_name("LIST");
  sweep->add_option("--placement", o->placement, "How threads are pinned: compact, scatter or none")
      ->capture_default_str();
  add_whole(sweep, "--repetitions", o->repetitions, 1u, 100'000u, "Repetitions of every point");
  add_whole(sweep, "--seed", o->seed, std::uint64_t{0}, ~std::uint64_t{0},
            "Seed of points, operations and images");
  add_whole(sweep, "--latency-every", o->latency_every, 0u, 1u << 30,
            "Time one operation in so many; 1 times all, 0 none");
  add_whole(sweep, "--reference-spp", o->reference_spp, 2u, 1u << 24,
            "Samples per pixel of the path-traced reference that ray-traced\nworkloads are judged by");
  sweep->add_flag(
      "--breakdown", o->breakdown,
      "Tell where the threads' time goes (fields time_*), and what the\nhardware counts, where it "
      "does; every operation is timed then");
  add_file(sweep, "--timeline", o->timeline,
           "Also what each thread did in the first repetition (Trace Event\nJSON, for Perfetto or "
           "plots/timeline.py); one point only");
  add_whole(sweep, "--timeline-events", o->timeline_events,
            static_cast<std::uint32_t>(Timeline::kLeastEvents),
            static_cast<std::uint32_t>(Timeline::kMostEvents), "Events in it at most; the longest are kept");
  sweep->add_option("--out", o->out, "Results (JSON); written as the sweep goes on")
      ->type_name("FILE")
      ->capture_default_str();
  sweep->add_flag("--resume", o->resume, "Go on with the interrupted sweep of --out");
  CLI::Option* dry_run = sweep->add_flag("--dry-run", o->dry_run,
                                         "Estimate the time from a trial of each workload; write nothing");
  sweep->add_flag("--list", o->list, "Print the name of every point; measure and write nothing")
      ->excludes(dry_run);
  o->given_to = sweep;
  sweep->callback([o] { sweep_command(*o); });
}

}  // namespace icbench
