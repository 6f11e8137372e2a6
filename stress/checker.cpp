#include "stress/checker.h"

#include <fmt/format.h>

#include <algorithm>

#include "stress/linearize.h"
#include "stress/overlap.h"
#include "stress/witness.h"

namespace icbench::stress {

namespace {

constexpr std::uint32_t kNone = UINT32_MAX;

/// Life::mark of contents, together with the number of the epoch; other marks are queries, which are fewer.
constexpr std::uint32_t kContentsMark = 1u << 31;

/// Stands for "before the epoch": records that were there when it began.
constexpr Stamp kBeforeAll = 0;

/// What is known of an id at the epoch being judged.
struct Life {
  enum class State : std::uint8_t { unknown, refused, alive, gone };

  State state = State::unknown;
  std::uint32_t operation = kNone;  ///< the insert
  std::uint32_t epoch = kNone;      ///< in which it was offered
  Stamp shown = kPending;           ///< earliest return of a query of this epoch that saw it
  std::uint32_t mark = kNone;       ///< last query, or contents, that showed it
};

class Judge {
 public:
  explicit Judge(const History& h)
      : h_(h), lives_(h.ids), base_(h.validity->places()), own_(h.validity->places()) {
    returned_.resize(h.validity->places());
    settled_.resize(h.validity->places());
  }

  Judgement run() {
    for (std::uint32_t i = 0; i < h_.epochs.size(); ++i) {
      epoch_number_ = i;
      epoch_ = &h_.epochs[i];
      judgement_.operations += epoch_->end - epoch_->first;
      const std::uint64_t irregular = judgement_[Check::regular].violations;
      enter_inserts();
      note_first_shown();
      collect_required();
      overlaps_.collect(h_, *epoch_);
      judgement_.concurrent_pairs += overlaps_.pairs().size();
      judge_queries();
      if (judgement_[Check::regular].violations != irregular) {
        accuse_unlinearizable_as_irregular();
      } else {
        judge_linearizable();
      }
      judge_contents();
      leave();
    }
    return std::move(judgement_);
  }

 private:
  const Operation& operation(std::uint32_t i) const noexcept { return h_.operations[i]; }
  bool is_own_epoch(const Life& life) const noexcept { return life.epoch == epoch_number_; }
  bool is_valid(const Life& life, std::uint32_t place) const noexcept {
    return h_.validity->is_valid(place, operation(life.operation).where);
  }
  static std::uint32_t id_of(std::uint32_t shown) noexcept { return shown & ~kTorn; }

  /// The life behind an id that was shown, if any insert ever stood behind it.
  Life* find(std::uint32_t shown) noexcept {
    const std::uint32_t id = id_of(shown);
    return id < lives_.size() && lives_[id].operation != kNone ? &lives_[id] : nullptr;
  }

  template <class F>
  void for_each_insert(F&& f) {
    for (std::uint32_t i = epoch_->first; i != epoch_->end; ++i) {
      if (!operation(i).is_query()) f(i, lives_[operation(i).first]);
    }
  }

  void enter_inserts() {
    for_each_insert([&](std::uint32_t i, Life& life) {
      life.state = operation(i).is_refused() ? Life::State::refused : Life::State::alive;
      life.operation = i;
      life.epoch = epoch_number_;
      if (life.state == Life::State::alive) alive_.push_back(operation(i).first);
    });
  }

  void note_first_shown() {
    for (std::uint32_t i = epoch_->first; i != epoch_->end; ++i) {
      if (!operation(i).is_query()) continue;
      for (const std::uint32_t shown : h_.seen_by(operation(i))) {
        if (Life* life = find(shown)) life->shown = std::min(life->shown, operation(i).ret);
      }
    }
  }

  Stamp settled(const Life& life) const noexcept {
    return is_own_epoch(life) ? std::min(operation(life.operation).ret, life.shown) : kBeforeAll;
  }
  Stamp returned(const Life& life) const noexcept {
    return is_own_epoch(life) ? operation(life.operation).ret : kBeforeAll;
  }

