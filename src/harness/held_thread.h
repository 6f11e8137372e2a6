// Stops a thread in the middle of what it does, for a set time: a preemption on purpose.
//
// The thread marks where it is (in an operation or between two); another one has it interrupted at a moment of its own
// choosing, and the handler, which runs wherever the thread was interrupted, holds it there if that was in an
// operation. A timer on the thread's own processor time interrupts it, so that this happens as the scheduler does it,
// at a tick and while it runs. A signal that is sent reaches a thread most easily in a system call, which is where it
// waits for a lock and seldom where it has one; it is sent only where the system has no such timers.
//
// The hold is timed by poll on a pipe, and ends early when the pipe is written to. Everything the handler calls is
// async-signal-safe: poll, clock_gettime, sem_post and lock-free atomics.
//
// One object at a time in a process: a signal's handler has no other way to its object.
#pragma once

#include <semaphore.h>
#include <sys/types.h>
#include <time.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <semaphore>

namespace icbench {

class HeldThread {
 public:
  /// Installs the handler. `hold_ms` in 1 .. 60,000. Throws std::runtime_error if there is one already or the system
  /// gives no pipe.
  explicit HeldThread(unsigned hold_ms);
  ~HeldThread();
  HeldThread(const HeldThread&) = delete;
  HeldThread& operator=(const HeldThread&) = delete;

  // By the thread that is to be held, once.
  void attach() noexcept;
  void mark(bool in_operation) noexcept {
    // The fences keep what is marked from moving out of the marks. relaxed: read by a handler on this very thread.
    std::atomic_signal_fence(std::memory_order_seq_cst);
    in_operation_.store(in_operation, std::memory_order_relaxed);
    std::atomic_signal_fence(std::memory_order_seq_cst);
  }

  /// By any thread of the team whose region is over: nobody is held from then on, and who is goes on.
  void ended() noexcept;

  // By the thread that holds it.
  /// Waits for attach. False if the region was over first.
  bool await_attached();
  /// Waits for `pause`. False if the region is over by then.
  bool pause(std::chrono::nanoseconds pause) { return !over_.try_acquire_for(pause); }
  /// Interrupts the thread when it runs next; returns when it has answered, which is after the hold. True if it was
  /// held, false if it was between operations or the region was over first.
  bool hold();

  unsigned holds() const noexcept { return holds_; }
  unsigned missed() const noexcept { return missed_; }  ///< attempts that found it between operations
  double held_ns() const noexcept { return held_ns_; }  ///< in all

 private:
  static void handle(const siginfo_t& signal) noexcept;
  void stop_here() noexcept;
  /// The signal comes: when the thread runs, or now.
  bool interrupt() noexcept;
  bool send() noexcept;
  /// The timer's signal was handled or comes no more.
  void call_off() noexcept;

  // H2  constructor: CAS acq_rel -> handle: load acquire; publishes the object.
  // H3  destructor: store release -> constructor: CAS; who makes the next one finds this one finished.
  static std::atomic<HeldThread*> current_;

  int hold_ms_;
  int release_[2] = {-1, -1};
  struct sigaction before_ {};
  sem_t attached_, answered_, called_off_;
  std::binary_semaphore over_{0};
  // H1  ended: exchange -> stop_here, hold, await_attached: load acquire; nothing but that the region is over.
  std::atomic<bool> is_over_{false};
  std::atomic<bool> in_operation_{false};
  pid_t thread_ = 0;  // published by attached_, as is the timer
  timer_t timer_{};
  bool has_timer_ = false;
  // Written by the handler, read after answered_, which orders them.
  bool was_held_ = false;
  double last_ns_ = 0.0;
  unsigned holds_ = 0, missed_ = 0;
  double held_ns_ = 0.0;
};

}  // namespace icbench
