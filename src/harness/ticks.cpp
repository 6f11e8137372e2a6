#include "harness/ticks.h"

#include <time.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <fstream>
#include <sstream>
#include <string>
#include <thread>

#include "harness/statistics.h"

namespace icbench {
namespace {

using Clock = std::chrono::steady_clock;

struct Stamp {
  std::uint64_t ticks;
  double ns;
};

/// A tick and a clock reading taken as close together as possible: the tightest of some attempts, so that an
/// interrupt between the two does not count.
Stamp stamp() {
  Stamp best{};
  auto tightest = Clock::duration::max();
  for (int attempt = 0; attempt < 16; ++attempt) {
    const auto before = Clock::now();
    const std::uint64_t t = ticks();
    const auto after = Clock::now();
    if (after - before >= tightest) continue;
    tightest = after - before;
    best = {
        t,
        std::chrono::duration<double, std::nano>((before + (after - before) / 2).time_since_epoch()).count()};
  }
  return best;
}

#if defined(__x86_64__)
bool processor_has(std::string_view flag) {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    if (!line.starts_with("flags")) continue;
    std::istringstream words(line);
    for (std::string word; words >> word;)
      if (word == flag) return true;
    return false;
  }
  return false;
}
#endif

}  // namespace

std::int64_t thread_cpu_ns() noexcept {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<std::int64_t>(t.tv_sec) * 1'000'000'000 + t.tv_nsec;
}

nlohmann::ordered_json TickRate::to_json() const {
  return {{"source", source}, {"ns_per_tick", ns_per_tick}, {"spread", spread}, {"invariant", invariant}};
}

const TickRate& tick_rate() {
  static const TickRate rate = calibrate_ticks();
  return rate;
}

TickRate calibrate_ticks() {
  TickRate rate;
#if defined(__x86_64__)
  rate.source = "rdtsc";
  rate.invariant = processor_has("constant_tsc") && processor_has("nonstop_tsc");
#elif defined(__aarch64__)
  rate.source = "cntvct";
#endif
  std::array<double, 7> tries;
  for (double& ns_per_tick : tries) {
    // The counter may tick as slowly as 1 MHz: the window is at least 1,000 ticks long, whatever sleep does.
    const Stamp begin = stamp();
    Stamp end = begin;
    do {
      std::this_thread::sleep_for(std::chrono::milliseconds(7));
      end = stamp();
    } while (end.ticks - begin.ticks < 1000);
    ns_per_tick = (end.ns - begin.ns) / static_cast<double>(end.ticks - begin.ticks);
  }
  rate.ns_per_tick = median(tries);
  const auto [fastest, slowest] = std::minmax_element(tries.begin(), tries.end());
  rate.spread = (*slowest - *fastest) / rate.ns_per_tick;
  return rate;
}

}  // namespace icbench
