// What waiting takes on this machine: of one thread, and of two on two cores.
#include <linux/futex.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <chrono>
#include <iterator>
#include <thread>
#include <vector>

#include "caches/locks.h"
#include "core/sync.h"
#include "harness/statistics.h"
#include "harness/thread_team.h"
#include "harness/ticks.h"
#include "simulate/calibration.h"

namespace icbench {
namespace {

using Clock = std::chrono::steady_clock;

/// Low quantile of many short measurements: what is longer was disturbed.
double undisturbed(const std::vector<double>& samples) { return quantile(samples, 0.1); }

/// Nanoseconds a turn of `f`, which is called `turns` times for each sample.
template <class F>
double time_of(unsigned turns, unsigned samples, F&& f) {
  std::vector<double> ns;
  for (unsigned i = 0; i < samples; ++i) {
    const auto start = Clock::now();
    for (unsigned turn = 0; turn < turns; ++turn) f();
    ns.push_back(std::chrono::duration<double, std::nano>(Clock::now() - start).count() / turns);
  }
  return undisturbed(ns);
}

struct alignas(kNoSharing) Word {
  std::atomic<int> value{0};
};
static_assert(sizeof(std::atomic<int>) == sizeof(int), "the kernel looks at the word itself");

long futex(Word& word, int operation, int value) {
  return syscall(SYS_futex, reinterpret_cast<int*>(&word.value), operation | FUTEX_PRIVATE_FLAG, value,
                 nullptr, nullptr, 0);
}

/// One way: two threads take turns at a word, and one of them tells how long a round takes.
double measured_transfer(ThreadTeam& two, const TickRate& rate) {
  constexpr int kRounds = 20'000;
  Word word;
  std::vector<double> samples;
  two.run([&](unsigned t) {
    std::uint64_t last = ticks();
    for (int round = 0; round < kRounds; ++round) {
      const int mine = 2 * round + static_cast<int>(t);
      for (int expected = mine;; expected = mine) {
        for (unsigned turn = 0; word.value.load(std::memory_order_relaxed) != mine; ++turn)
          NoHooks::wait_turn(turn);
        // Acquire and release as a lock's word has them, relaxed where it has: there is no data beside it.
        if (word.value.compare_exchange_strong(expected, mine + 1, std::memory_order_acq_rel,
                                               std::memory_order_relaxed))
          break;
      }
      if (t != 0) continue;
      const std::uint64_t now = ticks();
      samples.push_back(0.5 * rate.to_ns(now - last));
      last = now;
    }
  });
  return median(samples);
}

/// Reads so much memory that nothing of the kernel's stays near, as work between two calls does.
class OtherWork {
 public:
  void operator()() {
    unsigned sum = 0;
    for (std::size_t i = 0; i < memory_.size(); i += 64) sum += memory_[i];
    asm volatile("" ::"r"(sum));
  }

