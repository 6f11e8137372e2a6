#include "stress/explore/explore.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/names.h"
#include "core/setup_error.h"

namespace icbench::stress::explore {

namespace {

constexpr std::uint64_t kBriefSchedules = 200'000;  // per cache, scenario and stamping
constexpr std::uint64_t kFullSchedules = 20'000'000;
constexpr Stamping kStampings[] = {Stamping::stamped, Stamping::unstamped};

constexpr std::uint32_t bit(Check check) noexcept { return 1u << static_cast<unsigned>(check); }

std::uint32_t promised_checks(Consistency consistency) noexcept {
  std::uint32_t bits = 0;
  for (std::size_t i = 0; i < kCheckNames.size(); ++i) {
    if (promises(consistency, static_cast<Check>(i))) bits |= 1u << i;
  }
  return bits;
}

Check strictest(std::uint32_t checks) noexcept {
  for (const Check c : {Check::linearizable, Check::per_record_linearizable, Check::regular, Check::frame}) {
    if ((checks & bit(c)) != 0) return c;
  }
  return Check::integrity;
}

std::string id_of(std::string_view cache, const Scenario& scenario, Stamping stamping,
                  std::string_view schedule) {
  return fmt::format("{}:{}:{}:{}", cache, scenario.name, name_of(stamping), schedule);
}

SearchOptions search_options(const ExploreOptions& options) {
  SearchOptions search;
  search.preemptions = options.preemptions;
  search.most_schedules = options.extent == Extent::full ? kFullSchedules : kBriefSchedules;
  return search;
}

bool is_wanted(const ExploreOptions& options, const ExploreSubject& subject) {
  return options.caches.empty() ||
         std::find(options.caches.begin(), options.caches.end(), subject.name) != options.caches.end();
}
bool is_wanted(const ExploreOptions& options, const Scenario& scenario) {
  return !scenario.is_long || options.extent == Extent::full;
}

Exploration explore_one(const ExploreSubject& subject, const Scenario& scenario, Stamping stamping,
                        const SearchOptions& search) {
  const std::uint32_t promised = promised_checks(subject.traits.consistency);
  const ScenarioOutcome outcome = subject.explore(scenario, stamping, search, 0);
  Exploration e;
  e.cache = subject.name;
  e.scenario = scenario.name;
  e.threads = thread_count(scenario);
  e.preemptions = search.preemptions;
  e.stamping = stamping;
  e.coverage = outcome.coverage;
  e.check = strictest(promised);
  std::uint64_t first = UINT64_MAX;
  for (std::size_t i = 0; i < kCheckNames.size(); ++i) {
    const auto& finding = outcome.findings[i];
    if ((promised & (1u << i)) == 0 || finding.violations == 0) continue;
    e.violations = std::max(e.violations, finding.violations);
    if (finding.first >= first) continue;
    first = finding.first;
    e.witness = fmt::format("{}: {}", kCheckNames[i], finding.witness);
    e.replay = id_of(subject.name, scenario, stamping, finding.schedule);
  }
  return e;
}

const ExploreControl* find_control(std::string_view name) {
  for (const ExploreControl& control : all_explore_controls()) {
    if (control.subject.name == name) return &control;
  }
  return nullptr;
}

const ExploreSubject* find_subject(std::string_view name) {
  for (const ExploreSubject& subject : all_explore_subjects()) {
    if (subject.name == name && subject.explore != nullptr) return &subject;
  }
  const ExploreControl* const control = find_control(name);
  return control == nullptr ? nullptr : &control->subject;
}

}  // namespace

std::vector<Exploration> explore_all(const ExploreOptions& options, const ExploreProgress& progress) {
  std::vector<Exploration> out;
  if (options.extent == Extent::off) return out;
  for (const ExploreSubject& subject : all_explore_subjects()) {
    if (!is_wanted(options, subject) || subject.explore == nullptr) continue;
    for (const Scenario& scenario : all_scenarios()) {
      if (!is_wanted(options, scenario) || !is_about(scenario, subject.traits)) continue;
      for (const Stamping stamping : kStampings) {
        progress(fmt::format("{} {}", subject.name, scenario.name));
        out.push_back(explore_one(subject, scenario, stamping, search_options(options)));
      }
    }
  }
  return out;
}

std::size_t exploration_count(const ExploreOptions& options) {
  std::size_t programs = 0;
  for (const ExploreSubject& subject : all_explore_subjects()) {
    if (!is_wanted(options, subject) || subject.explore == nullptr) continue;
    for (const Scenario& scenario : all_scenarios())
      programs += is_wanted(options, scenario) && is_about(scenario, subject.traits);
  }
  return programs * std::size(kStampings) + all_explore_controls().size();
}

std::vector<ExploredControl> explore_controls(const ExploreOptions& options,
                                              const ExploreProgress& progress) {
  std::vector<ExploredControl> out;
  if (options.extent == Extent::off) return out;
  for (const ExploreControl& control : all_explore_controls()) {
    ExploredControl result;
    result.control = control.subject.name;
    result.fault = control.fault;
    result.check = control.check;
    progress(fmt::format("{}, which must be caught", control.subject.name));
    for (const std::string_view name : control.scenarios) {
      for (const Stamping stamping : kStampings) {
        if (name.empty() || result.is_caught) continue;
        const Scenario& scenario = *find_scenario(name);
        SearchOptions search = search_options(options);
        search.preemptions.reset();  // a control is caught for certain only where nothing is left out
        const ScenarioOutcome outcome =
            control.subject.explore(scenario, stamping, search, bit(control.check));
        result.schedules += outcome.coverage.schedules;
        const auto& finding = outcome.findings[static_cast<std::size_t>(control.check)];
        if (finding.violations == 0) continue;
        result.is_caught = true;
        result.witness = finding.witness;
        result.replay = id_of(control.subject.name, scenario, stamping, finding.schedule);
      }
    }
    out.push_back(std::move(result));
  }
  return out;
}

std::vector<std::string> exempt_caches(const ExploreOptions& options) {
  std::vector<std::string> out;
  for (const ExploreSubject& subject : all_explore_subjects()) {
    if (is_wanted(options, subject) && subject.explore == nullptr && !subject.traits.single_thread &&
        subject.traits.consistency != Consistency::none)
      out.emplace_back(subject.name);
  }
  return out;
}

Replay replay(const std::string& id) {
  std::array<std::string_view, 4> part;
  std::string_view rest = id;
  for (std::size_t i = 0; i < part.size(); ++i) {
    const std::size_t end = i + 1 == part.size() ? rest.size() : rest.find(':');
    if (end == rest.npos)
      fail_setup("a replay id is CACHE:SCENARIO:STAMPING:SCHEDULE, as the explorer prints it");
    part[i] = rest.substr(0, end);
    rest.remove_prefix(std::min(end + 1, rest.size()));
  }
  const ExploreSubject* const subject = find_subject(part[0]);
  if (subject == nullptr) {
    std::vector<std::string_view> known;
    for (const ExploreSubject& s : all_explore_subjects()) {
      if (s.explore != nullptr) known.push_back(s.name);
    }
    for (const ExploreControl& c : all_explore_controls()) known.push_back(c.subject.name);
    throw std::runtime_error(unknown_name("cache", part[0], known));
  }
  const Scenario* const scenario = find_scenario(part[1]);
  if (scenario == nullptr) {
    std::vector<std::string_view> known;
    for (const Scenario& s : all_scenarios()) known.push_back(s.name);
    throw std::runtime_error(unknown_name("scenario", part[1], known));
  }
  if (std::find(kStampingNames.begin(), kStampingNames.end(), part[2]) == kStampingNames.end())
    throw std::runtime_error(unknown_name("stamping", part[2], kStampingNames));
  const Stamping stamping = part[2] == kStampingNames[0] ? Stamping::stamped : Stamping::unstamped;
  const auto deviations = decode(part[3]);
  if (!deviations) fail_setup("the schedule of a replay id looks like '12t1.3r2', or '0'");
  const auto outcome = subject->replay(*scenario, stamping, *deviations);
  if (!outcome) fail_setup("the program has no such schedule; was the id made by this version of the cache?");

  Replay result;
  for (const TraceLine& line : outcome->trace)
    result.text += fmt::format("{:{}}thread {}: {}\n", "", 4 * line.thread, line.thread, line.text);
  if (outcome->ending.kind != Ending::Kind::finished) result.text += outcome->ending.what + "\n";
  const ExploreControl* const control = find_control(part[0]);
  for (std::size_t i = 0; i < kCheckNames.size(); ++i) {
    if ((outcome->verdict.violated & (1u << i)) == 0) continue;
    const bool is_promised = promises(subject->traits.consistency, static_cast<Check>(i));
    const bool is_expected = control != nullptr && control->check == static_cast<Check>(i);
    if (!is_promised && !is_expected) continue;
    result.is_violated = true;
    result.text += fmt::format("{} violated: {}\n", kCheckNames[i], outcome->verdict.witness[i]);
  }
  if (!result.is_violated) result.text += "nothing that is promised is violated\n";
  return result;
}

}  // namespace icbench::stress::explore
