// The specification of histories read word by word: exhaustive search in the manner of Wing and Gong (1993)
// and plain quantifiers, exponential or quadratic, for histories of a few operations. And random histories of
// that size, sound and faulty.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <set>
#include <string>
#include <vector>

#include "core/random.h"
#include "stress/history.h"

namespace icbench::stress {

using Ids = std::set<std::uint32_t>;

/// Whether each check of kCheckNames holds.
using OracleVerdict = std::array<bool, 5>;

class Oracle {
 public:
  explicit Oracle(const History& h) : h_(h) {}

  OracleVerdict run() {
    OracleVerdict holds;
    holds.fill(true);
    for (const Epoch& epoch : h_.epochs) {
      const std::vector<Operation> operations(h_.operations.begin() + epoch.first,
                                              h_.operations.begin() + epoch.end);
      holds[0] = holds[0] && integrity(epoch, operations);
      holds[1] = holds[1] && regular(operations);
      for (std::uint32_t id = 0; id < h_.ids; ++id) holds[2] = holds[2] && linearizable(operations, &id);
      // The projection knows the ids that exist; any other makes the history impossible.
      holds[2] = holds[2] && all_ids_exist(operations);
      holds[3] = holds[3] && linearizable(operations, nullptr);
      holds[4] = holds[4] && frame(operations);
      for (const Operation& o : operations) {
        if (!o.is_query() && !o.is_refused()) base_.insert(o.first);
      }
      for (const std::uint32_t id : epoch.dropped) bury(id);
      if (epoch.clears) {
        for (const std::uint32_t id : Ids(base_)) bury(id);
      }
    }
    return holds;
  }

 private:
  void bury(std::uint32_t id) { base_.erase(id); }

  Ids seen_by(const Operation& q) const {
    Ids ids;
    for (const std::uint32_t shown : h_.seen_by(q)) ids.insert(shown & ~kTorn);
    return ids;
  }

  const Operation* insert_of(std::uint32_t id) const {
    for (const Operation& o : h_.operations) {
      if (!o.is_query() && o.first == id) return &o;
    }
    return nullptr;
  }

  bool is_valid(std::uint32_t id, const Operation& q) const {
    return h_.validity->is_valid(q.where, insert_of(id)->where);
  }

  bool all_ids_exist(const std::vector<Operation>& operations) const {
    for (const Operation& q : operations) {
      if (!q.is_query()) continue;
      for (const std::uint32_t id : seen_by(q)) {
        if (insert_of(id) == nullptr) return false;
      }
    }
    return true;
  }

  /// Searches for an order of the operations; with `only`, of what they mean for that record alone.
  bool linearizable(const std::vector<Operation>& operations, const std::uint32_t* only) const {
    std::set<unsigned> tried;
    return search(operations, only, 0, tried);
  }

  bool search(const std::vector<Operation>& operations, const std::uint32_t* only, unsigned placed,
              std::set<unsigned>& tried) const {
    if (!tried.insert(placed).second) return false;
    bool is_complete = true;
    for (unsigned i = 0; i < operations.size(); ++i)
      is_complete = is_complete && ((placed >> i & 1) != 0 || operations[i].is_pending());
    if (is_complete) return true;
    for (unsigned i = 0; i < operations.size(); ++i) {
      if ((placed >> i & 1) != 0) continue;
      bool is_next = true;
      for (unsigned k = 0; k < operations.size(); ++k)
        is_next = is_next && ((placed >> k & 1) != 0 || operations[k].ret >= operations[i].call);
      if (!is_next || (operations[i].is_query() && answer(operations, operations[i], only, placed) !=
                                                       projected(seen_by(operations[i]), only)))
        continue;
      if (search(operations, only, placed | 1u << i, tried)) return true;
    }
    return false;
  }

  static Ids projected(const Ids& ids, const std::uint32_t* only) {
    if (only == nullptr) return ids;
    return ids.contains(*only) ? Ids{*only} : Ids{};
  }

  Ids answer(const std::vector<Operation>& operations, const Operation& q, const std::uint32_t* only,
             unsigned placed) const {
    Ids state = base_;
    for (unsigned i = 0; i < operations.size(); ++i) {
      if ((placed >> i & 1) != 0 && !operations[i].is_query() && !operations[i].is_refused())
        state.insert(operations[i].first);
    }
    Ids out;
    for (const std::uint32_t id : state) {
      if (is_valid(id, q)) out.insert(id);
    }
    return projected(out, only);
  }

  bool regular(const std::vector<Operation>& operations) const {
    for (const Operation& q : operations) {
      if (!q.is_query()) continue;
      Ids must, may;
      for (const std::uint32_t id : base_) {
        if (is_valid(id, q)) must.insert(id);
      }
      may = must;
      for (const Operation& r : operations) {
        if (r.is_query() || r.is_refused() || !is_valid(r.first, q)) continue;
        if (r.ret < q.call) must.insert(r.first);
        if (r.call <= q.ret) may.insert(r.first);
      }
      const Ids seen = seen_by(q);
      if (!std::includes(seen.begin(), seen.end(), must.begin(), must.end()) ||
          !std::includes(may.begin(), may.end(), seen.begin(), seen.end()))
        return false;
    }
    return true;
  }

