#include "stress/linearize.h"

#include <algorithm>
#include <numeric>
#include <unordered_set>

namespace icbench::stress {

std::vector<std::uint32_t> Linearizer::find_cycle(std::span<const Operation> operations,
                                                  std::span<const std::uint32_t> by_call,
                                                  std::span<const ForcedOrder> forced) {
  operations_ = operations;
  forced_ = forced;
  const std::size_t n = operations.size();
  by_return_.resize(n);
  std::iota(by_return_.begin(), by_return_.end(), 0u);
  std::sort(by_return_.begin(), by_return_.end(),
            [&](std::uint32_t a, std::uint32_t b) { return operations[a].ret < operations[b].ret; });

  // Successors by counting sort.
  first_successor_.assign(n + 1, 0);
  waits_for_.assign(n, 0);
  for (const ForcedOrder& o : forced) {
    ++first_successor_[o.before + 1];
    ++waits_for_[o.after];
  }
  std::partial_sum(first_successor_.begin(), first_successor_.end(), first_successor_.begin());
  successors_.resize(forced.size());
  ready_.assign(first_successor_.begin(), first_successor_.end() - 1);  // next free place of each
  for (const ForcedOrder& o : forced) successors_[ready_[o.before]++] = o.after;

  is_placed_.assign(n, 0);
  ready_.clear();
  std::size_t earliest = 0;  // of by_return_: the first operation not yet placed
  std::size_t released = 0;  // of by_call: those before are free of real time
  for (;;) {
    while (earliest < n && is_placed_[by_return_[earliest]]) ++earliest;
    if (earliest == n) return {};
    const Stamp limit = operations[by_return_[earliest]].ret;
    for (; released < n && operations[by_call[released]].call <= limit; ++released) {
      if (waits_for_[by_call[released]] == 0) ready_.push_back(by_call[released]);
    }
    if (ready_.empty()) return without_chords(trace_back(by_return_[earliest]));
    const std::uint32_t placed = ready_.back();
    ready_.pop_back();
    is_placed_[placed] = 1;
    for (std::uint32_t i = first_successor_[placed]; i < first_successor_[placed + 1]; ++i) {
      const std::uint32_t next = successors_[i];
      // One that real time still holds back is picked up when it is released.
      if (--waits_for_[next] == 0 && operations[next].call <= limit) ready_.push_back(next);
    }
  }
}

/// A cycle through operations that could not be placed. `start` is the one of them with the earliest return.
/// Each operation that real time does not hold back has a forced predecessor; any other has `start`. The walk
/// back meets an operation that overlaps start's return at least at every other step, and of those there are at most
/// as many as are open at once, P, so it closes after 2 P steps.
std::vector<std::uint32_t> Linearizer::trace_back(std::uint32_t start) const {
  constexpr std::uint32_t kNone = UINT32_MAX;
  std::vector<std::uint32_t> predecessor(operations_.size(), kNone);
  for (const ForcedOrder& o : forced_) {
    if (!is_placed_[o.before] && !is_placed_[o.after]) predecessor[o.after] = o.before;
  }
  std::vector<std::uint32_t> walk;
  std::vector<std::uint32_t> step_of(operations_.size(), kNone);
  std::uint32_t at = start;
  while (step_of[at] == kNone) {
    step_of[at] = static_cast<std::uint32_t>(walk.size());
    walk.push_back(at);
    at = operations_[at].call <= operations_[start].ret ? predecessor[at] : start;
  }
  std::vector<std::uint32_t> cycle(walk.begin() + step_of[at], walk.end());
  std::reverse(cycle.begin(), cycle.end());
  return cycle;
}

/// Takes short cuts until no order leads from an operation of the cycle to any but its successor.
std::vector<std::uint32_t> Linearizer::without_chords(std::vector<std::uint32_t> cycle) const {
  const std::unordered_set<std::uint32_t> members(cycle.begin(), cycle.end());
  std::unordered_set<std::uint64_t> pairs;
  for (const ForcedOrder& o : forced_) {
    if (members.contains(o.before) && members.contains(o.after))
      pairs.insert((std::uint64_t{o.before} << 32) | o.after);
  }
  const auto precedes = [&](std::uint32_t a, std::uint32_t b) {
    return operations_[a].ret < operations_[b].call || pairs.contains((std::uint64_t{a} << 32) | b);
  };
  const auto shorten = [&] {
    const std::size_t length = cycle.size();
    for (std::size_t i = 0; i < length; ++i) {
      for (std::size_t hop = 2; hop < length; ++hop) {
        if (!precedes(cycle[i], cycle[(i + hop) % length])) continue;
        std::vector<std::uint32_t> shorter;
        for (std::size_t k = 0; k <= length - hop; ++k) shorter.push_back(cycle[(i + hop + k) % length]);
        cycle = std::move(shorter);
        return true;
      }
    }
    return false;
  };
  while (shorten()) {
  }
  // Reads best from a pair in real time on, if there is one.
  for (std::size_t i = 0; i < cycle.size(); ++i) {
    if (operations_[cycle[i]].ret >= operations_[cycle[(i + 1) % cycle.size()]].call) continue;
    std::rotate(cycle.begin(), cycle.begin() + static_cast<std::ptrdiff_t>(i), cycle.end());
    break;
  }
  return cycle;
}

}  // namespace icbench::stress
