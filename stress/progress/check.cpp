#include "stress/progress/check.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/random.h"
#include "stress/progress/settings.h"

namespace icbench::stress {

namespace {

using namespace progress;

constexpr unsigned kVictim = 0, kOther = 1, kThird = 2, kSecondVictim = 3, kFibers = 4;

class ProgressCheck {
 public:
  ProgressCheck(const ProgressSubject& subject, const ProgressOptions& options)
      : subject_(subject),
        options_(options),
        is_alone_(subject.traits.single_thread),
        landscape_(kShape, options.seed, CacheConfig{}.a),
        stage_(kFibers) {}

  std::array<ProgressResult, kAskedNames.size()> run() {
    check(insert_settings());
    check(query_settings(Type::query));
    check(query_settings(Type::batch));
    if (!is_alone_) {
      run_mixed();
      const bool is_blocking = declared(Type::insert) == ProgressGuarantee::blocking ||
                               declared(Type::query) == ProgressGuarantee::blocking;
      // Two stopped operations say nothing new of a cache that one has brought down.
      const bool is_sound =
          std::all_of(accounts_.begin(), accounts_.end(), [](const Account& a) { return a.fault.empty(); });
      if (!is_blocking && is_sound) stop_pairs();
    }
    return {result(Type::insert), result(Type::query), result(Type::batch)};
  }

 private:
  struct Account {
    StepTally tally;
    std::vector<InterferenceSteps> series;
    std::uint64_t stops = 0;
    std::uint64_t blocking_stops = 0;
    std::uint64_t first_blocking_step = 0;
    std::uint64_t schedules = 0;
    std::string fault;  ///< the first, one line
    std::string witness;
  };

  /// What accusations add from here on: the setting they are about.
  void set_scene(const Setting& setting) {
    scene_ = setting.victim.type == Type::insert  ? fmt::format("; a record of size {}", setting.victim.where)
             : setting.victim.type == Type::query ? "; a query"
                                                  : fmt::format("; a batch of {} queries", kBatchQueries);
    for (const Prefill& p : setting.prefill) {
      if (p.records > 0) scene_ += fmt::format(", {} of size {} before", p.records, p.kind % kSizes);
    }
    if (setting.pool == Pool::scarce) scene_ += ", a scarce pool";
  }

  Account& account(Type type) noexcept { return accounts_[static_cast<std::size_t>(type)]; }
  ProgressGuarantee declared(Type type) const noexcept {
    return type == Type::insert ? subject_.traits.insert : subject_.traits.query;
  }

  /// On whose stage come the first `fibers`: no more sessions are set up than those need.
  Trial make_trial(const Setting& setting, unsigned fibers) {
    return Trial(stage_, subject_, landscape_, sessions(fibers), setting.prefill, setting.pool);
  }
  std::uint32_t sessions(unsigned fibers) const noexcept { return is_alone_ ? 1 : fibers + 1; }
  void start(Trial& trial, unsigned fiber, const Request& request) {
    trial.start(fiber, 1, [request](std::uint32_t) { return request; });
  }

  /// Enters what came of a trial; what the trial as a whole broke is charged to `type`.
  template <class... Args>
  void enter(Trial& trial, Type type, fmt::format_string<Args...> schedule, Args&&... args) {
    Trial::Outcome outcome = trial.finish();
    ++account(type).schedules;
    const auto where = [&] { return fmt::format(schedule, args...); };
    for (const Type t : {Type::insert, Type::query, Type::batch}) {
      StepTally& tally = outcome.tallies[static_cast<std::size_t>(t)];
      if (tally.exceeded > 0) accuse(t, tally.witness + ", " + where());
      account(t).tally.add(tally);
    }
    if (outcome.broken.empty()) return;
    accuse(type, fmt::format("{} does not hold, {}", outcome.broken, where()));
    if (account(type).witness.empty()) account(type).witness = std::move(outcome.witness);
  }
  void accuse(Type type, const std::string& line) {
    if (account(type).fault.empty()) account(type).fault = line + scene_;
  }

