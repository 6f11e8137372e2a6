#include "stress/explore/scenario.h"

#include <algorithm>

#include "caches/packed_lanes.h"
#include "core/interpolation.h"
#include "stress/round.h"

namespace icbench::stress::explore {

namespace {

constexpr float kRadii[Stage::kSizes] = {0.6f, 0.4f, 0.2f, 0.025f};
constexpr glm::vec3 kWhere[Stage::kPlaces] = {
    glm::vec3(0.05f), glm::vec3(0.95f), glm::vec3(0.45f), {0.48f, 0.25f, 0.25f}, {0.52f, 0.25f, 0.25f}};

// Least capacity at which the packed octree's grid has bricks that are not there from the start.
constexpr std::uint32_t kWithBricks = 48 << 6;

// Least capacity at which further lanes may be taken ahead.
constexpr std::uint32_t kWithMore = 64;

constexpr Scenario kScenarios[] = {
    {"install", {"i1", "i1"}, false, 0, false},
    {"install_deep", {"i2", "i2"}, true, 0, false},
    {"insert_query", {"i1", "q"}, false, 0, false},
    {"insert_over_old", {"i0", "q"}, false, 1, false},
    {"insert_queries", {"i1", "q q"}, true, 0, false},
    {"two_readers", {"i1", "q", "q"}, true, 0, false},
    {"two_inserts", {"i1", "i1", "q"}, true, 0, false},
    {"shallow_then_deep", {"i0 i1", "q"}, true, 0, false},
    {"deep_and_shallow", {"i2", "i0", "q"}, true, 0, false},
    {"both_look", {"i1 q", "i1 q"}, true, 0, false},
    {"grow", {"i0", "i0"}, true, 4, false},
    // Levels that nobody has been to, noted by two at once.
    {"two_levels", {"i0", "i1"}, false, 0, false},
    {"look_between", {"i1", "i0 q", "q"}, true, 0, false},
    {"insert_batch", {"i1", "bb"}, true, 0, false},
    {"chain_and_batch", {"i0 i1", "bb"}, true, 0, false},
    // A record is there in all of its cells or in none.
    {"across", {"x1", "l r"}, true, 0, false},
    {"across_back", {"x1", "r l"}, true, 0, false},
    // The memory that a thread has set to zero is published with what it builds there.
    {"prefault_query", {"i1", "q"}, false, 0, false, {}, 0, 0, true},
    {"prefault_insert", {"i1", "i1"}, false, 0, false, {}, 0, 0, true},
    {"prefault_node", {"i3", "q"}, false, 0, false, "packed", 0, 0, true},
    // Beside a packed cell's first lanes: nodes, bricks, further lanes, children of full cells, lists.
    {"install_node", {"i3", "i3"}, true, 0, false, "packed"},
    {"node_query", {"i3", "q"}, true, 0, false, "packed"},
    {"install_brick", {"i3", "i3"}, true, 0, false, "packed", 0, kWithBricks},
    {"brick_query", {"i3", "q"}, true, 0, false, "packed", 0, kWithBricks},
    {"further_lanes", {"i0", "i0"}, true, 0, false, "packed", kStripLanes},
    {"further_query", {"i0", "q"}, true, 0, false, "packed", kStripLanes},
    {"last_lane", {"i0", "i0"}, true, 0, false, "packed", kCellLanes - 1},
    {"split", {"i0", "i0"}, true, 0, false, "packed", kCellLanes},
    {"split_query", {"i0", "q"}, true, 0, false, "packed", kCellLanes},
    // Into cells of the next level, which another has for its own.
    {"split_and_finer", {"i0", "i1"}, true, 0, false, "packed", kCellLanes, kWithBricks},
    {"list", {"i0", "i0"}, true, 0, false, "packed", 2 * kCellLanes},
    {"list_query", {"i0", "q"}, true, 0, false, "packed", 2 * kCellLanes},
    {"further_batch", {"i0", "bb"}, true, 0, false, "packed", kStripLanes},
    {"list_batch", {"i0", "bb"}, true, 0, false, "packed", 2 * kCellLanes},
    {"further_prefault", {"i0", "q"}, false, 0, false, "packed", kStripLanes, kWithMore, true},
    {"install_three", {"i1", "i1", "i1"}, true, 0, true},
    {"grow_and_look", {"i0", "i0", "q"}, true, 4, true},
    {"two_inserts_queries", {"i1", "i1", "q q"}, true, 0, true},
    {"chain_and_insert", {"i0 i1", "i1", "q"}, true, 0, true},
    {"two_chains", {"i0 i1", "q q"}, true, 0, true},
    {"cold_inserts_query", {"i1", "i1", "q"}, false, 0, true},
    {"brick_and_look", {"i3", "i3", "q"}, true, 0, true, "packed", 0, kWithBricks},
    {"further_and_look", {"i0", "i0", "q"}, true, 0, true, "packed", kStripLanes},
    {"split_and_look", {"i0", "i0", "q"}, true, 0, true, "packed", kCellLanes},
    {"list_and_look", {"i0", "i0", "q"}, true, 0, true, "packed", 2 * kCellLanes},
    {"inserts_and_batch", {"i1", "i1", "bb"}, true, 0, true},
};

static_assert(std::all_of(std::begin(kScenarios), std::end(kScenarios),
                          [](const Scenario& s) {
                            constexpr unsigned kInserts = 8;  // of threads, warming up included
                            return s.before + s.nearby + kInserts <= LoggedOperation::kMostSeen;
                          }),
              "a query tells of all that it sees");

}  // namespace

std::span<const Scenario> all_scenarios() { return kScenarios; }

const Scenario* find_scenario(std::string_view name) {
  const auto* const at = std::find_if(std::begin(kScenarios), std::end(kScenarios),
                                      [&](const Scenario& s) { return s.name == name; });
  return at == std::end(kScenarios) ? nullptr : at;
}

bool is_about(const Scenario& s, const CacheTraits& traits) noexcept {
  return s.structure.empty() || s.structure == traits.structure;
}

unsigned thread_count(const Scenario& s) noexcept {
  unsigned n = 0;
  while (n < kMaxThreads && !s.threads[n].empty()) ++n;
  return n;
}

Stage::Stage() : validity_(kPlaces, kSizes) {
  for (std::uint32_t i = 0; i < kPlaces; ++i) places_[i] = {kWhere[i], {0.0f, 0.0f, 1.0f}};
  for (std::uint32_t kind = 0; kind < validity_.kinds(); ++kind) {
    for (std::uint32_t place = 0; place < kPlaces; ++place) {
      if (split_sphere_weight(places_[place], record(kind, 0), CacheConfig{}.a) > 0.0f)
        validity_.set_valid(place, kind);
    }
  }
}

Record Stage::record(std::uint32_t kind, std::uint32_t id) const noexcept {
  const SurfacePoint& x = places_[kind / kSizes];
  Record r{x.p, x.n, kRadii[kind % kSizes], {}, id};
  r.E = seal(r, 0);
  return r;
}

std::uint32_t ExecutionLog::ids() const noexcept {
  auto n = static_cast<std::uint32_t>(before.size());
  for (const auto& thread : threads) n += static_cast<std::uint32_t>(thread.size());
  return n;
}

namespace {

void add(History& h, const LoggedOperation& o, std::uint32_t thread, Stamp call, Stamp ret) {
  Operation out{call, ret, thread, o.where, o.id, 0, Operation::Type::insert, o.result};
  if (o.is_query) {
    out.type = Operation::Type::query;
    out.first = static_cast<std::uint32_t>(h.seen.size());
    out.count = o.seen_count;
    h.seen.insert(h.seen.end(), o.seen.begin(), o.seen.begin() + o.seen_count);
  }
  h.operations.push_back(out);
}

Epoch begin_epoch(const History& h) {
  Epoch e;
  e.first = e.end = static_cast<std::uint32_t>(h.operations.size());
  return e;
}

void end_epoch(History& h, Epoch e) {
  e.end = static_cast<std::uint32_t>(h.operations.size());
  h.epochs.push_back(std::move(e));
}

/// Bytes that tell one history from another.
void add_key(std::string& key, const LoggedOperation& o) {
  const auto put = [&](std::uint64_t n) { key.append(reinterpret_cast<const char*>(&n), sizeof n); };
  put(o.call);
  put(o.ret);
  put(static_cast<std::uint64_t>(o.result));
  put(o.seen_count);
  key.append(reinterpret_cast<const char*>(o.seen.data()), o.seen_count * sizeof o.seen[0]);
}

}  // namespace

/// `chain`: the thread whose operations follow each other, where there are no stamps.
History Verdicts::history(const ExecutionLog& log, std::optional<std::size_t> chain) const {
  constexpr Stamp kFirst = 1, kLast = 1000;
  History h;
  h.validity = &stage_.validity();
  h.ids = log.ids();
  const auto in_turn = [&](const std::vector<LoggedOperation>& operations, std::uint32_t thread) {
    Stamp at = kFirst + 1;
    for (const LoggedOperation& o : operations) {
      if (o.is_in_batch) at -= 2;
      add(h, o, thread, at, at + 1);
      at += 2;
    }
  };
  const auto observer = static_cast<std::uint32_t>(log.threads.size());
  Epoch before = begin_epoch(h);
  in_turn(log.before, observer);
  end_epoch(h, std::move(before));

  Epoch main = begin_epoch(h);
  for (std::uint32_t t = 0; t < observer; ++t) {
    if (chain == t) {
      in_turn(log.threads[t], t);
      continue;
    }
    for (const LoggedOperation& o : log.threads[t]) {
      const bool has_stamps = stamping_ == Stamping::stamped;
      add(h, o, t, has_stamps ? o.call : kFirst, has_stamps ? o.ret : kLast);
    }
  }
  main.has_contents = true;
  main.contents = log.contents;
  end_epoch(h, std::move(main));

  Epoch rest = begin_epoch(h);
  in_turn(log.rest, observer);
  rest.clears = true;
  end_epoch(h, std::move(rest));

  Epoch cleared = begin_epoch(h);
  cleared.has_contents = true;
  cleared.contents = log.after_clear;
  end_epoch(h, std::move(cleared));
  return h;
}

Verdicts::Verdict Verdicts::judge(const ExecutionLog& log, const Ending& ending) {
  Verdict verdict;
  if (ending.kind != Ending::Kind::finished) {
    verdict.violated = 1u << static_cast<unsigned>(Check::integrity);
    verdict.witness[static_cast<std::size_t>(Check::integrity)] = ending.what;
    return verdict;
  }
  key_.clear();
  for (const auto& thread : log.threads) {
    for (const LoggedOperation& o : thread) add_key(key_, o);
  }
  for (const LoggedOperation& o : log.rest) add_key(key_, o);
  const auto put_all = [&](const std::vector<std::uint32_t>& ids) {
    key_ += static_cast<char>(ids.size());
    key_.append(reinterpret_cast<const char*>(ids.data()), ids.size() * sizeof ids[0]);
  };
  put_all(log.contents);
  put_all(log.after_clear);
  if (harmless_.contains(key_)) return verdict;

  const std::size_t chains = stamping_ == Stamping::stamped ? 1 : log.threads.size();
  for (std::size_t chain = 0; chain < chains; ++chain) {
    const History h = history(log, stamping_ == Stamping::stamped ? std::nullopt : std::optional(chain));
    const Judgement judgement = stress::judge(h);
    for (std::size_t i = 0; i < kCheckNames.size(); ++i) {
      if (judgement.findings[i].violations == 0 || (verdict.violated & (1u << i)) != 0) continue;
      verdict.violated |= 1u << i;
      verdict.witness[i] = judgement.findings[i].witness;
    }
  }
  if (verdict.violated == 0) harmless_.insert(key_);
  return verdict;
}

}  // namespace icbench::stress::explore
