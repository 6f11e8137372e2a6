// A scenario on a cache in the hands of the engine.
#pragma once

#include <fmt/format.h>

#include <array>

#include "stress/explore/model_locks.h"
#include "stress/explore/scenario.h"
#include "stress/round.h"

namespace icbench::stress::explore {

/// What the schedules of one scenario showed.
struct ScenarioOutcome {
  Coverage coverage;
  /// Per check: schedules that violated it, and of the first its number from 1, its witness and its text.
  struct Finding {
    std::uint64_t violations = 0;
    std::uint64_t first = 0;
    std::string witness;
    std::string schedule;
  };
  std::array<Finding, kCheckNames.size()> findings;
};

struct ReplayOutcome {
  std::vector<TraceLine> trace;
  Ending ending;
  Verdicts::Verdict verdict;
};

/// `Cache` uses ModelSync and its relatives.
template <class Cache>
class Drive {
 public:
  Drive(const Scenario& scenario, Stamping stamping)
      : scenario_(scenario),
        stamping_(stamping),
        verdicts_(stage_, stamping),
        engine_(thread_count(scenario)) {
    read_scenario();
    program_.threads = thread_count(scenario);
    program_.prepare = [this](bool is_dirty) { prepare(is_dirty); };
    program_.body = [this](unsigned t) { run_thread(t); };
  }

  /// Ends early when a check of `stop_at`, as bits 1 << Check, is violated.
  ScenarioOutcome explore(const SearchOptions& options, std::uint32_t stop_at) {
    ScenarioOutcome outcome;
    std::uint64_t number = 0;
    program_.judge = [&](const Ending& ending) {
      ++number;
      const Verdicts::Verdict verdict = judge(ending);
      for (std::size_t i = 0; i < kCheckNames.size(); ++i) {
        if ((verdict.violated & (1u << i)) == 0) continue;
        auto& finding = outcome.findings[i];
        if (++finding.violations > 1) continue;
        finding.first = number;
        finding.witness = verdict.witness[i];
        finding.schedule = engine_.schedule_text();
      }
      return (verdict.violated & stop_at) == 0;
    };
    outcome.coverage = engine_.explore(program_, options);
    return outcome;
  }

  std::optional<ReplayOutcome> replay(std::span<const Deviation> deviations) {
    ReplayOutcome outcome;
    const auto ending = engine_.replay(program_, deviations, outcome.trace);
    if (!ending) return std::nullopt;
    outcome.ending = *ending;
    outcome.verdict = judge(*ending);
    return outcome;
  }

 private:
  using Session = typename Cache::Session;

  void read_scenario() {
    std::uint32_t id = 0;
    const auto insert = [&](std::uint32_t kind) {
      LoggedOperation o;
      o.where = kind;
      o.id = id++;
      return o;
    };
    for (unsigned i = 0; i < scenario_.before; ++i)
      log_.before.push_back(insert(Stage::kind(Stage::kHere, 0)));
    for (unsigned i = 0; i < scenario_.nearby; ++i)
      log_.before.push_back(insert(Stage::kind(Stage::kNearby, 0)));
    if (scenario_.is_warm) {
      for (unsigned t = 0; t < thread_count(scenario_); ++t)
        log_.before.push_back(insert(Stage::kind(Stage::kElsewhere, 1)));
    }
    for (unsigned t = 0; t < thread_count(scenario_); ++t) {
      auto& operations = log_.threads.emplace_back();
      char last = ' ';
      for (const char c : scenario_.threads[t]) {
        const bool is_in_batch = c == 'b' && last == 'b';
        if (c == 'q' || c == 'b' || c == 'l' || c == 'r') {
          LoggedOperation o;
          o.is_query = true;
          o.is_in_batch = is_in_batch;
          o.where = c == 'l' ? Stage::kLeft : c == 'r' ? Stage::kRight : Stage::kHere;
          o.id = id++;
          operations.push_back(o);
        } else if (c >= '0' && c < '0' + static_cast<char>(Stage::kSizes)) {
          const std::uint32_t place = last == 'x' ? Stage::kLeft : Stage::kHere;
          operations.push_back(insert(Stage::kind(place, static_cast<std::uint32_t>(c - '0'))));
        }
        last = c;
      }
    }
    for (std::uint32_t place = 0; place < Stage::kPlaces; ++place) {
      LoggedOperation o;
      o.is_query = true;
      o.where = place;
      log_.rest.push_back(o);
    }
  }

  void prepare(bool is_dirty) {
    const unsigned threads = thread_count(scenario_);
    if (is_dirty || !cache_) {
      sessions_.clear();
      const std::uint32_t capacity = std::max(capacity_for(log_.ids(), threads), scenario_.capacity);
      cache_.emplace(CacheConfig{.capacity = capacity, .max_sessions = threads});
      for (unsigned t = 0; t < threads; ++t) sessions_.push_back(cache_->open_session(t));
    } else if (!is_clear_) {
      cache_->clear();
    }
    is_clear_ = false;
    counter_.store(0, std::memory_order_relaxed);  // relaxed, as all here: one thread
    if (scenario_.is_warm) {
      for (Session& s : sessions_) s.prefault(kWarmRecords);
    }
    const std::size_t first_warm = scenario_.before + scenario_.nearby;
    for (std::size_t i = 0; i < log_.before.size(); ++i) {
      LoggedOperation& o = log_.before[i];
      o.result = sessions_[i < first_warm ? 0 : i - first_warm].insert(stage_.record(o.where, o.id));
    }
    cache_->end_frame();
    cache_->begin_frame();
  }