 private:
  std::vector<unsigned char> memory_ = std::vector<unsigned char>(256u << 10, 1);
};

void wait_until(std::uint64_t tick) {
  while (ticks() < tick) {
  }
}

constexpr int kSleepsOfEach = 60;  // length

/// Of the thread that wakes another, and until that one runs, after so long a sleep.
void measure_waking(ThreadTeam& two, const TickRate& rate, double slept_ns, std::vector<double>& calls,
                    std::vector<double>& delays) {
  Word word;
  std::atomic<int> asleep{-1};
  std::vector<std::uint64_t> since(kSleepsOfEach), called(kSleepsOfEach), returned(kSleepsOfEach),
      woken(kSleepsOfEach);
  std::vector<bool> has_slept(kSleepsOfEach);
  OtherWork other_work;
  two.run([&](unsigned t) {
    for (int round = 0; round < kSleepsOfEach; ++round) {
      const auto i = static_cast<std::size_t>(round);
      if (t == 0) {
        other_work();
        since[i] = ticks();
        // Release: the stamps of this round and of the one before. Paired with the acquire below.
        asleep.store(round, std::memory_order_release);
        while (word.value.load(std::memory_order_acquire) != round + 1) futex(word, FUTEX_WAIT, round);
        woken[i] = ticks();
      } else {
        for (unsigned turn = 0; asleep.load(std::memory_order_acquire) != round; ++turn)
          NoHooks::wait_turn(turn);
        wait_until(since[i] + static_cast<std::uint64_t>(slept_ns / rate.ns_per_tick));
        word.value.store(round + 1, std::memory_order_release);
        called[i] = ticks();
        has_slept[i] = futex(word, FUTEX_WAKE, 1) == 1;
        returned[i] = ticks();
      }
    }
  });
  for (std::size_t i = 0; i < kSleepsOfEach; ++i) {
    if (!has_slept[i]) continue;  // it was still on its way
    calls.push_back(rate.to_ns(returned[i] - called[i]));
    delays.push_back(rate.to_ns(woken[i] > called[i] ? woken[i] - called[i] : 0));
  }
}

/// The same for all lengths of sleep; one too short to be slept is as the next longer.
void measure_waking(ThreadTeam& two, const TickRate& rate, WaitCosts& out) {
  for (std::size_t i = BySleep::kSleeps; i-- > 0;) {
    std::vector<double> calls, delays;
    measure_waking(two, rate, BySleep::slept_ns(i), calls, delays);
    const bool has_longer = i + 1 < BySleep::kSleeps;
    if (std::ssize(calls) >= kSleepsOfEach / 2) {  // fewer are those that slept longer by chance
      out.wake_call_ns.ns[i] = median(calls);
      out.wake_delay_ns.ns[i] = median(delays);
    } else if (has_longer) {
      out.wake_call_ns.ns[i] = out.wake_call_ns.ns[i + 1];
      out.wake_delay_ns.ns[i] = out.wake_delay_ns.ns[i + 1];
    }
  }
}

/// From a thread's call to sleep until the kernel has looked at the word: another thread changes the word after ever
/// longer delays, and whoever is still in time sends the caller back; and how long a call takes that comes back so.
/// `transfer_ns`: what the word takes to the kernel.
void measure_calls_in_vain(ThreadTeam& two, const TickRate& rate, double transfer_ns, WaitCosts& out) {
  constexpr unsigned kDelays = 40, kEach = 15;
  constexpr double kStepNs = 20.0, kAheadNs = 3'000.0;
  Word word;
  std::atomic<std::uint64_t> begin{0};
  std::atomic<int> called{-1}, back{-1};  // the last turn in which it was
  std::vector<double> in_vain;
  OtherWork other_work;
  two.run([&](unsigned t) {
    for (unsigned i = 0; i < kDelays * kEach; ++i) {
      const int turn = static_cast<int>(i);
      if (t == 0) {
        other_work();
        begin.store(ticks() + static_cast<std::uint64_t>(kAheadNs / rate.ns_per_tick),
                    std::memory_order_relaxed);
        called.store(turn, std::memory_order_release);  // with the begin
        wait_until(begin.load(std::memory_order_relaxed));
        const std::uint64_t start = ticks();
        if (futex(word, FUTEX_WAIT, turn) != 0) in_vain.push_back(rate.to_ns(ticks() - start));
        back.store(turn, std::memory_order_release);
        for (unsigned spins = 0; word.value.load(std::memory_order_acquire) != turn + 1; ++spins)
          NoHooks::wait_turn(spins);
      } else {
        for (unsigned spins = 0; called.load(std::memory_order_acquire) != turn; ++spins)
          NoHooks::wait_turn(spins);
        const double delay = kStepNs * (static_cast<double>(i / kEach) + 0.5);
        wait_until(begin.load(std::memory_order_relaxed) +
                   static_cast<std::uint64_t>(delay / rate.ns_per_tick));
        word.value.store(turn + 1, std::memory_order_release);
        // Until it is back, for it may be on its way to sleep. It may be in its next turn by then, and be woken there:
        // that turn is over, too.
        while (back.load(std::memory_order_acquire) < turn) futex(word, FUTEX_WAKE, 1);
      }
    }
  });
  out.check_ns = kStepNs * static_cast<double>(in_vain.size()) / kEach + transfer_ns;
  if (!in_vain.empty()) out.park_ns = median(in_vain);
}

/// A thread takes a place in the queue of a lock that another one holds, who gives it back after ever longer delays.
/// As Locked does it: tried in vain, then the clock is read before and after.
void measure_queue(ThreadTeam& two, const TickRate& rate, double transfer_ns, WaitCosts& out) {
  constexpr std::size_t kLengths = QueueHandOver::kWaits, kEach = 11;
  // Until both are where they are to be: the holder about to give the lock back, the other one about to come.
  constexpr double kAheadNs = 1'500.0;
  struct Turn {
    std::uint64_t came = 0, has = 0, gives = 0, gave = 0;
  };
  std::vector<Turn> turns(kLengths * kEach);
  struct alignas(kNoSharing) {
    QueuingMutex::Mutex mutex;
  } lock;
  std::atomic<std::uint64_t> begin{0};
  alignas(kNoSharing) std::atomic<int> held{-1}, done{-1};  // the last turn in which it was
  two.run([&](unsigned t) {
    for (std::size_t i = 0; i < turns.size(); ++i) {
      const int turn = static_cast<int>(i);
      QueuingMutex::Mutex::scoped_lock place;
      if (t == 0) {
        place.acquire(lock.mutex);
        begin.store(ticks() + static_cast<std::uint64_t>(kAheadNs / rate.ns_per_tick),
                    std::memory_order_relaxed);
        held.store(turn, std::memory_order_release);  // with the begin
        // Turns of all lengths mixed: what lasts some turns does not lie on one length alone.
        const double delay = QueueHandOver::kStepNs * static_cast<double>(i * 29 % (kLengths + 6));
        wait_until(begin.load(std::memory_order_relaxed) +
                   static_cast<std::uint64_t>(delay / rate.ns_per_tick));
        turns[i].gives = ticks();
        place.release();
        turns[i].gave = ticks();
        for (unsigned spins = 0; done.load(std::memory_order_acquire) != turn; ++spins)
          NoHooks::wait_turn(spins);
      } else {
        for (unsigned spins = 0; held.load(std::memory_order_acquire) != turn; ++spins)
          NoHooks::wait_turn(spins);
        wait_until(begin.load(std::memory_order_relaxed));
        if (!place.try_acquire(lock.mutex)) {
          const auto start = Clock::now();
          turns[i].came = ticks();
          place.acquire(lock.mutex);
          [[maybe_unused]] const auto waited = Clock::now() - start;
          turns[i].has = ticks();
        }
        place.release();
        done.store(turn, std::memory_order_release);
      }
    }
  });
  // One stamp is in each difference; and the clock is read by who has the lock.
  const double stamp_ns = time_of(100, 50, [] { ticks(); });
  std::array<std::vector<double>, kLengths> by_wait;
  std::vector<double> leaving;
  for (const Turn& turn : turns) {
    if (turn.came == 0 || turn.gives < turn.came || turn.has < turn.gives) continue;
    leaving.push_back(rate.to_ns(turn.gave - turn.gives));
    const double place = rate.to_ns(turn.gives - turn.came) / QueueHandOver::kStepNs;
    if (place < static_cast<double>(kLengths))
      by_wait[static_cast<std::size_t>(place)].push_back(rate.to_ns(turn.has - turn.gives));
  }
  QueueHandOver measured = QueueHandOver::reckoned(out.pause_ns, out.yield_ns, transfer_ns);
  for (std::size_t i = 0; i < kLengths; ++i) {
    if (by_wait[i].size() >= kEach / 2)  // fewer came so late by chance: what is reckoned stays
      measured.ns[i] = std::max(0.0, median(by_wait[i]) - stamp_ns - out.clock_ns);
  }
  if (!leaving.empty()) measured.leave_ns = std::max(0.0, median(leaving) - stamp_ns);
  out.queue = measured;
}

/// Taking a lock that is free and giving it back, as Locked does, by one thread.
template <class Policy>
double measured_lock() {
  WithCounters counters;
  typename Policy::Mutex mutex;
  typename PartOfSession<Policy>::type part;
  if constexpr (PartOfSession<Policy>::kOn) mutex.admit(part);
  return time_of(100, 200, [&] {
    if constexpr (PartOfSession<Policy>::kOn) {
      typename Policy::Read scope(part, counters);
    } else {
      typename Policy::Read scope(mutex, counters);
    }
  });
}

std::array<double, kLockKinds> measured_locks() {
  std::array<double, kLockKinds> out{};
  const auto of = [&](LockKind kind) -> double& { return out[static_cast<std::size_t>(kind)]; };
  of(LockKind::mutex) = measured_lock<GlobalMutex>();
  of(LockKind::spin) = measured_lock<GlobalSpin<>>();
  of(LockKind::queue) = measured_lock<QueuingMutex>();
  of(LockKind::futex_rw) = measured_lock<SharedMutex>();
  of(LockKind::spin_rw) = measured_lock<SpinRwMutex>();
  of(LockKind::distributed_rw) = measured_lock<DistributedRw<>>();
  return out;
}

}  // namespace

void measure_waits(WaitCosts& out) {
  Word word;
  out.park_ns = time_of(10, 500, [&] { futex(word, FUTEX_WAIT, 1); });  // it returns at once
  out.clock_ns = time_of(100, 500, [] {
    const auto now = Clock::now();
    asm volatile("" ::"r"(&now) : "memory");
  });
  out.pause_ns = time_of(100, 500, [] { spin_pause(); });
  out.yield_ns = time_of(10, 500, [] { std::this_thread::yield(); });
  out.lock_ns = measured_locks();
  out.queue = QueueHandOver::reckoned(out.pause_ns, out.yield_ns, Transfers().ns[0]);
  out.start_ns = time_of(1, 50, [] { std::jthread([] {}); });
}

void measure_contention(ThreadTeam& two, Transfers& transfers, WaitCosts& waits) {
  const TickRate& rate = tick_rate();
  transfers = Transfers().with_near(measured_transfer(two, rate));
  measure_waking(two, rate, waits);
  measure_calls_in_vain(two, rate, transfers.ns[0], waits);
  measure_queue(two, rate, transfers.ns[0], waits);
}

}  // namespace icbench
