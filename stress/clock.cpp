#include "stress/clock.h"

#include <algorithm>
#include <mutex>
#include <thread>
#include <vector>

#include "core/processing_units.h"

namespace icbench::stress {

bool tsc_is_usable() {
  if constexpr (!kHasTsc) return false;
  constexpr int kPasses = 20'000;
  std::mutex mutex;
  Stamp last = 0;
  bool agree = true;
  const auto pass = [&] {
    for (int i = 0; i < kPasses; ++i) {
      const std::lock_guard lock(mutex);
      const Stamp now = tsc_before();
      agree = agree && now >= last;
      last = tsc_after();
    }
  };
  std::vector<std::jthread> threads;
  for (unsigned i = 0; i < std::clamp(processing_units(), 2u, 16u); ++i) threads.emplace_back(pass);
  threads.clear();
  return agree;
}

}  // namespace icbench::stress
