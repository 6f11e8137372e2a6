// Broken caches on linear lists, where each fault is a few lines. Each must be seen failing.
//
// All are templates over the Sync policy (core/sync.h), so that the same source runs under delays, where histories show
// its fault, and in the hands of the schedule explorer.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "caches/direct.h"
#include "caches/locked.h"

namespace icbench::stress {

/// What all of them have: a pool of slots, from 1, that are handed out by fetch_add, and a scan over slots.
template <class Sync>
class Slots {
 protected:
  using SharedWord = typename Sync::template Atomic<std::uint32_t>;

 public:
  using SharedSync = Sync;
  struct Workspace {};
  struct Slot {
    Record record{};
    SharedWord ready{0};
    SharedWord next{0};
  };

  explicit Slots(const CacheConfig& config)
      : slots_(std::make_unique<Slot[]>(config.capacity + 1)), capacity_(config.capacity) {}

  static std::size_t bytes(const Workspace&) noexcept { return 0; }
  void prefault(Workspace&, std::uint32_t) noexcept {}
  std::uint64_t room(std::uint64_t /*live*/) const noexcept { return capacity_ - taken(); }

  /// Quiescent: all slots that are ready; f may drop records.
  template <class F>
  void update(F&& f) {
    for (std::uint32_t i = 1; i <= taken(); ++i) {
      if (slot(i).ready.load(std::memory_order_relaxed) != 0 && f(slot(i).record) == UpdateResult::drop)
        slot(i).ready.store(0, std::memory_order_relaxed);
    }
  }
  template <class F>
  void for_each(F&& f) const {
    for (std::uint32_t i = 1; i <= taken(); ++i) {
      if (slot(i).ready.load(std::memory_order_relaxed) != 0) f(static_cast<const Record&>(slot(i).record));
    }
  }
  void clear() {
    for (std::uint32_t i = 1; i <= taken(); ++i) {
      slot(i).record = {};
      slot(i).ready.store(0, std::memory_order_relaxed);
      slot(i).next.store(0, std::memory_order_relaxed);
    }
    taken_.store(0, std::memory_order_relaxed);
  }

 protected:
  // The cache's tickets never give out more than its capacity. Relaxed: other words publish.
  std::uint32_t take() noexcept { return taken_.fetch_add(1, std::memory_order_relaxed) + 1; }
  std::uint32_t taken() const noexcept { return taken_.load(std::memory_order_relaxed); }
  Slot& slot(std::uint32_t i) const noexcept { return slots_[i]; }

  template <class F>
  static void test(const Slot& s, const SurfacePoint& x, float a, F& f) noexcept {
    if (s.ready.load(std::memory_order_acquire) == 0) return;
    Sync::reads(&s.record, sizeof s.record);
    const float weight = split_sphere_weight(x, s.record, a);
    if (weight > 0.0f) f(static_cast<const Record&>(s.record), weight);
  }

  /// Slots 1 to `end`.
  template <class F>
  void scan(std::uint32_t end, const SurfacePoint& x, float a, F& f) const noexcept {
    for (std::uint32_t i = 1; i <= end; ++i) test(slot(i), x, a, f);
  }

  // A record in two steps: what makes it valid somewhere, and what it brings.
  static void write_place(Slot& s, const Record& r) noexcept {
    Sync::writes(&s.record, offsetof(Record, E));
    s.record.p = r.p;
    s.record.n = r.n;
    s.record.R = r.R;
  }
  static void write_light(Slot& s, const Record& r) noexcept {
    Sync::writes(&s.record.E, sizeof s.record.E + sizeof s.record.id);
    s.record.E = r.E;
    s.record.id = r.id;
  }

  static void publish(Slot& s, const Record& r) noexcept {
    Sync::writes(&s.record, sizeof s.record);
    s.record = r;
    s.ready.store(1, std::memory_order_release);
  }

  /// In the next slot.
  void add(const Record& r) noexcept { publish(slot(take()), r); }

