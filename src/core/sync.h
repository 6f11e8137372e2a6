// Where a structure's shared words live: the policy that turns one structure into its wait-free form, its
// unsynchronised twin, or a form whose every step a test controls.
//
// A policy offers `template <class T> using Atomic`, with load, store, fetch_add and compare_exchange_strong
// that take explicit memory orders. All-zero bytes must be a valid Atomic<T> of value 0: structures live in
// zeroed pool memory. It also has the hooks of `NoHooks`, by which tests see what atomics do not show.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <thread>

namespace icbench {

/// Tells the core that this is a spin loop.
inline void spin_pause() noexcept {
#if defined(__x86_64__)
  __builtin_ia32_pause();
#elif defined(__aarch64__)
  asm volatile("yield");
#endif
}

/// The hooks of a policy, doing nothing.
struct NoHooks {
  /// Ordinary memory that atomics publish is about to be read or written.
  static constexpr void reads(const void*, std::size_t) noexcept {}
  static constexpr void writes(const void*, std::size_t) noexcept {}
  /// Memory that nobody else has been told of, atomic words and other, has been set to zero.
  static constexpr void zeroes(const void*, std::size_t) noexcept {}

  /// A query has read how far a list reaches, `items` items, and will read no more of it than that.
  static constexpr void extent(std::uint32_t) noexcept {}

  /// Whether a pool may hand out memory that it has; a test may say no.
  static constexpr bool may_allocate() noexcept { return true; }
  /// Whether it has whole pieces for sessions; without, each allocation has to go to it by itself, and each insert for
  /// its ticket.
  static constexpr bool may_take_pieces() noexcept { return true; }

  /// A loop that may wait for another thread begins. What it does before its first wait_turn is its first turn.
  static constexpr void begin_waiting() noexcept {}

  /// Turn number `turn` of a loop that waits for another thread. Yields the processor after a bounded spin, so that
  /// whoever is waited for can run.
  static void wait_turn(unsigned turn) noexcept {
    constexpr unsigned kSpins = 256;
    if (turn < kSpins) {
      spin_pause();
    } else {
      std::this_thread::yield();
    }
  }
};

/// Shared by threads: std::atomic.
struct StdSync : NoHooks {
  template <class T>
  using Atomic = std::atomic<T>;
  static constexpr bool kConcurrent = true;
};

/// std::atomic's interface over ordinary memory. For one thread, or under a lock.
template <class T>
class PlainAtomic {
 public:
  PlainAtomic() noexcept = default;
  explicit(false) PlainAtomic(T value) noexcept : value_(value) {}

  T load(std::memory_order) const noexcept { return value_; }
  void store(T value, std::memory_order) noexcept { value_ = value; }
  T fetch_add(T n, std::memory_order) noexcept {
    const T old = value_;
    value_ = static_cast<T>(value_ + n);
    return old;
  }
  bool compare_exchange_strong(T& expected, T desired, std::memory_order, std::memory_order) noexcept {
    if (value_ == expected) {
      value_ = desired;
      return true;
    }
    expected = value_;
    return false;
  }

 private:
  T value_{};
};

/// Ordinary memory: the unsynchronised twin of a structure.
struct PlainSync : NoHooks {
  template <class T>
  using Atomic = PlainAtomic<T>;
  static constexpr bool kConcurrent = false;
};

static_assert(sizeof(std::atomic<std::uint32_t>) == 4 && sizeof(PlainAtomic<std::uint32_t>) == 4,
              "the twins must have one memory layout, or comparing them says nothing");

/// Distance at which two threads' data do not share a cache line, adjacent-line prefetch included (x86, ARM).
/// Bytes.
inline constexpr std::size_t kNoSharing = 128;

}  // namespace icbench
