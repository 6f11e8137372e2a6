#include "stress/explore/engine.h"

#include <fmt/format.h>

#include <stdexcept>

namespace icbench::stress::explore {

Coverage Engine::explore(const Program& program, const SearchOptions& options) {
  Search search(options);
  Coverage coverage;
  search_ = &search;
  bool is_dirty = false;
  bool is_left = true;
  for (; is_left; is_left = search.advance()) {
    if (coverage.schedules + coverage.redundant >= options.most_schedules) break;
    program.prepare(is_dirty);
    search.begin_execution();
    const Ending ending = run(program);
    is_dirty = is_abandoned_;
    if (has_failed_) break;
    if (is_off_record_) {
      ++coverage.redundant;
      continue;
    }
    ++coverage.schedules;
    search.schedule(last_schedule_, last_ruled_);
    if (!program.judge(ending)) break;
  }
  coverage.complete = !is_left;
  search_ = nullptr;
  if (has_failed_)
    throw std::runtime_error("the program is too large for the model of memory; use fewer operations");
  return coverage;
}

std::optional<Ending> Engine::replay(const Program& program, std::span<const Deviation> deviations,
                                     std::vector<TraceLine>& trace) {
  deviations_ = deviations;
  skipped_ = 0;
  last_thread_.reset();
  trace.clear();
  trace_ = &trace;
  program.prepare(false);
  const Ending ending = run(program);
  trace_ = nullptr;
  if (has_failed_ || !deviations_.empty()) return std::nullopt;
  return ending;
}

std::string Engine::schedule_text() const { return encode(last_schedule_, last_ruled_); }

Ending Engine::run(const Program& program) {
  threads_ = program.threads;
  memory_.reset(threads_);
  steps_ = 0;
  is_off_record_ = is_abandoned_ = has_failed_ = false;
  ending_ = {};
  current_ = this;
  is_starting_ = true;
  for (unsigned t = 0; t < threads_; ++t) {
    pending_[t].is_live = false;
    fibers_.start(t, [&program, t] { program.body(t); });
  }
  // Each runs up to its first step.
  for (unsigned t = 0; t < threads_ && !is_abandoned_; ++t) fibers_.resume(t);
  is_starting_ = false;
  // A fiber that ends, or that chose another, comes back here.
  if (!is_abandoned_) choose();
  while (next_ != kNobody && !is_abandoned_) {
    const unsigned t = next_;
    fibers_.resume(t);
    if (fibers_.is_done(t) && !is_abandoned_) choose();
  }
  current_ = nullptr;
  return std::move(ending_);
}

void Engine::stop(Ending::Kind kind, std::string what) {
  is_abandoned_ = true;
  ending_ = {kind, std::move(what)};
}

Effect Engine::access(const Access& a) {
  const unsigned self = Fibers::running();
  Pending& p = pending_[self];
  p.access = a;
  p.location = memory_.locate(a);
  p.is_live = true;
  if (memory_.is_exhausted() || ++steps_ > kMostSteps) {
    has_failed_ = is_abandoned_ = true;
    for (;;) Fibers::pause();
  }
  if (is_starting_) {
    Fibers::pause();
  } else {
    choose();
    while (next_ != self || is_abandoned_) Fibers::pause();
  }
  p.is_live = false;
  if (const auto race = memory_.race_with_zeroing(self, a)) end_with(*race);
  const Effect effect = memory_.perform(self, a, p.location, next_index_);
  if (search_ != nullptr && !is_off_record_) search_->done(effect, memory_.past(self));
  if (trace_ != nullptr) trace_step(self, a, effect, p.location);
  return effect;
}

void Engine::touch(const void* begin, std::size_t bytes, bool writes) {
  const unsigned self = Fibers::running();
  note([&] { return fmt::format("  {} {} bytes of plain memory", writes ? "write" : "read", bytes); });
  if (const auto race = memory_.touch(self, begin, bytes, writes)) end_with(*race);
}

void Engine::zero(const void* begin, std::size_t bytes) {
  note([&] { return fmt::format("  set {} bytes of memory to zero", bytes); });
  if (const auto race = memory_.zero(Fibers::running(), begin, bytes)) end_with(*race);
}

void Engine::end_with(const Race& race) {
  const char* does = race.second_writes ? "writes" : "reads";
  const char* did = race.first_writes ? "has written" : "has read";
  if (!race.is_of_word) {
    stop(Ending::Kind::raced,
         fmt::format("data race: thread {} {} {} bytes that thread {} {}, and nothing orders the two",
                     race.second, does, race.bytes, race.first, did));
  } else if (race.first != race.second) {
    stop(Ending::Kind::raced,
         fmt::format("data race: thread {} {} a word in {} bytes that thread {} has set to zero, "
                     "and nothing orders the two",
                     race.second, does, race.bytes, race.first));
  } else {
    stop(Ending::Kind::raced,
         fmt::format("thread {} sets {} bytes to zero that have words in use", race.second, race.bytes));
  }
  for (;;) Fibers::pause();
}

void Engine::choose() noexcept {
  if (is_off_record_) return choose_anyhow();
  if (search_ == nullptr) return choose_replayed();
  const Search::Next next = search_->decide(memory_, std::span(pending_.data(), threads_));
  switch (next.verdict) {
    case Search::Verdict::step:
      next_ = next.thread;
      next_index_ = next.index;
      return;
    case Search::Verdict::redundant:
      is_off_record_ = true;
      return choose_anyhow();
    case Search::Verdict::blocked:
      stop(Ending::Kind::blocked, "every thread that is left waits for another");
      [[fallthrough]];
    case Search::Verdict::finished:
      next_ = kNobody;
  }
}

void Engine::choose_anyhow() noexcept {
  bool is_live = false;
  next_ = kNobody;
  for (unsigned t = 0; t < threads_; ++t) {
    if (!pending_[t].is_live) continue;
    is_live = true;
    const Choices choices = memory_.choices(t, pending_[t].access, pending_[t].location);
    if (choices.count == 0) continue;
    next_ = t;
    next_index_ = choices.index[0];
    return;
  }
  is_abandoned_ = is_live;
}

void Engine::choose_replayed() noexcept {
  std::array<Choices, kMaxThreads> choices;
  std::uint32_t enabled = 0;
  bool is_live = false, is_woken = false;
  for (unsigned t = 0; t < threads_; ++t) {
    choices[t].count = 0;
    if (!pending_[t].is_live) continue;
    is_live = true;
    choices[t] = memory_.choices(t, pending_[t].access, pending_[t].location);
    if (choices[t].count == 0) continue;
    if (!memory_.is_waiting(t) || memory_.may_go_on(t))
      enabled |= 1u << t;
    else
      is_woken = true;
  }
  next_ = kNobody;
  if (enabled == 0) {
    if (is_woken)
      has_failed_ = is_abandoned_ = true;  // the search cuts it short here (search.h)
    else if (is_live)
      stop(Ending::Kind::blocked, "every thread that is left waits for another");
    return;
  }
  std::uint8_t thread = Search::thread_by_rule(enabled, last_thread_);
  unsigned age = 0;
  if (!deviations_.empty() && skipped_++ == deviations_.front().skip) {
    thread = deviations_.front().thread.value_or(thread);
    age = deviations_.front().age;
    skipped_ = 0;
    deviations_ = deviations_.subspan(1);
  }
  const unsigned stores = memory_.stores(pending_[thread].location);
  const auto* const first = choices[thread].index.begin();
  const auto* const last = first + choices[thread].count;
  if (age >= stores || std::find(first, last, stores - 1 - age) == last) {
    has_failed_ = is_abandoned_ = true;  // no schedule of this program
    return;
  }
  last_thread_ = thread;
  next_ = thread;
  next_index_ = stores - 1 - age;
}

void Engine::trace_step(unsigned thread, const Access& a, const Effect& effect, Location l) {
  const bool failed = a.kind == Access::Kind::compare_exchange && !effect.wrote;
  std::string text =
      fmt::format("  {} word {}, {}", name_of(a.kind), l, name_of(failed ? a.failure : a.order));
  if (!a.is_blind()) text += fmt::format(": reads {}", effect.read);
  if (effect.is_stale) {
    text += fmt::format(" (stale: {} newer)", memory_.stores(l) - 1 - effect.index);
  }
  if (effect.wrote) text += fmt::format("{} writes {}", a.is_blind() ? ":" : ",", effect.written);
  if (failed) text += ", fails";
  trace_->push_back({thread, text});
}

}  // namespace icbench::stress::explore
