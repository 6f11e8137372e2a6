// The `icstress` program: runs caches under stress and under every schedule of small programs, judges what was seen,
// and proves by controls that it was strong enough to see anything.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <system_error>

#include "cli/options.h"
#include "core/names.h"
#include "files/json_file.h"
#include "files/standard_streams.h"
#include "harness/progress.h"
#include "stress/report.h"

namespace icbench::stress {
namespace {

using nlohmann::ordered_json;

/// The names in a comma-separated list, or all `known` ones for "all".
std::vector<std::string> select(std::string_view kind, std::string_view option, const std::string& text,
                                std::span<const std::string_view> known) {
  if (text == "all") return {known.begin(), known.end()};
  std::vector<std::string> out = split_list(option, text);
  for (const std::string& item : out)
    if (std::find(known.begin(), known.end(), item) == known.end())
      throw std::runtime_error(unknown_name(kind, item, known));
  require_distinct(option, out);
  return out;
}

struct Options {
  std::string caches = "all";
  std::string checks = "all";
  CampaignOptions campaign;
  explore::Extent extent = explore::Extent::brief;
  std::optional<unsigned> preemptions;
  explore::Extent progress = explore::Extent::brief;
  std::string replay;
  std::string json;
};

/// A run's parts, one after the other; `report` takes what they find. What is there so far stands, where a file was asked
/// for, in FILE.partial, lest an interrupted run of hours leave nothing.
class Run {
 public:
  explicit Run(const Options& options) : options_(options), report_(options.campaign.seed) {
    if (!options.json.empty() && !is_written_in_place(options.json)) partial_ = options.json + ".partial";
    std::vector<std::string_view> known;
    for (const Subject& subject : all_subjects()) known.push_back(subject.traits.name);
    caches_ = select("cache", "--caches", options.caches, known);
    checks_ = select("check", "--check", options.checks, kCheckNames);
  }

  const Report& run() {
    run_histories();
    if (options_.extent != explore::Extent::off) run_schedules();
    if (options_.progress != explore::Extent::off) run_progress();
    say_what_was_left_out();
    return report_;
  }

  /// The file that was asked for is there: the other one goes.
  void forget_partial() const {
    std::error_code ignored;
    if (!partial_.empty()) std::filesystem::remove(partial_, ignored);
  }

 private:
  void keep() const {
    if (partial_.empty()) return;
    auto json = report_.to_json();
    json["not_examined"].push_back("Whatever comes after this: the run had not ended when it was written.");
    write_json(partial_, json);
  }

  void run_histories() {
    Progress progress("stress", static_cast<double>(options_.campaign.operations * caches_.size()));
    for (const Subject& subject : all_subjects()) {
      if (std::find(caches_.begin(), caches_.end(), subject.traits.name) == caches_.end()) continue;
      const Totals totals = run_campaign(subject, options_.campaign, [&](double operations) {
        progress.advance(operations, subject.traits.name);
      });
      report_.add(subject, totals, checks_);
      keep();
    }
    progress.finish();
    for (const Control& control : all_controls())
      report_.add(control, run_control(control, options_.campaign));
    keep();
  }

  void run_schedules() {
    explore::ExploreOptions options;
    options.extent = options_.extent;
    options.preemptions = options_.preemptions;
    options.caches = caches_;
    Progress progress("schedules", static_cast<double>(explore::exploration_count(options)));
    const auto advance = [&](const std::string& what) { progress.advance(1.0, what); };
    for (const auto& exploration : explore::explore_all(options, advance)) {
      report_.add(exploration);
      cut_short_ += !exploration.coverage.complete;
    }
    for (const auto& control : explore::explore_controls(options, advance)) report_.add(control);
    report_.exempt(explore::exempt_caches(options));
    progress.finish();
    keep();
  }

