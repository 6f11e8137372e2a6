// The threads that a renderer works with between tiles, as rendering code sees them: it starts none itself.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <functional>

#include "core/sync.h"
#include "render/ray_tracer.h"

namespace icbench {

/// A team of threads, each with a tracer of its own that counts its rays.
class Crew {
 public:
  virtual ~Crew() = default;
  virtual unsigned size() const noexcept = 0;

  /// Calls f(thread, tracer) once in every thread, thread < size(), and waits for all.
  virtual void run(const std::function<void(unsigned thread, Tracer& tracer)>& f) = 0;

  /// Calls f(thread, tracer, i) once for every i < n, chunks of `grain` by whichever thread is free.
  template <class F>
  void for_each(std::size_t n, std::size_t grain, F&& f) {
    if (n == 0) return;
    alignas(kNoSharing) std::atomic<std::size_t> next{0};
    run([&](unsigned thread, Tracer& tracer) {
      for (;;) {
        // Relaxed: chunks only have to be distinct; run orders what is in them.
        const std::size_t begin = next.fetch_add(grain, std::memory_order_relaxed);
        if (begin >= n) return;
        for (std::size_t i = begin; i < std::min(begin + grain, n); ++i) f(thread, tracer, i);
      }
    });
  }
};

}  // namespace icbench