  void run_thread(unsigned t) {
    if (scenario_.prefaults && t == 0) sessions_[t].prefault(kPrefaultRecords);
    const std::span operations(log_.threads[t]);
    for (std::size_t i = 0, n; i < operations.size(); i += n) {
      for (n = 1; n < kMostBatch && i + n < operations.size() && operations[i + n].is_in_batch;) ++n;
      const std::span call = operations.subspan(i, n);
      LoggedOperation& first = call.front();
      // Acquire: what has returned by the number read is known here.
      if (stamping_ == Stamping::stamped) first.call = 2 * counter_.load(std::memory_order_acquire) + 2;
      Engine::current().note([&] { return call_text(call); });
      if (!first.is_query) {
        first.result = sessions_[t].insert(stage_.record(first.where, first.id));
      } else if (n == 1) {
        query(sessions_[t], first);
      } else {
        query_batch(sessions_[t], call);
      }
      for (const LoggedOperation& o : call) Engine::current().note([&] { return return_text(o); });
      if (stamping_ == Stamping::stamped)
        first.ret = 2 * counter_.fetch_add(1, std::memory_order_acq_rel) + 3;
      for (LoggedOperation& o : call) {
        o.call = first.call;
        o.ret = first.ret;
      }
    }
  }

  void query(Session& session, LoggedOperation& o) {
    o.seen_count = 0;
    session.visit(stage_.place(o.where), [&](const Record& r, float) noexcept { o.see(shown_id(r, 0)); });
    // Which record came first does not matter.
    std::sort(o.seen.begin(), o.seen.begin() + o.seen_count);
  }

  /// The visitors of a batch.
  struct Watching {
    std::span<LoggedOperation> queries;
    auto operator[](std::size_t i) const noexcept {
      return [&o = queries[i]](const Record& r, float) noexcept { o.see(shown_id(r, 0)); };
    }
  };

  void query_batch(Session& session, std::span<LoggedOperation> queries) {
    // Not of the heap: an execution may be abandoned within.
    std::array<SurfacePoint, kMostBatch> points;
    for (std::size_t i = 0; i < queries.size(); ++i) {
      queries[i].seen_count = 0;
      points[i] = stage_.place(queries[i].where);
    }
    const Watching watching{queries};
    session.visit_batch({points.data(), queries.size()}, watching);
    for (LoggedOperation& o : queries) std::sort(o.seen.begin(), o.seen.begin() + o.seen_count);
  }

  Verdicts::Verdict judge(const Ending& ending) {
    if (ending.kind == Ending::Kind::finished) {
      cache_->end_frame();
      log_.contents.clear();
      cache_->for_each_record([&](const Record& r) { log_.contents.push_back(shown_id(r, 0)); });
      std::sort(log_.contents.begin(), log_.contents.end());
      for (LoggedOperation& o : log_.rest) query(sessions_[0], o);
      cache_->clear();
      is_clear_ = true;
      log_.after_clear.clear();
      cache_->for_each_record([&](const Record& r) { log_.after_clear.push_back(shown_id(r, 0)); });
    }
    return verdicts_.judge(log_, ending);
  }

  static std::string call_text(std::span<const LoggedOperation> call) {
    if (call.size() > 1) return fmt::format("calls a batch of {} queries", call.size());
    const LoggedOperation& o = call.front();
    if (o.is_query)
      return o.where == Stage::kLeft    ? "calls query on the left"
             : o.where == Stage::kRight ? "calls query on the right"
                                        : "calls query";
    return fmt::format("calls insert of record {}, size {}", o.id, o.where % Stage::kSizes);
  }
  static std::string return_text(const LoggedOperation& o) {
    if (!o.is_query) return fmt::format("has inserted record {}", o.id);
    std::string text = fmt::format("has seen {} records", o.seen_count);
    for (unsigned i = 0; i < o.seen_count; ++i)
      text += fmt::format("{} {}", i == 0 ? ":" : ",", o.seen[i] & ~kTorn);
    return text;
  }

  static constexpr std::uint32_t kWarmRecords = 8, kPrefaultRecords = 64;

  const Scenario& scenario_;
  Stamping stamping_;
  Stage stage_;
  Verdicts verdicts_;
  Engine engine_;
  Program program_;
  ExecutionLog log_;
  std::optional<Cache> cache_;
  std::vector<Session> sessions_;
  ModelSync::Atomic<std::uint64_t> counter_{0};
  bool is_clear_ = false;
};

}  // namespace icbench::stress::explore
