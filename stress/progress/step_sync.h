// Policies under which every atomic step of the shipping code is counted and may be the last of its fiber.
//
// StepSync and StepPlainSync stand for StdSync and PlainSync (core/sync.h): on a stage (progress/stage.h) each
// operation on an atomic word is one step and a point; off it they are std::atomic. Memory that is about to be written
// is filled with rubbish first, as memory half written would be.
//
// The spin lock and the node locks are the shipping code on these words. Locks of the standard library and of oneTBB
// cannot be stopped between their steps; models that block in the same cases take their places:
//
//   std::mutex           the spin lock: whoever asks when it is free gets it
//   tbb::queuing_mutex   a ticket lock: in order of arrival, so one that stops in the queue stops all behind it
//   std::shared_mutex    readers share; a writer that waits does not hold them up (glibc's default)
//   tbb::spin_rw_mutex   readers share; a writer that waits keeps new ones out
//   any other            the spin lock, or readers share if its policy reads by another scope than it writes
#pragma once

#include <atomic>
#include <cstring>
#include <type_traits>

#include "caches/locks.h"
#include "core/sync.h"
#include "stress/foreign_locks.h"
#include "stress/hooked_atomic.h"
#include "stress/progress/stage.h"
#include "stress/rebind.h"

namespace icbench::stress {

template <class T>
using StepAtomic = HookedAtomic<T, std::atomic<T>, Stage>;
static_assert(sizeof(StepAtomic<std::uint32_t>) == 4 && sizeof(StepAtomic<std::uint64_t>) == 8,
              "counting must not change a structure's layout");

struct StepHooks : NoHooks {
  static void reads(const void*, std::size_t) noexcept { Stage::point(); }
  static void writes(const void* memory, std::size_t size) noexcept {
    if (!Stage::is_inside()) return;
    Stage::point();
    std::memset(const_cast<void*>(memory), 0xee, size);
    Stage::point();
  }
  static bool may_take_pieces() noexcept { return Stage::may_take_pieces(); }
  static void extent(std::uint32_t items) { Stage::extent(items); }
  static void wait_turn(unsigned turn) noexcept {
    if (Stage::is_inside()) {
      Stage::wait();
    } else {
      NoHooks::wait_turn(turn);
    }
  }
};

struct StepSync : StepHooks {
  template <class T>
  using Atomic = StepAtomic<T>;
  static constexpr bool kConcurrent = true;
};

struct StepPlainSync : StepHooks {
  template <class T>
  using Atomic = StepAtomic<T>;
  static constexpr bool kConcurrent = false;
};

/// Model of tbb::queuing_mutex.
class StepQueueLock {
 public:
  void lock() noexcept {
    const std::uint32_t ticket = next_.fetch_add(1, std::memory_order_relaxed);
    for (unsigned turn = 0; serving_.load(std::memory_order_acquire) != ticket; ++turn)
      StepSync::wait_turn(turn);
    held_ = ticket;
  }
  bool try_lock() noexcept {
    std::uint32_t serving = serving_.load(std::memory_order_acquire);
    if (!next_.compare_exchange_strong(serving, serving + 1, std::memory_order_acquire,
                                       std::memory_order_relaxed))
      return false;
    held_ = serving;
    return true;
  }
  void unlock() noexcept { serving_.store(held_ + 1, std::memory_order_release); }

 private:
  StepAtomic<std::uint32_t> next_{0};
  StepAtomic<std::uint32_t> serving_{0};
  std::uint32_t held_ = 0;  // ticket of the holder, which alone uses it
};

/// Model of the readers-writer locks.
template <bool kWritersFirst>
class StepRwLock {
 public:
  void lock() noexcept {
    for (unsigned turn = 0; !try_lock(); ++turn) {
      std::uint32_t word = word_.load(std::memory_order_relaxed);
      if (kWritersFirst && (word & kWaiting) == 0 && (word & ~kWaiting) != 0) {
        word_.compare_exchange_strong(word, word | kWaiting, std::memory_order_relaxed,
                                      std::memory_order_relaxed);
        word = word_.load(std::memory_order_relaxed);
      }
      if ((word & ~kWaiting) != 0) StepSync::wait_turn(turn);
    }
  }
  bool try_lock() noexcept {
    std::uint32_t word = word_.load(std::memory_order_relaxed);
    return (word & ~kWaiting) == 0 &&
           word_.compare_exchange_strong(word, kWriter, std::memory_order_acquire, std::memory_order_relaxed);
  }
  void unlock() noexcept {
    for (std::uint32_t word = kWriter; !word_.compare_exchange_strong(
             word, word & kWaiting, std::memory_order_release, std::memory_order_relaxed);) {
    }
  }

  void lock_shared() noexcept {
    for (unsigned turn = 0; !try_lock_shared(); ++turn) {
      if ((word_.load(std::memory_order_relaxed) & kExclusive) != 0) StepSync::wait_turn(turn);
    }
  }
  bool try_lock_shared() noexcept {
    std::uint32_t word = word_.load(std::memory_order_relaxed);
    return (word & kExclusive) == 0 &&
           word_.compare_exchange_strong(word, word + 1, std::memory_order_acquire,
                                         std::memory_order_relaxed);
  }
  void unlock_shared() noexcept { word_.fetch_add(~std::uint32_t{0}, std::memory_order_release); }

 private:
  static constexpr std::uint32_t kWriter = 1u << 31;
  static constexpr std::uint32_t kWaiting = 1u << 30;  // a writer waits
  static constexpr std::uint32_t kExclusive = kWriter | (kWritersFirst ? kWaiting : 0u);

  StepAtomic<std::uint32_t> word_{0};  // the bits above, and the number of readers
};

template <class T>
struct WithSteps {
  using type = T;
};
template <>
struct WithSteps<StdSync> {
  using type = StepSync;
};
template <>
struct WithSteps<PlainSync> {
  using type = StepPlainSync;
};
template <ForeignLock T>
struct WithSteps<T> {
  using Lock = std::conditional_t<kReadersShare<T>, StepRwLock<false>, SpinLock<StepSync>>;
  using type =
      WithMutex<T, Lock, std::conditional_t<kReadersShare<T>, SharedScope<Lock>, ExclusiveScope<Lock>>,
                ExclusiveScope<Lock>>;
};
template <>
struct WithSteps<QueuingMutex> {
  using Scope = ExclusiveScope<StepQueueLock>;
  using type = WithMutex<QueuingMutex, StepQueueLock, Scope, Scope>;
};
template <>
struct WithSteps<SpinRwMutex> {
  using Lock = StepRwLock<true>;
  using type = WithMutex<SpinRwMutex, Lock, SharedScope<Lock>, ExclusiveScope<Lock>>;
};

/// `Cache` with its steps counted.
template <class Cache>
using Stepped = Rebound<Cache, WithSteps>;

}  // namespace icbench::stress
