// Locks as policies: of Locked<Structure, Policy> (one lock around the cache) and of structures with a lock
// per node.
//
// A global policy names its Mutex and two scoped types, Read and Write, constructed from (Mutex&, Counters&). One whose
// sessions have a part of the lock each also names that, Reader; Read is then constructed from (Reader&, Counters&),
// and the mutex is told of every session's by admit(Reader&) before any of them is used.
// With counters on, a lock is tried once first, so that an acquisition that has to wait can be timed.
#pragma once

#include <oneapi/tbb/queuing_mutex.h>
#include <oneapi/tbb/spin_rw_mutex.h>

#include <chrono>
#include <mutex>
#include <shared_mutex>
#include <string_view>
#include <vector>

#include "core/counters.h"
#include "core/sync.h"

namespace icbench {

/// Acquires by `lock` and counts; `try_lock` is asked first when counters are on.
template <class Counters, class TryLock, class DoLock>
inline void acquire_counted(Counters& counters, TryLock&& try_lock, DoLock&& do_lock) noexcept {
  if constexpr (Counters::kOn) {
    counters.template add<&Counts::lock_acquisitions>(1);
    if (try_lock()) return;
    const auto start = std::chrono::steady_clock::now();
    do_lock();
    const auto waited = std::chrono::steady_clock::now() - start;
    counters.template add<&Counts::lock_contended>(1);
    counters.template add<&Counts::lock_wait_ns>(
        static_cast<std::uint64_t>(std::chrono::duration_cast<std::chrono::nanoseconds>(waited).count()));
  } else {
    do_lock();
  }
}

/// Test-and-test-and-set lock. Blocking and unfair. All-zero bytes are an unlocked lock.
///
/// Publication pair: L1 unlock store release -> lock CAS acquire; publishes what the holder wrote.
template <class Sync>
class SpinLock {
 public:
  bool try_lock() noexcept {
    std::uint32_t unlocked = 0;
    // Relaxed test and relaxed failure: only a successful acquisition reads what the lock protects.
    return word_.load(std::memory_order_relaxed) == 0 &&
           word_.compare_exchange_strong(unlocked, 1, std::memory_order_acquire /* L1 */,
                                         std::memory_order_relaxed);
  }

  void lock() noexcept {
    Sync::begin_waiting();
    for (unsigned turn = 0; !try_lock(); ++turn) Sync::wait_turn(turn);
  }

  void unlock() noexcept { word_.store(0, std::memory_order_release /* L1 */); }

 private:
  typename Sync::template Atomic<std::uint32_t> word_{0};
};

/// Orders of the accesses by which DistributedRwLock's readers and writers see each other. What else there could be is
/// there to be caught by the stress suite.
struct InOneOrder {
  static constexpr std::memory_order kStore = std::memory_order_seq_cst, kLoad = std::memory_order_seq_cst;
};

/// Readers-writer lock whose readers share no cache line: every session has a word of its own that says whether it is
/// reading, and a writer waits at all of them. Reading costs a read-modify-write of a line that is at hand, writing a
/// look at as many lines as there are sessions. These are the visible readers of BRAVO (Dice & Kogan, USENIX ATC 2019),
/// with a word a session where BRAVO hashes threads into a table and so needs a second lock for those that collide.
/// Blocking; a writer that waits keeps new readers out, and writers in a row may keep them out for long.
///
/// Writers exclude each other by the spin lock (L1). Of a reader and a writer one sees the other:
///
///   D1  try_lock_shared: store of `reading`, then load of `writing`; lock: store of `writing`, then loads of
///       `reading`. All sequentially consistent: in their one order either the reader's store is before the writer's
///       load, which sees it, or the writer's store is before the reader's load.
///   D2  unlock_shared, a try in vain: store release of `reading` -> lock: load of `reading`; what was read is
///       overwritten only after.
///   D3  unlock: store release of `writing` -> try_lock_shared: load of `writing`; publishes what the writer wrote.
template <class Sync, class Order = InOneOrder>
class DistributedRwLock {
  using Word = typename Sync::template Atomic<std::uint32_t>;

 public:
  /// A session's part. Its user sees to it that no two lie on one cache line.
  class Reader {
    friend DistributedRwLock;

   public:
    bool try_lock_shared() noexcept {
      reading_.store(1, Order::kStore /* D1 */);
      if (lock_->writing_.load(Order::kLoad /* D1, D3 */) == 0) return true;
      // Release though nothing was read: it hides the store of an unlock before it, in whose place it is seen.
      reading_.store(0, std::memory_order_release /* D2 */);
      return false;
    }
    void lock_shared() noexcept {
      Sync::begin_waiting();
      // The relaxed test keeps a reader that waits from holding the writer up.
      for (unsigned turn = 0; lock_->writing_.load(std::memory_order_relaxed) != 0 || !try_lock_shared();
           ++turn)
        Sync::wait_turn(turn);
    }
    void unlock_shared() noexcept { reading_.store(0, std::memory_order_release /* D2 */); }

   private:
    Word reading_{0};
    DistributedRwLock* lock_ = nullptr;
  };

  /// Makes `reader` one of the lock's. Before anybody uses it.
  void admit(Reader& reader) {
    reader.lock_ = this;
    readers_.push_back(&reader);
  }