  bool frame(const std::vector<Operation>& operations) const {
    for (std::size_t k = 0; k < operations.size(); ++k) {
      const Operation& q = operations[k];
      if (!q.is_query()) continue;
      Ids expected;
      for (const std::uint32_t id : base_) {
        if (is_valid(id, q)) expected.insert(id);
      }
      for (std::size_t i = 0; i < k; ++i) {
        const Operation& r = operations[i];
        if (!r.is_query() && !r.is_refused() && r.thread == q.thread && is_valid(r.first, q))
          expected.insert(r.first);
      }
      if (seen_by(q) != expected) return false;
    }
    return true;
  }

  bool integrity(const Epoch& epoch, const std::vector<Operation>& operations) const {
    Ids alive = base_;
    Ids required = base_;
    for (const Operation& r : operations) {
      if (r.is_query() || r.is_refused()) continue;
      alive.insert(r.first);
      if (!r.is_pending()) required.insert(r.first);
    }
    const auto are_sound = [&](std::span<const std::uint32_t> shown) {
      Ids once;
      for (const std::uint32_t s : shown) {
        if ((s & kTorn) != 0 || !alive.contains(s) || !once.insert(s).second) return false;
      }
      return true;
    };
    for (const Operation& q : operations) {
      if (!q.is_query()) continue;
      if (!are_sound(h_.seen_by(q))) return false;
      const Ids seen = seen_by(q);
      for (const std::uint32_t id : seen) {
        if (!is_valid(id, q)) return false;
      }
      for (const std::uint32_t id : base_) {
        if (is_valid(id, q) && !seen.contains(id)) return false;
      }
    }
    if (!epoch.has_contents) return true;
    const Ids contents(epoch.contents.begin(), epoch.contents.end());
    return are_sound(epoch.contents) &&
           std::includes(contents.begin(), contents.end(), required.begin(), required.end());
  }

  const History& h_;
  Ids base_;
};

inline OracleVerdict oracle(const History& h) { return Oracle(h).run(); }

/// A history of up to three epochs of up to seven operations: answers of an atomic cache, of one that reads
/// record by record, of one that flips a coin for whatever overlaps, or of thread-local writes; some with
/// faults put in afterwards.
class RandomHistory {
 public:
  explicit RandomHistory(std::uint64_t seed)
      : random_(hash_keys(seed)), validity_(1 + random_.below(2), 1 + random_.below(2)) {
    for (std::uint32_t kind = 0; kind < validity_.kinds(); ++kind) {
      for (std::uint32_t place = 0; place < validity_.places(); ++place) {
        if (place == kind / validity_.sizes() || chance(50)) validity_.set_valid(place, kind);
      }
    }
    history_.validity = &validity_;
    mode_ = static_cast<Mode>(random_.below(4));
    fault_percent_ = chance(50) ? 0 : 6;
    const std::uint32_t epochs = 1 + random_.below(3);
    for (std::uint32_t e = 0; e < epochs; ++e) add_epoch(e * 100, e + 1 == epochs);
    history_.ids = next_id_ + 1;
  }

  const History& history() const noexcept { return history_; }

 private:
  enum class Mode { atomic, record_by_record, coin, thread_local_writes };

  bool chance(std::uint32_t percent) { return random_.below(100) < percent; }

  void add_epoch(Stamp origin, bool is_last) {
    Epoch epoch;
    epoch.first = static_cast<std::uint32_t>(history_.operations.size());
    const std::uint32_t threads = 2 + random_.below(3);
    std::uint32_t left = 2 + random_.below(6);
    for (std::uint32_t t = 0; t < threads; ++t) {
      const std::uint32_t n = t + 1 == threads ? std::min(left, 3u) : random_.below(std::min(left, 3u) + 1);
      left -= n;
      Stamp now = origin;
      for (std::uint32_t i = 0; i < n; ++i) {
        if (i > 0 && history_.operations.back().is_query() && chance(25)) {
          add_to_batch();
        } else {
          now = add_operation(t, now, is_last && i + 1 == n);
        }
      }
    }
    epoch.end = static_cast<std::uint32_t>(history_.operations.size());
    points_.resize(epoch.end);
    for (std::uint32_t i = epoch.first; i != epoch.end; ++i) points_[i] = point_in(history_.operations[i]);
    for (std::uint32_t i = epoch.first; i != epoch.end; ++i) {
      if (history_.operations[i].is_query()) answer(epoch, i);
    }
    finish(epoch);
    history_.epochs.push_back(epoch);
  }