  /// Lets fibers [first, end) run in turns of `points` points until none can. After many turns, those become longer:
  /// one that spins is found out sooner.
  void let_run(unsigned first, unsigned end, std::uint64_t points) {
    std::uint64_t turns = 0;
    for (bool ran = true; ran;) {
      ran = false;
      if (++turns > kManyTurns) points = Stage::kAll;
      for (unsigned f = first; f < end; ++f) {
        if (!stage_.can_run(f)) continue;
        stage_.run(f, points);
        ran = true;
      }
    }
  }
  bool all_done(unsigned first, unsigned end) const noexcept {
    for (unsigned f = first; f < end; ++f) {
      if (!stage_.is_done(f)) return false;
    }
    return true;
  }

  void check(const std::vector<Setting>& settings) {
    for (const Setting& setting : settings) {
      if (setting.pool == Pool::scarce &&
          (is_alone_ || declared(Type::insert) == ProgressGuarantee::blocking))
        continue;
      set_scene(setting);
      const std::uint64_t points = run_alone(setting, kThird + 1);
      if (is_alone_) continue;
      stop_everywhere(setting, points);
      if (setting.is_interfered || options_.is_long) interfere(setting, points);
    }
  }

  /// Points of the victim undisturbed. There may be more of them with more sessions, so those of all `fibers` are
  /// there.
  std::uint64_t run_alone(const Setting& setting, unsigned fibers) {
    Trial trial = make_trial(setting, fibers);
    start(trial, kVictim, setting.victim);
    let_run(kVictim, kVictim + 1, Stage::kAll);
    const std::uint64_t points = stage_.points(kVictim);
    if (is_alone_) enter_series(account(setting.victim.type), 0, stage_.steps(kVictim));
    enter(trial, setting.victim.type, "alone");
    return points;
  }

  /// Stops the victim after each of its points; two others must do all the same.
  void stop_everywhere(const Setting& setting, std::uint64_t points) {
    Account& a = account(setting.victim.type);
    for (std::uint64_t k = 0; k < points; ++k) {
      bool blocks = false;
      std::uint64_t steps = 0;
      for (const std::uint64_t turn : {Stage::kAll, kTurn}) {
        Trial trial = make_trial(setting, kThird + 1);
        start(trial, kVictim, setting.victim);
        stage_.run(kVictim, k);
        steps = stage_.steps(kVictim);
        start_others(trial, setting);
        let_run(kOther, kThird + 1, turn);
        blocks = blocks || !all_done(kOther, kThird + 1);
        enter(trial, setting.victim.type, "stopped for good after step {}", steps);
      }
      ++a.stops;
      if (!blocks) continue;
      a.first_blocking_step = a.blocking_stops == 0 ? steps : std::min(a.first_blocking_step, steps);
      ++a.blocking_stops;
      if (declared(setting.victim.type) != ProgressGuarantee::blocking)
        accuse(setting.victim.type, fmt::format("blocks others when stopped after step {}", steps));
    }
  }

  /// What those do who are not stopped.
  void start_others(Trial& trial, const Setting& setting) {
    const std::uint32_t kind = setting.victim.type == Type::insert ? setting.victim.where : 0;
    for (const unsigned f : {kOther, kThird}) {
      const std::array<Request, 6> requests = {{{Type::query, 0},
                                                {Type::insert, kind},
                                                {Type::query, 0},
                                                {Type::insert, (kind + f) % kKinds},
                                                {Type::query, 0},
                                                {Type::query, 1}}};
      trial.start(f, requests.size(), [requests](std::uint32_t n) { return requests[n]; });
    }
  }

  /// An insert and a query stopped together: a query may have stopped while it helped.
  void stop_pairs() {
    std::vector<Setting> settings = {{{{1, 1}}, {Type::insert, 1}, false}};
    if (options_.is_long) settings = insert_settings();
    for (const Setting& setting : settings) {
      set_scene(setting);
      const std::uint64_t points = run_alone(setting, kFibers);
      for (std::uint64_t k = 0; k < points; ++k) {
        for (std::uint64_t j = 0; !stop_pair(setting, k, j); ++j) {
        }
      }
    }
  }

