// Policies under which every atomic step of the shipping code is counted and may be the last of its fiber.
//
// StepSync and StepPlainSync stand for StdSync and PlainSync (core/sync.h): on a stage (progress/stage.h) each operation
// on an atomic word is one step and a point; off it they are std::atomic. Memory that is about to be written is filled
// with rubbish first, as memory half written would be.
//
// The spin lock and the node locks are the shipping code on these words. Locks of the standard library and of oneTBB
// cannot be stopped between their steps; models that block in the same cases take their places:
//
//   std::mutex           the spin lock: whoever asks when it is free gets it
//   tbb::queuing_mutex   a ticket lock: in order of arrival, so one that stops in the queue stops all behind it
//   std::shared_mutex    readers share; a writer that waits does not hold them up (glibc's default)
//   tbb::spin_rw_mutex   readers share; a writer that waits keeps new ones out
#pragma once

#include <atomic>
#include <cstring>

#include "caches/locks.h"
#include "core/sync.h"
#include "stress/progress/stage.h"
#include "stress/rebind.h"

namespace icbench::stress {

template <class T>
class StepAtomic {
 public:
  StepAtomic() noexcept = default;
  explicit(false) StepAtomic(T value) noexcept : word_(value) {}

  T load(std::memory_order order) const noexcept {
    Stage::step();
    return word_.load(order);
  }
  void store(T value, std::memory_order order) noexcept {
    Stage::step();
    word_.store(value, order);
    Stage::wrote();
  }
  T fetch_add(T n, std::memory_order order) noexcept {
    Stage::step();
    Stage::wrote();
    return word_.fetch_add(n, order);
  }
  T exchange(T value, std::memory_order order) noexcept {
    Stage::step();
    Stage::wrote();
    return word_.exchange(value, order);
  }
  bool compare_exchange_strong(T& expected, T desired, std::memory_order success,
                               std::memory_order failure) noexcept {
    Stage::step();
    const bool is_stored = word_.compare_exchange_strong(expected, desired, success, failure);
    if (is_stored) Stage::wrote();
    return is_stored;
  }

 private:
  std::atomic<T> word_{};
};
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

template <class Policy, class Lock, template <class> class ReadScope>
struct StepPolicy : Policy {
  using Mutex = Lock;
  using Read = ReadScope<Lock>;
  using Write = ExclusiveScope<Lock>;
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
template <>
struct WithSteps<GlobalMutex> {
  using type = StepPolicy<GlobalMutex, SpinLock<StepSync>, ExclusiveScope>;
};
template <>
struct WithSteps<QueuingMutex> {
  using type = StepPolicy<QueuingMutex, StepQueueLock, ExclusiveScope>;
};
template <>
struct WithSteps<SharedMutex> {
  using type = StepPolicy<SharedMutex, StepRwLock<false>, SharedScope>;
};
template <>
struct WithSteps<SpinRwMutex> {
  using type = StepPolicy<SpinRwMutex, StepRwLock<true>, SharedScope>;
};

/// `Cache` with its steps counted.
template <class Cache>
using Stepped = Rebound<Cache, WithSteps>;

}  // namespace icbench::stress