  /// Per place, the sorted stamps after which a query must see each record of this epoch: its return, and
  /// (settled) its return or the first return of a query that saw it.
  void collect_required() {
    for (auto& stamps : returned_) stamps.clear();
    for (auto& stamps : settled_) stamps.clear();
    by_stamp_.clear();
    for_each_insert([&](std::uint32_t i, Life& life) {
      if (life.state == Life::State::alive) by_stamp_.emplace_back(operation(i).ret, i);
    });
    distribute(returned_);
    for (auto& [stamp, i] : by_stamp_) stamp = settled(lives_[operation(i).first]);
    distribute(settled_);
  }

  void distribute(std::vector<std::vector<Stamp>>& per_place) {
    std::sort(by_stamp_.begin(), by_stamp_.end());
    for (const auto& [stamp, i] : by_stamp_) {
      for (const std::uint32_t place : h_.validity->places_of(operation(i).where))
        per_place[place].push_back(stamp);
    }
  }

  void judge_queries() {
    forced_.clear();
    next_overlap_ = 0;
    std::uint32_t thread = kNone;
    for (std::uint32_t i = epoch_->first; i != epoch_->end; ++i) {
      if (operation(i).thread != thread) {
        thread = operation(i).thread;
        std::fill(own_.begin(), own_.end(), 0);
      }
      if (operation(i).is_query()) {
        judge_query(i);
      } else if (!operation(i).is_refused()) {
        for (const std::uint32_t place : h_.validity->places_of(operation(i).where)) ++own_[place];
      }
    }
  }

  void judge_query(std::uint32_t q) {
    const Operation& query = operation(q);
    const std::uint32_t place = query.where;
    std::uint64_t seen_base = 0, seen_returned = 0, seen_settled = 0, seen_own = 0;
    for (const std::uint32_t shown : h_.seen_by(query)) {
      Life* life = judge_shown(shown, q);
      if (life == nullptr) continue;
      if (!is_valid(*life, place)) {
        accuse(Check::integrity, {q, life->operation}, "record {} was shown where it is not valid",
               id_of(shown));
        accuse_impossible(q, *life, "record {} was seen where it is not valid", shown);
        continue;
      }
      if (life->state != Life::State::alive) continue;
      if (!is_own_epoch(*life)) {
        ++seen_base;
        continue;
      }
      const Operation& insert = operation(life->operation);
      if (insert.call > query.ret) {
        accuse_impossible(q, *life, "record {} was seen before its insert was called", shown);
        continue;
      }
      seen_returned += insert.ret < query.call;
      seen_settled += settled(*life) < query.call;
      if (insert.thread == query.thread && life->operation < q) {
        ++seen_own;
      } else {
        accuse(Check::frame, {life->operation, q},
               "record {} of another thread was seen before the end of the frame", id_of(shown));
      }
    }
    const auto required = [&](const std::vector<std::vector<Stamp>>& stamps) {
      const auto& at = stamps[place];
      return static_cast<std::uint64_t>(std::lower_bound(at.begin(), at.end(), query.call) - at.begin());
    };
    const std::uint64_t lost = base_[place] - seen_base;
    const std::uint64_t missed_returned = lost + required(returned_) - seen_returned;
    const std::uint64_t missed_settled = lost + required(settled_) - seen_settled;
    const std::uint64_t missed_own = lost + own_[place] - seen_own;
    if (lost > 0) accuse_missing(Check::integrity, q, lost, "lost", true, kBeforeAll);
    if (missed_returned > 0) accuse_missing(Check::regular, q, missed_returned, "missed", false, query.call);
    if (missed_settled > 0)
      accuse_missing(Check::per_record_linearizable, q, missed_settled, "missed", false, query.call);
    if (missed_own > 0) accuse_missing(Check::frame, q, missed_own, "missed", false, query.call);
    const auto& pairs = overlaps_.pairs();
    for (; next_overlap_ < pairs.size() && pairs[next_overlap_].query == q; ++next_overlap_) {
      const std::uint32_t r = pairs[next_overlap_].insert;
      const bool was_seen = lives_[operation(r).first].mark == q;
      forced_.push_back(was_seen ? ForcedOrder{r - epoch_->first, q - epoch_->first}
                                 : ForcedOrder{q - epoch_->first, r - epoch_->first});
    }
  }

