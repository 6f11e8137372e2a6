// Broken caches made of shipping ones: Ward's tree over Sync policies that do not keep their word, and
// wrappers that lose something at a quiescent point. Each must be seen failing.
#pragma once

#include <optional>
#include <vector>

#include "caches/direct.h"
#include "caches/local_write.h"
#include "caches/ward_tree.h"
#include "stress/delay_sync.h"

namespace icbench::stress {

/// Every order relaxed: nothing is published. Stores stay in order on x86, so a history cannot show it there;
/// on ARM it can.
template <class T>
class RelaxedAtomic : public DelayAtomic<T, StdAtomic> {
  using Base = DelayAtomic<T, StdAtomic>;

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

struct RelaxedSync : NoHooks {
  template <class T>
  using Atomic = RelaxedAtomic<T>;
  static constexpr bool kConcurrent = true;
};

/// Children and chunks are installed by a test and a plain store: of two threads that find a link empty, one
/// overwrites the other's node.
template <class T>
class StoreAtomic : public DelayAtomic<T, StdAtomic> {
  using Base = DelayAtomic<T, StdAtomic>;

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

struct StoreSync : NoHooks {
  template <class T>
  using Atomic = StoreAtomic<T>;
  static constexpr bool kConcurrent = true;
};

/// The loser of an installing CAS believes it has won and goes on in its own node, which nobody can reach.
template <class T>
class NeverLosingAtomic : public DelayAtomic<T, StdAtomic> {
  using Base = DelayAtomic<T, StdAtomic>;

 public:
  using Base::Base;
  bool compare_exchange_strong(T& expected, T desired, std::memory_order success,
                               std::memory_order failure) noexcept {
    Base::compare_exchange_strong(expected, desired, success, failure);
    return true;
  }
};

struct NeverLosingSync : NoHooks {
  template <class T>
  using Atomic = NeverLosingAtomic<T>;
  static constexpr bool kConcurrent = true;
};

/// Does not count a record as there when the local structures are merged: the last.
class ForgetfulTree : public WardTree<PlainSync> {
 public:
  using WardTree<PlainSync>::WardTree;
  template <class F>
  void for_each(F&& f) const {
    std::optional<Record> held_back;
    WardTree<PlainSync>::for_each([&](const Record& r) {
      if (held_back) f(*held_back);
      held_back = r;
    });
  }
};

/// Clearing leaves one record behind.
class LeakyTree : public WardTree<DelaySync> {
  using Base = WardTree<DelaySync>;

 public:
  using Base::Base;
  void clear() {
    std::optional<Record> survivor;
    Base::for_each([&](const Record& r) { survivor = r; });
    Base::clear();
    Workspace workspace;
    NoCounters counters;
    if (survivor) Base::insert(workspace, *survivor, counters);
  }
};

using RelaxedPublication = Direct<WardTree<RelaxedSync>>;
using PlainStoreInstall = Direct<WardTree<StoreSync>>;
using ChildInstalledTwice = Direct<WardTree<NeverLosingSync>>;
using MergeDropsLast = LocalWrite<WardTree<DelaySync>, ForgetfulTree>;
using ClearLeavesOne = Direct<LeakyTree>;

}  // namespace icbench::stress