 private:
  std::unique_ptr<Slot[]> slots_;
  std::uint32_t capacity_;
  SharedWord taken_{0};
};

constexpr CacheTraits broken_traits(std::string_view name, Consistency consistency) {
  return {name,
          "list",
          "broken",
          ProgressGuarantee::wait_free,
          ProgressGuarantee::wait_free,
          consistency,
          false,
          "must be seen failing"};
}

/// A record is put at the head by exchange and linked to the rest afterwards: between the two, a query that
/// starts at the head misses everything older.
template <class Sync>
class ExchangeThenLinkList : public Slots<Sync> {
  using Base = Slots<Sync>;
  using typename Base::SharedWord, typename Base::Slot;

 public:
  using typename Base::Workspace;
  static constexpr CacheTraits kTraits =
      broken_traits("exchange_then_link", Consistency::per_record_linearizable);
  using Base::Base;

  template <class Counters>
  bool insert(Workspace&, const Record& r, Counters&) noexcept {
    const std::uint32_t i = this->take();
    this->publish(this->slot(i), r);
    this->slot(i).next.store(head_.exchange(i, std::memory_order_acq_rel), std::memory_order_release);
    return true;
  }
  template <class Counters, class F>
  void visit(const SurfacePoint& x, float a, Counters&, F&& f) noexcept {
    std::uint32_t i = head_.load(std::memory_order_acquire);
    for (; i != 0; i = this->slot(i).next.load(std::memory_order_acquire)) this->test(this->slot(i), x, a, f);
  }
  void clear() {
    Base::clear();
    head_.store(0, std::memory_order_relaxed);
  }

 private:
  SharedWord head_{0};
};

/// A slot is marked ready and filled afterwards.
template <class Sync>
class PublishBeforeFillList : public Slots<Sync> {
  using Base = Slots<Sync>;
  using typename Base::SharedWord, typename Base::Slot;

 public:
  using typename Base::Workspace;
  static constexpr CacheTraits kTraits =
      broken_traits("publish_before_fill", Consistency::per_record_linearizable);
  using Base::Base;

  template <class Counters>
  bool insert(Workspace&, const Record& r, Counters&) noexcept {
    Slot& s = this->slot(this->take());
    this->write_place(s, r);
    s.ready.store(1, std::memory_order_release);
    this->write_light(s, r);
    return true;
  }
  template <class Counters, class F>
  void visit(const SurfacePoint& x, float a, Counters&, F&& f) noexcept {
    this->scan(this->taken(), x, a, f);
  }
};

/// Two counters: a slot is reserved by adding to `index`, filled, and reported by adding to `count`; readers
/// trust `size`, which is set to `index` whenever the counters meet. One writer that stalls hides everybody's
/// records, and a late writer of `size` takes back what an earlier one had shown.
template <class Sync>
class CounterAppendList : public Slots<Sync> {
  using Base = Slots<Sync>;
  using typename Base::SharedWord, typename Base::Slot;

 public:
  using typename Base::Workspace;
  static constexpr CacheTraits kTraits =
      broken_traits("counter_append", Consistency::per_record_linearizable);
  using Base::Base;

  template <class Counters>
  bool insert(Workspace&, const Record& r, Counters&) noexcept {
    this->add(r);
    const std::uint32_t count = count_.fetch_add(1, std::memory_order_acq_rel) + 1;
    const std::uint32_t index = this->taken();
    if (count == index) size_.store(index, std::memory_order_release);
    return true;
  }
  template <class Counters, class F>
  void visit(const SurfacePoint& x, float a, Counters&, F&& f) noexcept {
    this->scan(size_.load(std::memory_order_acquire), x, a, f);
  }
  void clear() {
    Base::clear();
    count_.store(0, std::memory_order_relaxed);
    size_.store(0, std::memory_order_relaxed);
  }

 private:
  SharedWord count_{0};
  SharedWord size_{0};
};

/// A batch loads all records before it looks at the marks that publish them: it may show what was half written then.
template <class Sync>
class BatchLoadsAheadList : public Slots<Sync> {
  using Base = Slots<Sync>;
  using typename Base::SharedWord, typename Base::Slot;

