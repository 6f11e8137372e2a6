// Broken caches made of shipping ones: Ward's tree and the packed octree over Sync policies that do not keep their
// word, and wrappers that lose something at a quiescent point. Each must be seen failing. Templates over the Sync
// policy, as those on lists are.
#pragma once

#include <optional>
#include <vector>

#include "caches/direct.h"
#include "caches/local_write.h"
#include "caches/packed_octree.h"
#include "caches/ward_tree.h"

namespace icbench::stress {

/// Every order relaxed: nothing is published. Stores stay in order on x86, so a history cannot show it there; on ARM it
/// can, and the schedule explorer anywhere.
template <class T, class Sync>
class RelaxedAtomic : public Sync::template Atomic<T> {
  using Base = typename Sync::template Atomic<T>;

 public:
  using Base::Base;
  T load(std::memory_order) const noexcept { return Base::load(std::memory_order_relaxed); }
  void store(T value, std::memory_order) noexcept { Base::store(value, std::memory_order_relaxed); }
  T fetch_add(T n, std::memory_order) noexcept { return Base::fetch_add(n, std::memory_order_relaxed); }
  bool compare_exchange_strong(T& expected, T desired, std::memory_order, std::memory_order) noexcept {
    return Base::compare_exchange_strong(expected, desired, std::memory_order_relaxed,
                                         std::memory_order_relaxed);
  }
};

template <class Sync>
struct RelaxedSync : Sync {
  template <class T>
  using Atomic = RelaxedAtomic<T, Sync>;
};

/// Additions publish nothing: what a packed cell's mask shows, its lanes' words, where they are and the records behind
/// them, has only been written where the processor keeps stores in order.
template <class T, class Sync>
class RelaxedAdditionAtomic : public Sync::template Atomic<T> {
  using Base = typename Sync::template Atomic<T>;

 public:
  using Base::Base;
  T fetch_add(T n, std::memory_order) noexcept { return Base::fetch_add(n, std::memory_order_relaxed); }
};

template <class Sync>
struct RelaxedAdditionSync : Sync {
  template <class T>
  using Atomic = RelaxedAdditionAtomic<T, Sync>;
};

/// What is installed by a compare-exchange is published no further than that it is there: not that its memory has been
/// set to zero. Records are, by their marks.
template <class T, class Sync>
class RelaxedInstallAtomic : public Sync::template Atomic<T> {
  using Base = typename Sync::template Atomic<T>;

 public:
  using Base::Base;
  bool compare_exchange_strong(T& expected, T desired, std::memory_order,
                               std::memory_order failure) noexcept {
    return Base::compare_exchange_strong(expected, desired, std::memory_order_relaxed, failure);
  }
};

template <class Sync>
struct RelaxedInstallSync : Sync {
  template <class T>
  using Atomic = RelaxedInstallAtomic<T, Sync>;
};

/// Children and chunks are installed by a test and a plain store: of two threads that find a link empty, one
/// overwrites the other's node.
template <class T, class Sync>
class StoreAtomic : public Sync::template Atomic<T> {
  using Base = typename Sync::template Atomic<T>;

 public:
  using Base::Base;
  bool compare_exchange_strong(T& expected, T desired, std::memory_order success,
                               std::memory_order failure) noexcept {
    const T old = Base::load(failure);
    if (old != expected) {
      expected = old;
      return false;
    }
    Base::store(desired, success);
    return true;
  }
};

template <class Sync>
struct StoreSync : Sync {
  template <class T>
  using Atomic = StoreAtomic<T, Sync>;
};

/// The loser of an installing CAS believes it has won and goes on in its own node, which nobody can reach.
template <class T, class Sync>
class NeverLosingAtomic : public Sync::template Atomic<T> {
  using Base = typename Sync::template Atomic<T>;

