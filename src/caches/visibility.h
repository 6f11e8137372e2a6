// What makes a record visible: the word beside every record of a list, and what a query compares it with.
//
// Use: a structure takes one of the policies below; `In<Sync>` is the state it holds.
//
//   At first sight   one flag a record. A query sees a record from its publication on, list by list as it comes by:
//                    per-record linearizable, where a record is stored once.
//
//   Snapshot         one stamp a record, from a clock that all share. A query reads the clock first and then sees
//                    exactly the records stamped by then, wherever it goes: linearizable. An insert sets `pending` and
//                    then, by one CAS, a tick of its own; a query that comes by in between does the same for it.
//                    Related: the timestamps of constant-time snapshots (Wei et al. 2021) and bundled references
//                    (Nelson-Slivon, Hassan, Palmieri 2022), which keep old versions of links; records here never
//                    change, so a stamp each is all that is needed, and no version is kept.
//
// Publication pairs
//
//   P1  publish: mark store release -> shows: mark load acquire; publishes the record
//
//   P4  publish, shows: clock fetch_add acq_rel -> moment: clock load acquire. Who stamps has first put the record in
//                    its place or seen it there. So when a query reads a clock that has reached the stamp, it will find
//                    the record and its mark at `pending` or further: no record of its snapshot escapes it.
//
//   P5  publish, shows: mark CAS release -> shows: mark load or failed CAS acquire; publishes the record, as P1: a CAS
//       by a helper is in the release sequence of the store of `pending`.
//
// Why a query sees the same as any other at the same moment: a mark leaves `pending` once, and its stamp never changes.
// Whoever stamps draws its tick after the mark was pending, hence inside the insert, and the insert ends with the mark
// stamped. So the insert takes effect when its tick is drawn, the query when it reads the clock.
//
// Progress: all steps are bounded and none is repeated; kMomentSteps, kPublishSteps and kShowsSteps say how many there
// are at most.
#pragma once

#include <cstdint>

#include "core/sync.h"

namespace icbench {

/// One flag a record.
struct AtFirstSight {
  static constexpr bool kIsSnapshot = false;

  template <class Sync>
  class In {
   public:
    /// 0 empty, 1 published. All-zero bytes are empty.
    struct Mark {
      typename Sync::template Atomic<std::uint32_t> word;
    };
    /// What a query knows of time: nothing.
    struct Moment {};

    static constexpr std::uint32_t kMomentSteps = 0, kPublishSteps = 1, kShowsSteps = 1;

    Moment moment() const noexcept { return {}; }

    /// Makes the record beside `mark` visible.
    void publish(Mark& mark) noexcept { mark.word.store(1, std::memory_order_release /* P1 */); }

    /// Whether the record beside `mark` is to be seen.
    bool shows(Mark& mark, Moment) noexcept { return look(mark) != 0; }

    // The same in steps: what a mark says, what it says at last, and whether that, 1 or 0, shows the record.
    using Word = std::uint32_t;
    Word look(const Mark& mark) const noexcept { return mark.word.load(std::memory_order_acquire /* P1 */); }
    Word settled(Mark&, Word word) noexcept { return word; }
    static std::uint32_t is_shown_by(Word word, Moment) noexcept { return word; }

    void clear() noexcept {}
  };
};

/// One stamp a record.
struct Snapshot {
  static constexpr bool kIsSnapshot = true;

  template <class Sync>
  class In {
   public:
    /// 0 empty, 1 pending, else one more than the record's tick. All-zero bytes are empty.
    struct Mark {
      typename Sync::template Atomic<std::uint64_t> word;
    };
    /// Ticks drawn when the query began.
    using Moment = std::uint64_t;

    // Pending, tick and CAS; a load, and if the record is pending a tick, a CAS and another load.
    static constexpr std::uint32_t kMomentSteps = 1, kPublishSteps = 3, kShowsSteps = 4;

    Moment moment() const noexcept { return clock_.load(std::memory_order_acquire /* P4 */); }

    /// Makes the record beside `mark` visible.
    void publish(Mark& mark) noexcept {
      mark.word.store(kPending, std::memory_order_release /* P1 */);
      stamp(mark);
    }

    bool shows(Mark& mark, Moment moment) noexcept {
      return is_shown_by(settled(mark, look(mark)), moment) != 0;
    }

    using Word = std::uint64_t;
    Word look(const Mark& mark) const noexcept {
      return mark.word.load(std::memory_order_acquire /* P1, P5 */);
    }
    Word settled(Mark& mark, Word word) noexcept {
      if (word != kPending) return word;
      stamp(mark);
      return look(mark);
    }
    static std::uint32_t is_shown_by(Word word, Moment moment) noexcept {
      // Stamped, by a tick of at most `moment`: what is empty or pending wraps round.
      return word - (kPending + 1) < moment;
    }

    /// Quiescent; no mark is set.
    void clear() noexcept { clock_.store(0, std::memory_order_relaxed); }  // relaxed: quiescent

   private:
    static constexpr std::uint64_t kPending = 1;

    void stamp(Mark& mark) noexcept {
      const std::uint64_t tick = clock_.fetch_add(1, std::memory_order_acq_rel /* P4 */) + 1;
      std::uint64_t pending = kPending;
      // Whoever fails leaves the mark to the winner's tick.
      mark.word.compare_exchange_strong(pending, tick + 1, std::memory_order_release /* P5 */,
                                        std::memory_order_acquire /* P5 */);
    }

    alignas(kNoSharing) typename Sync::template Atomic<std::uint64_t> clock_{0};
  };
};

}  // namespace icbench
