#include "stress/explore/search.h"

#include <fmt/format.h>

#include <bit>
#include <charconv>

namespace icbench::stress::explore {

namespace {

constexpr std::uint32_t bit(unsigned thread) noexcept { return 1u << thread; }

/// One can only come after the other, never in its place.
bool never_together(Access::Kind earlier, Access::Kind next) noexcept {
  using Kind = Access::Kind;
  if (earlier == Kind::unlock) return next == Kind::lock || next == Kind::lock_shared;
  if (earlier == Kind::unlock_shared) return next == Kind::lock;
  return false;
}

}  // namespace

std::uint8_t Search::thread_by_rule(std::uint32_t enabled, std::optional<std::uint8_t> last) noexcept {
  if (last && (enabled & bit(*last)) != 0) return *last;
  return static_cast<std::uint8_t>(std::countr_zero(enabled));
}

std::optional<std::uint8_t> Search::last_thread(unsigned depth) const noexcept {
  if (depth == 0) return std::nullopt;
  return nodes_[depth - 1].thread;
}

unsigned Search::preemptions_of(unsigned depth, std::uint8_t thread) const noexcept {
  if (depth == 0) return 0;
  const Node& before = nodes_[depth - 1];
  const bool could_go_on = (nodes_[depth].enabled & bit(before.thread)) != 0;
  return before.preemptions + (could_go_on && thread != before.thread);
}

bool Search::is_affordable(unsigned depth, std::uint8_t thread) const noexcept {
  return !options_.preemptions || preemptions_of(depth, thread) <= *options_.preemptions;
}

/// The first choice from number `from` on that is awake.
std::optional<std::uint8_t> Search::first_awake(const Node& n, std::uint8_t thread,
                                                unsigned from) const noexcept {
  const Choices& choices = n.next[thread].choices;
  for (unsigned i = from; i < choices.count; ++i) {
    if (choices.index[i] >= n.asleep_below[thread]) return static_cast<std::uint8_t>(i);
  }
  return std::nullopt;
}

bool Search::try_thread(unsigned depth, std::uint8_t thread) noexcept {
  Node& n = nodes_[depth];
  const auto choice = first_awake(n, thread, 0);
  if (!choice || !is_affordable(depth, thread)) return false;
  n.thread = thread;
  n.choice = *choice;
  n.preemptions = static_cast<std::uint8_t>(preemptions_of(depth, thread));
  return true;
}

void Search::fill(Node& n, const Memory& memory, std::span<const Pending> pending) const noexcept {
  n.asleep_below.fill(0);
  n.enabled = n.backtrack = n.tried = n.waiting = 0;
  for (std::uint8_t t = 0; t < pending.size(); ++t) {
    Step& s = n.next[t];
    const Pending& p = pending[t];
    s.is_live = p.is_live;
    n.past[t] = memory.past(t);
    if (!p.is_live) continue;
    const Choices choices = memory.choices(t, p.access, p.location);
    if (memory.is_waiting(t) && (choices.count == 0 || !memory.may_go_on(t))) {
      s.is_live = false;
      n.waiting |= choices.count > 0 ? kWoken : kWaiting;
      continue;
    }
    s.kind = p.access.kind;
    s.may_write = p.access.may_write();
    s.is_total = p.access.is_seq_cst();
    s.location = p.location;
    s.stores = static_cast<std::uint16_t>(memory.stores(p.location));
    s.choices = choices;
    if (s.choices.count > 0) n.enabled |= bit(t);
  }
  for (auto t = static_cast<unsigned>(pending.size()); t < kMaxThreads; ++t) n.next[t].is_live = false;
}

void Search::inherit_sleep(Node& n) const noexcept {
  const Node& parent = nodes_[depth_ - 1];
  for (unsigned t = 0; t < kMaxThreads; ++t) {
    if (t == parent.thread) continue;
    const bool is_woken = n.next[t].is_total && parent.next[parent.thread].is_total;
    n.asleep_below[t] = is_woken ? 0 : parent.asleep_below[t];
  }
}

Search::Next Search::decide(const Memory& memory, std::span<const Pending> pending) {
  if (depth_ < size_) {
    const Node& n = nodes_[depth_];
    return {Verdict::step, n.thread, n.next[n.thread].choices.index[n.choice]};
  }
  if (nodes_.size() == size_) nodes_.emplace_back();
  Node& n = nodes_[depth_];
  fill(n, memory, pending);
  const bool is_live = std::any_of(n.next.begin(), n.next.end(), [](const Step& s) { return s.is_live; });
  if (sleeps()) {
    find_races(depth_, is_live && n.enabled == 0);
  } else if (options_.reduce) {
    find_races_bounded(depth_);
  }
  if (n.enabled == 0) {
    if ((n.waiting & kWoken) != 0) return {Verdict::redundant};
    return {is_live || n.waiting != 0 ? Verdict::blocked : Verdict::finished};
  }
  n.by_rule = thread_by_rule(n.enabled, last_thread(depth_));
  if (sleeps() && depth_ > 0) inherit_sleep(n);
  // By the rule, which costs no preemption, unless that thread sleeps.
  bool found = try_thread(depth_, n.by_rule);
  for (std::uint8_t t = 0; !found && t < kMaxThreads; ++t)
    found = (n.enabled & bit(t)) != 0 && try_thread(depth_, t);
  if (!found) return {Verdict::redundant};
  n.backtrack = options_.reduce ? bit(n.thread) : n.enabled;
  ++size_;
  return {Verdict::step, n.thread, n.next[n.thread].choices.index[n.choice]};
}

void Search::done(const Effect& effect, const VectorClock& past) noexcept {
  Node& n = nodes_[depth_++];
  n.wrote = effect.wrote;
  n.past_after = past;
  n.ordinal = past.at[n.thread];
}

bool Search::advance() {
  // What was not reached, because the execution stopped early, is not explored.
  size_ = std::min(size_, depth_);
  for (; size_ > 0; --size_) {
    const unsigned depth = size_ - 1;
    Node& n = nodes_[depth];
    if (const auto choice = first_awake(n, n.thread, n.choice + 1u)) {
      n.choice = *choice;
      return true;
    }
    n.tried |= bit(n.thread);
    if (sleeps()) n.asleep_below[n.thread] = n.next[n.thread].stores;
    for (Mask rest = n.backtrack & ~n.tried; rest != 0; rest = n.backtrack & ~n.tried) {
      const auto t = static_cast<std::uint8_t>(std::countr_zero(rest));
      if (try_thread(depth, t)) return true;
      n.tried |= bit(t);
    }
  }
  return false;
}

bool Search::conflict(const Node& event, const Step& next) const noexcept {
  const Step& step = event.next[event.thread];
  if (!next.is_live) return false;
  if (step.is_total && next.is_total) return true;
  if (step.location != next.location || never_together(step.kind, next.kind)) return false;
  return next.may_write || (options_.preemptions && event.wrote);
}

/// Of the step done last, with all that went before; where everything is blocked, of those that cannot be done, too.
void Search::find_races(unsigned depth, bool is_blocked) noexcept {
  if (depth == 0) return;
  const Node& last = nodes_[depth - 1];
  for (unsigned event = depth - 1; event-- > 0;) {
    if (is_race(event, last.thread, last.next[last.thread], last.past[last.thread]))
      go_back(event, depth - 1, last.thread, last.past_after);
  }
  const Node& now = nodes_[depth];
  for (std::uint8_t t = 0; is_blocked && t < kMaxThreads; ++t) {
    for (unsigned event = depth; event-- > 0;) {
      if (is_race(event, t, now.next[t], now.past[t])) go_back(event, depth, t, now.past[t]);
    }
  }
}

/// With a bound: of the steps that are next; of a thread that has just stepped with all that went before, of the others
/// with the last one, as they have been compared with the rest before.
void Search::find_races_bounded(unsigned depth) noexcept {
  if (depth == 0) return;
  for (std::uint8_t t = 0; t < kMaxThreads; ++t) {
    const bool is_fresh = t == nodes_[depth - 1].thread;
    for (unsigned event = depth; event-- > (is_fresh ? 0 : depth - 1);) {
      const Node& e = nodes_[event];
      if (e.thread == t || !conflict(e, nodes_[depth].next[t])) continue;
      unsigned turn = event;
      while (turn > 0 && nodes_[turn - 1].thread == e.thread) --turn;
      go_back_bounded(event, t);
      go_back_bounded(turn, t);
    }
  }
}

/// Whether `step`, of a thread with that past, could have come before `event`, and have changed it.
bool Search::is_race(unsigned event, std::uint8_t thread, const Step& step,
                     const VectorClock& past) const noexcept {
  const Node& e = nodes_[event];
  return e.thread != thread && conflict(e, step) && e.ordinal > past.at[e.thread];
}

/// Lets a step of `thread`, which was or would be number `depth`, happen in the place of `event`: after those in
/// between that do not depend on `event`. Of them all, any that depends on none of the others may begin; one such
/// thread is enough (source sets: Abdulla, Aronis, Jonsson, Sagonas 2014).
void Search::go_back(unsigned event, unsigned depth, std::uint8_t thread, const VectorClock& past) noexcept {
  Node& n = nodes_[event];
  const auto is_before = [](const Node& e, const VectorClock& p) { return e.ordinal <= p.at[e.thread]; };
  const auto is_first = [&](unsigned end, const VectorClock& p) {
    for (unsigned k = event + 1; k < end; ++k) {
      if (!is_before(n, nodes_[k].past_after) && is_before(nodes_[k], p)) return false;
    }
    return true;
  };
  Mask initials = 0;
  Mask seen = 0;
  for (unsigned j = event + 1; j < depth; ++j) {
    const Node& e = nodes_[j];
    if ((seen & bit(e.thread)) != 0 || is_before(n, e.past_after)) continue;
    seen |= bit(e.thread);
    if (is_first(j, e.past_after)) initials |= bit(e.thread);
  }
  if ((seen & bit(thread)) == 0 && is_first(depth, past)) initials |= bit(thread);
  initials &= n.enabled;
  if ((initials & n.backtrack) != 0) return;
  if ((initials & bit(thread)) != 0) {
    n.backtrack |= bit(thread);
  } else if (initials != 0) {
    n.backtrack |= bit(static_cast<unsigned>(std::countr_zero(initials)));
  } else {
    n.backtrack |= n.enabled;
  }
}

void Search::go_back_bounded(unsigned at, std::uint8_t thread) noexcept {
  Node& n = nodes_[at];
  n.backtrack |= (n.enabled & bit(thread)) != 0 ? bit(thread) : n.enabled;
}

void Search::schedule(Schedule& decisions, std::vector<std::uint8_t>& ruled) const {
  decisions.clear();
  ruled.clear();
  for (unsigned i = 0; i < depth_; ++i) {
    const Node& n = nodes_[i];
    const Step& s = n.next[n.thread];
    decisions.push_back({n.thread, static_cast<std::uint8_t>(s.stores - 1 - s.choices.index[n.choice])});
    ruled.push_back(n.by_rule);
  }
}

std::string encode(std::span<const Decision> schedule, std::span<const std::uint8_t> ruled_thread) {
  std::string text;
  std::uint32_t skipped = 0;
  for (std::size_t i = 0; i < schedule.size(); ++i) {
    const Decision d = schedule[i];
    if (d.thread == ruled_thread[i] && d.age == 0) {
      ++skipped;
      continue;
    }
    if (!text.empty()) text += '.';
    text += fmt::format("{}", skipped);
    if (d.thread != ruled_thread[i]) text += fmt::format("t{}", d.thread);
    if (d.age != 0) text += fmt::format("r{}", d.age);
    skipped = 0;
  }
  return text.empty() ? "0" : text;
}

std::optional<std::vector<Deviation>> decode(std::string_view text) {
  std::vector<Deviation> out;
  const char* at = text.data();
  const char* const end = at + text.size();
  const auto number = [&](auto& value) {
    const auto [next, error] = std::from_chars(at, end, value);
    const bool is_read = error == std::errc{} && next != at;
    at = next;
    return is_read;
  };
  if (text == "0") return out;
  for (;;) {
    Deviation d;
    if (!number(d.skip)) return std::nullopt;
    const char* const mark = at;
    if (at != end && *at == 't') {
      ++at;
      if (!number(d.thread.emplace()) || *d.thread >= kMaxThreads) return std::nullopt;
    }
    if (at != end && *at == 'r') {
      ++at;
      if (!number(d.age)) return std::nullopt;
    }
    if (at == mark) return std::nullopt;
    out.push_back(d);
    if (at == end) return out;
    if (*at++ != '.') return std::nullopt;
  }
}

}  // namespace icbench::stress::explore
