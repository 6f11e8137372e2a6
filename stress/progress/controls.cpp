#include "stress/progress/controls.h"

#include "caches/direct.h"
#include "core/arena.h"
#include "core/interpolation.h"

namespace icbench::stress {

namespace {

using Word = StepAtomic<std::uint32_t>;

constexpr CacheTraits control_traits(std::string_view name, ProgressGuarantee insert) {
  return {name,
          "list",
          "control",
          insert,
          ProgressGuarantee::wait_free,
          Consistency::per_record_linearizable,
          false,
          "must be seen through"};
}

/// What all of them have: slots, numbered from 1, in the order of some counter.
class ControlList {
 public:
  using SharedSync = StepSync;
  struct Workspace {};

  explicit ControlList(const CacheConfig& config) : slots_(config.capacity) {}
  void prefault(Workspace&, std::uint32_t) noexcept {}

 protected:
  struct Slot {
    Record record;
    Word ready;
    Word next;
    std::uint32_t length;  // of the list from here on
  };
  using Slots = Arena<StepSync, 64>;
  static_assert(sizeof(Slot) <= 64, "a slot is one unit");

  Slot& slot(std::uint32_t i) const noexcept { return *std::launder(static_cast<Slot*>(slots_.at(i))); }
  UnitIndex take() noexcept { return slots_.take(1); }

  static void fill(Slot& s, const Record& r) noexcept {
    StepSync::writes(&s.record, sizeof r);
    s.record = r;
  }
  template <class F>
  static void test(const Slot& s, const SurfacePoint& x, float a, F& f) noexcept {
    const float weight = split_sphere_weight(x, s.record, a);
    if (weight > 0.0f) f(static_cast<const Record&>(s.record), weight);
  }

  /// Quiescent: the slots up to number `end` that are ready.
  template <class F>
  void for_each_ready(std::uint32_t end, F&& f) const {
    for (std::uint32_t i = 1; i <= end; ++i) {
      if (slot(i).ready.load(std::memory_order_relaxed) != 0) f(static_cast<const Record&>(slot(i).record));
    }
  }

 private:
  Slots slots_;
};

/// A record is put at the head by a CAS that is tried until it succeeds (Treiber 1986): lock-free, not wait-free.
template <ProgressGuarantee kDeclared>
class RetryList : public ControlList {
 public:
  static constexpr CacheTraits kTraits = control_traits("retry_list", kDeclared);
  static constexpr std::string_view kInsertBound = "5", kVisitBound = "1 + slots";
  static constexpr std::uint32_t insert_steps(const Record&) noexcept { return 5; }
  static constexpr std::uint32_t kVisitSteps = 0, kMostLists = 1;
  static constexpr std::uint64_t list_steps(std::uint32_t extent) noexcept { return 1 + extent; }
  using ControlList::ControlList;

  template <class Counters>
  bool insert(Workspace&, const Record& r, Counters&) noexcept {
    const UnitIndex i = take();
    Slot& s = slot(i);
    fill(s, r);
    std::uint32_t head = head_.load(std::memory_order_acquire);
    do {
      s.next.store(head, std::memory_order_relaxed);  // relaxed: the CAS publishes
      s.length = head == 0 ? 1 : slot(head).length + 1;
    } while (!head_.compare_exchange_strong(head, i, std::memory_order_release, std::memory_order_acquire));
    return true;
  }
  template <class Counters, class F>
  void visit(const SurfacePoint& x, float a, Counters&, F&& f) noexcept {
    std::uint32_t i = head_.load(std::memory_order_acquire);
    StepSync::extent(i == 0 ? 0 : slot(i).length);
    for (; i != 0; i = slot(i).next.load(std::memory_order_relaxed)) test(slot(i), x, a, f);
  }
  template <class F>
  void for_each(F&& f) const {
    for (std::uint32_t i = head_.load(std::memory_order_relaxed); i != 0;
         i = slot(i).next.load(std::memory_order_relaxed))
      f(static_cast<const Record&>(slot(i).record));
  }

 private:
  Word head_{0};
};

/// Slots are handed out by fetch_add and marked when they are filled. A base that is right.
class MarkedList : public ControlList {
 public:
  static constexpr std::string_view kInsertBound = "2", kVisitBound = "1 + slots";
  static constexpr std::uint32_t insert_steps(const Record&) noexcept { return 2; }
  static constexpr std::uint32_t kVisitSteps = 0, kMostLists = 1;
  static constexpr std::uint64_t list_steps(std::uint32_t extent) noexcept { return 1 + extent; }
  using ControlList::ControlList;