  void run_progress() {
    ProgressOptions options;
    options.seed = options_.campaign.seed;
    options.is_long = options_.progress == explore::Extent::full;
    Progress progress("progress", static_cast<double>(caches_.size() + all_progress_controls().size()));
    for (const ProgressSubject& subject : all_progress_subjects()) {
      if (std::find(caches_.begin(), caches_.end(), subject.traits.name) == caches_.end()) continue;
      for (const ProgressResult& result : check_progress(subject, options)) report_.add(result);
      progress.advance(1.0, subject.traits.name);
    }
    for (const ProgressControl& control : all_progress_controls()) {
      report_.add(control, run_progress_control(control, options));
      progress.advance(1.0, control.name);
    }
    progress.finish();
  }

  void say_what_was_left_out() {
    const auto left_out = [&](const std::string& what) { report_.not_examined(what); };
    left_out(
        "Histories on other processors than this one: an order that only weaker memory allows shows itself "
        "in explored schedules alone.");
    if (const std::size_t others = all_subjects().size() - caches_.size(); others > 0)
      left_out(fmt::format("{} other caches.", others));
    std::vector<std::string_view> unchecked;
    for (const std::string_view check : kCheckNames)
      if (std::find(checks_.begin(), checks_.end(), check) == checks_.end()) unchecked.push_back(check);
    if (!unchecked.empty()) left_out(fmt::format("Histories for {}.", fmt::join(unchecked, ", ")));
    if (options_.extent == explore::Extent::off) left_out("Schedules: they were switched off.");
    if (options_.preemptions)
      left_out(fmt::format("Schedules of more than {} preemptions.", *options_.preemptions));
    if (cut_short_ > 0) {
      left_out(
          fmt::format("Schedules beyond the budget, in {} explorations of a cache, a scenario and a "
                      "stamping (complete: false).",
                      cut_short_));
    }
    if (options_.extent == explore::Extent::brief)
      left_out("Schedules of the long form (icstress --explore long).");
    left_out(
        "Explored schedules: loads that see stores not yet made (load buffering), stores that take effect "
        "in another order than they were made, and more than three threads with a few operations each.");
    left_out(
        "Locks of libraries (std::mutex, std::shared_mutex, oneTBB): in explored schedules and under a "
        "count of steps they are models that block in the same cases.");
    if (options_.progress == explore::Extent::off) left_out("Progress: it was switched off.");
    left_out(
        "Progress under weak memory, and of operations at quiescent points, which wait for everybody by "
        "contract.");
  }

  const Options& options_;
  std::vector<std::string> caches_;
  std::vector<std::string> checks_;
  std::string partial_;        // empty: none
  std::size_t cut_short_ = 0;  // explorations
  Report report_;
};

int fail(std::string_view line) {
  tell("icstress: {}\n", line);
  return 2;
}

/// One line for the first argument that nobody knows.
std::string unexpected(const CLI::App& app, const std::string& argument) {
  if (!argument.starts_with('-'))
    return fmt::format("unexpected argument '{}'; see icstress --help", argument);
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options()) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  }
  const std::vector<std::string_view> views(names.begin(), names.end());
  return unknown_name("option", argument.substr(0, argument.find('=')), views);
}

/// The exit status of a run that could say what it found.
int finish(bool passed) { return status_of_output("icstress", passed ? 0 : 1); }

int print_replay(const std::string& id) {
  const explore::Replay replay = explore::replay(id);
  fmt::print("{}", replay.text);
  return finish(!replay.is_violated);
}

/// An option for how far to go: off, short (the default) or long.
void add_extent(CLI::App& app, const std::string& name, explore::Extent& extent, const std::string& help) {
  static constexpr std::string_view kNames[] = {"off", "short", "long"};
  static constexpr explore::Extent kExtents[] = {explore::Extent::off, explore::Extent::brief,
                                                 explore::Extent::full};
  const auto set = [&extent, name](const std::string& text) {
    const auto* at = std::find(std::begin(kNames), std::end(kNames), text);
    if (at == std::end(kNames))
      throw std::runtime_error(fmt::format("{} '{}' is none of off, short and long", name, text));
    extent = kExtents[at - std::begin(kNames)];
  };
  app.add_option_function<std::string>(name, set, help + ": off, short or long")
      ->type_name("EXTENT")
      ->default_str("short");
}

