// Broken caches that keep a record twice. Each must be seen failing, as those of lists.h, of which they are made.
#pragma once

#include <cstdint>

#include "stress/broken/lists.h"

namespace icbench::stress {

/// A list and a second one, into which every record is copied when it is in the first.
template <class Sync>
class TwoLists : public Slots<Sync> {
  using Base = Slots<Sync>;

 public:
  using typename Base::Workspace;

  explicit TwoLists(const CacheConfig& config) : Base(config), second_(config) {}

  template <class Counters>
  bool insert(Workspace&, const Record& r, Counters&) noexcept {
    this->add(r);
    second_.add(r);
    return true;
  }
  void clear() {
    Base::clear();
    second_.clear();
  }

 protected:
  struct List : Base {
    using Base::add, Base::Base, Base::scan, Base::taken;
  };
  List second_;
};

/// Queries take turns in which list they read: a copy is seen while the other is not there yet. That is regular, but no
/// more.
template <class Sync>
class ReplicatedList : public TwoLists<Sync> {
  using Base = TwoLists<Sync>;

 public:
  static constexpr CacheTraits kTraits =
      broken_traits("replicated_without_commit", Consistency::per_record_linearizable);
  using Base::Base;

  template <class Counters, class F>
  void visit(const SurfacePoint& x, float a, Counters&, F&& f) noexcept {
    // Relaxed: any distribution of queries over the lists will do.
    if ((turn_.fetch_add(1, std::memory_order_relaxed) & 1) != 0)
      this->second_.scan(this->second_.taken(), x, a, f);
    else
      this->scan(this->taken(), x, a, f);
  }
  template <class F>
  void update(F&& f) {
    Base::update(f);
    this->second_.update(f);
  }
  void clear() {
    Base::clear();
    turn_.store(0, std::memory_order_relaxed);
  }

 private:
  typename Sync::template Atomic<std::uint32_t> turn_{0};
};

/// Queries read the second list. An update that drops something makes it anew; one that only changes records leaves it
/// as it was.
template <class Sync>
class UpdateKeepsCopiesList : public TwoLists<Sync> {
  using Base = TwoLists<Sync>;

 public:
  static constexpr CacheTraits kTraits =
      broken_traits("update_keeps_copies", Consistency::per_record_linearizable);
  using Base::Base;

  template <class Counters, class F>
  void visit(const SurfacePoint& x, float a, Counters&, F&& f) noexcept {
    this->second_.scan(this->second_.taken(), x, a, f);
  }
  template <class F>
  void update(F&& f) {
    bool dropped = false;
    Base::update([&](Record& r) {
      const UpdateResult verdict = f(r);
      dropped |= verdict == UpdateResult::drop;
      return verdict;
    });
    if (!dropped) return;
    this->second_.clear();
    this->for_each([&](const Record& r) { this->second_.add(r); });
  }
};

template <class Sync>
using ReplicatedWithoutCommit = Direct<ReplicatedList<Sync>>;
template <class Sync>
using UpdateKeepsCopies = Direct<UpdateKeepsCopiesList<Sync>>;

}  // namespace icbench::stress