  template <class Counters>
  bool insert(Workspace&, const Record& r, Counters&) noexcept {
    Slot& s = next_slot();
    fill(s, r);
    s.ready.store(1, std::memory_order_release);
    return true;
  }
  template <class Counters, class F>
  void visit(const SurfacePoint& x, float a, Counters&, F&& f) noexcept {
    const std::uint32_t end = extent();
    for (std::uint32_t i = 1; i <= end; ++i) {
      if (slot(i).ready.load(std::memory_order_acquire) != 0) test(slot(i), x, a, f);
    }
  }
  template <class F>
  void for_each(F&& f) const {
    for_each_ready(count(), f);
  }

 protected:
  // The cache's tickets never give out more than its capacity. Relaxed: the marks publish.
  Slot& next_slot() noexcept { return slot(count_.fetch_add(1, std::memory_order_relaxed) + 1); }
  std::uint32_t count() const noexcept { return count_.load(std::memory_order_relaxed); }
  std::uint32_t extent() const noexcept {
    const std::uint32_t end = count();
    StepSync::extent(end);
    return end;
  }

 private:
  Word count_{0};
};

/// Tickets are drawn by a CAS that is tried until it succeeds. Others change its word seldom, so that it stays within a
/// bound with some slack, unless they have to draw one by one.
class RetryTicket : public MarkedList {
 public:
  static constexpr CacheTraits kTraits = control_traits("retry_ticket", ProgressGuarantee::wait_free);
  static constexpr std::string_view kInsertBound = "200";
  static constexpr std::uint32_t insert_steps(const Record&) noexcept { return 200; }
  using MarkedList::MarkedList;
  struct Workspace : MarkedList::Workspace {
    std::uint32_t tickets = 0;
  };

  template <class Counters>
  bool insert(Workspace& w, const Record& r, Counters& counters) noexcept {
    if (w.tickets == 0) {
      w.tickets = StepSync::may_take_pieces() ? kTicketBatch : 1;
      std::uint32_t drawn = drawn_.load(std::memory_order_relaxed);
      while (!drawn_.compare_exchange_strong(drawn, drawn + w.tickets, std::memory_order_relaxed,
                                             std::memory_order_relaxed)) {
      }
    }
    --w.tickets;
    return MarkedList::insert(w, r, counters);
  }

 private:
  Word drawn_{0};
};

/// A query walks until it has caught up with the tail.
class GrowingTail : public MarkedList {
 public:
  static constexpr CacheTraits kTraits = control_traits("growing_tail", ProgressGuarantee::wait_free);
  static constexpr std::string_view kVisitBound = "2 + 2 slots";
  static constexpr std::uint64_t list_steps(std::uint32_t extent) noexcept { return 2 + 2ull * extent; }
  using MarkedList::MarkedList;

  template <class Counters, class F>
  void visit(const SurfacePoint& x, float a, Counters&, F&& f) noexcept {
    extent();
    for (std::uint32_t i = 1; i <= count(); ++i) {
      if (slot(i).ready.load(std::memory_order_acquire) != 0) test(slot(i), x, a, f);
    }
  }
};

/// The same, claiming at every slot that what is there now was there from the start.
class GrowingClaim : public MarkedList {
 public:
  static constexpr CacheTraits kTraits = control_traits("growing_claim", ProgressGuarantee::wait_free);
  using MarkedList::MarkedList;

  template <class Counters, class F>
  void visit(const SurfacePoint& x, float a, Counters&, F&& f) noexcept {
    for (std::uint32_t i = 1; i <= extent(); ++i) {
      if (slot(i).ready.load(std::memory_order_acquire) != 0) test(slot(i), x, a, f);
    }
  }
};

/// A query waits for the slots that are handed out and not filled, without telling that it does.
class AwaitingQuery : public MarkedList {
 public:
  static constexpr CacheTraits kTraits = control_traits("awaiting_query", ProgressGuarantee::wait_free);
  using MarkedList::MarkedList;

  template <class Counters, class F>
  void visit(const SurfacePoint& x, float a, Counters&, F&& f) noexcept {
    const std::uint32_t end = extent();
    for (std::uint32_t i = 1; i <= end; ++i) {
      while (slot(i).ready.load(std::memory_order_acquire) == 0) {
      }
      test(slot(i), x, a, f);
    }
  }
};

/// A batch is made again until nobody has inserted meanwhile, so as to be a snapshot.
class RepeatedBatch : public MarkedList {
 public:
  static constexpr CacheTraits kTraits = control_traits("repeated_batch", ProgressGuarantee::wait_free);
  static constexpr std::string_view kVisitBound = "3 + slots";
  static constexpr std::uint32_t kVisitSteps = 2;
  static constexpr std::size_t kBatch = 4;
  using MarkedList::MarkedList;

