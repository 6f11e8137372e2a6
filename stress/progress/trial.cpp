#include "stress/progress/trial.h"

#include <fmt/format.h>

#include <algorithm>

namespace icbench::stress {

namespace {

constexpr std::uint32_t kUsualCapacity = 1 << 13, kLargeCapacity = 1 << 16;

CacheConfig config_for(std::uint32_t sessions, Pool pool) {
  return {.capacity = pool == Pool::large ? kLargeCapacity : kUsualCapacity, .max_sessions = sessions};
}

}  // namespace

void StepTally::add(std::uint64_t steps, std::uint64_t bound) noexcept {
  ++operations;
  if (steps < most_steps || (steps == most_steps && bound <= bound_of_most)) return;
  most_steps = steps;
  bound_of_most = bound;
}

void StepTally::accuse(std::string line) {
  if (++exceeded == 1) witness = std::move(line);
}

void StepTally::add(const StepTally& other) {
  const std::uint64_t sum = operations + other.operations;
  add(other.most_steps, other.bound_of_most);
  operations = sum;
  if (exceeded == 0) witness = other.witness;
  exceeded += other.exceeded;
}

Trial::Trial(Stage& stage, const ProgressSubject& subject, const Landscape& landscape, std::uint32_t sessions,
             const std::vector<Prefill>& prefill, Pool pool)
    : stage_(stage),
      landscape_(landscape),
      consistency_(subject.traits.consistency),
      cache_(subject.make(config_for(sessions, pool))),
      logs_(sessions) {
  stage_.clear();
  stage_.refuse_pieces(pool == Pool::scarce);
  history_.validity = &landscape_.validity();
  for (const Prefill& p : prefill) {
    for (std::uint32_t i = 0; i < p.records; ++i) insert(sessions - 1, p.kind);
  }
  if (!logs_[sessions - 1].empty()) {
    cache_->end_frame();
    close_epoch();
  }
}

void Trial::start(unsigned i, std::uint32_t count, std::function<Request(std::uint32_t)> request) {
  stage_.start(i, [this, i, count, request = std::move(request)] {
    for (std::uint32_t n = 0; n < count; ++n) {
      Stage::begin_operation();
      const Request r = request(n);
      switch (r.type) {
        case Asked::insert:
          insert(i, r.where);
          break;
        case Asked::query:
          query(i, r.where);
          break;
        case Asked::batch:
          query_batch(i, r.where);
          break;
      }
    }
  });
}

void Trial::insert(std::uint32_t session, std::uint32_t kind) {
  std::vector<Logged>& log = logs_[session];
  const std::size_t first = log.size();
  const std::uint32_t id = next_id_++;
  log.push_back({{++clock_, kPending, session, kind, id, 0, Operation::Type::insert, InsertResult::inserted},
                 Asked::insert});
  const InsertResult result = cache_->insert(session, landscape_.record(kind, id, 0));
  log[first].operation.result = result;
  end(session, first);
}

void Trial::query(std::uint32_t session, std::uint32_t place) {
  std::vector<Logged>& log = logs_[session];
  const std::size_t first = log.size();
  log.push_back({{++clock_, kPending, session, place, 0, 0, Operation::Type::query, InsertResult::inserted},
                 Asked::query});
  cache_->visit(session, landscape_.place(place),
                [&seen = log[first].seen](const Record& r) { seen.push_back(shown_id(r, 0)); });
  end(session, first);
}

void Trial::query_batch(std::uint32_t session, std::uint32_t place) {
  std::vector<Logged>& log = logs_[session];
  const std::size_t first = log.size();
  std::array<SurfacePoint, kBatchQueries> points;
  ++clock_;
  for (std::uint32_t i = 0; i < kBatchQueries; ++i) {
    const std::uint32_t where = (place + i) % landscape_.validity().places();
    points[i] = landscape_.place(where);
    log.push_back({{clock_, kPending, session, where, 0, 0, Operation::Type::query, InsertResult::inserted},
                   Asked::batch});
  }
  Logged* const queries = &log[first];
  cache_->visit_batch(session, points, [queries](std::size_t i, const Record& r) {
    queries[i].seen.push_back(shown_id(r, 0));
  });
  end(session, first);
}

/// The call that made the operations from number `first` on has come to its end.
void Trial::end(std::uint32_t session, std::size_t first) {
  Stage::point();
  ++clock_;
  std::vector<Logged>& log = logs_[session];
  for (std::size_t i = first; i < log.size(); ++i) log[i].operation.ret = clock_;
  if (Stage::is_inside()) weigh(log[first], Stage::own_steps(), Stage::own_extents());
}

/// Most steps of a call that read lists of these extents, if any are promised. A batch has those of its queries.
std::optional<std::uint64_t> Trial::bound(const Logged& call,
                                          const std::vector<std::uint32_t>& extents) const {
  const Operation& o = call.operation;
  if (call.call == Asked::insert) return cache_->insert_steps(landscape_.record(o.where, o.first, 0));
  std::optional<std::uint64_t> steps = cache_->query_steps(extents);
  if (steps && call.call == Asked::batch) *steps += (kBatchQueries - 1) * *cache_->query_steps({});
  return steps;
}

void Trial::weigh(const Logged& call, std::uint64_t steps, const std::vector<std::uint32_t>& extents) {
  const std::string_view name = kAskedNames[static_cast<std::size_t>(call.call)];
  StepTally& tally = tallies_[static_cast<std::size_t>(call.call)];
  const std::optional<std::uint64_t> most = bound(call, extents);
  tally.add(steps, most.value_or(0));
  if (!most) return;
  if (steps > *most) {
    tally.accuse(fmt::format("{} took {}{} steps, its bound is {}", name,
                             call.operation.is_pending() ? "more than " : "", steps, *most));
  }
  if (call.call == Asked::insert) return;
  // A bound that counts what was not there when it was read is none.
  const std::uint32_t most_lists = cache_->most_lists() * (call.call == Asked::batch ? kBatchQueries : 1);
  if (extents.size() > most_lists)
    tally.accuse(fmt::format("{} read {} lists, at most {} were allowed", name, extents.size(), most_lists));
  const auto longest = std::max_element(extents.begin(), extents.end());
  if (longest != extents.end() && *longest > next_id_)
    tally.accuse(fmt::format("{} claims that a list held {} records when only {} had been inserted", name,
                             *longest, next_id_));
}

/// What was logged becomes an epoch; queries that did not return leave no trace in it.
void Trial::close_epoch() {
  Epoch epoch;
  epoch.first = static_cast<std::uint32_t>(history_.operations.size());
  for (std::vector<Logged>& log : logs_) {
    for (Logged& l : log) {
      if (l.operation.is_query()) {
        if (l.operation.is_pending()) continue;
        l.operation.first = static_cast<std::uint32_t>(history_.seen.size());
        l.operation.count = static_cast<std::uint32_t>(l.seen.size());
        history_.seen.insert(history_.seen.end(), l.seen.begin(), l.seen.end());
      }
      history_.operations.push_back(l.operation);
    }
    log.clear();
  }
  epoch.end = static_cast<std::uint32_t>(history_.operations.size());
  epoch.has_contents = true;
  cache_->for_each_record([&](const Record& r) { epoch.contents.push_back(shown_id(r, 0)); });
  history_.epochs.push_back(std::move(epoch));
}

Trial::Outcome Trial::finish() {
  for (unsigned i = 0; i < stage_.size(); ++i) {
    if (stage_.is_done(i) || logs_[i].empty() || !logs_[i].back().operation.is_pending()) continue;
    weigh(logs_[i].back(), stage_.steps(i), stage_.extents(i));
  }
  stage_.clear();
  close_epoch();
  history_.ids = next_id_;
  Outcome outcome;
  outcome.tallies = std::move(tallies_);
  const Judgement judgement = judge(history_);
  for (std::size_t i = 0; i < kCheckNames.size(); ++i) {
    const auto check = static_cast<Check>(i);
    if (!promises(consistency_, check) || judgement.holds(check)) continue;
    outcome.broken = kCheckNames[i];
    outcome.witness = judgement[check].witness;
    break;
  }
  return outcome;
}

}  // namespace icbench::stress
