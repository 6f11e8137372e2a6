// The schedule explorer's search: its reduction loses nothing, and a schedule can be had again.
#include <gtest/gtest.h>

#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>

#include "core/random.h"
#include "litmus.h"

namespace icbench::stress::explore {
namespace {

// Random programs: the reduced search shows what the full one shows.

struct Instruction {
  Access::Kind kind;
  std::uint8_t word;
  std::uint8_t value;
  std::memory_order order;
};
using RandomProgram = std::vector<std::vector<Instruction>>;

RandomProgram random_program(std::uint64_t seed, unsigned threads, unsigned steps) {
  Pcg32 random(hash_keys(seed, threads, steps));
  const unsigned words = 1 + random.below(2);
  const bool has_locks = random.below(4) == 0;
  RandomProgram program(threads);
  for (auto& thread : program) {
    for (unsigned i = 1 + random.below(steps); i > 0; --i) {
      constexpr Access::Kind kKinds[] = {Access::Kind::load, Access::Kind::store, Access::Kind::add,
                                         Access::Kind::compare_exchange};
      constexpr std::memory_order kOrders[] = {kRelaxed, kAcqRel, kRelaxed, kAcqRel, kSeqCst};
      Instruction in{kKinds[random.below(4)], static_cast<std::uint8_t>(random.below(words)),
                     static_cast<std::uint8_t>(random.below(3)), kOrders[random.below(5)]};
      if (has_locks && random.below(2) == 0) in.kind = Access::Kind::lock;  // around one addition
      if (has_locks && random.below(6) == 0) in.kind = Access::Kind::lock_shared;
      thread.push_back(in);
    }
  }
  return program;
}

/// An execution of it: every value read, every value that was in a word, in order, and how it ended. Values that are
/// stored name the store, so that this tells executions of different kinds apart.
class RandomRun {
 public:
  explicit RandomRun(const RandomProgram& program) : code_(program) {
    program_.threads = static_cast<unsigned>(program.size());
    program_.prepare = [this](bool) {
      state_.emplace();
      reads_.assign(code_.size(), {});
    };
    program_.body = [this](unsigned t) { execute(t); };
  }

  std::map<Outcome, unsigned> explore(const SearchOptions& options) {
    std::map<Outcome, unsigned> outcomes;
    program_.judge = [&](const Ending& ending) {
      ++outcomes[outcome(ending)];
      return true;
    };
    coverage = engine_.explore(program_, options);
    return outcomes;
  }
  Outcome outcome(const Ending& ending) const {
    Outcome o{static_cast<std::uint32_t>(ending.kind)};
    if (ending.kind == Ending::Kind::raced) return o;
    for (const Outcome& reads : reads_) {
      o.push_back(~0u);
      o.insert(o.end(), reads.begin(), reads.end());
    }
    for (const Word& w : state_->w) o.push_back(w.load(kRelaxed));
    return o;
  }
  Engine& engine() { return engine_; }
  const Program& program() const { return program_; }

  Coverage coverage;

 private:
  static std::memory_order load_order(std::memory_order o) { return o == kAcqRel ? kAcquire : o; }
  static std::memory_order store_order(std::memory_order o) { return o == kAcqRel ? kRelease : o; }

  void execute(unsigned t) {
    Litmus& l = *state_;
    std::uint32_t number = 0;
    for (const Instruction& in : code_[t]) {
      Word& w = l.w[in.word];
      // Large values are unique; small ones let compare-exchanges succeed.
      const std::uint32_t unique = in.value == 0 ? 100 * (t + 1) + ++number : in.value;
      switch (in.kind) {
        case Access::Kind::load:
          reads_[t].push_back(w.load(load_order(in.order)));
          break;
        case Access::Kind::store:
          w.store(unique, store_order(in.order));
          break;
        case Access::Kind::add:
          reads_[t].push_back(w.fetch_add(1000, in.order));
          break;
        case Access::Kind::lock:
          l.mutex.lock();
          ModelSync::writes(&l.plain, sizeof l.plain);
          reads_[t].push_back(l.plain++);
          reads_[t].push_back(w.load(kRelaxed));
          l.mutex.unlock();
          break;
        case Access::Kind::lock_shared:
          l.mutex.lock_shared();
          ModelSync::reads(&l.plain, sizeof l.plain);
          reads_[t].push_back(l.plain);
          l.mutex.unlock_shared();
          break;
        default: {
          std::uint32_t expected = in.value;
          reads_[t].push_back(w.compare_exchange_strong(expected, unique, in.order, load_order(in.order)));
          reads_[t].push_back(expected);
        }
      }
    }
  }