 public:
  using typename Base::Workspace;
  static constexpr CacheTraits kTraits =
      broken_traits("batch_loads_ahead", Consistency::per_record_linearizable);
  static constexpr std::size_t kBatch = 4;
  using Base::Base;

  template <class Counters>
  bool insert(Workspace&, const Record& r, Counters&) noexcept {
    Slot& s = this->slot(this->take());
    this->write_place(s, r);
    this->write_light(s, r);
    s.ready.store(1, std::memory_order_release);
    return true;
  }
  template <class Counters, class F>
  void visit(const SurfacePoint& x, float a, Counters&, F&& f) noexcept {
    this->scan(this->taken(), x, a, f);
  }
  template <class Counters, class Visitors>
  void visit_batch(std::span<const SurfacePoint> points, float a, Counters&, Visitors visitors) noexcept {
    std::vector<Record> ahead(this->taken());
    for (std::uint32_t i = 0; i < ahead.size(); ++i) {
      Sync::reads(&this->slot(i + 1).record, sizeof(Record));
      ahead[i] = this->slot(i + 1).record;
    }
    for (std::uint32_t i = 0; i < ahead.size(); ++i) {
      if (this->slot(i + 1).ready.load(std::memory_order_acquire) == 0) continue;
      for (std::size_t k = 0; k < points.size(); ++k) {
        const float weight = split_sphere_weight(points[k], ahead[i], a);
        if (weight > 0.0f) visitors[k](static_cast<const Record&>(ahead[i]), weight);
      }
    }
  }
};

/// A batch looks no further than the list reached when the last batch was done.
template <class Sync>
class BatchKeepsExtentList : public Slots<Sync> {
  using Base = Slots<Sync>;
  using typename Base::SharedWord, typename Base::Slot;

 public:
  using typename Base::Workspace;
  static constexpr CacheTraits kTraits =
      broken_traits("batch_keeps_extent", Consistency::per_record_linearizable);
  static constexpr std::size_t kBatch = 4;
  using Base::Base;

  template <class Counters>
  bool insert(Workspace&, const Record& r, Counters&) noexcept {
    this->add(r);
    return true;
  }
  template <class Counters, class F>
  void visit(const SurfacePoint& x, float a, Counters&, F&& f) noexcept {
    this->scan(this->taken(), x, a, f);
  }
  template <class Counters, class Visitors>
  void visit_batch(std::span<const SurfacePoint> points, float a, Counters&, Visitors visitors) noexcept {
    const std::uint32_t end = extent_.load(std::memory_order_acquire);
    for (std::size_t k = 0; k < points.size(); ++k) {
      auto&& visitor = visitors[k];
      this->scan(end, points[k], a, visitor);
    }
    extent_.store(this->taken(), std::memory_order_release);
  }
  void clear() {
    Base::clear();
    extent_.store(0, std::memory_order_relaxed);
  }

 private:
  SharedWord extent_{0};
};

/// A structure for one thread, as locks wrap them.
template <class Sync>
class UnsharedList {
 public:
  static constexpr std::string_view kPrefix = "", kStructure = "list";
  static constexpr CacheTraits kTraits{"unshared_list",
                                       kStructure,
                                       "none",
                                       ProgressGuarantee::wait_free,
                                       ProgressGuarantee::wait_free,
                                       Consistency::linearizable,
                                       true,
                                       "part of a broken cache"};
  using SharedSync = Sync;
  struct Workspace {};

  explicit UnsharedList(const CacheConfig& config)
      : records_(std::make_unique<Record[]>(config.capacity)), capacity_(config.capacity) {}

