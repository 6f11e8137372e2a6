// The `icstress` program: runs caches under stress, judges what was seen, and proves by controls that the
// stress was strong enough to see anything.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "core/names.h"
#include "harness/output_file.h"
#include "harness/progress.h"
#include "stress/campaign.h"
#include "stress/controls.h"

namespace icbench::stress {
namespace {

using nlohmann::ordered_json;

/// The names in a comma-separated list, or all `known` ones for "all".
std::vector<std::string> select(std::string_view kind, const std::string& text,
                                std::span<const std::string_view> known) {
  if (text == "all") return {known.begin(), known.end()};
  std::vector<std::string> out;
  for (std::size_t begin = 0;;) {
    const std::size_t end = text.find(',', begin);
    const std::string item = text.substr(begin, end - begin);
    if (std::find(known.begin(), known.end(), item) == known.end())
      throw std::runtime_error(unknown_name(kind, item, known));
    if (std::find(out.begin(), out.end(), item) == out.end()) out.push_back(item);
    if (end == text.npos) return out;
    begin = end + 1;
  }
}

struct Options {
  std::string caches = "all";
  std::string checks = "all";
  CampaignOptions campaign;
  std::string json;
};

void print_witness(const std::string& witness) {
  std::string text = "    ";
  for (const char c : witness) text += c == '\n' ? std::string("\n    ") : std::string(1, c);
  fmt::print("{}\n", text);
}

class Run {
 public:
  explicit Run(const Options& options) : options_(options) {
    std::vector<std::string_view> known;
    for (const Subject& subject : all_subjects()) known.push_back(subject.traits.name);
    caches_ = select("cache", options.caches, known);
    checks_ = select("check", options.checks, kCheckNames);
  }

  /// Whether all promises held and all controls were seen failing.
  bool run() {
    Progress progress("stress", static_cast<double>(options_.campaign.operations * caches_.size()));
    for (const Subject& subject : all_subjects()) {
      if (std::find(caches_.begin(), caches_.end(), subject.traits.name) == caches_.end()) continue;
      report(subject, run_campaign(subject, options_.campaign, [&](double operations) {
               progress.advance(operations, subject.traits.name);
             }));
    }
    progress.finish();
    for (const Control& control : all_controls()) report(control, run_control(control, options_.campaign));
    return print();
  }

  ordered_json to_json() const { return {{"checks", checks_json_}, {"controls", controls_json_}}; }

 private:
  void report(const Subject& subject, const Totals& totals) {
    for (std::size_t i = 0; i < kCheckNames.size(); ++i) {
      if (std::find(checks_.begin(), checks_.end(), kCheckNames[i]) == checks_.end()) continue;
      const Finding& finding = totals.judgement.findings[i];
      checks_json_.push_back({{"cache", subject.traits.name},
                              {"check", kCheckNames[i]},
                              {"verdict", finding.violations == 0 ? "holds" : "violated"},
                              {"promised", promises(subject.traits.consistency, static_cast<Check>(i))},
                              {"operations", totals.judgement.operations},
                              {"concurrent_pairs", totals.judgement.concurrent_pairs},
                              {"violations", finding.violations},
                              {"witness", finding.witness},
                              {"seed", options_.campaign.seed}});
    }
  }

  void report(const Control& control, const ControlOutcome& outcome) {
    const auto check = static_cast<std::size_t>(control.check);
    controls_json_.push_back({{"control", control.name},
                              {"fault", control.fault},
                              {"check", name_of(control.check)},
                              {"seen", outcome.seen},
                              {"required", !control.needs_weak_memory},
                              {"rounds", outcome.totals.rounds},
                              {"rounds_violated", outcome.totals.rounds_violated[check]},
                              {"operations", outcome.totals.judgement.operations},
                              {"witness", outcome.totals.judgement.findings[check].witness},
                              {"seed", options_.campaign.seed}});
  }

