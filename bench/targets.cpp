// Every performance figure of the project, as a ratio from one run, with its verdict.
//
// A row is sampled until its 95 % interval lies on one side of the target, or its time is up: then it is
// undecided. A row whose cache breaks its contract fails, whatever its ratio. Exit status: 0 no row failed, 1 a row
// failed, 2 bad usage.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <thread>
#include <vector>

#include "cli/options.h"
#include "core/names.h"
#include "files/json_file.h"
#include "files/standard_streams.h"
#include "rows/rows.h"

namespace icbench {
namespace {

struct Options {
  std::string json, rows;
  bool list = false;
  double seconds = 30.0;
  std::size_t samples = 11;  // before a verdict
  std::uint64_t seed = 1;
};

constexpr std::size_t kMaximum = 2000;
constexpr std::size_t kHopeless = 11;  // unusable samples, none usable, after which a row is skipped

struct Measured {
  std::vector<double> ratios;
  Interval interval;
  std::string verdict;
  std::string why;
};

Measured measure(const Row& row, const Machine& machine, const Options& o) {
  using Clock = std::chrono::steady_clock;
  const auto experiment = row.make(machine);
  if (!experiment->starts_warm()) experiment->sample();
  Measured out;
  std::string unusable;
  std::size_t skipped = 0;
  Verdict verdict = Verdict::undecided;
  // Verdicts are sought at 11, 22, 44, ... samples only, and once the time is up: an interval that is looked at after
  // every sample would sooner or later lie on the wrong side by chance.
  std::size_t next_look = o.samples;
  for (const auto start = Clock::now(); out.ratios.size() < kMaximum;) {
    const Sample sample = experiment->sample();
    if (sample.not_usable.empty()) {
      out.ratios.push_back(sample.ratio);
    } else {
      unusable = sample.not_usable;
      ++skipped;
    }
    if (out.ratios.size() == next_look) {
      next_look *= 2;
      out.interval = bootstrap_median(out.ratios, machine.seed);
      verdict = decide(out.interval, row.relation, row.target);
      if (verdict != Verdict::undecided) break;
    }
    const bool time_up = std::chrono::duration<double>(Clock::now() - start).count() > o.seconds;
    // Fewer samples than asked for say nothing: they are waited for, unless the machine does not yield them.
    const bool enough = out.ratios.size() >= o.samples || skipped > out.ratios.size();
    if (time_up ? enough : out.ratios.empty() && skipped >= kHopeless) break;
  }
  if (verdict == Verdict::undecided && out.ratios.size() >= o.samples) {
    out.interval = bootstrap_median(out.ratios, machine.seed);
    verdict = decide(out.interval, row.relation, row.target);
  }
  out.verdict = to_string(verdict);
  if (out.ratios.size() < o.samples && skipped > 0) {
    out.verdict = "skipped";
    out.why = unusable;
  } else if (verdict == Verdict::undecided) {
    out.why = fmt::format("the interval still holds the target after {} samples", out.ratios.size());
  } else if (skipped > 0) {
    out.why = fmt::format("{} further samples did not count: {}", skipped, unusable);
  }
  return out;
}

nlohmann::ordered_json to_json(const Row& row, const Measured& m, std::size_t least) {
  nlohmann::ordered_json j = {
      {"name", row.name}, {"what", row.what}, {"relation", to_string(row.relation)}, {"target", row.target}};
  if (m.ratios.size() >= least) {
    j["median"] = median(m.ratios);
    j["low"] = m.interval.low;
    j["high"] = m.interval.high;
  } else {
    j["median"] = j["low"] = j["high"] = nullptr;
  }
  j["samples"] = m.ratios.size();
  j["verdict"] = m.verdict;
  j["why"] = m.why;
  return j;
}

std::string target_of(const Row& row) {
  return fmt::format("{} {:.4g}", row.relation == Relation::at_most ? "at most" : "at least", row.target);
}

/// Those of `all` that `list` names; all of them if it is empty.
std::vector<const Row*> rows_of(const std::vector<Row>& all, const std::string& list) {
  std::vector<const Row*> out;
  std::vector<std::string_view> known;
  for (const Row& row : all) {
    known.push_back(row.name);
    if (list.empty()) out.push_back(&row);
  }
  if (list.empty()) return out;
  const std::vector<std::string> named = split_list("--rows", list);
  for (const std::string& name : named) {
    const auto at = std::find_if(all.begin(), all.end(), [&](const Row& row) { return row.name == name; });
    if (at == all.end()) {  // there are too many to name them all in a line
      const std::string_view guess = nearest(name, known);
      throw std::runtime_error(fmt::format("unknown row '{}'; {}--list names all {}", name,
                                           guess.empty() ? "" : fmt::format("did you mean '{}'? ", guess),
                                           all.size()));
    }
    out.push_back(&*at);
  }
  require_distinct("--rows", named);
  return out;
}

/// Where rows are kept until all are measured: a list cut short would look complete. Empty if there is no such place.
std::filesystem::path unfinished(std::filesystem::path json) {
  if (json.empty() || (std::filesystem::exists(json) && !std::filesystem::is_regular_file(json))) return {};
  return json += ".unfinished";
}

int run(const Options& o) {
  const std::filesystem::path so_far = unfinished(o.json);
  for (const std::filesystem::path& file : {std::filesystem::path(o.json), so_far})
    if (!o.list && !file.empty()) require_writable("--json", file);
  const std::vector<Row> all = all_rows();
  const std::vector<const Row*> rows = rows_of(all, o.rows);
  if (o.list) {
    if (!o.json.empty()) tell_without_effect("targets", "--json", "with --list");
    for (const Row* row : rows) fmt::print("{:<34} {:<16} {}\n", row->name, target_of(*row), row->what);
    return 0;
  }
  const Topology topology = Topology::of_this_process();
  const Work work = Work::calibrate();
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  bool failed = false;
  std::FILE* const out = tables_stream(o.json);
  fmt::print(out, "{:<30} {:<16} {:>8} {:>19}  {:>7}  {}\n", "row", "target", "median", "95 % interval",
             "samples", "verdict");
  for (const Row* row : rows) {
    // A thread of its own for each row: some pin themselves.
    Measured m;
    std::string error;
    std::thread([&] {
      try {
        m = measure(*row, {topology, work, o.seed}, o);
      } catch (const InvalidTrial& e) {
        m.verdict = "fail";
        m.why = e.what();
      } catch (const std::exception& e) {
        error = e.what();
      }
    }).join();
    if (!error.empty()) throw std::runtime_error(fmt::format("row {}: {}", row->name, error));
    json.push_back(to_json(*row, m, o.samples));
    if (!so_far.empty()) write_json(so_far, json);
    failed |= m.verdict == "fail";
    const std::string figures =
        m.ratios.size() < o.samples
            ? fmt::format("{:>8} {:>19}", "-", "-")
            : fmt::format("{:>8.3f} {:>19}", median(m.ratios),
                          fmt::format("[{:.3f}, {:.3f}]", m.interval.low, m.interval.high));
    fmt::print(out, "{:<30} {:<16} {}  {:>7}  {}{}\n", row->name, target_of(*row), figures, m.ratios.size(),
               m.verdict, m.why.empty() ? "" : ": " + m.why);
    std::fflush(out);
  }
  if (!o.json.empty()) write_json(o.json, json);
  if (!so_far.empty()) std::filesystem::remove(so_far);
  return failed ? 1 : 0;
}

}  // namespace
}  // namespace icbench