  template <class Counters>
  bool insert(Workspace&, const Record& r, Counters&) noexcept {
    const std::uint32_t i = count_.load(std::memory_order_relaxed);  // relaxed, as below: ordinary memory
    if (i >= capacity_) return false;
    Sync::writes(&records_[i], sizeof r);
    records_[i] = r;
    count_.store(i + 1, std::memory_order_relaxed);
    return true;
  }
  template <class Counters, class F>
  void visit(const SurfacePoint& x, float a, Counters&, F&& f) noexcept {
    const std::uint32_t end = count_.load(std::memory_order_relaxed);
    for (std::uint32_t i = 0; i < end; ++i) {
      Sync::reads(&records_[i], sizeof records_[i]);
      const float weight = split_sphere_weight(x, records_[i], a);
      if (weight > 0.0f) f(static_cast<const Record&>(records_[i]), weight);
    }
  }
  template <class F>
  void update(F&& f) {
    std::uint32_t kept = 0;
    for (std::uint32_t i = 0; i < count_.load(std::memory_order_relaxed); ++i) {
      if (f(records_[i]) == UpdateResult::keep) records_[kept++] = records_[i];
    }
    count_.store(kept, std::memory_order_relaxed);
  }
  template <class F>
  void for_each(F&& f) const {
    for (std::uint32_t i = 0; i < count_.load(std::memory_order_relaxed); ++i)
      f(static_cast<const Record&>(records_[i]));
  }
  void clear() { count_.store(0, std::memory_order_relaxed); }
  std::uint64_t room(std::uint64_t /*live*/) const noexcept {
    return capacity_ - count_.load(std::memory_order_relaxed);
  }
  void prefault(Workspace&, std::uint32_t) noexcept {}
  void touch(std::uint32_t, std::uint32_t) noexcept {}
  static std::size_t bytes(const Workspace&) noexcept { return 0; }

 private:
  std::unique_ptr<Record[]> records_;
  std::uint32_t capacity_;
  typename Sync::template Atomic<std::uint32_t> count_{0};
};

/// Takes the lock and lets go of it before anything is done under it.
template <class Sync>
struct EarlyRelease {
  static constexpr std::string_view kName = "lock_released_early", kSource = "must be seen failing";
  using Mutex = SpinLock<Sync>;
  struct Scope {
    template <class Counters>
    Scope(Mutex& mutex, Counters&) noexcept {
      mutex.lock();
      mutex.unlock();
    }
  };
  using Read = Scope;
  using Write = Scope;
};

/// Readers and writers of the distributed lock that may both miss each other: each stores its own word and then loads
/// the other's, and a load may be done before a store that precedes it.
struct AcquireRelease {
  static constexpr std::memory_order kStore = std::memory_order_release, kLoad = std::memory_order_acquire;
};
/// The same though one half of the steps is sequentially consistent.
struct OrderedLoads {
  static constexpr std::memory_order kStore = std::memory_order_release, kLoad = std::memory_order_seq_cst;
};
struct OrderedStores {
  static constexpr std::memory_order kStore = std::memory_order_seq_cst, kLoad = std::memory_order_acquire;
};

template <class Sync>
using ExchangeThenLink = Direct<ExchangeThenLinkList<Sync>>;
template <class Sync>
using PublishBeforeFill = Direct<PublishBeforeFillList<Sync>>;
template <class Sync>
using CounterAppend = Direct<CounterAppendList<Sync>>;
template <class Sync>
using BatchLoadsAhead = Direct<BatchLoadsAheadList<Sync>>;
template <class Sync>
using BatchKeepsExtent = Direct<BatchKeepsExtentList<Sync>>;
template <class Sync, class Plain>
using LockReleasedEarly = Locked<UnsharedList<Plain>, EarlyRelease<Sync>>;
template <class Sync, class Plain>
using LockWithoutOrder = Locked<UnsharedList<Plain>, DistributedRw<Sync, AcquireRelease>>;
template <class Sync, class Plain>
using LockStoresLate = Locked<UnsharedList<Plain>, DistributedRw<Sync, OrderedLoads>>;
template <class Sync, class Plain>
using LockLoadsEarly = Locked<UnsharedList<Plain>, DistributedRw<Sync, OrderedStores>>;

}  // namespace icbench::stress