  template <class Counters, class Visitors>
  void visit_batch(std::span<const SurfacePoint> points, float a, Counters&, Visitors visitors) noexcept {
    std::uint32_t end = extent();
    std::vector<std::uint32_t> ready;
    for (std::uint32_t before = end + 1; before != end; end = count()) {
      before = end;
      ready.clear();
      for (std::uint32_t i = 1; i <= end; ++i) {
        if (slot(i).ready.load(std::memory_order_acquire) != 0) ready.push_back(i);
      }
    }
    for (std::size_t k = 0; k < points.size(); ++k) {
      auto&& visitor = visitors[k];
      for (const std::uint32_t i : ready) test(slot(i), points[k], a, visitor);
    }
  }
};

/// Records become visible in the order of their slots: an insert waits for those before it.
class InOrder : public MarkedList {
 public:
  static constexpr CacheTraits kTraits = control_traits("in_order", ProgressGuarantee::wait_free);
  static constexpr std::string_view kInsertBound = "4";
  static constexpr std::uint32_t insert_steps(const Record&) noexcept { return 4; }
  using MarkedList::MarkedList;

  template <class Counters>
  bool insert(Workspace&, const Record& r, Counters&) noexcept {
    Slot& s = next_slot();
    fill(s, r);
    for (unsigned turn = 0; &slot(shown_.load(std::memory_order_acquire) + 1) != &s; ++turn)
      StepSync::wait_turn(turn);
    s.ready.store(1, std::memory_order_release);
    shown_.fetch_add(1, std::memory_order_release);
    return true;
  }

 private:
  Word shown_{0};
};

/// A slot is marked ready and filled afterwards: what a stopped insert leaves behind is half a record.
class HalfRecord : public MarkedList {
 public:
  static constexpr CacheTraits kTraits = control_traits("half_record", ProgressGuarantee::wait_free);
  using MarkedList::MarkedList;

  template <class Counters>
  bool insert(Workspace&, const Record& r, Counters&) noexcept {
    Slot& s = next_slot();
    s.ready.store(1, std::memory_order_release);
    fill(s, r);
    return true;
  }
};

}  // namespace

std::span<const ProgressControl> all_progress_controls() {
  constexpr auto lock_free = ProgressGuarantee::lock_free, wait_free = ProgressGuarantee::wait_free;
  static const ProgressControl controls[] = {
      {"retry_list", "none: declared lock-free, its inserts' steps may grow and must be seen growing",
       "insert", false, progress_subject<Direct<RetryList<lock_free>>>()},
      {"retry_declared_wait_free", "a CAS is tried until it succeeds", "insert", true,
       progress_subject<Direct<RetryList<wait_free>>>()},
      {"retry_ticket", "tickets are drawn by a CAS that is tried until it succeeds", "insert", true,
       progress_subject<Direct<RetryTicket>>()},
      {"growing_tail", "a query walks to a tail that still grows", "query", true,
       progress_subject<Direct<GrowingTail>>()},
      {"growing_claim", "the same, and the query claims all of it as its extent", "query", true,
       progress_subject<Direct<GrowingClaim>>()},
      {"awaiting_query", "a query spins on a slot that is not filled yet", "query", true,
       progress_subject<Direct<AwaitingQuery>>()},
      {"repeated_batch", "a batch is made again until nobody has inserted meanwhile", "query_batch", true,
       progress_subject<Direct<RepeatedBatch>>()},
      {"in_order", "an insert waits for those that began before it", "insert", true,
       progress_subject<Direct<InOrder>>()},
      {"half_record", "a slot is marked before it is filled: whoever stops there leaves half a record",
       "insert", true, progress_subject<Direct<HalfRecord>>()},
  };
  return controls;
}

ProgressControlOutcome run_progress_control(const ProgressControl& control, const ProgressOptions& options) {
  ProgressControlOutcome outcome{false, check_progress(control.subject, options)};
  const ProgressResult& r = outcome.of(control.operation);
  const bool grows = !r.steps_by_interference.empty() &&
                     r.steps_by_interference.back().steps > r.steps_by_interference.back().inserts;
  outcome.seen = control.is_violation ? !r.holds : r.holds && grows;
  return outcome;
}

}  // namespace icbench::stress