  /// An insert stopped after `k` points and a query after `j`. Whether the query had come to its end by then.
  bool stop_pair(const Setting& setting, std::uint64_t k, std::uint64_t j) {
    Trial trial = make_trial(setting, kFibers);
    start(trial, kVictim, setting.victim);
    stage_.run(kVictim, k);
    start(trial, kSecondVictim, {Type::query, 0});
    stage_.run(kSecondVictim, j);
    const bool has_ended = !stage_.can_run(kSecondVictim);
    if (has_ended && !stage_.is_done(kSecondVictim))
      accuse(Type::query, fmt::format("does not end when an insert has stopped after {} points", k));
    start_others(trial, setting);
    let_run(kOther, kThird + 1, kTurn);
    if (!all_done(kOther, kThird + 1))
      accuse(Type::query,
             fmt::format("an insert stopped after {} points and a query after {} block others", k, j));
    enter(trial, Type::query, "an insert stopped for good after {} points and a query after {}", k, j);
    return has_ended;
  }

  /// Whole inserts by another fiber between the victim's steps.
  void interfere(const Setting& setting, std::uint64_t points) {
    Account& a = account(setting.victim.type);
    for (const bool is_mixed : {false, true}) {
      for (std::size_t i = 0; i < kInterference.size(); ++i) {
        const std::uint32_t n = kInterference[i];
        std::uint64_t most = interfere(setting, is_mixed, 1, 0, n);
        for (std::uint64_t k = 0; k < points && n > 0; ++k)
          most = std::max(most, interfere(setting, is_mixed, n, k, n));
        enter_series(a, i, most);
        if (n > 0 && declared(setting.victim.type) == ProgressGuarantee::wait_free)
          interfere(setting, is_mixed, n, 0, options_.is_long ? kLongInterference : kShortInterference);
      }
    }
  }

  static void enter_series(Account& a, std::size_t i, std::uint64_t steps) {
    if (a.series.size() == i) a.series.push_back({kInterference[i], 0});
    a.series[i].steps = std::max(a.series[i].steps, steps);
  }

  /// From the victim's point number `first` on, another fiber does `each` inserts before every one of its points, until
  /// it has done `n` in all. Returns the victim's steps.
  std::uint64_t interfere(const Setting& setting, bool is_mixed, std::uint32_t each, std::uint64_t first,
                          std::uint32_t n) {
    Setting roomy = setting;
    if (n > kShortInterference) roomy.pool = Pool::large;
    Trial trial = make_trial(roomy, kOther + 1);
    const std::uint32_t kind = setting.victim.type == Type::insert ? setting.victim.where : 0;
    start(trial, kVictim, setting.victim);
    trial.start(kOther, n, [=](std::uint32_t i) {
      return Request{Type::insert, is_mixed ? (kind + i) % kKinds : kind};
    });
    stage_.run(kVictim, first);
    while (!stage_.is_done(kVictim)) {
      if (stage_.can_run(kOther)) stage_.run(kOther, Stage::kAll, each);
      if (stage_.can_run(kVictim)) {
        stage_.run(kVictim, 1);
      } else if (!stage_.can_run(kOther)) {
        break;
      }
    }
    const std::uint64_t steps = stage_.steps(kVictim);
    if (!all_done(kVictim, kVictim + 1)) accuse(setting.victim.type, "does not end");
    let_run(kOther, kOther + 1, Stage::kAll);
    enter(trial, setting.victim.type, "{} inserts before each point from number {} on, {} in all", each,
          first, n);
    return steps;
  }

