// Broken caches that keep a record twice. Each must be seen failing, as those of lists.h, of which they are made.
#pragma once

#include <memory>

#include "stress/broken/lists.h"

namespace icbench::stress {

/// A record is copied into two lists, one after the other, and queries take turns in which one they read: a
/// copy is seen while the other is not there yet. That is regular, but no more.
template <class Sync>
class ReplicatedList : public Slots<Sync> {
  using Base = Slots<Sync>;
  using typename Base::SharedWord, typename Base::Slot;

 public:
  using typename Base::Workspace;
  static constexpr CacheTraits kTraits =
      broken_traits("replicated_without_commit", Consistency::per_record_linearizable);

  explicit ReplicatedList(const CacheConfig& config) : Base(config), second_(config) {}

  template <class Counters>
  bool insert(Workspace& workspace, const Record& r, Counters& counters) noexcept {
    this->publish(this->slot(this->take()), r);
    return second_.insert(workspace, r, counters);
  }
  template <class Counters, class F>
  void visit(const SurfacePoint& x, float a, Counters& counters, F&& f) noexcept {
    // Relaxed: any distribution of queries over the lists will do.
    if ((turn_.fetch_add(1, std::memory_order_relaxed) & 1) != 0) return second_.visit(x, a, counters, f);
    this->scan(this->taken(), x, a, f);
  }
  template <class F>
  void update(F&& f) {
    Base::update(f);
    second_.update(f);
  }
  void clear() {
    Base::clear();
    second_.clear();
    turn_.store(0, std::memory_order_relaxed);
  }

 private:
  /// The second copy; also a list that is right.
  class Copy : public Base {
   public:
    using Base::Base;
    template <class Counters>
    bool insert(Workspace&, const Record& r, Counters&) noexcept {
      this->publish(this->slot(this->take()), r);
      return true;
    }
    template <class Counters, class F>
    void visit(const SurfacePoint& x, float a, Counters&, F&& f) noexcept {
      const std::uint32_t end = this->taken();
      for (std::uint32_t i = 1; i <= end; ++i) this->test(this->slot(i), x, a, f);
    }
  };

  Copy second_;
  SharedWord turn_{0};
};

/// Queries read copies of the records. An update that drops something makes all copies anew; one that only changes
/// records leaves those as they were.
template <class Sync>
class UpdateKeepsCopiesList : public Slots<Sync> {
  using Base = Slots<Sync>;
  using typename Base::Slot;

 public:
  using typename Base::Workspace;
  static constexpr CacheTraits kTraits =
      broken_traits("update_keeps_copies", Consistency::per_record_linearizable);

  explicit UpdateKeepsCopiesList(const CacheConfig& config)
      : Base(config), copies_(std::make_unique<Slot[]>(config.capacity + 1)) {}

  template <class Counters>
  bool insert(Workspace&, const Record& r, Counters&) noexcept {
    const std::uint32_t i = this->take();
    this->publish(this->slot(i), r);
    this->publish(copies_[i], r);
    return true;
  }
  template <class Counters, class F>
  void visit(const SurfacePoint& x, float a, Counters&, F&& f) noexcept {
    const std::uint32_t end = this->taken();
    for (std::uint32_t i = 1; i <= end; ++i) this->test(copies_[i], x, a, f);
  }
  template <class F>
  void update(F&& f) {
    bool dropped = false;
    Base::update([&](Record& r) {
      const UpdateResult verdict = f(r);
      dropped |= verdict == UpdateResult::drop;
      return verdict;
    });
    if (dropped) copy_all();
  }
  void clear() {
    Base::clear();
    for (std::uint32_t i = 0; i <= this->capacity(); ++i) {
      copies_[i].record = {};
      copies_[i].ready.store(0, std::memory_order_relaxed);
    }
  }

 private:
  void copy_all() {
    for (std::uint32_t i = 1; i <= this->taken(); ++i) {
      const Slot& s = this->slot(i);
      copies_[i].record = s.record;
      copies_[i].ready.store(s.ready.load(std::memory_order_relaxed), std::memory_order_relaxed);
    }
  }

  std::unique_ptr<Slot[]> copies_;
};

template <class Sync>
using ReplicatedWithoutCommit = Direct<ReplicatedList<Sync>>;
template <class Sync>
using UpdateKeepsCopies = Direct<UpdateKeepsCopiesList<Sync>>;

}  // namespace icbench::stress