  /// Integrity of one id shown by query `q`; its life unless it is to be left out of all counting.
  Life* judge_shown(std::uint32_t shown, std::uint32_t q) {
    Life* life = find(shown);
    if (life == nullptr) {
      accuse(Check::integrity, {q}, "record {} was never inserted (invented)", id_of(shown));
      for (const Check check : {Check::regular, Check::per_record_linearizable, Check::frame})
        accuse(check, {q}, "record {} was seen but never inserted", id_of(shown));
      return nullptr;
    }
    if ((shown & kTorn) != 0) {
      accuse(Check::integrity, {life->operation, q},
             "record {} is not what was inserted or last written (torn)", id_of(shown));
    }
    if (life->mark == q) {
      accuse(Check::integrity, {life->operation, q}, "record {} was shown twice by one query (duplicated)",
             id_of(shown));
      return nullptr;
    }
    life->mark = q;
    if (life->state == Life::State::gone) {
      accuse(Check::integrity, {q}, "record {} was shown after it was cleared or dropped (resurrected)",
             id_of(shown));
      accuse_impossible(q, *life, "record {} was seen after it was cleared or dropped", shown);
    } else if (life->state == Life::State::refused) {
      accuse(Check::integrity, {life->operation, q},
             "record {} was shown though its insert was refused (invented)", id_of(shown));
      accuse_impossible(q, *life, "record {} was seen though its insert was refused", shown);
    }
    return life;
  }

  template <class... Args>
  void accuse(Check check, std::initializer_list<std::uint32_t> operations, fmt::format_string<Args...> what,
              Args&&... args) {
    Finding& finding = judgement_[check];
    if (++finding.violations > 1) return;
    finding.witness_operations.assign(operations);
    finding.witness =
        witness_text(h_, *epoch_, fmt::format(what, std::forward<Args>(args)...), finding.witness_operations);
  }

  void accuse_impossible(std::uint32_t q, const Life& life, fmt::format_string<std::uint32_t> what,
                         std::uint32_t shown) {
    for (const Check check : {Check::regular, Check::per_record_linearizable, Check::frame}) {
      // An insert of an earlier epoch has no part in this epoch's times.
      if (is_own_epoch(life)) {
        accuse(check, {q, life.operation}, what, id_of(shown));
      } else {
        accuse(check, {q}, what, id_of(shown));
      }
    }
  }

  /// Query `q`, whose shown records bear its mark, has missed `n` records. Names the first for the witness.
  void accuse_missing(Check check, std::uint32_t q, std::uint64_t n, std::string_view verb, bool only_base,
                      Stamp before) {
    Finding& finding = judgement_[check];
    finding.violations += n;
    if (finding.violations > n) return;
    const Operation& query = operation(q);
    for (const std::uint32_t id : alive_) {
      const Life& life = lives_[id];
      if (life.mark == q || !is_valid(life, query.where)) continue;
      const bool is_base = !is_own_epoch(life);
      if (!is_base && (only_base || !is_required(check, life, query, before))) continue;
      describe_missing(finding, q, id, is_base, verb);
      return;
    }
  }

  bool is_required(Check check, const Life& life, const Operation& query, Stamp before) const noexcept {
    if (check == Check::regular) return returned(life) < before;
    if (check == Check::per_record_linearizable) return settled(life) < before;
    const Operation& insert = operation(life.operation);
    return insert.thread == query.thread && insert.call < query.call;
  }

  void describe_missing(Finding& finding, std::uint32_t q, std::uint32_t id, bool is_base,
                        std::string_view verb) {
    const Life& life = lives_[id];
    if (is_base) {
      finding.witness_operations = {q};
      finding.witness = witness_text(
          h_, *epoch_, fmt::format("record {}, accepted before the last barrier, was {}", id, verb),
          finding.witness_operations);
      return;
    }
    if (returned(life) < operation(q).call) {
      finding.witness_operations = {life.operation, q};
      finding.witness =
          witness_text(h_, *epoch_, fmt::format("record {}, whose insert had returned, was {}", id, verb),
                       finding.witness_operations);
      return;
    }
    for (std::uint32_t i = epoch_->first; i != epoch_->end; ++i) {
      if (!operation(i).is_query() || operation(i).ret != life.shown) continue;
      const auto seen = h_.seen_by(operation(i));
      if (std::find_if(seen.begin(), seen.end(), [&](auto s) { return id_of(s) == id; }) == seen.end())
        continue;
      finding.witness_operations = {life.operation, i, q};
      finding.witness = cycle_text(h_, *epoch_, finding.witness_operations);
      return;
    }
  }

