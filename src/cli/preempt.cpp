// icbench preempt: a thread is held in the middle of an operation, again and again; what becomes of the others.
#include "workload/preempt.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <memory>

#include "cli/cache_list.h"
#include "cli/command.h"
#include "cli/options.h"
#include "files/standard_streams.h"
#include "harness/environment.h"
#include "harness/progress.h"
#include "harness/statistics.h"
#include "workload/names.h"
#include "workload/sweep.h"

namespace icbench {
namespace {

using Json = nlohmann::ordered_json;

struct PreemptOptions {
  std::string caches = "packed_global_mutex,packed_global_spin,packed_local_write,packed_wait_free",
              workload = "mix_90_10:operations=1000000", placement = "compact", out = "preempt.json";
  unsigned threads = 0;  // the processing units
  unsigned repetitions = 7;
  unsigned hold_ms = 10, pause_ms = 10;
  std::uint64_t seed = 1;
  bool resume = false;
};

/// A line for each cache and kind: medians of what the others saw.
void print_summary(const std::vector<Json>& rows) {
  std::map<std::string, std::map<std::string, std::vector<double>>> values;
  std::vector<std::string> order;
  for (const Json& row : rows) {
    const std::string name = row.at("name");
    if (!values.contains(name)) order.push_back(name);
    for (const char* field : {"latency_query_p50_ns", "latency_query_p999_ns", "latency_query_max_ns",
                              "stalled_share", "holds"}) {
      if (row.contains(field) && row.at(field).is_number()) values[name][field].push_back(row.at(field));
    }
  }
  std::sort(order.begin(), order.end());
  fmt::print("{:>10} {:>10} {:>12} {:>9} {:>6}\n", "query p50", "p99.9", "longest", "stalled", "holds");
  const auto us = [](const std::vector<double>& v) {
    return v.empty() ? std::string("-") : fmt::format("{:.4g} us", 1e-3 * median(v));
  };
  for (const std::string& name : order) {
    auto& v = values[name];
    fmt::print("{:>10} {:>10} {:>12} {:>7.1f} % {:>6.0f}  {}\n", us(v["latency_query_p50_ns"]),
               us(v["latency_query_p999_ns"]), us(v["latency_query_max_ns"]),
               100.0 * median(v["stalled_share"]), median(v["holds"]), name);
  }
  std::erase_if(order, [&](const std::string& name) {
    return !name.ends_with("/held") || median(values[name]["holds"]) > 0.0;
  });
  if (order.empty()) return;
  tell(
      "warning: {}: in most trials nobody was held before they were over; give --workload more "
      "operations, or a shorter --pause-ms\n",
      fmt::join(order, ", "));
}

void preempt_command(const PreemptOptions& o) {
  const Topology topology = Topology::of_this_process();
  PreemptRequest request;
  request.workload = parse_workload(o.workload);
  std::vector<const CacheEntry*> caches = caches_of(o.caches);
  if (o.caches == "all") std::erase_if(caches, [](const CacheEntry* e) { return e->traits.single_thread; });
  request.caches = names_of(caches);
  request.threads = o.threads != 0 ? o.threads : std::max(2u, static_cast<unsigned>(topology.units().size()));
  request.placement = parse_placement(o.placement);
  request.repetitions = o.repetitions;
  request.seed = o.seed;
  request.hold_ms = o.hold_ms;
  request.pause_ms = o.pause_ms;
  Preempt preempt(request, topology);

  RunInfo info;
  info.command_line = command_line();
  info.seed = o.seed;
  info.placement = request.placement;
  info.thread_counts = {request.threads};
  Json context = environment(topology, info);
  context["work_calibration"] = preempt.work().calibration().to_json();
  context["tick_rate"] = preempt.tick_rate().to_json();
  const Json configuration = {{"command", "preempt"},
                              {"workload", request.workload.name},
                              {"caches", request.caches},
                              {"threads", request.threads},
                              {"placement", to_string(request.placement)},
                              {"repetitions", request.repetitions},
                              {"hold_ms", request.hold_ms},
                              {"pause_ms", request.pause_ms},
                              {"seed", request.seed},
                              {"environment", environment_identity(context)}};
  ResultsWriter results(o.out, context, configuration, o.resume ? OnExisting::resume : OnExisting::replace);
  preempt.use(Work(WorkCalibration::from_json(results.context().at("work_calibration"))));
  Progress progress("preempt", static_cast<double>(2 * request.caches.size() * request.repetitions));
  std::vector<Json> rows = results.rows();
  std::vector<std::string> invalid;
  bool warm = false;
  for (unsigned repetition = 0; repetition < request.repetitions; ++repetition) {
    for (const Preempt::Point& point : preempt.points(repetition)) {
      const std::string name = preempt.name_of(point);
      if (results.is_completed(name, repetition)) {
        progress.skip(1);
        continue;
      }
      try {
        if (!std::exchange(warm, true)) preempt.run(point, repetition);  // the first trial runs cold
        const Entry entry = preempt.run(point, repetition);
        results.add(entry);
        rows.emplace_back(entry.counters)["name"] = name;
      } catch (const InvalidTrial& e) {
        invalid.emplace_back(e.what());
      }
      progress.advance(1, name);
    }
  }
  if (!invalid.empty())
    throw CheckFailed(
        fmt::format("{} trials were invalid and have no row, so '{}' stays incomplete; the first: {}",
                    invalid.size(), o.out, invalid.front()));
  results.finish();
  if (tells_figures(o.out)) print_summary(rows);
  progress.finish();
}

}  // namespace

void add_preempt(CLI::App& app) {
  const auto o = std::make_shared<PreemptOptions>();
  CLI::App* command =
      app.add_subcommand("preempt", "Hold a thread in mid-operation; measure the others' latencies");
  command
      ->add_option("--caches", o->caches,
                   "Shared caches, separated by commas; all leaves out brute_force, the\noracle; see icbench "
                   "list caches")
      ->type_name("LIST")
      ->capture_default_str();
  command
      ->add_option("--workload", o->workload,
                   "Synthetic workload with parameters; long enough for many holds")
      ->type_name("NAME")
      ->capture_default_str();
  add_whole(command, "--threads", o->threads, 2u, kMaxThreads,
            "Threads, 2 to 8192: one is held, the others are measured\n(default: the processing units)")
      ->default_str("");
  command->add_option("--placement", o->placement, "How threads are pinned: compact, scatter or none")
      ->capture_default_str();
  add_whole(command, "--hold-ms", o->hold_ms, 1u, 60'000u, "Length of every hold, milliseconds");
  add_whole(command, "--pause-ms", o->pause_ms, 1u, 60'000u,
            "Mean time between two holds, milliseconds; drawn from 0.5 to 1.5\ntimes that, and then the next "
            "tick that finds it in an operation");
  add_whole(command, "--repetitions", o->repetitions, 1u, 100'000u,
            "Repetitions of every cache, with a thread held and without");
  add_whole(command, "--seed", o->seed, std::uint64_t{0}, ~std::uint64_t{0},
            "Seed of points, operations and moments");
  command->add_option("--out,--json", o->out, "Results (JSON); written as the work goes on")
      ->type_name("FILE")
      ->capture_default_str();
  command->add_flag("--resume", o->resume, "Go on with the interrupted run of --out");
  command->callback([o] { preempt_command(*o); });
}

}  // namespace icbench