  bool try_lock() noexcept {
    if (!writers_.try_lock()) return false;
    writing_.store(1, Order::kStore /* D1 */);
    for (const Reader* reader : readers_) {
      if (reader->reading_.load(Order::kLoad /* D1, D2 */) != 0) {
        unlock();
        return false;
      }
    }
    return true;
  }
  void lock() noexcept {
    writers_.lock();
    writing_.store(1, Order::kStore /* D1 */);
    for (const Reader* reader : readers_) {
      Sync::begin_waiting();
      for (unsigned turn = 0; reader->reading_.load(Order::kLoad /* D1, D2 */) != 0; ++turn)
        Sync::wait_turn(turn);
    }
  }
  void unlock() noexcept {
    writing_.store(0, std::memory_order_release /* D3 */);
    writers_.unlock();
  }

 private:
  Word writing_{0};
  SpinLock<Sync> writers_;
  std::vector<Reader*> readers_;
};

/// Exclusive ownership of anything with lock, try_lock and unlock.
template <class Mutex>
class ExclusiveScope {
 public:
  template <class Counters>
  ExclusiveScope(Mutex& mutex, Counters& counters) noexcept : mutex_(mutex) {
    acquire_counted(
        counters, [&] { return mutex.try_lock(); }, [&] { mutex.lock(); });
  }
  ~ExclusiveScope() { mutex_.unlock(); }
  ExclusiveScope(const ExclusiveScope&) = delete;
  ExclusiveScope& operator=(const ExclusiveScope&) = delete;

 private:
  Mutex& mutex_;
};

/// Shared ownership of anything with lock_shared, try_lock_shared and unlock_shared.
template <class Mutex>
class SharedScope {
 public:
  template <class Counters>
  SharedScope(Mutex& mutex, Counters& counters) noexcept : mutex_(mutex) {
    acquire_counted(
        counters, [&] { return mutex.try_lock_shared(); }, [&] { mutex.lock_shared(); });
  }
  ~SharedScope() { mutex_.unlock_shared(); }
  SharedScope(const SharedScope&) = delete;
  SharedScope& operator=(const SharedScope&) = delete;

 private:
  Mutex& mutex_;
};

/// Exclusive ownership of a lock whose waiters queue up in nodes of their own (oneTBB's scoped_lock
/// interface).
template <class Mutex>
class QueuedScope {
 public:
  template <class Counters>
  QueuedScope(Mutex& mutex, Counters& counters) noexcept {
    acquire_counted(
        counters, [&] { return node_.try_acquire(mutex); }, [&] { node_.acquire(mutex); });
  }

 private:
  typename Mutex::scoped_lock node_;
};

struct GlobalMutex {
  static constexpr std::string_view kName = "global_mutex", kSource = "Dubla 2012, 7.2.1 (LCK)";
  using Mutex = std::mutex;
  using Read = ExclusiveScope<Mutex>;
  using Write = ExclusiveScope<Mutex>;
};

template <class Sync = StdSync>
struct GlobalSpin {
  static constexpr std::string_view kName = "global_spin",
                                    kSource = "Dubla 2012, 7.2.1 (LCK), on a spin lock";
  using Mutex = SpinLock<Sync>;
  using Read = ExclusiveScope<Mutex>;
  using Write = ExclusiveScope<Mutex>;
};

struct QueuingMutex {
  static constexpr std::string_view kName = "queuing_mutex",
                                    kSource = "Dubla 2012, 7.2.1 (LCK), on oneTBB's queuing_mutex";
  using Mutex = tbb::queuing_mutex;
  using Read = QueuedScope<Mutex>;
  using Write = QueuedScope<Mutex>;
};

struct SharedMutex {
  static constexpr std::string_view kName = "shared_mutex",
                                    kSource = "readers-writer lock, as pbrt-v2 and Sunflow";
  using Mutex = std::shared_mutex;
  using Read = SharedScope<Mutex>;
  using Write = ExclusiveScope<Mutex>;
};

struct SpinRwMutex {
  static constexpr std::string_view kName = "spin_rw_mutex", kSource = "oneTBB's spin_rw_mutex";
  using Mutex = tbb::spin_rw_mutex;
  using Read = SharedScope<Mutex>;
  using Write = ExclusiveScope<Mutex>;
};

template <class Sync = StdSync, class Order = InOneOrder>
struct DistributedRw {
  static constexpr std::string_view kName = "distributed_rw",
                                    kSource = "visible readers of BRAVO (Dice & Kogan 2019)";
  using Mutex = DistributedRwLock<Sync, Order>;
  using Reader = typename Mutex::Reader;
  using Read = SharedScope<Reader>;
  using Write = ExclusiveScope<Mutex>;
};

/// What a session has of a lock: the policy's Reader, or nothing.
template <class Policy>
struct PartOfSession {
  struct type {};
  static constexpr bool kOn = false;
};
template <class Policy>
requires requires { typename Policy::Reader; }
struct PartOfSession<Policy> {
  using type = typename Policy::Reader;
  static constexpr bool kOn = true;
};

/// Per-node locking switched off: takes no memory and no time.
struct NoNodeLock {
  static constexpr bool kOn = false;
  /// Policy of the words that sessions share, in a structure whose nodes are under `Sync`.
  template <class Sync>
  using Shared = Sync;
  template <class Counters>
  struct Scope {
    Scope(NoNodeLock&, Counters&) noexcept {}
  };
};

/// One spin lock in every node of a structure.
template <class Sync = StdSync>
struct SpinNodeLock {
  static constexpr bool kOn = true;
  template <class>
  using Shared = Sync;
  SpinLock<Sync> lock;
  template <class Counters>
  struct Scope : ExclusiveScope<SpinLock<Sync>> {
    Scope(SpinNodeLock& node, Counters& counters) noexcept
        : ExclusiveScope<SpinLock<Sync>>(node.lock, counters) {}
  };
};

}  // namespace icbench