int run_program(int argc, char** argv) {
  Options options;
  CLI::App app{
      "icstress: concurrent correctness of the caches, from recorded histories and explored schedules",
      "icstress"};
  app.add_option("--caches", options.caches, "all, or names separated by commas")
      ->type_name("LIST")
      ->capture_default_str();
  app.add_option("--check", options.checks,
                 "of histories: all, or of integrity,regular,per_record_linearizable,linearizable,frame")
      ->type_name("LIST")
      ->capture_default_str();
  add_whole(&app, "--threads", options.campaign.threads, 2u, kMaxThreads,
            fmt::format("threads, 2 to {} (with one, nothing overlaps)", kMaxThreads));
  add_whole(&app, "--operations", options.campaign.operations, std::uint64_t{1},
            std::uint64_t{1'000'000'000'000}, "operations per cache, at least");
  add_whole(&app, "--seed", options.campaign.seed, std::uint64_t{0}, ~std::uint64_t{0},
            "seed of everything random");
  add_extent(app, "--explore", options.extent, "schedules explored one by one");
  add_whole(&app, "--preemptions", options.preemptions, 0u, 1000u,
            "most preemptions in an explored schedule; unbounded if not given");
  add_extent(app, "--progress", options.progress, "step bounds and stopped threads");
  const CLI::Option* replay = app.add_option("--replay", options.replay,
                                             "print the schedule of this id, step by step, and nothing else")
                                  ->type_name("ID");
  const CLI::Option* json =
      app.add_option("--json", options.json, "file for the verdicts")->type_name("FILE");
  app.footer(
      "Exit status: 0 all promises held, and all controls that had to be were seen failing; 1 not so,\n"
      "or the schedule of --replay breaks a promise; 2 bad usage (one line on standard error).\n"
      "While it runs, verdicts of what has ended stand in FILE.partial of --json FILE.");
  app.allow_extras();
  try {
    app.parse(argc, argv);
    if (const auto extras = app.remaining(); !extras.empty()) return fail(unexpected(app, extras.front()));
    if (replay->count() > 0) {
      for (const char* option : {"--caches", "--check", "--threads", "--operations", "--seed", "--explore",
                                 "--preemptions", "--progress", "--json"})
        if (app.count(option) > 0) tell_without_effect("icstress", option, "with --replay");
      return print_replay(options.replay);
    }
    if (json->count() > 0) require_writable("--json", options.json);
    Run run(options);  // refuses names that nobody knows, before anything else is said
    if (options.preemptions && options.extent == explore::Extent::off)
      tell_without_effect("icstress", "--preemptions", "with --explore off");
    options.campaign.use_tsc = tsc_is_usable();
    options.campaign.use_counter = !kThreadSanitizer || !options.campaign.use_tsc;
    if (!options.campaign.use_tsc)
      tell("icstress: the cores' time-stamp counters disagree; stamping by the shared counter alone\n");
    const Report& report = run.run();
    const bool passed = report.print(tables_stream(options.json));
    if (json->count() > 0) write_json(options.json, report.to_json());
    run.forget_partial();
    return finish(passed);
  } catch (const CLI::Success& e) {
    return status_of_output("icstress", app.exit(e));
  } catch (const std::bad_alloc&) {
    return fail("out of memory; ask for fewer threads");
  } catch (const std::exception& e) {
    return fail(line_of(e));
  }
}

}  // namespace
}  // namespace icbench::stress

int main(int argc, char** argv) {
  icbench::occupy_standard_streams();
  icbench::survive_file_size_limits();
  return icbench::stress::run_program(argc, argv);
}
