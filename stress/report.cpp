#include "stress/report.h"

#include <fmt/format.h>

#include <algorithm>

namespace icbench::stress {

namespace {

using nlohmann::ordered_json;

std::string text(const ordered_json& row, const char* key) { return row[key].get<std::string>(); }
bool is(const ordered_json& row, const char* key) { return row[key].get<bool>(); }
std::uint64_t number(const ordered_json& row, const char* key) { return row[key].get<std::uint64_t>(); }

bool is_broken(const ordered_json& row) { return is(row, "promised") && text(row, "verdict") == "violated"; }

void print_witness(std::FILE* out, const std::string& witness) {
  std::string indented = "    ";
  for (const char c : witness) indented += c == '\n' ? std::string("\n    ") : std::string(1, c);
  fmt::print(out, "{}\n", indented);
}

void print_replay(std::FILE* out, const ordered_json& row) {
  print_witness(out, text(row, "witness"));
  fmt::print(out, "    replay: icstress --replay {}\n", text(row, "replay"));
}

const char* verdict(std::uint64_t violations) { return violations == 0 ? "holds" : "violated"; }

}  // namespace

void Report::add(const Subject& subject, const Totals& totals, std::span<const std::string> checks) {
  for (std::size_t i = 0; i < kCheckNames.size(); ++i) {
    if (std::find(checks.begin(), checks.end(), kCheckNames[i]) == checks.end()) continue;
    const Finding& finding = totals.judgement.findings[i];
    checks_.push_back({{"cache", subject.traits.name},
                       {"check", kCheckNames[i]},
                       {"verdict", verdict(finding.violations)},
                       {"promised", promises(subject.traits.consistency, static_cast<Check>(i))},
                       {"operations", totals.judgement.operations},
                       {"concurrent_pairs", totals.judgement.concurrent_pairs},
                       {"violations", finding.violations},
                       {"witness", finding.witness},
                       {"seed", seed_}});
  }
}

void Report::add(const Control& control, const ControlOutcome& outcome) {
  const auto check = static_cast<std::size_t>(control.check);
  controls_.push_back({{"control", control.name},
                       {"fault", control.fault},
                       {"check", name_of(control.check)},
                       {"seen", outcome.seen},
                       {"required", !control.needs_weak_memory},
                       {"rounds", outcome.totals.rounds},
                       {"rounds_violated", outcome.totals.rounds_violated[check]},
                       {"operations", outcome.totals.judgement.operations},
                       {"witness", outcome.totals.judgement.findings[check].witness},
                       {"seed", seed_}});
}

void Report::add(const explore::Exploration& e) {
  schedules_.push_back({{"cache", e.cache},
                        {"scenario", e.scenario},
                        {"threads", e.threads},
                        {"preemptions", e.preemptions ? ordered_json(*e.preemptions) : ordered_json()},
                        {"stamps", name_of(e.stamping)},
                        {"schedules", e.coverage.schedules},
                        {"complete", e.coverage.complete},
                        {"check", name_of(e.check)},
                        {"verdict", verdict(e.violations)},
                        {"promised", true},
                        {"violations", e.violations},
                        {"replay", e.replay},
                        {"witness", e.witness}});
}

void Report::add(const explore::ExploredControl& c) {
  explored_controls_.push_back({{"control", c.control},
                                {"fault", c.fault},
                                {"check", name_of(c.check)},
                                {"caught", c.is_caught},
                                {"schedules", c.schedules},
                                {"replay", c.replay},
                                {"witness", c.witness}});
}

void Report::add(const ProgressResult& r) {
  auto steps = ordered_json::array();
  for (const InterferenceSteps& s : r.steps_by_interference) steps.push_back({s.inserts, s.steps});
  const bool is_bounded = r.declared == ProgressGuarantee::wait_free;
  progress_.push_back({{"cache", r.cache},
                       {"operation", r.operation},
                       {"declared", to_string(r.declared)},
                       {"bound", is_bounded ? ordered_json(r.bound) : ordered_json()},
                       {"bound_steps", is_bounded ? ordered_json(r.bound_steps) : ordered_json()},
                       {"most_steps", r.most_steps},
                       {"steps_by_interference", steps},
                       {"positions", r.stop_positions},
                       {"blocked_positions", r.blocking_positions},
                       {"operations", r.operations},
                       {"schedules", r.schedules},
                       {"verdict", r.verdict()},
                       {"note", r.note},
                       {"witness", r.witness},
                       {"seed", seed_}});
}

void Report::add(const ProgressControl& control, const ProgressControlOutcome& outcome) {
  const ProgressResult& shown = outcome.of(control.operation);
  progress_controls_.push_back({{"control", control.name},
                                {"fault", control.fault},
                                {"operation", control.operation},
                                {"must", control.is_violation ? "violate" : "grow"},
                                {"seen", outcome.seen},
                                {"note", shown.note},
                                {"seed", seed_}});
}

ordered_json Report::to_json() const {
  ordered_json all = {{"checks", checks_}, {"controls", controls_}};
  // A part that was switched off is absent, lest it look as if nothing had been found.
  if (!explored_controls_.empty()) {
    all["schedules"] = schedules_;
    all["explored_controls"] = explored_controls_;
  }
  if (!progress_controls_.empty()) {
    all["progress"] = progress_;
    all["progress_controls"] = progress_controls_;
  }
  all["not_examined"] = not_examined_;
  for (const std::string& cache : exempt_) {
    all["not_examined"].push_back(fmt::format(
        "Schedules of {}: it is built on a foreign container, whose steps cannot be scheduled.", cache));
  }
  return all;
}

bool Report::print(std::FILE* out) const {
  const unsigned broken = print_checks(out);
  const unsigned unseen = print_controls(out);
  const unsigned broken_by_schedule = print_schedules(out);
  const unsigned uncaught = print_explored_controls(out);
  const unsigned unkept = print_progress(out);
  const unsigned unseen_progress = print_progress_controls(out);
  const unsigned all_broken = broken + broken_by_schedule + unkept;
  if (all_broken > 0) fmt::print(out, "\n{} broken promises\n", all_broken);
  if (unseen > 0) {
    fmt::print(
        out,
        "\nthe stress was too weak: {} controls were not seen failing; use more threads or other seeds\n",
        unseen);
  }
  if (uncaught > 0)
    fmt::print(out, "\nthe exploration was too weak: {} controls were not caught\n", uncaught);
  if (unseen_progress > 0)
    fmt::print(out, "\nthe check of progress was too weak: {} controls were not seen\n", unseen_progress);
  const bool is_well = all_broken + unseen + uncaught + unseen_progress == 0;
  if (is_well) fmt::print(out, "\nall promises held, all controls that had to be were seen failing\n");
  return is_well;
}

unsigned Report::print_checks(std::FILE* out) const {
  unsigned broken = 0;
  fmt::print(out, "{:<26} {:<24} {:<9} {:<9} {:>11} {:>13} {:>11}\n", "cache", "check", "verdict", "promised",
             "operations", "overlapping", "violations");
  for (const ordered_json& row : checks_) {
    fmt::print(out, "{:<26} {:<24} {:<9} {:<9} {:>11} {:>13} {:>11}\n", text(row, "cache"),
               text(row, "check"), text(row, "verdict"), is(row, "promised") ? "yes" : "no",
               number(row, "operations"), number(row, "concurrent_pairs"), number(row, "violations"));
    if (is_broken(row)) print_witness(out, text(row, "witness"));
    broken += is_broken(row);
  }
  return broken;
}

unsigned Report::print_controls(std::FILE* out) const {
  unsigned unseen = 0;
  fmt::print(out, "\n{:<26} {:<24} {:<9} {:>11}\n", "control", "must violate", "seen", "rounds");
  for (const ordered_json& row : controls_) {
    const bool seen = is(row, "seen"), required = is(row, "required");
    fmt::print(out, "{:<26} {:<24} {:<9} {:>5} of {:>2}\n", text(row, "control"), text(row, "check"),
               seen       ? "yes"
               : required ? "NO"
                          : "(no)",
               number(row, "rounds_violated"), number(row, "rounds"));
    if (!seen && !required)
      fmt::print(out, "    on this processor histories need not show it; the explorer does on any\n");
    unseen += !seen && required;
  }
  return unseen;
}

/// One line a cache; scenarios only where something is wrong.
unsigned Report::print_schedules(std::FILE* out) const {
  if (schedules_.empty() && exempt_.empty()) return 0;
  struct Line {
    std::string cache, check;
    unsigned scenarios = 0, complete = 0;
    std::uint64_t schedules = 0, violations = 0;
  };
  std::vector<Line> lines;
  unsigned broken = 0;
  for (const ordered_json& row : schedules_) {
    if (lines.empty() || lines.back().cache != text(row, "cache")) {
      Line& line = lines.emplace_back();
      line.cache = text(row, "cache");
      line.check = text(row, "check");
    }
    Line& line = lines.back();
    ++line.scenarios;
    line.complete += is(row, "complete");
    line.schedules += number(row, "schedules");
    line.violations += number(row, "violations");
    broken += is_broken(row);
  }
  fmt::print(out, "\n{:<26} {:<24} {:>9} {:>9} {:>12} {:>11}\n", "cache, every schedule", "held to",
             "scenarios", "complete", "schedules", "violations");
  for (const Line& line : lines) {
    fmt::print(out, "{:<26} {:<24} {:>9} {:>9} {:>12} {:>11}\n", line.cache, line.check, line.scenarios,
               line.complete, line.schedules, line.violations);
  }
  for (const std::string& cache : exempt_)
    fmt::print(out, "{:<26} exempt: built on a foreign container, whose steps cannot be scheduled\n", cache);
  for (const ordered_json& row : schedules_) {
    if (!is_broken(row)) continue;
    fmt::print(out, "  {} breaks its promise in {}\n", text(row, "cache"), text(row, "scenario"));
    print_replay(out, row);
  }
  return broken;
}

unsigned Report::print_explored_controls(std::FILE* out) const {
  if (explored_controls_.empty()) return 0;
  unsigned uncaught = 0;
  fmt::print(out, "\n{:<26} {:<24} {:<9} {:>11}  {}\n", "control, every schedule", "must violate", "caught",
             "schedules", "replay");
  for (const ordered_json& row : explored_controls_) {
    const bool caught = is(row, "caught");
    fmt::print(out, "{:<26} {:<24} {:<9} {:>11}  {}\n", text(row, "control"), text(row, "check"),
               caught ? "yes" : "NO", number(row, "schedules"), text(row, "replay"));
    uncaught += !caught;
  }
  return uncaught;
}

unsigned Report::print_progress(std::FILE* out) const {
  if (progress_.empty()) return 0;
  unsigned unkept = 0;
  fmt::print(out, "\n{:<19} {:<11} {:<10} {:>7} {:>7} {:>16}  {}\n", "cache, progress", "of", "declared",
             "steps", "bound", "stops that block", "verdict");
  for (const ordered_json& row : progress_) {
    const bool holds = text(row, "verdict") == "holds";
    fmt::print(out, "{:<19} {:<11} {:<10} {:>7} {:>7} {:>6} of {:>6}  {}\n", text(row, "cache"),
               text(row, "operation"), text(row, "declared"), number(row, "most_steps"),
               row["bound_steps"].is_null() ? "-" : std::to_string(number(row, "bound_steps")),
               number(row, "blocked_positions"), number(row, "positions"), text(row, "verdict"));
    if (!holds) {
      fmt::print(out, "    {}\n", text(row, "note"));
      if (!text(row, "witness").empty()) print_witness(out, text(row, "witness"));
    }
    unkept += !holds;
  }
  return unkept;
}

unsigned Report::print_progress_controls(std::FILE* out) const {
  if (progress_controls_.empty()) return 0;
  unsigned unseen = 0;
  fmt::print(out, "\n{:<26} {:<11} {:<8} {:<5}  {}\n", "control, progress", "in", "must", "seen", "note");
  for (const ordered_json& row : progress_controls_) {
    const bool seen = is(row, "seen");
    fmt::print(out, "{:<26} {:<11} {:<8} {:<5}  {}\n", text(row, "control"), text(row, "operation"),
               text(row, "must"), seen ? "yes" : "NO", text(row, "note"));
    unseen += !seen;
  }
  return unseen;
}

}  // namespace icbench::stress