 public:
  using Base::Base;
  bool compare_exchange_strong(T& expected, T desired, std::memory_order success,
                               std::memory_order failure) noexcept {
    Base::compare_exchange_strong(expected, desired, success, failure);
    return true;
  }
};

template <class Sync>
struct NeverLosingSync : Sync {
  template <class T>
  using Atomic = NeverLosingAtomic<T, Sync>;
};

/// Does not count a record as there when the local structures are merged: the last.
template <class Plain>
class ForgetfulTree : public WardTree<Plain> {
 public:
  using WardTree<Plain>::WardTree;
  template <class F>
  void for_each(F&& f) const {
    std::optional<Record> held_back;
    WardTree<Plain>::for_each([&](const Record& r) {
      if (held_back) f(*held_back);
      held_back = r;
    });
  }
};

/// Clearing leaves one record behind.
template <class Sync>
class LeakyTree : public WardTree<Sync> {
  using Base = WardTree<Sync>;

 public:
  using Base::Base;
  void clear() {
    std::optional<Record> survivor;
    Base::for_each([&](const Record& r) { survivor = r; });
    Base::clear();
    typename Base::Workspace workspace;
    NoCounters counters;
    if (survivor) Base::insert(workspace, *survivor, counters);
  }
};

/// Tidying loses a record: the last.
template <class Sync>
class TidyDropsLast : public Direct<WardTree<Sync>> {
  using Base = Direct<WardTree<Sync>>;

 public:
  using Base::Base;
  void tidy() {
    Base::tidy();
    std::optional<std::uint32_t> last;
    Base::for_each_record([&](const Record& r) { last = r.id; });
    Base::update_records(
        [&](Record& r) noexcept { return r.id == last ? UpdateResult::drop : UpdateResult::keep; });
  }
};

/// A record is marked by a relaxed store: who sees the mark does not know of all that the insert did before, as the
/// record's lanes in other cells.
struct UnorderedMarks {
  static constexpr bool kIsSnapshot = false;

  template <class Sync>
  class In : public AtFirstSight::In<Sync> {
   public:
    void publish(typename AtFirstSight::In<Sync>::Mark& mark) noexcept {
      mark.word.store(1, std::memory_order_relaxed);
    }
  };
};

/// A query reads the clock when it meets a record, instead of before the first list: what was stamped since is seen
/// here and missed in the lists that it has left behind.
struct LateClock {
  static constexpr bool kIsSnapshot = true;

  template <class Sync>
  class In : public Snapshot::In<Sync> {
    using Base = Snapshot::In<Sync>;

   public:
    struct Moment {};
    Moment moment() const noexcept { return {}; }
    bool shows(typename Base::Mark& mark, Moment) noexcept { return Base::shows(mark, Base::moment()); }
  };
};

/// A query passes over a record that is pending and does not stamp it: its tick may be drawn already, before the query
/// read the clock.
struct NoHelp {
  static constexpr bool kIsSnapshot = true;

  template <class Sync>
  class In : public Snapshot::In<Sync> {
    using Base = Snapshot::In<Sync>;

   public:
    bool shows(typename Base::Mark& mark, typename Base::Moment moment) noexcept {
      constexpr std::uint64_t kUnstamped = 1;
      const std::uint64_t stamp = mark.word.load(std::memory_order_acquire /* P1, P5 */);
      return stamp > kUnstamped && stamp - 1 <= moment;
    }
  };
};

template <class Sync>
using RelaxedPublication = Direct<WardTree<RelaxedSync<Sync>>>;
template <class Sync>
using InstalledUnordered = Direct<WardTree<RelaxedInstallSync<Sync>>>;
template <class Sync>
using CellsUnordered = Direct<Packed<RelaxedInstallSync<Sync>>>;
template <class Sync>
using LanesUnpublished = Direct<Packed<RelaxedAdditionSync<Sync>>>;
template <class Sync>
using MarksUnordered = Direct<Packed<Sync, UnorderedMarks>>;
template <class Sync>
using PlainStoreInstall = Direct<WardTree<StoreSync<Sync>>>;
template <class Sync>
using ChildInstalledTwice = Direct<WardTree<NeverLosingSync<Sync>>>;
template <class Sync>
using ClockReadLate = Direct<WardTree<Sync, NoNodeLock, LateClock>>;
template <class Sync>
using PendingNotHelped = Direct<WardTree<Sync, NoNodeLock, NoHelp>>;
template <class Sync, class Plain>
using MergeDropsLast = LocalWrite<WardTree<Sync>, ForgetfulTree<Plain>>;
template <class Sync>
using ClearLeavesOne = Direct<LeakyTree<Sync>>;

}  // namespace icbench::stress
