// Fork and join for quiescent work: merging, updating and clearing a cache between frames.
//
// Plain threads on purpose, not oneTBB: ThreadSanitizer sees every edge of it (oneTBB's scheduler is a prebuilt library
// and looks like a race), and a renderer that embeds a cache needs no task scheduler for it. POSIX ones, since
// std::thread ends a program without exceptions where the system has no more threads. Starting a thread costs some ten
// microseconds, so callers choose a grain worth more than that; below two grains nothing is started.
#pragma once

#include <pthread.h>

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <exception>
#include <memory>
#include <new>

#include "core/processing_units.h"

namespace icbench {

/// Threads that run `work()`, at most `most` of them; they are joined when this goes out of scope.
template <class Work>
class Helpers {
 public:
  Helpers(Work& work, std::size_t most) noexcept
      : work_(work), threads_(most != 0 ? new (std::nothrow) pthread_t[most] : nullptr) {
    const auto run = [](void* of) -> void* {
      (*static_cast<Work*>(of))();
      return nullptr;
    };
    // Fewer if the system has no more threads, or no memory for one.
    while (threads_ != nullptr && count_ < most &&
           ::pthread_create(&threads_[count_], nullptr, run, &work_) == 0)
      ++count_;
  }
  ~Helpers() {
    for (std::size_t i = 0; i < count_; ++i) ::pthread_join(threads_[i], nullptr);
  }
  Helpers(const Helpers&) = delete;
  Helpers& operator=(const Helpers&) = delete;

 private:
  Work& work_;
  std::unique_ptr<pthread_t[]> threads_;
  std::size_t count_ = 0;
};

/// The first exception of several threads. Read it when all have been joined.
class FirstException {
 public:
  /// Calls f; false if it threw.
  template <class F>
  bool guard(F&& f) noexcept {
#if defined(__cpp_exceptions)
    try {
      f();
    } catch (...) {
      // Relaxed: it only decides who keeps its exception; joining the threads publishes that.
      if (!taken_.exchange(true, std::memory_order_relaxed)) exception_ = std::current_exception();
      return false;
    }
#else
    f();
#endif
    return true;
  }

  void rethrow() const {
#if defined(__cpp_exceptions)
    if (exception_) std::rethrow_exception(exception_);
#endif
  }

 private:
  std::atomic<bool> taken_{false};
  std::exception_ptr exception_;
};

/// Calls f(begin, end) for consecutive chunks of `grain`, the last one perhaps shorter, that cover [0, n): on as many
/// threads as there are whole chunks, and processing units, at most. f is called from several threads at once. If it
/// throws, chunks may be left out, and one of the exceptions comes out of here when all threads have ended.
template <class F>
void parallel_chunks(std::size_t n, std::size_t grain, F&& f) {
  std::atomic<std::size_t> next{0};
  FirstException exception;
  auto work = [&] {
    for (;;) {
      // Relaxed: chunks only have to be distinct; starting and joining the threads orders what is in them.
      const std::size_t begin = next.fetch_add(grain, std::memory_order_relaxed);
      if (begin >= n) return;
      if (!exception.guard([&] { f(begin, std::min(begin + grain, n)); })) return;
    }
  };
  std::size_t workers = n / grain;
  if (workers > 1)  // to count the processors takes longer than a few chunks
    workers = std::min<std::size_t>(workers, processing_units());
  {
    const Helpers helpers(work, workers > 1 ? workers - 1 : 0);
    work();
  }
  exception.rethrow();
}

}  // namespace icbench
