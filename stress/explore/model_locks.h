// Locks of foreign libraries as the engine models them: one word each, held by one or read by several, acquire to lock,
// release to unlock. The scopes that the caches take them by are the shipping ones (caches/locks.h).
#pragma once

#include <type_traits>

#include "caches/locks.h"
#include "stress/explore/model_sync.h"
#include "stress/foreign_locks.h"
#include "stress/rebind.h"

namespace icbench::stress::explore {

/// Stands for any mutex, std::mutex, std::shared_mutex and oneTBB's spin_rw_mutex among them. For use inside executions
/// only.
class ModelMutex {
 public:
  void lock() noexcept { step(Access::Kind::lock, std::memory_order_acquire); }
  void unlock() noexcept { step(Access::Kind::unlock, std::memory_order_release); }
  void lock_shared() noexcept { step(Access::Kind::lock_shared, std::memory_order_acquire); }
  void unlock_shared() noexcept { step(Access::Kind::unlock_shared, std::memory_order_release); }
  bool try_lock() noexcept { return try_to(Access::kExclusive); }
  bool try_lock_shared() noexcept { return try_to(1); }

 private:
  Access access(Access::Kind kind, std::memory_order order) const noexcept {
    Access a;
    a.kind = kind;
    a.order = order;
    a.address = this;
    a.in_place = word_;
    return a;
  }
  void step(Access::Kind kind, std::memory_order order) noexcept {
    if (Engine::is_inside()) word_ = Engine::current().access(access(kind, order)).written;
  }
  /// Only from free: a reader that finds readers waits for its turn like anybody else.
  bool try_to(std::uint64_t value) noexcept {
    if (!Engine::is_inside()) return true;
    Access a = access(Access::Kind::compare_exchange, std::memory_order_acquire);
    a.operand = value;
    const Effect effect = Engine::current().access(a);
    if (effect.wrote) word_ = effect.written;
    return effect.wrote;
  }

  std::uint64_t word_ = 0;
};

/// Stands for oneTBB's queuing_mutex.
class ModelQueuingMutex {
 public:
  class scoped_lock {
   public:
    void acquire(ModelQueuingMutex& mutex) noexcept { (mutex_ = &mutex.lock_)->lock(); }
    bool try_acquire(ModelQueuingMutex& mutex) noexcept {
      if (!mutex.lock_.try_lock()) return false;
      mutex_ = &mutex.lock_;
      return true;
    }
    scoped_lock() noexcept = default;
    scoped_lock(const scoped_lock&) = delete;
    scoped_lock& operator=(const scoped_lock&) = delete;
    ~scoped_lock() {
      if (mutex_ != nullptr) mutex_->unlock();
    }

   private:
    ModelMutex* mutex_ = nullptr;
  };

 private:
  ModelMutex lock_;
};

using Exclusive = ExclusiveScope<ModelMutex>;
using Shared = SharedScope<ModelMutex>;
using Queued = QueuedScope<ModelQueuingMutex>;

template <class T>
struct Modelled {
  using type = T;
};
template <>
struct Modelled<StdSync> {
  using type = ModelSync;
};
template <>
struct Modelled<PlainSync> {
  using type = ModelPlainSync;
};
template <ForeignLock T>
struct Modelled<T> {
  using type = WithMutex<T, ModelMutex, std::conditional_t<kReadersShare<T>, Shared, Exclusive>, Exclusive>;
};
template <>
struct Modelled<QueuingMutex> {
  using type = WithMutex<QueuingMutex, ModelQueuingMutex, Queued, Queued>;
};

/// `Cache` in the hands of the engine.
template <class Cache>
using InModel = Rebound<Cache, Modelled>;

}  // namespace icbench::stress::explore
