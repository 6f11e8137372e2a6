#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <latch>
#include <numeric>
#include <stdexcept>
#include <string>
#include <thread>

#include "harness/calibrated_work.h"
#include "harness/thread_team.h"
#include "limited_child.h"
#include "sanitized.h"

namespace icbench {
namespace {

const Topology& machine() {
  static const Topology topology = Topology::of_this_process();
  return topology;
}

TEST(ThreadTeam, EveryWorkerRunsOncePerRegion) {
  ThreadTeam team(machine(), Placement::compact, 7);
  std::vector<int> calls(7, 0);
  for (int region = 0; region < 200; ++region) team.run([&](unsigned i) { ++calls[i]; });
  EXPECT_EQ(calls, std::vector<int>(7, 200));
}

TEST(ThreadTeam, RegionsAreOrderedBeforeAndAfterRun) {
  ThreadTeam team(machine(), Placement::compact, 4);
  std::vector<long> values(4, 0);
  for (long round = 1; round <= 100; ++round) {
    std::fill(values.begin(), values.end(), round);
    team.run([&](unsigned i) { values[i] *= 2; });
    ASSERT_EQ(std::accumulate(values.begin(), values.end(), 0L), 8 * round);
  }
}

TEST(ThreadTeam, WorkersAreAllInsideTheRegionAtOnce) {
  // Each worker waits for all others: with fewer than all inside at once this never ends.
  constexpr unsigned kWorkers = 64;
  ThreadTeam team(machine(), Placement::scatter, kWorkers);
  std::latch all_there(kWorkers);
  team.run([&](unsigned) { all_there.arrive_and_wait(); });
  EXPECT_TRUE(all_there.try_wait());
}

TEST(ThreadTeam, NobodyBeginsBeforeAllAreReady) {
  ThreadTeam team(machine(), Placement::compact, 32);
  for (int region = 0; region < 20; ++region) {
    const TeamTimes times = team.run([](unsigned) {});
    std::int64_t last_ready = times.threads[0].ready_ns, first_begin = times.threads[0].begin_ns;
    for (const ThreadTime& t : times.threads) {
      last_ready = std::max(last_ready, t.ready_ns);
      first_begin = std::min(first_begin, t.begin_ns);
    }
    ASSERT_LE(last_ready, first_begin);
  }
}

TEST(ThreadTeam, WorkersSitWhereThePlanSays) {
  const std::vector<Binding> plan = machine().plan(Placement::compact, 5);
  ThreadTeam team(plan);
  std::vector<int> actual(5, -1);
  std::vector<int> widths(5, 0);
  team.run([&](unsigned i) {
    cpu_set_t mask;
    sched_getaffinity(0, sizeof mask, &mask);
    widths[i] = CPU_COUNT(&mask);
    actual[i] = sched_getcpu();
  });
  EXPECT_EQ(actual, plan);
  EXPECT_EQ(widths, std::vector<int>(5, 1));
}

TEST(ThreadTeam, WithoutPlacementTheMaskStays) {
  cpu_set_t mine;
  sched_getaffinity(0, sizeof mine, &mine);
  ThreadTeam team(machine(), Placement::none, 3);
  std::atomic<int> same = 0;
  team.run([&](unsigned) {
    cpu_set_t mask;
    sched_getaffinity(0, sizeof mask, &mask);
    same += CPU_EQUAL(&mask, &mine) ? 1 : 0;
  });
  EXPECT_EQ(same, 3);
}

TEST(ThreadTeam, TimesEncloseTheRegion) {
  ThreadTeam team(machine(), Placement::compact, 3);
  std::vector<std::int64_t> inside(3);
  const auto now = [] {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(
               std::chrono::steady_clock::now().time_since_epoch())
        .count();
  };
  const std::int64_t before = now();
  const TeamTimes times = team.run([&](unsigned i) { inside[i] = now(); });
  const std::int64_t after = now();
  ASSERT_EQ(times.threads.size(), 3u);
  for (unsigned i = 0; i < 3; ++i) {
    EXPECT_LE(before, times.threads[i].begin_ns);
    EXPECT_LE(times.threads[i].begin_ns, inside[i]);
    EXPECT_LE(inside[i], times.threads[i].end_ns);
    EXPECT_LE(times.threads[i].end_ns, after);
  }
}

TEST(ThreadTeam, CpuTimeIsThatOfTheWorkersRegion) {
  ThreadTeam team(machine(), Placement::compact, 2);
  std::atomic<std::uint64_t> sink = 0;
  const TeamTimes times = team.run([&](unsigned i) {
    if (i == 0) sink += do_work(3'000'000);
    if (i == 1) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  });
  // The one that slept used less processor time than the one that worked, however busy the machine.
  EXPECT_LT(times.threads[1].cpu_ns, times.threads[0].cpu_ns);
  EXPECT_GE(times.threads[1].cpu_ns, 0);
  EXPECT_EQ(times.cpu_ns(), times.threads[0].cpu_ns + times.threads[1].cpu_ns);
}

TEST(TeamTimes, WallReachesFromTheFirstBeginToTheLastEnd) {
  TeamTimes times;
  times.threads = {{80, 100, 200, 5}, {70, 90, 150, 6}, {60, 110, 250, 7}};
  EXPECT_EQ(times.wall_ns(), 160);
  EXPECT_EQ(times.cpu_ns(), 18);
  EXPECT_EQ(times.start_skew_ns(), 20);
  EXPECT_EQ(TeamTimes{}.wall_ns(), 0);
  EXPECT_EQ(TeamTimes{}.start_skew_ns(), 0);
}

TEST(ThreadTeam, TheExceptionOfTheLowestIndexComesOutAndTheTeamGoesOn) {
  ThreadTeam team(machine(), Placement::none, 6);
  try {
    team.run([](unsigned i) {
      if (i >= 2) throw std::runtime_error(fmt::format("worker {}", i));
    });
    FAIL() << "nothing was thrown";
  } catch (const std::runtime_error& error) {
    EXPECT_STREQ(error.what(), "worker 2");
  }
  std::atomic<int> calls = 0;
  team.run([&](unsigned) { ++calls; });
  EXPECT_EQ(calls, 6);
}

TEST(ThreadTeam, AFailedBindNamesThreadAndUnitAndLeavesNoThreadBehind) {
  std::vector<Binding> plan = machine().plan(Placement::compact, 3);
  plan[1] = 1'000'000;
  try {
    ThreadTeam team(plan);
    FAIL() << "nothing was thrown";
  } catch (const std::runtime_error& error) {
    const std::string text = error.what();
    EXPECT_NE(text.find("thread 1 "), text.npos) << text;
    EXPECT_NE(text.find("1000000"), text.npos) << text;
    EXPECT_NE(text.find("--placement none"), text.npos) << text;
    EXPECT_EQ(text.find('\n'), text.npos) << text;
  }
}

TEST(ThreadTeam, SizesOutOfRangeAreErrors) {
  EXPECT_THROW(ThreadTeam(std::vector<Binding>{}), std::runtime_error);
  EXPECT_THROW(ThreadTeam(std::vector<Binding>(kMaxThreads + 1, kUnbound)), std::runtime_error);
}

TEST(ThreadTeam, RunsWithAsManyThreadsAsAreOffered) {
  constexpr unsigned kThreads = kSanitized ? 256 : kMaxThreads;
  std::atomic<unsigned> calls = 0;
  try {
    ThreadTeam team(machine(), Placement::compact, kThreads);
    for (int region = 0; region < 3; ++region) team.run([&](unsigned) { ++calls; });
  } catch (const std::runtime_error& error) {
    GTEST_SKIP() << "this system forbids so many threads: " << error.what();
  }
  EXPECT_EQ(calls, 3 * kThreads);
}

TEST(ThreadTeam, AThreadThatCannotBeCreatedIsAOneLineErrorWithoutLeftovers) {
  if (kSanitized) GTEST_SKIP() << "sanitizers reserve address space without measure";
  EXPECT_EQ(status_with_little_memory([] {
              try {
                ThreadTeam team(machine(), Placement::none, 4000);
              } catch (const std::runtime_error& error) {
                const std::string text = error.what();
                const bool good = text.starts_with("cannot create thread ") &&
                                  text.find(" of 4000: ") != text.npos &&
                                  text.find("--threads") != text.npos && text.find('\n') == text.npos;
                ThreadTeam(machine(), Placement::none, 4).run([](unsigned) {});
                return good ? 0 : 1;
              }
              return 2;
            }),
            0);
}

}  // namespace
}  // namespace icbench
