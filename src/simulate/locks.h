// Locks in virtual time: who gets in when, and what that costs. One model for each way of locking in caches/locks.h.
//
// A model is told of a thread that comes (`enter`) and one that goes (`leave`); it answers with the time at which the
// thread goes on, or, if it has to wait, calls `wake` for it later with the time at which it tries again (`resume`).
// What a lock costs that nobody contends for is in the measured cost of the operation; here is what comes on top. A
// thread that finds it taken reads the clock and waits from then on, as caches/locks.h does when it counts.
//
//   mutex            glibc's: a thread that finds it taken goes to sleep in the kernel; who leaves calls the kernel to
//                    wake one. Whoever comes before the woken one has run gets in: unfair. The kernel looks at the word
//                    again before it lets a thread sleep; if the lock was given back until then, the call returns
//   spin             test-and-test-and-set: waiters read the word until it is free and then try at once; one of them
//                    gets it, whoever leaves may be back before. Each hand-over moves the line to those that wait in
//                    vain, too (Anderson, The Performance of Spin Lock Alternatives for Shared-Memory Multiprocessors,
//                    IEEE TPDS 1(1), 1990): half a transfer for each
//   queue            first come, first served, each waiter on a word of its own (oneTBB's queuing_mutex; after
//                    Mellor-Crummey and Scott 1991), which it looks at after ever longer pauses: when it finds
//                    what was written there is measured, by how long it has waited
//   futex_rw         glibc's readers-writer lock: readers count themselves on one line, and go first; waiters sleep
//   spin_rw          oneTBB's: readers count themselves on one line; a writer that waits keeps new readers out
//   distributed_rw   readers write a line of their own and read the writer's; a writer looks at all of them
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>

#include "core/random.h"
#include "simulate/machine.h"

namespace icbench {

enum class LockKind : std::uint8_t { none, mutex, spin, queue, futex_rw, spin_rw, distributed_rw };
inline constexpr std::size_t kLockKinds = 7;

/// What waking a thread takes, nanoseconds, by how long it has slept: a processor that has just gone idle is still
/// looking whether there is work, or on its way to being halted, or halted, which a virtual one leaves slowly.
struct BySleep {
  static constexpr std::size_t kSleeps = 8;
  /// What entry i is of: 500 ns, doubled each time.
  static constexpr double slept_ns(std::size_t i) noexcept {
    return 500.0 * static_cast<double>(std::uint64_t{1} << i);
  }
  static BySleep always(double ns) noexcept {
    BySleep out;
    out.ns.fill(ns);
    return out;
  }
  /// Linear in the logarithm between entries, constant beyond them.
  double after(double slept) const noexcept;

  std::array<double, kSleeps> ns{};  ///< each >= 0
};

/// Handing a queue's lock to the thread that waits next, nanoseconds, by how long that one has waited: it looks at its
/// word after ever longer pauses, so who is let in just after a look waits for the next one. Beyond the last entry it
/// gives up the processor between looks, and what was measured repeats itself with every turn of that.
struct QueueHandOver {
  static constexpr std::size_t kWaits = 64;
  /// What entry i is of: waits from i to i + 1 times so long.
  static constexpr double kStepNs = 25.0;

  /// As reckoned from what a turn of the waiting loop, giving up the processor and a line's transfer take: the word of
  /// the one who leaves comes to it with the name of the next, that one's word is taken away, and comes back.
  static QueueHandOver reckoned(double pause_ns, double yield_ns, double transfer_ns);

  /// From giving it back until the next one has it, `waited` nanoseconds after that one came (from when it is there);
  /// `transfer`: what a line takes between the two.
  double after(double waited, double transfer, double yield) const noexcept;
  /// Of the thread that gives it back: more than with nobody waiting.
  double leaving(double transfer) const noexcept { return std::max(0.0, leave_ns + transfer - transfer_ns); }

  std::array<double, kWaits> ns{};  ///< each >= 0
  double leave_ns = 0.0;            ///< >= 0
  double transfer_ns = 0.0;         ///< what a line took between the two threads of the measurement
};

/// What waiting costs, nanoseconds; measured by the calibration. The defaults are of the order of what was measured on
/// virtual machines.
struct WaitCosts {
  double park_ns = 700.0;   ///< a call to the kernel to sleep, or to wake, that has nothing to do
  double check_ns = 500.0;  ///< of it, until the kernel has looked at the word: who lets go later has to wake
  BySleep wake_call_ns = BySleep::always(1'000.0);   ///< of the thread that wakes another
  BySleep wake_delay_ns = BySleep::always(5'000.0);  ///< from the call to the woken thread's running
  double pause_ns = 20.0;                            ///< one turn of a spin loop
  double yield_ns = 400.0;                           ///< giving up the processor with nobody there to take it
  double clock_ns = 30.0;      ///< reading the clock: who has waited does so while it holds the lock
  double start_ns = 10'000.0;  ///< of starting a thread
  /// By LockKind: taking a lock that is free and giving it back, which is in the measured cost of an operation. Half of
  /// it is before the lock is held, half after.
  std::array<double, kLockKinds> lock_ns{};
  QueueHandOver queue = QueueHandOver::reckoned(20.0, 400.0, 23.0);
};

/// What handing a lock to a thread that sleeps takes, nanoseconds >= 0, however long it has slept: what-if figures in
/// place of those that a calibration measures. Other hand-overs follow from what a cache line takes (Transfers).
struct HandOver {
  double call_ns;   ///< of the thread that gives the lock back: the kernel's call that wakes
  double delay_ns;  ///< from that call until the woken thread runs

  void apply_to(WaitCosts& costs) const noexcept {
    costs.wake_call_ns = BySleep::always(call_ns);
    costs.wake_delay_ns = BySleep::always(delay_ns);
  }
};

/// A thread that comes to a lock.
struct Visitor {
  unsigned thread, core;
  bool writes;
};

/// Of a thread that comes: when it is in, or since when it waits.
struct Arrival {
  double time;
  bool is_in;
};

class VirtualLock {
 public:
  /// Tells the scheduler to call resume(thread) at a time.
  using Wake = std::function<void(unsigned thread, double time)>;

  virtual ~VirtualLock() = default;
  virtual Arrival enter(const Visitor& v, double t) = 0;
  /// A thread that was woken tries again. When it is in, or nothing: it goes on waiting.
  virtual std::optional<double> resume(const Visitor& v, double t) = 0;
  /// When the thread that leaves goes on.
  virtual double leave(const Visitor& v, double t) = 0;
};

/// Null for LockKind::none. `machine` and `costs` must outlive it; `seed` decides who of several gets in.
std::unique_ptr<VirtualLock> make_lock(LockKind kind, const MachineModel& machine, const WaitCosts& costs,
                                       std::uint64_t seed, VirtualLock::Wake wake);

}  // namespace icbench
