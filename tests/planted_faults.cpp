// planted_faults FAULT: makes one fault that a sanitizer must report, so that their silence elsewhere says something.
//
// Built and run in sanitizer builds only. `none` does the same work without a fault and must be reported by nobody.
#include <algorithm>
#include <atomic>
#include <cstdio>
#include <memory>
#include <optional>
#include <string_view>
#include <thread>
#include <vector>

#include "caches/registry.h"
#include "stress/broken/lists.h"
#include "stress/broken/trees.h"

namespace icbench {
namespace {

constexpr std::uint32_t kRecords = 500, kAhead = 20;
const SurfacePoint kPlace{{0.5f, 0.5f, 0.0f}, {0, 0, 1}};

Record record(std::uint32_t id) { return {kPlace.p, kPlace.n, 0.1f, {1, 2, 3}, id}; }

/// One thread inserts while another looks until it has seen all, in batches of `batch` or, if that is 0, by single
/// visits. The first waits for the other now and then, or on one core all could be there before it looks. Whatever
/// orders them comes from the cache.
template <class Cache>
void share(std::uint32_t sessions, std::size_t batch = 0) {
  Cache cache({.capacity = kRecords, .max_sessions = sessions});
  auto writer_session = cache.open_session(0);
  auto reader_session = cache.open_session(sessions - 1);
  std::atomic<std::uint32_t> seen{0};
  std::jthread writer([&] {
    for (std::uint32_t i = 0; i < kRecords; ++i) {
      // relaxed, as its partner: orders nothing.
      while (seen.load(std::memory_order_relaxed) + kAhead < i) std::this_thread::yield();
      writer_session.insert(record(i));
    }
  });
  std::jthread reader([&] {
    const std::vector<SurfacePoint> points(batch, kPlace);
    for (std::uint32_t n = 0; n < kRecords;) {
      n = 0;
      const auto count = [&](const Record& r, float) { n += r.R > 0.0f; };
      const std::vector visitors(std::max(batch, std::size_t{1}), count);
      batch == 0 ? reader_session.visit(kPlace, visitors[0]) : reader_session.visit_batch(points, visitors);
      n /= static_cast<std::uint32_t>(visitors.size());
      seen.store(n, std::memory_order_relaxed);
      std::this_thread::yield();
    }
  });
}

/// A session used when its cache is no more.
void use_after_free() {
  auto cache = std::make_unique<WaitFree<WithCounters>>(CacheConfig{});
  auto session = cache->open_session(0);
  cache.reset();
  session.insert(Record{});
}

/// More answers than there is room for.
void overflow() {
  WaitFree<> cache({});
  const std::vector<SurfacePoint> points(8, kPlace);
  std::vector<std::optional<Irradiance>> answers(7);
  cache.open_session(0).query_batch(points, answers);
}

/// What the language does not define: a signed sum out of range.
void undefined() {
  volatile int largest = 0x7fffffff;
  largest = largest + 1;
}

int run(std::string_view fault) {
  if (fault == "none") {
    share<WaitFree<>>(2);
    share<WaitFreeSnapshot<>>(2);
    share<PackedWaitFree<>>(2, 17);
    share<PackedWaitFreeSnapshot<>>(2, 17);
  } else if (fault == "relaxed_publication") {
    share<stress::RelaxedPublication<StdSync>>(2);
  } else if (fault == "lanes_unpublished") {
    share<stress::LanesUnpublished<StdSync>>(2);
  } else if (fault == "batch_loads_ahead") {
    share<stress::BatchLoadsAhead<StdSync>>(2, 4);
  } else if (fault == "unsynchronised") {
    share<Sequential<>>(1);
  } else if (fault == "use_after_free") {
    use_after_free();
  } else if (fault == "overflow") {
    overflow();
  } else if (fault == "undefined") {
    undefined();
  } else {
    std::fputs(
        "usage: planted_faults "
        "none|relaxed_publication|lanes_unpublished|batch_loads_ahead|unsynchronised|use_after_free|overflow|"
        "undefined\n",
        stderr);
    return 2;
  }
  std::puts("done");
  return 0;
}

}  // namespace
}  // namespace icbench

int main(int argc, char** argv) { return icbench::run(argc == 2 ? argv[1] : ""); }
