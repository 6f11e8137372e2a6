// Sync policies (core/sync.h) that put a structure into the hands of the engine: every step on an atomic word is a
// point at which the schedule may change and an old value may be read.
//
// Outside an execution, at set-up and at rest, ModelAtomic is the std::atomic that it contains; memory of zero bytes is
// a valid one, and its size is that of its value.
#pragma once

#include <atomic>
#include <type_traits>

#include "core/sync.h"
#include "stress/explore/engine.h"

namespace icbench::stress::explore {

/// An integer word of up to 64 bits.
template <class T>
class ModelAtomic {
  static_assert(std::is_integral_v<T> && sizeof(T) <= sizeof(std::uint64_t),
                "the model keeps values in 64 bits");

 public:
  ModelAtomic() noexcept = default;
  explicit(false) constexpr ModelAtomic(T value) noexcept : value_(value) {}

  T load(std::memory_order order) const noexcept {
    if (!Engine::is_inside()) return value_.load(order);
    Access a = access(Access::Kind::load, order);
    return static_cast<T>(Engine::current().access(a).read);
  }
  void store(T value, std::memory_order order) noexcept {
    if (!Engine::is_inside()) return value_.store(value, order);
    change(Access::Kind::store, value, order);
  }
  T fetch_add(T n, std::memory_order order) noexcept {
    if (!Engine::is_inside()) return value_.fetch_add(n, order);
    return change(Access::Kind::add, n, order);
  }
  T exchange(T value, std::memory_order order) noexcept {
    if (!Engine::is_inside()) return value_.exchange(value, order);
    return change(Access::Kind::exchange, value, order);
  }
  bool compare_exchange_strong(T& expected, T desired, std::memory_order success,
                               std::memory_order failure) noexcept {
    if (!Engine::is_inside()) return value_.compare_exchange_strong(expected, desired, success, failure);
    Access a = access(Access::Kind::compare_exchange, success);
    a.failure = failure;
    a.operand = bits(desired);
    a.expected = bits(expected);
    const Effect effect = Engine::current().access(a);
    if (effect.wrote) {
      keep(effect);
    } else {
      expected = static_cast<T>(effect.read);
    }
    return effect.wrote;
  }

 private:
  static constexpr std::uint64_t bits(T value) noexcept {
    return static_cast<std::uint64_t>(static_cast<std::make_unsigned_t<T>>(value));
  }
  Access access(Access::Kind kind, std::memory_order order) const noexcept {
    Access a;
    a.kind = kind;
    a.order = order;
    a.address = this;
    a.in_place = bits(value_.load(std::memory_order_relaxed));
    a.mask = bits(static_cast<T>(-1));
    return a;
  }
  T change(Access::Kind kind, T operand, std::memory_order order) noexcept {
    Access a = access(kind, order);
    a.operand = bits(operand);
    const Effect effect = Engine::current().access(a);
    keep(effect);
    return static_cast<T>(effect.read);
  }
  // Relaxed, as in access: one thread of the system.
  void keep(const Effect& effect) noexcept {
    value_.store(static_cast<T>(effect.written), std::memory_order_relaxed);
  }

  std::atomic<T> value_{};
};

/// Ordinary memory: no steps, but races are found.
template <class T>
class ModelPlain : public PlainAtomic<T> {
  using Base = PlainAtomic<T>;

 public:
  using Base::Base;
  T load(std::memory_order order) const noexcept {
    touch(false);
    return Base::load(order);
  }
  void store(T value, std::memory_order order) noexcept {
    touch(true);
    Base::store(value, order);
  }
  T fetch_add(T n, std::memory_order order) noexcept {
    touch(true);
    return Base::fetch_add(n, order);
  }
  bool compare_exchange_strong(T& expected, T desired, std::memory_order success,
                               std::memory_order failure) noexcept {
    touch(true);
    return Base::compare_exchange_strong(expected, desired, success, failure);
  }

 private:
  void touch(bool writes) const noexcept {
    if (Engine::is_inside()) Engine::current().touch(this, sizeof(T), writes);
  }
};

struct ModelHooks : NoHooks {
  static void reads(const void* begin, std::size_t bytes) noexcept {
    if (Engine::is_inside()) Engine::current().touch(begin, bytes, false);
  }
  static void writes(const void* begin, std::size_t bytes) noexcept {
    if (Engine::is_inside()) Engine::current().touch(begin, bytes, true);
  }
  static void zeroes(const void* begin, std::size_t bytes) noexcept {
    if (Engine::is_inside()) Engine::current().zero(begin, bytes);
  }
  static void begin_waiting() noexcept {
    if (Engine::is_inside()) Engine::current().begin_waiting();
  }
  /// Goes on when there is something newer in the word that the loop read last.
  static void wait_turn(unsigned turn) noexcept {
    if (!Engine::is_inside()) return NoHooks::wait_turn(turn);
    Engine::current().wait_for_news();
  }
};

struct ModelSync : ModelHooks {
  template <class T>
  using Atomic = ModelAtomic<T>;
  static constexpr bool kConcurrent = true;
};

struct ModelPlainSync : ModelHooks {
  template <class T>
  using Atomic = ModelPlain<T>;
  static constexpr bool kConcurrent = false;
};

static_assert(sizeof(ModelAtomic<std::uint32_t>) == 4 && sizeof(ModelAtomic<std::uint64_t>) == 8 &&
                  sizeof(ModelPlain<std::uint32_t>) == 4,
              "the model must not change a structure's layout");

}  // namespace icbench::stress::explore
