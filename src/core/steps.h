// Steps of work that running threads share, and between which they wait for each other.
//
// A region of a team for each step would put all threads to sleep and wake them. Here a thread that has to wait looks a
// while whether the last one has come, and sleeps only then; where there are more threads than processing units it
// sleeps at once, so that the others can run.
//
// Publication pairs:
//
//   T1  a thread's missing_ fetch_sub -> that of the last to arrive: what all did in the step, for the last one to see
//
//   T2  the last one's step_ store -> the others' step_ load or wait: what it did alone, and the step of all the others
//       (through T1)
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>

#include "core/processing_units.h"
#include "core/sync.h"

namespace icbench {

/// For one use by so many threads, each of which goes through the same steps: share, if there is work, then end.
class Steps {
 public:
  explicit Steps(unsigned threads)
      : threads_(static_cast<int>(threads)),
        spins_(threads <= processing_units() ? kSpins : 0),
        missing_(threads_) {}

  /// This thread's share of a step: calls f(i) for i < n, which all threads together do once for each i, chunks of
  /// `grain` by whichever is free.
  template <class F>
  void share(std::size_t n, std::size_t grain, F&& f) noexcept {
    for (;;) {
      // Relaxed: chunks only have to be distinct; the end of the step orders what is in them.
      const std::size_t begin = next_.fetch_add(grain, std::memory_order_relaxed);
      if (begin >= n) return;
      for (std::size_t i = begin; i < std::min(begin + grain, n); ++i) f(i);
    }
  }

  /// Ends a step: waits for all threads. The last to arrive calls alone() before any goes on; all are given the same.
  template <class F>
  void end(F&& alone) noexcept {
    // Relaxed: cannot change before this thread arrives.
    const int step = step_.load(std::memory_order_relaxed);
    if (missing_.fetch_sub(1, std::memory_order_acq_rel) == 1) {  // T1
      alone();
      next_.store(0, std::memory_order_relaxed);  // T2 publishes both
      missing_.store(threads_, std::memory_order_relaxed);
      // seq_cst: notify_all skips the system call when nobody is registered as waiting, and must not look before.
      step_.store(step + 1, std::memory_order_seq_cst);  // T2
      step_.notify_all();
      return;
    }
    for (unsigned turn = 0; turn < spins_; ++turn) {
      if (step_.load(std::memory_order_acquire) != step) return;  // T2
      spin_pause();
    }
    step_.wait(step, std::memory_order_acquire);  // T2
  }

 private:
  // 75 microseconds on an AMD EPYC, about what making a record takes.
  static constexpr unsigned kSpins = 4096;

  const int threads_;
  const unsigned spins_;
  // Apart: all threads take from the first while they work; they change the second as they end, and wait for the third.
  // 32 bits and signed: what the standard library waits on with a bare futex.
  alignas(kNoSharing) std::atomic<std::size_t> next_{0};  ///< chunk of this step
  alignas(kNoSharing) std::atomic<int> missing_;          ///< threads that have not ended it
  alignas(kNoSharing) std::atomic<int> step_{0};          ///< its number
};

}  // namespace icbench