  /// Operations of all kinds by all fibers: in turns, one starved, and switching at random.
  void run_mixed() {
    scene_.clear();
    const std::vector<Prefill> none, some = {{1, 4}, {2, 1}};
    std::uint64_t round = 0;
    const auto make = [&](std::uint32_t operations) {
      auto trial = std::make_unique<Trial>(stage_, subject_, landscape_, sessions(kFibers),
                                           round % 2 == 0 ? none : some, Pool::usual);
      for (unsigned f = 0; f < kFibers; ++f) {
        trial->start(
            f, operations, [random = Pcg32(hash_keys(options_.seed, round, f))](std::uint32_t) mutable {
              if (random.below(2) == 0) return Request{Type::insert, random.below(kKinds)};
              return Request{random.below(4) == 0 ? Type::batch : Type::query, random.below(kPlaces)};
            });
      }
      ++round;
      return trial;
    };
    const auto close = [&](Trial& trial, auto schedule, std::uint64_t number) {
      if (!all_done(0, kFibers)) accuse(Type::query, "nobody can go on, though nobody was stopped");
      enter(trial, Type::query, "{} {}", schedule, number);
    };
    for (std::uint64_t turn = 1; turn <= kMostTurn; ++turn) {
      for (int i = 0; i < 2; ++i) {
        const auto trial = make(kMixedOperations);
        let_run(0, kFibers, turn);
        close(*trial, "in turns of points,", turn);
      }
    }
    for (unsigned starved = 0; starved < kFibers; ++starved) {
      for (int i = 0; i < 2; ++i) {
        const auto trial = make(kStarvingOperations);
        while (!all_done(0, kFibers) && can_any_run()) {
          for (unsigned f = 0; f < kFibers; ++f) {
            if (stage_.can_run(f)) stage_.run(f, f == starved ? 1 : kFeast);
          }
        }
        close(*trial, "starving fiber", starved);
      }
    }
    const std::uint64_t seeds = options_.is_long ? kLongSeeds : kShortSeeds;
    for (std::uint64_t s = 0; s < seeds; ++s) {
      const auto trial = make(kMixedOperations);
      Pcg32 random(hash_keys(options_.seed, s, 17));
      const std::uint32_t longest = 1u << random.below(6);
      while (!all_done(0, kFibers) && can_any_run()) {
        const unsigned f = random.below(kFibers);
        if (stage_.can_run(f)) stage_.run(f, 1 + random.below(longest));
      }
      close(*trial, "random schedule", s);
    }
  }
  bool can_any_run() const noexcept {
    for (unsigned f = 0; f < kFibers; ++f) {
      if (stage_.can_run(f)) return true;
    }
    return false;
  }

  ProgressResult result(Type type) {
    const Account& a = account(type);
    const bool is_insert = type == Type::insert;
    ProgressResult r;
    r.cache = subject_.traits.name;
    r.operation = kAskedNames[static_cast<std::size_t>(type)];
    r.declared = declared(type);
    r.bound = is_insert ? subject_.insert_bound : subject_.query_bound;
    if (type == Type::batch && !r.bound.empty())
      r.bound = fmt::format("{} queries, each {}", kBatchQueries, r.bound);
    r.bound_steps = a.tally.bound_of_most;
    r.most_steps = a.tally.most_steps;
    r.steps_by_interference = a.series;
    r.stop_positions = a.stops;
    r.blocking_positions = a.blocking_stops;
    r.operations = a.tally.operations;
    r.schedules = a.schedules;
    r.holds = a.fault.empty();
    r.witness = a.witness;
    r.note = !r.holds ? a.fault : note(a, r.declared);
    return r;
  }

  std::string note(const Account& a, ProgressGuarantee guarantee) const {
    if (is_alone_) return "one thread: there are no others";
    if (guarantee == ProgressGuarantee::blocking && subject_.traits.waits_in_library)
      return "blocks, where it does, in a library whose steps cannot be stopped or counted";
    std::string line = a.blocking_stops == 0
                           ? fmt::format("hinders nobody when stopped in any of {} places", a.stops)
                           : fmt::format("blocks others when stopped in {} of {} places, first after step {}",
                                         a.blocking_stops, a.stops, a.first_blocking_step);
    if (guarantee == ProgressGuarantee::lock_free && a.series.back().steps > kInterference.back())
      line += fmt::format("; steps grow with interference, from {} to {}", a.series.front().steps,
                          a.series.back().steps);
    return line;
  }

  static constexpr std::uint32_t kShortInterference = 4'000, kLongInterference = 20'000;
  static constexpr std::uint32_t kMixedOperations = 6, kStarvingOperations = 24;
  static constexpr std::uint64_t kManyTurns = 10'000, kTurn = 5, kMostTurn = 8, kFeast = 50;
  static constexpr std::uint64_t kShortSeeds = 500, kLongSeeds = 50'000;

  const ProgressSubject& subject_;
  const ProgressOptions& options_;
  bool is_alone_;  // its cache is for one thread
  Landscape landscape_;
  Stage stage_;
  std::string scene_;
  std::array<Account, kAskedNames.size()> accounts_;
};

}  // namespace

std::array<ProgressResult, kAskedNames.size()> check_progress(const ProgressSubject& subject,
                                                              const ProgressOptions& options) {
  return ProgressCheck(subject, options).run();
}

}  // namespace icbench::stress
