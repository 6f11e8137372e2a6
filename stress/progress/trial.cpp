#include "stress/progress/trial.h"

#include <fmt/format.h>

#include <algorithm>

namespace icbench::stress {

namespace {

constexpr std::uint32_t kCapacity = 1 << 16;
// Of a pool made short: sessions take room for 2^15 records, 2^14, and so on down to 64, if they get it. What is left
// is less than a piece and, by the choice of the capacity, enough for two deep inserts into Ward's tree.
constexpr std::uint32_t kShortCapacity = 8 * kTicketBatch + 1, kHoarders = 10, kLargestHoard = 1 << 15;

CacheConfig config_for(std::uint32_t sessions, bool is_pool_short) {
  if (is_pool_short) return {.capacity = kShortCapacity, .max_sessions = sessions + kHoarders};
  return {.capacity = kCapacity, .max_sessions = sessions};
}

constexpr std::array<std::string_view, 2> kTypeNames = {"insert", "query"};

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
             const std::vector<Prefill>& prefill, bool is_pool_short)
    : stage_(stage),
      landscape_(landscape),
      consistency_(subject.traits.consistency),
      cache_(subject.make(config_for(sessions, is_pool_short))),
      logs_(sessions) {
  stage_.clear();
  history_.validity = &landscape_.validity();
  for (const Prefill& p : prefill) {
    for (std::uint32_t i = 0; i < p.records; ++i) insert(sessions - 1, p.kind);
  }
  cache_->end_frame();
  close_epoch();
  for (std::uint32_t i = 0; is_pool_short && i < kHoarders; ++i)
    cache_->prefault(sessions + i, kLargestHoard >> i);
}

void Trial::start(unsigned i, std::uint32_t count, std::function<Request(std::uint32_t)> request) {
  stage_.start(i, [this, i, count, request = std::move(request)] {
    for (std::uint32_t n = 0; n < count; ++n) {
      Stage::begin_operation();
      const Request r = request(n);
      r.type == Operation::Type::insert ? insert(i, r.where) : query(i, r.where);
    }
  });
}

Operation& Trial::begin(std::uint32_t session, const Request& request, std::uint32_t id) {
  return logs_[session]
      .emplace_back(Logged{
          {++clock_, kPending, session, request.where, id, 0, request.type, InsertResult::inserted}, {}})
      .operation;
}

void Trial::insert(std::uint32_t session, std::uint32_t kind) {
  const std::uint32_t id = next_id_++;
  Operation& operation = begin(session, {Operation::Type::insert, kind}, id);
  operation.result = cache_->insert(session, landscape_.record(kind, id, 0));
  Stage::point();
  operation.ret = ++clock_;
  if (Stage::is_inside()) weigh(operation, Stage::own_steps(), Stage::own_extents());
}

void Trial::query(std::uint32_t session, std::uint32_t place) {
  Operation& operation = begin(session, {Operation::Type::query, place}, 0);
  std::vector<std::uint32_t>& seen = logs_[session].back().seen;
  cache_->visit(session, landscape_.place(place),
                [&seen](const Record& r) { seen.push_back(shown_id(r, 0)); });
  Stage::point();
  operation.ret = ++clock_;
  if (Stage::is_inside()) weigh(operation, Stage::own_steps(), Stage::own_extents());
}

void Trial::weigh(const Operation& operation, std::uint64_t steps,
                  const std::vector<std::uint32_t>& extents) {
  StepTally& tally = tallies_[static_cast<std::size_t>(operation.type)];
  const bool is_query = operation.is_query();
  const std::optional<std::uint64_t> bound =
      is_query ? cache_->query_steps(extents)
               : cache_->insert_steps(landscape_.record(operation.where, operation.first, 0));
  tally.add(steps, bound.value_or(0));
  if (!bound) return;
  if (steps > *bound) {
    tally.accuse(fmt::format("{} took {}{} steps, its bound is {}",
                             kTypeNames[static_cast<std::size_t>(operation.type)],
                             operation.is_pending() ? "more than " : "", steps, *bound));
  }
  // A bound that counts what was not there when it was read is none.
  if (is_query && extents.size() > cache_->most_lists())
    tally.accuse(
        fmt::format("query read {} lists, at most {} were allowed", extents.size(), cache_->most_lists()));
  const auto longest = std::max_element(extents.begin(), extents.end());
  if (is_query && longest != extents.end() && *longest > next_id_)
    tally.accuse(fmt::format("query claims that a list held {} records when only {} had been inserted",
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
    weigh(logs_[i].back().operation, stage_.steps(i), stage_.extents(i));
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