int main(int argc, char** argv) {
  icbench::occupy_standard_streams();
  icbench::survive_file_size_limits();
  icbench::Options o;
  CLI::App app{"Measures every performance figure of the project as a ratio from one run", "targets"};
  icbench::add_file(&app, "--json", o.json,
                    "Also write the rows to this file; to FILE.unfinished until\nall are measured");
  app.add_option("--rows", o.rows, "Only these rows, separated by commas")
      ->check([](const std::string& text) {
        return text.empty() ? "no row is named; leave --rows away for all" : "";
      });
  app.add_flag("--list", o.list, "Print name, target and meaning of the rows; measure nothing");
  app.add_option(
         "--seconds", o.seconds,
         "Time for a row that stays undecided, 1 to 100000 s; one that has\nfewer than --samples by then "
         "goes on until it has them")
      ->type_name("X")
      ->check(CLI::Range(1.0, 1e5).description(""))
      ->capture_default_str();
  // Of fewer than six samples no interval is a 95 % one: bootstrap_median.
  icbench::add_whole(&app, "--samples", o.samples, std::size_t{6}, icbench::kMaximum,
                     "Samples of a row before a verdict is sought, 6 or more");
  icbench::add_whole(&app, "--seed", o.seed, std::uint64_t{0}, ~std::uint64_t{0},
                     "Seed of all random numbers");
  try {
    app.parse(argc, argv);
    if (std::isnan(o.seconds))
      throw std::runtime_error("--seconds is not a number");  // in no range, and passes
    return icbench::status_of_output("targets", icbench::run(o));
  } catch (const CLI::Success& e) {
    return icbench::status_of_output("targets", app.exit(e));
  } catch (const std::exception& e) {
    icbench::tell("targets: {}\n", icbench::line_of(e));
    return 2;
  }
}
