#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <vector>

#include "core/steps.h"
#include "harness/thread_team.h"

namespace icbench {
namespace {

// Memory without atomics throughout: what the steps do not order, ThreadSanitizer reports.
TEST(Steps, EachItemIsDoneOnceAndSeenByTheThreadThatGoesOnAlone) {
  const Topology machine = Topology::of_this_process();
  constexpr int kSteps = 200;
  for (const unsigned threads : {1u, 2u, 3u, 16u}) {
    ThreadTeam team(machine, Placement::compact, threads);
    std::vector<int> done(97, 0);
    std::vector<int> agreed(threads, 0);
    int alone = 0, wrong = 0, items = 0;
    Steps steps(threads);
    team.run([&](unsigned thread) {
      for (int step = 1; step <= kSteps; ++step) {
        steps.share(static_cast<std::size_t>(items), 1 + step % 5, [&](std::size_t i) { done[i] += step; });
        steps.end([&] {
          wrong += std::accumulate(done.begin(), done.end(), 0) != items * step;
          std::fill(done.begin(), done.end(), 0);
          items = step % 97;  // of the next one; none in some
          ++alone;
        });
        agreed[thread] += alone == step;
      }
    });
    EXPECT_EQ(alone, kSteps);
    EXPECT_EQ(wrong, 0);
    EXPECT_EQ(agreed, std::vector<int>(threads, kSteps)) << "of " << threads << " threads";
  }
}

}  // namespace
}  // namespace icbench
