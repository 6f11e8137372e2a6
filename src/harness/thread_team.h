// A team of pinned threads, created once and reused for many measured regions.
//
// run(f) calls f(index) once on every worker. All workers gather at a barrier first, so that waking them up
// happens before the region; begin and end of each are stamped on the worker itself, and the wall time
// reaches from the first begin to the last end. Waiting is by futex throughout: a team may have many more
// threads than there are processing units, and an idle one takes no processor time from the others.
//
// Costs: nothing is allocated on a worker; a region costs each worker two wake-ups and five clock readings.
// Workers leave the barrier one after the other, as the kernel wakes them; TeamTimes::start_skew_ns tells how
// far apart.
//
// run is to be called from one thread at a time, never from a worker. A worker that waits for another one
// inside f waits for ever if that one has thrown.
#pragma once

#include <atomic>
#include <cstdint>
#include <exception>
#include <memory>
#include <system_error>
#include <thread>
#include <type_traits>
#include <vector>

#include "core/sync.h"
#include "harness/topology.h"

namespace icbench {

/// One worker's part in a region. steady_clock and thread CPU time (user and system), nanoseconds.
struct ThreadTime {
  std::int64_t ready_ns = 0;  ///< awake and at the barrier; no worker begins before all are ready
  std::int64_t begin_ns = 0;
  std::int64_t end_ns = 0;
  std::int64_t cpu_ns = 0;
};

struct TeamTimes {
  std::vector<ThreadTime> threads;  ///< by worker index

  std::int64_t wall_ns() const noexcept;        ///< last end - first begin
  std::int64_t cpu_ns() const noexcept;         ///< summed over the workers
  std::int64_t start_skew_ns() const noexcept;  ///< last begin - first begin
};

class ThreadTeam {
 public:
  /// Starts one worker per binding and pins each. Throws std::runtime_error (one line) if a thread cannot be
  /// created or cannot be pinned as asked; then no worker is left behind.
  explicit ThreadTeam(const std::vector<Binding>& bindings);
  ThreadTeam(const Topology& topology, Placement placement, unsigned n)
      : ThreadTeam(topology.plan(placement, n)) {}
  ~ThreadTeam();
  ThreadTeam(const ThreadTeam&) = delete;
  ThreadTeam& operator=(const ThreadTeam&) = delete;

  unsigned size() const noexcept { return static_cast<unsigned>(threads_.size()); }

  /// Calls f(unsigned index) on every worker and waits for all. If workers threw, the exception of the one
  /// with the lowest index is rethrown after all have ended; the team stays usable.
  template <class F>
  TeamTimes run(F&& f) {
    using Function = std::remove_reference_t<F>;
    return run_erased([](void* context, unsigned index) { (*static_cast<Function*>(context))(index); },
                      const_cast<void*>(static_cast<const void*>(std::addressof(f))));
  }

 private:
  using Call = void (*)(void* context, unsigned index);

  // Written by its worker alone within a region, read by run after the region.
  struct alignas(kNoSharing) Slot {
    ThreadTime time;
    std::error_code bind_error;  ///< of the worker's start
    std::exception_ptr error;    ///< of the last region
  };

  void work(unsigned index, Binding binding);
  void run_slot(unsigned index) noexcept;
  void finish_one() noexcept;
  TeamTimes run_erased(Call call, void* context);
  void stop(unsigned started) noexcept;

  std::vector<Slot> slots_;
  std::vector<std::thread> threads_;
  Call call_ = nullptr;
  void* context_ = nullptr;
  bool stopping_ = false;

  // 32-bit and signed: the one type that the standard library waits on with a bare futex. Each on its own
  // line, since waiters re-read theirs while the others change.
  alignas(kNoSharing) std::atomic<int> region_{0};   ///< number of the region that workers may enter
  alignas(kNoSharing) std::atomic<int> arrived_{0};  ///< workers at the barrier of this region
  alignas(kNoSharing) std::atomic<int> go_{0};       ///< number of the region whose barrier is open
  alignas(kNoSharing) std::atomic<int> unfinished_{0};
  alignas(kNoSharing) std::atomic<int> finished_{0};  ///< number of the region that all workers have left
};

}  // namespace icbench
