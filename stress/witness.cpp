#include "stress/witness.h"

#include <fmt/format.h>

#include <algorithm>

namespace icbench::stress {

namespace {

Stamp first_call(const History& h, const Epoch& epoch) {
  Stamp first = kPending;
  for (std::uint32_t i = epoch.first; i != epoch.end; ++i) first = std::min(first, h.operations[i].call);
  return first;
}

std::string describe(const History& h, Stamp origin, const Operation& o) {
  const std::string ret = o.is_pending() ? "never" : fmt::format("{}", o.ret - origin);
  const std::string when = fmt::format("thread {} [{}, {}]", o.thread, o.call - origin, ret);
  if (o.is_query()) return fmt::format("{} query at place {}, saw {} records", when, o.where, o.count);
  const std::uint32_t sizes = h.validity->sizes();
  return fmt::format("{} insert of record {}, place {}, size {}{}", when, o.first, o.where / sizes,
                     o.where % sizes, o.is_refused() ? ", refused" : "");
}

std::string reason(const Operation& a, const Operation& b, std::string_view next) {
  if (a.ret < b.call) return fmt::format("returned before {} was called", next);
  if (b.is_query()) return fmt::format("was seen by {}", next);
  return fmt::format("did not see {}", next);
}

}  // namespace

std::string witness_text(const History& history, const Epoch& epoch, std::string_view what,
                         std::span<const std::uint32_t> operations) {
  const Stamp origin = first_call(history, epoch);
  std::string text(what);
  for (const std::uint32_t i : operations) text += "\n  " + describe(history, origin, history.operations[i]);
  return text;
}

std::string cycle_text(const History& history, const Epoch& epoch, std::span<const std::uint32_t> cycle) {
  const Stamp origin = first_call(history, epoch);
  std::string text = fmt::format("cycle of {} operations, each of which must precede the next", cycle.size());
  for (std::size_t i = 0; i < cycle.size(); ++i) {
    const bool is_last = i + 1 == cycle.size();
    const Operation& o = history.operations[cycle[i]];
    const Operation& next = history.operations[cycle[is_last ? 0 : i + 1]];
    text += fmt::format("\n  {}\n    {}", describe(history, origin, o),
                        reason(o, next, is_last ? "the first" : "the next"));
  }
  return text;
}

}  // namespace icbench::stress
