// icbench simulate: a sweep in virtual time, and how far it is from a real one.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <string>

#include "cli/cache_list.h"
#include "cli/command.h"
#include "cli/options.h"
#include "files/standard_streams.h"
#include "harness/environment.h"
#include "harness/progress.h"
#include "harness/statistics.h"
#include "simulate/engine.h"
#include "simulate/simulation.h"
#include "simulate/validation.h"
#include "workload/sweep.h"

namespace icbench {
namespace {

constexpr const char* kDefaultCores = "1,2,4,8,16,32,64,128,256";
struct SimulateOptions {
  std::string cores = kDefaultCores, caches = fmt::format("{}", fmt::join(kUsualCaches, ",")), workloads,
              calibration, transfers, hand_over;
  std::optional<std::string> out;
  std::uint64_t seed = 1;
  unsigned complex_cores = 8, socket_cores = 64, repetitions = 9;
  bool recalibrate = false, validate = false;
  const CLI::App* given_to = nullptr;

  /// A validation does not take the place of what was simulated before.
  std::string out_or_default() const { return out.value_or(validate ? "validation.json" : "simulated.json"); }
};

std::vector<unsigned> parse_cores(std::string_view text) {
  std::vector<unsigned> out;
  for (const std::string& item : split_list("--cores", text))
    out.push_back(parse_whole("--cores", item, 1u, kMaxVirtualCores));
  require_distinct("--cores", out);
  return out;
}

/// N numbers of nanoseconds, "23,107,197".
template <std::size_t N>
std::array<double, N> parse_times(std::string_view option, const std::string& text) {
  const auto refused = [&](std::string_view range) {
    return std::runtime_error(
        fmt::format("{} '{}' is not {} numbers {}", option, text, N == 2 ? "two" : "three", range));
  };
  const std::vector<std::string> items = split_list(option, text);
  std::array<double, N> out{};
  if (items.size() != N) throw refused("of nanoseconds");
  for (std::size_t i = 0; i < N; ++i) {
    const std::optional<double> number = number_of<double>(items[i]);
    if (!number || !(*number >= 0.0 && *number <= 1e6)) throw refused("from 0 to 1e6");
    out[i] = *number;
  }
  return out;
}

SimulationRequest request_of(const SimulateOptions& o, const Topology& topology) {
  SimulationRequest r;
  const std::string workloads = !o.workloads.empty() ? o.workloads
                                : o.validate         ? fmt::format("{}", fmt::join(kValidatedWorkloads, ","))
                                                     : "miss_driven:cost=10";
  for (const std::string& text : split_list("--workloads", workloads)) {
    r.workloads.push_back(parse_workload(text));
  }
  std::vector<const CacheEntry*> caches = caches_of(o.caches);
  if (o.caches == "all") std::erase_if(caches, [](const CacheEntry* e) { return !has_model(e->traits); });
  r.caches = names_of(caches);
  std::vector<std::string> names;
  for (const WorkloadSpec& w : r.workloads) names.push_back(w.name);
  require_distinct("--workloads", names);
  r.cores = parse_cores(o.cores);  // what is wrong is said though --validate takes others
  if (o.validate) r.cores = validated_cores(topology);
  if (o.socket_cores % o.complex_cores != 0) {
    throw std::runtime_error(
        fmt::format("--socket {} is no multiple of --complex {}: complexes lie in sockets", o.socket_cores,
                    o.complex_cores));
  }
  if (!o.transfers.empty()) {
    r.transfers = Transfers{parse_times<3>("--transfer", o.transfers)};
    if (!std::ranges::is_sorted(r.transfers->ns)) {
      throw std::runtime_error(
          fmt::format("--transfer '{}' falls: a cache line takes no less time to a core that is farther away",
                      o.transfers));
    }
  }
  if (!o.hand_over.empty()) {
    const auto [call, delay] = parse_times<2>("--hand-over", o.hand_over);
    r.hand_over = HandOver{call, delay};
  }
  r.machine.cores_per_complex = o.complex_cores;
  r.machine.cores_per_socket = o.socket_cores;
  r.seed = o.seed;
  r.calibration_path = o.calibration.empty() ? default_calibration_path() : o.calibration;
  require_simulated(r);
  return r;
}

void validate(Simulation& simulation, const Topology& topology, const SimulateOptions& o,
              ResultsWriter& results) {
  Progress progress("validate", static_cast<double>(simulation.points().size()) * (o.repetitions + 1));
  std::vector<ComparedPoint> points;
  try {
    points = compare_in_rounds(simulation, topology, o.repetitions, false,
                               [&](const std::string& name) { progress.advance(1, name); });
  } catch (const InvalidTrial& e) {
    throw CheckFailed(e.what());
  }
  progress.finish();

  std::string table = fmt::format(
      "{:>11} {:>11} {:>7} {:>9} {:>9} {:>7} {:>7}\n{:>11} {:>11} {:>7} {:>9} {:>9} {:>7} {:>7}\n",
      "measured", "simulated", "off by", "redundant", "simulated", "waiting", "simul.", "/s", "/s", "", "",
      "", "", "");
  const Validation outcome = validation_of(simulation, points);
  for (const ComparedPoint& c : points) {
    const Entry row = row_of(c, outcome);
    results.add(row);
    table +=
        fmt::format("{:>11.4g} {:>11.4g} {:>6.1f}% {:>9.0f} {:>9.0f} {:>6.1f}% {:>6.1f}%  {}\n",
                    median(c.measured.throughput), row.items_per_second.value_or(0.0),
                    100.0 * c.throughput_error(), c.measured.redundant_mean(), c.simulated.redundant_mean(),
                    100.0 * median(c.measured.waiting), 100.0 * median(c.simulated.waiting), row.name);
  }
  const std::string line = fmt::format(
      "median errors with 2 to {} threads: throughput {:.1f} % ({} points), redundant records {:.1f} % ({}), "
      "waiting for locks {:.1f} % ({})",
      outcome.threads, 100.0 * outcome.throughput_error, outcome.points, 100.0 * outcome.records_error,
      outcome.records_points, 100.0 * outcome.waiting_error, outcome.waiting_points);
  table +=
      fmt::format("{}\nby the costs that are kept, the middle of those of the moments: throughput {:.1f} %\n",
                  line, 100.0 * outcome.file_error);
  simulation.calibration().validation = outcome;
  write_validated(simulation.calibration(), simulation.request().calibration_path);
  results.finish();
  if (tells_figures(o.out_or_default())) fmt::print("{}", table);
  if (!outcome.holds())
    throw CheckFailed(
        fmt::format("{}, by the costs that are kept {:.1f} %; at most {:.0f} % was to be reached", line,
                    100.0 * outcome.file_error, 100.0 * Validation::kBar));
}

void simulate_command(const SimulateOptions& o) {
  const Topology topology = Topology::of_this_process();
  SimulationRequest request = request_of(o, topology);
  const std::string out = o.out_or_default();
  std::vector<GivenFile> traces;
  for (const WorkloadSpec& w : request.workloads) traces.push_back({"a workload's trace", w.file});
  require_apart({{"--out", out}, {"--calibration", request.calibration_path}}, traces);
  require_writable("--out", out);
  RunInfo info;
  info.command_line = command_line();
  info.seed = o.seed;
  info.thread_counts = {1};
  nlohmann::ordered_json context = environment(topology, info);
  request.host_name = context.value("host_name", "");
  request.cpu_model = context.value("cpu_model", "");
  request.commit = program_of(context);

  std::optional<Calibration> calibration;
  if (!o.recalibrate) calibration = read_calibration(request.calibration_path);
  if (!calibration) {
    make_folder_of(request.calibration_path);
    require_writable("--calibration", request.calibration_path);  // what cannot be kept is not measured
    tell("calibrating this machine into {}\n", request.calibration_path);
    calibration = calibrate_machine(topology, context);
    write_calibration(*calibration, request.calibration_path);
  }
  const Calibration used = *calibration;
  Simulation simulation(request, topology, *calibration);
  if (o.validate) require_this_machine(simulation);
  const auto& r = simulation.request();
  context["simulated"] = true;
  nlohmann::ordered_json told = used.to_json();
  told.erase("costs");
  if (o.validate) told.erase("validation");  // of these rows it is yet to come
  context["calibration"] = told;
  context["calibration"]["file"] = r.calibration_path;
  context["virtual_machine"] = {{"cores_per_complex", r.machine.cores_per_complex},
                                {"cores_per_socket", r.machine.cores_per_socket},
                                {"transfer_ns", r.transfers.value_or(used.transfers).ns}};
  if (r.hand_over) {
    context["virtual_machine"]["hand_over_ns"] = {r.hand_over->call_ns, r.hand_over->delay_ns};
  }
  std::vector<std::string> workloads;
  for (const WorkloadSpec& w : r.workloads) workloads.push_back(w.name);
  const nlohmann::ordered_json configuration = {
      {"command", "simulate"}, {"workloads", workloads}, {"caches", r.caches},
      {"cores", r.cores},      {"seed", r.seed},         {"virtual_machine", context["virtual_machine"]}};
  simulation.complete_calibration([](const std::string& what) { tell("calibrating {}\n", what); });
  ResultsWriter results(out, context, configuration);
  if (o.validate && o.given_to->count("--cores") > 0)
    tell_without_effect("icbench", "--cores", "with --validate, which takes those of this machine");
  if (!o.validate && o.given_to->count("--repetitions") > 0)
    tell_without_effect("icbench", "--repetitions", "without --validate");
  if (o.validate) return validate(simulation, topology, o, results);

  const std::vector<SimulationPoint> points = simulation.points();
  Progress progress("simulate", static_cast<double>(points.size()));
  for (const SimulationPoint& point : points) {
    results.add(simulation.run(point));
    progress.advance(1, simulation.name_of(point));
  }
  results.finish();
  progress.finish();
}

}  // namespace

void add_simulate(CLI::App& app) {
  const auto o = std::make_shared<SimulateOptions>();
  CLI::App* simulate =
      app.add_subcommand("simulate", "Run caches in virtual time on cores that are not there");
  simulate->footer(
      "Executes each cache's real operations, each virtual thread seeing what it would see at its virtual\n"
      "time, and adds up what operations, locks and cache lines cost. Costs are measured on one thread\n"
      "when first needed and kept in the calibration file, which every result names. Rows are marked as\n"
      "simulated, and say up to how many threads --validate has found such figures near measured ones; 0\n"
      "where it has not, or they were too far off. Not simulated: threads beyond cores, and the bandwidth\n"
      "and the caches that cores share.");
  simulate
      ->add_option("--cores", o->cores, "Virtual cores with a thread each, 1 to 1024, separated by commas")
      ->type_name("LIST")
      ->capture_default_str();
  simulate
      ->add_option("--caches", o->caches,
                   "Caches, separated by commas; all leaves out brute_force, the\noracle, and what has no "
                   "model; see icbench list caches")
      ->type_name("LIST")
      ->default_str("six packed ones");
  simulate
      ->add_option("--workloads", o->workloads,
                   "Workloads, separated by commas: synthetic ones, or\ntrace:file=PATH (default: "
                   "miss_driven:cost=10;\n"
                   "with --validate costs of 1, 10, 100, mix_90_10 and read_only)")
      ->type_name("LIST")
      ->check(is_named);
  add_whole(simulate, "--seed", o->seed, std::uint64_t{0}, ~std::uint64_t{0},
            "Seed of points, operations and of who gets a lock");
  add_file(simulate, "--calibration", o->calibration,
           "Costs (JSON) (default: icbench/calibration.json in\n$XDG_CACHE_HOME or ~/.cache)");
  simulate->add_flag("--recalibrate", o->recalibrate,
                     "Measure all costs anew; what was validated is forgotten");
  CLI::Option* const transfers =
      simulate
          ->add_option(
              "--transfer", o->transfers,
              "Nanoseconds for a cache line to another core: within a complex,\na socket, across "
              "sockets (default: "
              "measured, 107, 197; as an\nAMD EPYC 7R13, see src/simulate/machine.h); such rows were "
              "not\nvalidated")
          ->check(is_named)
          ->type_name("A,B,C");
  CLI::Option* const hand_over =
      simulate
          ->add_option(
              "--hand-over", o->hand_over,
              "Nanoseconds for handing a lock to a thread that sleeps: of the call\nthat wakes it, and "
              "until it runs (default: measured, by how long\nit has slept); such rows were not "
              "validated")
          ->check(is_named)
          ->type_name("A,B");
  add_whole(simulate, "--complex", o->complex_cores, 1u, 8192u,
            "Cores that share a last-level cache; a validation is of one\n--complex and one --socket");
  add_whole(simulate, "--socket", o->socket_cores, 1u, 8192u, "Cores of a socket");
  simulate
      ->add_flag("--validate", o->validate,
                 "Measure, too, with all thread counts that this machine has\n(powers of two and all "
                 "units), and tell how far off simulated\nfigures are; status 1 if by more than 10 %")
      ->excludes(hand_over)
      ->excludes(transfers);
  add_whole(simulate, "--repetitions", o->repetitions, 1u, 100'000u, "Of measured points, for --validate");
  simulate
      ->add_option("--out", o->out,
                   "Results (JSON) (default: simulated.json; with --validate\nvalidation.json)")
      ->type_name("FILE");
  o->given_to = simulate;
  simulate->callback([o] { simulate_command(*o); });
}

}  // namespace icbench