  void accuse_unlinearizable_as_irregular() {
    Finding& finding = judgement_[Check::linearizable];
    if (++finding.violations > 1) return;
    finding.witness = judgement_[Check::regular].witness;
    finding.witness_operations = judgement_[Check::regular].witness_operations;
  }

  void judge_linearizable() {
    const auto operations = std::span(h_.operations).subspan(epoch_->first, epoch_->end - epoch_->first);
    std::vector<std::uint32_t> cycle = linearizer_.find_cycle(operations, overlaps_.by_call(), forced_);
    if (cycle.empty()) return;
    Finding& finding = judgement_[Check::linearizable];
    if (++finding.violations > 1) return;
    for (std::uint32_t& i : cycle) i += epoch_->first;
    finding.witness = cycle_text(h_, *epoch_, cycle);
    finding.witness_operations = std::move(cycle);
  }

  /// After the barrier exactly the accepted records are there.
  void judge_contents() {
    if (!epoch_->has_contents) return;
    const std::uint32_t mark = kContentsMark | epoch_number_;
    for (const std::uint32_t shown : epoch_->contents) {
      Life* life = find(shown);
      const std::uint32_t id = id_of(shown);
      if (life == nullptr || life->state == Life::State::refused) {
        accuse(Check::integrity, {}, "record {} is in the cache but no insert of it was accepted (invented)",
               id);
        continue;
      }
      if ((shown & kTorn) != 0)
        accuse(Check::integrity, {}, "record {} is in the cache but not as it was written (torn)", id);
      if (life->state == Life::State::gone) {
        accuse(Check::integrity, {},
               "record {} is in the cache after it was cleared or dropped (resurrected)", id);
      } else if (life->mark == mark) {
        accuse(Check::integrity, {}, "record {} is in the cache twice (duplicated)", id);
      }
      life->mark = mark;
    }
    for (const std::uint32_t id : alive_) {
      const Life& life = lives_[id];
      if (life.mark == mark || operation(life.operation).is_pending()) continue;
      if (is_own_epoch(life)) {
        accuse(Check::integrity, {life.operation}, "record {} was accepted but is not in the cache (lost)",
               id);
      } else {
        accuse(Check::integrity, {}, "record {} was in the cache but is no longer (lost)", id);
      }
    }
  }

  /// Hands the records over to the next epoch.
  void leave() {
    for_each_insert([&](std::uint32_t i, const Life& life) {
      if (life.state == Life::State::alive) count_base(i, 1);
    });
    const auto bury = [&](Life& life) {
      life.state = Life::State::gone;
      count_base(life.operation, -1);
    };
    for (const std::uint32_t id : epoch_->dropped) {
      if (lives_[id].state == Life::State::alive) bury(lives_[id]);
    }
    if (epoch_->clears) {
      for (const std::uint32_t id : alive_) {
        if (lives_[id].state == Life::State::alive) bury(lives_[id]);
      }
    }
    std::erase_if(alive_, [&](std::uint32_t id) { return lives_[id].state != Life::State::alive; });
  }

  void count_base(std::uint32_t insert, std::int64_t n) {
    for (const std::uint32_t place : h_.validity->places_of(operation(insert).where))
      base_[place] += static_cast<std::uint64_t>(n);
  }

  const History& h_;
  Judgement judgement_;
  std::vector<Life> lives_;           ///< by id
  std::vector<std::uint32_t> alive_;  ///< ids in state alive
  std::vector<std::uint64_t> base_;   ///< per place: records valid there that were there when the epoch began
  std::vector<std::uint64_t> own_;    ///< per place: records valid there that the current thread has inserted
  std::vector<std::vector<Stamp>> returned_, settled_;
  std::vector<std::pair<Stamp, std::uint32_t>> by_stamp_;
  Overlaps overlaps_;
  std::size_t next_overlap_ = 0;
  std::vector<ForcedOrder> forced_;
  Linearizer linearizer_;
  const Epoch* epoch_ = nullptr;
  std::uint32_t epoch_number_ = 0;
};

}  // namespace

Judgement judge(const History& history) { return Judge(history).run(); }

}  // namespace icbench::stress