  bool print() const {
    unsigned broken = 0, unseen = 0;
    fmt::print("{:<26} {:<24} {:<9} {:<9} {:>11} {:>13} {:>11}\n", "cache", "check", "verdict", "promised",
               "operations", "overlapping", "violations");
    for (const ordered_json& row : checks_json_) {
      const bool is_broken = row["promised"].get<bool>() && row["verdict"] == "violated";
      fmt::print("{:<26} {:<24} {:<9} {:<9} {:>11} {:>13} {:>11}\n", row["cache"].get<std::string>(),
                 row["check"].get<std::string>(), row["verdict"].get<std::string>(),
                 row["promised"].get<bool>() ? "yes" : "no", row["operations"].get<std::uint64_t>(),
                 row["concurrent_pairs"].get<std::uint64_t>(), row["violations"].get<std::uint64_t>());
      if (is_broken) print_witness(row["witness"].get<std::string>());
      broken += is_broken;
    }
    fmt::print("\n{:<26} {:<24} {:<9} {:>11}\n", "control", "must violate", "seen", "rounds");
    for (const ordered_json& row : controls_json_) {
      const bool seen = row["seen"].get<bool>(), required = row["required"].get<bool>();
      fmt::print("{:<26} {:<24} {:<9} {:>5} of {:>2}\n", row["control"].get<std::string>(),
                 row["check"].get<std::string>(),
                 seen       ? "yes"
                 : required ? "NO"
                            : "(no)",
                 row["rounds_violated"].get<std::uint32_t>(), row["rounds"].get<std::uint32_t>());
      if (!seen && !required)
        fmt::print("    needs a processor that reorders stores, or an explorer that models one\n");
      unseen += !seen && required;
    }
    if (broken > 0) fmt::print("\n{} broken promises\n", broken);
    if (unseen > 0) {
      fmt::print(
          "\nthe stress was too weak: {} controls were not seen failing; use more threads or other seeds\n",
          unseen);
    }
    if (broken + unseen == 0) fmt::print("\nall promises held, all controls were seen failing\n");
    return broken + unseen == 0;
  }

  const Options& options_;
  std::vector<std::string> caches_;
  std::vector<std::string> checks_;
  ordered_json checks_json_ = ordered_json::array();
  ordered_json controls_json_ = ordered_json::array();
};

void write_json(const std::string& path, const ordered_json& content) {
  const std::string text = content.dump(2) + "\n";
  if (is_written_in_place(path)) {
    write_all(open_in_place(path), text, path);
  } else {
    replace_file(path, [&](const Descriptor& out) { write_all(out, text, path); });
  }
}

/// Fails before the work, not after it, if the file cannot be written.
void require_writable(const std::string& path) {
  const auto refuse = [&](int code) {
    throw std::runtime_error(
        fmt::format("cannot write --json '{}': {}; name a file in a folder that can be written", path,
                    std::strerror(code)));
  };
  if (path.empty()) refuse(ENOENT);
  if (std::filesystem::is_directory(path)) refuse(EISDIR);
  if (is_written_in_place(path)) return;
  const std::filesystem::path folder = std::filesystem::absolute(path).parent_path();
  if (::access(folder.c_str(), W_OK | X_OK) != 0) refuse(errno);
}

int fail(std::string_view line) {
  fmt::print(stderr, "icstress: {}\n", line);
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

int run_program(int argc, char** argv) {
  Options options;
  CLI::App app{"icstress: concurrent correctness of the caches, from recorded histories", "icstress"};
  app.add_option("--caches", options.caches, "all, or names separated by commas")->capture_default_str();
  app.add_option("--check", options.checks,
                 "all, or of integrity,regular,per_record_linearizable,linearizable,frame")
      ->capture_default_str();
  app.add_option("--threads", options.campaign.threads, "threads, 2 to 8192 (with one, nothing overlaps)")
      ->capture_default_str()
      ->check(CLI::Range(2u, 8192u));
  app.add_option("--operations", options.campaign.operations, "operations per cache, at least")
      ->capture_default_str()
      ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{1'000'000'000'000}));
  app.add_option("--seed", options.campaign.seed, "seed of everything random")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  const CLI::Option* json = app.add_option("--json", options.json, "file for the verdicts");
  app.allow_extras();
  try {
    app.parse(argc, argv);
    if (const auto extras = app.remaining(); !extras.empty()) return fail(unexpected(app, extras.front()));
    if (json->count() > 0) require_writable(options.json);
    options.campaign.use_tsc = tsc_is_usable();
    options.campaign.use_counter = !kThreadSanitizer || !options.campaign.use_tsc;
    if (!options.campaign.use_tsc)
      fmt::print(stderr,
                 "icstress: the cores' time-stamp counters disagree; stamping by the shared counter alone\n");
    Run run(options);
    const bool passed = run.run();
    if (json->count() > 0) write_json(options.json, run.to_json());
    if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0) return fail("cannot write to standard output");
    return passed ? 0 : 1;
  } catch (const CLI::Success& e) {
    return app.exit(e);
  } catch (const std::bad_alloc&) {
    return fail("out of memory; ask for fewer threads");
  } catch (const std::exception& e) {
    return fail(e.what());
  }
}

}  // namespace
}  // namespace icbench::stress

int main(int argc, char** argv) { return icbench::stress::run_program(argc, argv); }
