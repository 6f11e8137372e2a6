#include <gtest/gtest.h>
#include <sched.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <set>
#include <stdexcept>
#include <utility>

#include "harness/topology.h"

namespace icbench {
namespace {

using Bindings = std::vector<Binding>;
using Marks = std::vector<std::pair<unsigned, std::string>>;

Marks marks(const Topology& topology) {
  Marks found;
  for (const Boundary& b : topology.boundaries()) found.emplace_back(b.threads, b.kind);
  return found;
}

// Two packages of three cores with two threads each; package 0 has units 0-5, its cores are (0,1) (2,3)
// (4,5).
const char* const kTwoSockets = "package:2 core:3 pu:2";

TEST(Topology, CompactFillsCoresThenSiblingsThenTheNextPackage) {
  const Topology t = Topology::synthetic(kTwoSockets);
  EXPECT_EQ(t.plan(Placement::compact, 12), (Bindings{0, 2, 4, 1, 3, 5, 6, 8, 10, 7, 9, 11}));
}

TEST(Topology, ScatterAlternatesPackagesAndUsesSiblingsLast) {
  const Topology t = Topology::synthetic(kTwoSockets);
  EXPECT_EQ(t.plan(Placement::scatter, 12), (Bindings{0, 6, 2, 8, 4, 10, 1, 7, 3, 9, 5, 11}));
}

TEST(Topology, ScatterSpreadsOverNodesThenCachesThenCores) {
  // Per package two NUMA nodes, per node two L3 caches, per cache two cores: units 0-7 in package 0, 8-15 in
  // package 1.
  const Topology t = Topology::synthetic("package:2 group:2 [numa] l3:2 core:2 pu:1");
  EXPECT_EQ(t.plan(Placement::scatter, 16), (Bindings{0, 8, 4, 12, 2, 10, 6, 14, 1, 9, 5, 13, 3, 11, 7, 15}));
  EXPECT_EQ(marks(t), (Marks{{5, "numa_node"}, {9, "package"}, {13, "numa_node"}, {17, "oversubscribed"}}));
}

TEST(Topology, BoundariesMarkSiblingsPackagesAndOversubscription) {
  EXPECT_EQ(marks(Topology::synthetic(kTwoSockets)),
            (Marks{{4, "smt"}, {7, "package"}, {10, "smt"}, {13, "oversubscribed"}}));
  EXPECT_EQ(marks(Topology::synthetic("core:1 pu:1")), (Marks{{2, "oversubscribed"}}));
  EXPECT_EQ(marks(Topology::synthetic("core:1 pu:4")),
            (Marks{{2, "smt"}, {3, "smt"}, {4, "smt"}, {5, "oversubscribed"}}));
}

TEST(Topology, NoPlacementLeavesThreadsUnbound) {
  EXPECT_EQ(Topology::synthetic(kTwoSockets).plan(Placement::none, 3), (Bindings(3, kUnbound)));
}

TEST(Topology, PlansWrapRoundAndArePrefixesOfEachOther) {
  const Topology t = Topology::synthetic(kTwoSockets);
  for (const Placement placement : {Placement::compact, Placement::scatter}) {
    const Bindings longest = t.plan(placement, kMaxThreads);
    ASSERT_EQ(longest.size(), kMaxThreads);
    for (unsigned i = 12; i < kMaxThreads; ++i) ASSERT_EQ(longest[i], longest[i - 12]);
    for (unsigned n : {1u, 5u, 12u, 13u, 100u})
      EXPECT_EQ(t.plan(placement, n), Bindings(longest.begin(), longest.begin() + n));
  }
}

TEST(Topology, OversubscriptionStartsPastTheLastUnit) {
  const Topology t = Topology::synthetic(kTwoSockets);
  EXPECT_FALSE(t.oversubscribed(12));
  EXPECT_TRUE(t.oversubscribed(13));
}

TEST(Topology, DefaultCountsSufficeForAScalingLawFromSixUnitsOn) {
  using Counts = std::vector<unsigned>;
  EXPECT_EQ(default_thread_counts(1), (Counts{1, 4}));
  EXPECT_EQ(default_thread_counts(2), (Counts{1, 2, 8}));
  EXPECT_EQ(default_thread_counts(4), (Counts{1, 2, 4, 16}));
  EXPECT_EQ(default_thread_counts(6), (Counts{1, 2, 3, 4, 5, 6, 24}));
  EXPECT_EQ(default_thread_counts(8), (Counts{1, 2, 3, 4, 6, 8, 32}));
  EXPECT_EQ(default_thread_counts(16), (Counts{1, 2, 3, 4, 6, 8, 12, 16, 64}));
  EXPECT_EQ(default_thread_counts(17), (Counts{1, 2, 4, 8, 16, 17, 68}));
  EXPECT_EQ(default_thread_counts(64), (Counts{1, 2, 4, 8, 16, 32, 64, 256}));
  EXPECT_EQ(default_thread_counts(256), (Counts{1, 2, 4, 8, 16, 32, 64, 128, 256, 1024}));
  EXPECT_EQ(default_thread_counts(kMaxThreads).back(), kMaxThreads);
  for (unsigned units = 6; units <= 300; ++units) {
    const Counts counts = default_thread_counts(units);
    EXPECT_GE(std::upper_bound(counts.begin(), counts.end(), units) - counts.begin(), 6) << units;
  }
}

TEST(Topology, EveryUnitOfALargeMachineIsUsedOnce) {
  const Topology t = Topology::synthetic("package:2 l3:16 core:8 pu:2");
  EXPECT_EQ(t.allowed().units, 512u);
  EXPECT_EQ(t.allowed().cores, 256u);
  EXPECT_EQ(t.allowed().packages, 2u);
  for (const Placement placement : {Placement::compact, Placement::scatter}) {
    const Bindings plan = t.plan(placement, 512);
    EXPECT_EQ(std::set<Binding>(plan.begin(), plan.end()).size(), 512u);
  }
}

TEST(Topology, MachinesWithoutCoresOrPackagesStillGetAPlan) {
  EXPECT_EQ(Topology::synthetic("pu:3").plan(Placement::compact, 4), (Bindings{0, 1, 2, 0}));
  EXPECT_EQ(Topology::synthetic("pu:3").plan(Placement::scatter, 4), (Bindings{0, 1, 2, 0}));
}

TEST(Topology, CachesOfOneSortAreListedOnceWithTheirCount) {
  const Topology t = Topology::synthetic("package:2 l3:1(size=32MiB) core:4 l1d:1(size=32KiB) pu:2");
  ASSERT_EQ(t.caches().size(), 2u);
  EXPECT_EQ(t.caches()[0].level, 1u);
  EXPECT_EQ(t.caches()[0].size, 32u << 10);
  EXPECT_EQ(t.caches()[0].num_sharing, 2u);
  EXPECT_EQ(t.caches()[0].count, 8u);
  EXPECT_EQ(t.caches()[1].level, 3u);
  EXPECT_EQ(t.caches()[1].num_sharing, 8u);
  EXPECT_EQ(t.caches()[1].count, 2u);
}

TEST(Topology, ThreadCountsOutOfRangeAreErrors) {
  const Topology t = Topology::synthetic(kTwoSockets);
  EXPECT_THROW(t.plan(Placement::compact, 0), std::runtime_error);
  EXPECT_THROW(t.plan(Placement::compact, kMaxThreads + 1), std::runtime_error);
}

TEST(Topology, NonsenseDescriptionsAreErrors) {
  EXPECT_THROW(Topology::synthetic("no such machine"), std::runtime_error);
}

TEST(Topology, PlacementNamesRoundTrip) {
  for (const Placement p : {Placement::compact, Placement::scatter, Placement::none})
    EXPECT_EQ(parse_placement(to_string(p)), p);
  EXPECT_THROW(parse_placement("close"), std::runtime_error);
}

TEST(Topology, UsesExactlyTheUnitsOfTheAffinityMask) {
  cpu_set_t mask;
  ASSERT_EQ(sched_getaffinity(0, sizeof mask, &mask), 0);
  for (int cpu = 0; cpu < CPU_SETSIZE; ++cpu) {
    if (!CPU_ISSET(cpu, &mask)) continue;
    // In a process of its own, so that the mask of this one stays.
    const pid_t child = fork();
    if (child == 0) {
      cpu_set_t one;
      CPU_ZERO(&one);
      CPU_SET(cpu, &one);
      if (sched_setaffinity(0, sizeof one, &one) != 0) _exit(2);
      try {
        const Topology t = Topology::of_this_process();
        _exit(t.plan(Placement::compact, 2) == Bindings{cpu, cpu} && t.oversubscribed(2) ? 0 : 1);
      } catch (const std::exception&) {
        _exit(3);
      }
    }
    int status = 0;
    waitpid(child, &status, 0);
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << "unit " << cpu;
  }
  EXPECT_EQ(Topology::of_this_process().units().size(), static_cast<unsigned>(CPU_COUNT(&mask)));
}

TEST(Topology, BindingToAUnitThatDoesNotExistIsAnError) {
  for (const unsigned unit : {8191u, 8192u, 1'000'000u})
    EXPECT_EQ(bind_this_thread(unit), std::errc::invalid_argument) << unit;
}

}  // namespace
}  // namespace icbench