  RandomProgram code_;
  Program program_;
  Engine engine_;
  std::optional<Litmus> state_;
  std::vector<Outcome> reads_;
};

template <class F>
std::set<Outcome> keys(const F& outcomes) {
  std::set<Outcome> out;
  for (const auto& [outcome, n] : outcomes) out.insert(outcome);
  return out;
}

std::uint64_t random_programs(std::uint64_t usual) {
  const char* const wanted = std::getenv("ICBENCH_EXPLORE_PROGRAMS");
  return wanted != nullptr ? std::strtoull(wanted, nullptr, 10) : usual;
}

constexpr std::uint64_t kPrograms = 400;

struct Size {
  unsigned threads, steps;
};
constexpr Size kSizes[] = {{2, 4}, {3, 2}, {3, 3}, {4, 2}};

TEST(Reduction, LosesNoOutcome) {
  std::uint64_t all = 0, reduced = 0;
  for (std::uint64_t seed = 0; seed < random_programs(kPrograms); ++seed) {
    const Size size = kSizes[seed % std::size(kSizes)];
    RandomRun run(random_program(seed, size.threads, size.steps));
    const auto expected = run.explore({.preemptions = {}, .reduce = false});
    all += run.coverage.schedules;
    const auto got = run.explore({});
    reduced += run.coverage.schedules;
    ASSERT_EQ(keys(got), keys(expected)) << "seed " << seed;
  }
  EXPECT_LT(reduced * 4, all);
}

TEST(Reduction, LosesNoOutcomeWithinABound) {
  for (std::uint64_t seed = 0; seed < random_programs(kPrograms); ++seed) {
    const Size size = kSizes[seed % std::size(kSizes)];
    RandomRun run(random_program(seed, size.threads, size.steps));
    for (unsigned bound = 0; bound < 3; ++bound) {
      const auto expected = run.explore({.preemptions = bound, .reduce = false});
      const auto got = run.explore({.preemptions = bound});
      ASSERT_EQ(keys(got), keys(expected)) << "seed " << seed << ", bound " << bound;
    }
  }
}

/// What has been printed of a schedule, decoded and run again, ends the same way.
TEST(Replays, AreTheSameExecution) {
  for (std::uint64_t seed = 0; seed < random_programs(300); ++seed) {
    const Size size = kSizes[seed % std::size(kSizes)];
    RandomRun run(random_program(seed, size.threads, size.steps));
    std::map<std::string, Outcome> by_schedule;
    Program program = run.program();
    program.judge = [&](const Ending& ending) {
      const auto [at, is_new] = by_schedule.emplace(run.engine().schedule_text(), run.outcome(ending));
      EXPECT_TRUE(is_new) << "two schedules of one name: " << at->first;
      return true;
    };
    run.engine().explore(program, {});
    for (const auto& [text, outcome] : by_schedule) {
      const auto deviations = decode(text);
      ASSERT_TRUE(deviations) << text;
      std::vector<TraceLine> trace;
      const auto ending = run.engine().replay(program, *deviations, trace);
      ASSERT_TRUE(ending) << text;
      EXPECT_EQ(run.outcome(*ending), outcome) << text;
    }
  }
}

}  // namespace
}  // namespace icbench::stress::explore