  Stamp add_operation(std::uint32_t thread, Stamp now, bool may_hang) {
    Operation o{};
    o.thread = thread;
    o.call = now + 1 + random_.below(4);
    o.ret = o.call + random_.below(9);
    if (chance(45)) {
      o.type = Operation::Type::insert;
      o.where = random_.below(validity_.kinds());
      o.first = next_id_++;
      o.result = chance(10) ? InsertResult::full : InsertResult::inserted;
      if (may_hang && chance(20)) o.ret = kPending;
    } else {
      o.type = Operation::Type::query;
      o.where = random_.below(validity_.places());
    }
    history_.operations.push_back(o);
    return o.ret;
  }

  /// A query in one call with the last one.
  void add_to_batch() {
    Operation o = history_.operations.back();
    o.where = random_.below(validity_.places());
    history_.operations.push_back(o);
  }

  double point_in(const Operation& o) {
    const Stamp ret = o.is_pending() ? o.call + 10 : o.ret;
    return static_cast<double>(o.call) +
           static_cast<double>(random_.uniform()) * static_cast<double>(ret - o.call);
  }

  void answer(const Epoch& epoch, std::uint32_t q) {
    Operation& query = history_.operations[q];
    query.first = static_cast<std::uint32_t>(history_.seen.size());
    for (const std::uint32_t r : alive_) show(query, r, true);
    for (std::uint32_t r = epoch.first; r != epoch.end; ++r) {
      const Operation& insert = history_.operations[r];
      if (insert.is_query()) continue;
      show(query, r, !insert.is_refused() && is_seen(epoch, q, r));
    }
    if (fault_percent_ > 0 &&
        chance(3)) {  // an id of any state, perhaps twice, perhaps torn, perhaps unknown
      history_.seen.push_back(random_.below(next_id_ + 1) | (chance(30) ? kTorn : 0));
    }
    query.count = static_cast<std::uint32_t>(history_.seen.size()) - query.first;
  }

  void show(const Operation& query, std::uint32_t insert, bool is_seen) {
    const Operation& r = history_.operations[insert];
    if (!validity_.is_valid(query.where, r.where)) return;
    if (chance(fault_percent_)) is_seen = !is_seen;
    if (is_seen) history_.seen.push_back(r.first);
  }

  bool is_seen(const Epoch&, std::uint32_t q, std::uint32_t r) {
    const Operation& query = history_.operations[q];
    const Operation& insert = history_.operations[r];
    switch (mode_) {
      case Mode::atomic:
        return points_[r] < points_[q];
      case Mode::record_by_record:
        return points_[r] < point_in(query);
      case Mode::coin:
        return insert.ret < query.call || (insert.call <= query.ret && chance(50));
      case Mode::thread_local_writes:
        return insert.thread == query.thread && r < q;
    }
    return false;
  }

  void finish(Epoch& epoch) {
    for (std::uint32_t i = epoch.first; i != epoch.end; ++i) {
      const Operation& o = history_.operations[i];
      if (!o.is_query() && !o.is_refused()) alive_.push_back(i);
    }
    epoch.has_contents = chance(50);
    for (const std::uint32_t r : alive_) {
      const Operation& insert = history_.operations[r];
      if (epoch.has_contents && !(insert.is_pending() && chance(50)) && !(fault_percent_ > 0 && chance(2)))
        epoch.contents.push_back(insert.first);
    }
    if (epoch.has_contents && fault_percent_ > 0 && chance(3))
      epoch.contents.push_back(random_.below(next_id_ + 1) | (chance(30) ? kTorn : 0));
    std::erase_if(alive_, [&](std::uint32_t r) {
      const bool drop = chance(20);
      if (drop) epoch.dropped.push_back(history_.operations[r].first);
      return drop;
    });
    epoch.clears = chance(30);
    if (epoch.clears) alive_.clear();
  }

  Pcg32 random_;
  ValidityTable validity_;
  Mode mode_;
  std::uint32_t fault_percent_;
  History history_;
  std::vector<std::uint32_t> alive_;  // inserts, by index of the operation
  std::vector<double> points_;        // where operations take effect
  std::uint32_t next_id_ = 0;
};

inline std::string to_string(const History& h) {
  std::string out;
  for (const Epoch& epoch : h.epochs) {
    for (std::uint32_t i = epoch.first; i != epoch.end; ++i) {
      const Operation& o = h.operations[i];
      out += fmt::format("{}: thread {} [{}, {}] {} at {}:", i, o.thread, o.call,
                         o.is_pending() ? "never" : std::to_string(o.ret), o.is_query() ? "query" : "insert",
                         o.where);
      if (o.is_query()) {
        for (const std::uint32_t id : h.seen_by(o)) out += fmt::format(" {}", id);
      } else {
        out += fmt::format(" {}{}", o.first, o.is_refused() ? " refused" : "");
      }
      out += "\n";
    }
    out += "barrier";
    for (const std::uint32_t id : epoch.dropped) out += fmt::format(", {} dropped", id);
    out += epoch.clears ? ", clear\n" : "\n";
  }
  return out;
}

}  // namespace icbench::stress
