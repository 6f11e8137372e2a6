// Workload specifications: canonical names, every parameter, and errors of one line; what a sweep makes of
// them.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <set>
#include <stdexcept>

#include "files/memory.h"
#include "harness/topology.h"
#include "temporary_folder.h"
#include "workload/names.h"
#include "workload/spec.h"
#include "workload/sweep.h"

namespace icbench {
namespace {

TEST(Spec, EveryListedWorkloadParsesWithItsDefaults) {
  for (const WorkloadEntry& entry : list_workloads()) {
    const WorkloadSpec plain = parse_workload(entry.name);
    EXPECT_EQ(plain.name, entry.name);
    std::string full = entry.name + ":" + entry.parameters;
    std::replace(full.begin(), full.end(), ' ', ':');
    const WorkloadSpec spelt = parse_workload(full);
    EXPECT_EQ(spelt.name, full);
    EXPECT_EQ(spelt.kind, plain.kind);
    EXPECT_EQ(spelt.scene, plain.scene);
    EXPECT_EQ(spelt.a, plain.a);
    EXPECT_EQ(spelt.order, plain.order);
    EXPECT_EQ(spelt.records, plain.records);
    EXPECT_EQ(spelt.tidied, plain.tidied);
    EXPECT_EQ(spelt.operations, plain.operations);
    EXPECT_EQ(spelt.cost_us, plain.cost_us);
    EXPECT_EQ(spelt.rays, plain.rays);
    EXPECT_EQ(spelt.spp, plain.spp);
    EXPECT_EQ(spelt.width, plain.width);
    EXPECT_EQ(spelt.height, plain.height);
    EXPECT_EQ(spelt.tiles, plain.tiles);
    EXPECT_EQ(spelt.method, plain.method);
    EXPECT_EQ(spelt.cell, plain.cell);
  }
}

TEST(Spec, SyntheticParameters) {
  const WorkloadSpec s =
      parse_workload("mix_90_10:order=hot_spot:records=5:operations=7:a=0.125:scene=lit_floor");
  EXPECT_EQ(s.kind, WorkloadKind::mix);
  EXPECT_EQ(s.order, PointOrder::hot_spot);
  EXPECT_EQ(s.records, 5u);
  EXPECT_EQ(s.operations, 7u);
  EXPECT_EQ(s.a, 0.125f);
  EXPECT_EQ(s.scene, "lit_floor");
  EXPECT_TRUE(s.uses_cache());
  EXPECT_EQ(parse_workload("miss_driven:cost=2.5").cost_us, 2.5);
  EXPECT_EQ(parse_workload("miss_driven:cost=-0").name, parse_workload("miss_driven:cost=0").name);
  EXPECT_EQ(parse_workload("read_only:order=coherent").order, PointOrder::coherent);
  EXPECT_TRUE(parse_workload("mix_99_1:layout=tidied").tidied);
  EXPECT_TRUE(is_one_line_with(error_of([] { parse_workload("insert_only:layout=tidied"); }), "layout"));
}

TEST(Spec, RayTracedParameters) {
  const WorkloadSpec s =
      parse_workload("white_furnace:integrator=path:rays=9:a=0.5:spp=3:size=40x30:tiles=random");
  EXPECT_EQ(s.kind, WorkloadKind::ray_traced);
  EXPECT_EQ(s.scene, "white_furnace");
  EXPECT_EQ(s.method, Method::path);
  EXPECT_FALSE(s.uses_cache());
  EXPECT_EQ(s.rays, 9u);
  EXPECT_EQ(s.a, 0.5f);
  EXPECT_EQ(s.spp, 3u);
  EXPECT_EQ(s.width, 40u);
  EXPECT_EQ(s.height, 30u);
  EXPECT_EQ(s.tiles, TileOrder::random);
}

TEST(Spec, HashCellsUseNoCache) {
  const WorkloadSpec s = parse_workload("cornell_box:cell=2.5:integrator=hash_cells:spp=4");
  EXPECT_EQ(s.name, "cornell_box:integrator=hash_cells:spp=4:cell=2.5");
  EXPECT_EQ(s.method, Method::hash_cells);
  EXPECT_FALSE(s.uses_cache());
  EXPECT_EQ(s.cell, 2.5f);
}

TEST(Spec, WhatMakesNoDifferenceToTheIntegratorIsIdle) {
  const auto idle = [](const std::string& integrator) {
    return parse_workload("cornell_box:rays=4:a=0.2:spp=4:cell=2.5:size=8x8:integrator=" + integrator).idle;
  };
  using Keys = std::vector<std::string>;
  EXPECT_EQ(idle("irradiance_cache"), (Keys{"spp", "cell"}));
  EXPECT_EQ(idle("path"), (Keys{"rays", "a", "cell"}));
  EXPECT_EQ(idle("hash_cells"), (Keys{"rays", "a"}));
}

// Each session may hold tickets that it does not use: room for as many is left.
TEST(Spec, StoresNoMoreThanACacheOfAllSessionsHolds) {
  const std::uint64_t most = kMaxCapacity - std::uint64_t{kMaxSessions} * kTicketBatch;
  const auto storing = [](std::uint64_t n) {
    return parse_workload(fmt::format("mix_50_50:records=1000:operations={}", 2 * (n - 1000)));
  };
  EXPECT_EQ(storing(most).prefilled() + storing(most).inserts(), most);
  EXPECT_THROW(storing(most + 1), std::runtime_error);
}

TEST(Spec, InsertsOfAMixAreItsShare) {
  EXPECT_EQ(parse_workload("mix_99_1:operations=1000").inserts(), 10u);
  EXPECT_EQ(parse_workload("mix_90_10:operations=1000").inserts(), 100u);
  EXPECT_EQ(parse_workload("mix_50_50:operations=1000").inserts(), 500u);
  EXPECT_EQ(parse_workload("insert_only:records=33").inserts(), 33u);
  EXPECT_EQ(parse_workload("read_only").inserts(), 0u);
  EXPECT_EQ(parse_workload("miss_driven").inserts(), 0u);
}

TEST(Spec, NamesAreCanonical) {
  EXPECT_EQ(parse_workload("read_only:a=0.20:records=1e3").name, "read_only:records=1000:a=0.2");
  EXPECT_EQ(parse_workload("miss_driven:cost=10.0").name, "miss_driven:cost=10");
  EXPECT_EQ(parse_workload("cornell_box:size=0064x032:rays=4").name, "cornell_box:rays=4:size=64x32");
}

TEST(Spec, ErrorsAreOneLineThatNamesTheWorkload) {
  for (const char* text : {"read_only:",
                           "read_only::",
                           "read_only:a",
                           "read_only:a=",
                           "read_only:a=x",
                           "read_only:a=0",
                           "read_only:a=1.01",
                           "read_only:a=nan",
                           "read_only:a=inf",
                           "read_only:a=0.3 ",
                           "read_only:records=0",
                           "read_only:records=-1",
                           "read_only:records=2.5",
                           "read_only:records=16777217",
                           "read_only:operations=268435457",
                           "read_only:cost=1",
                           "read_only:size=4x4",
                           "insert_only:operations=5",
                           "miss_driven:records=5",
                           "miss_driven:cost=-1",
                           "miss_driven:cost=1e7",
                           "read_only:a=0.3:a=0.3",
                           "cornell_box:size=4",
                           "cornell_box:size=4x",
                           "cornell_box:size=x4",
                           "cornell_box:size=0x4",
                           "cornell_box:size=4x16385",
                           "cornell_box:size=4x4x4",
                           "cornell_box:rays=0",
                           "cornell_box:spp=0",
                           "cornell_box:order=uniform",
                           "mix_50_50:operations=268435456"}) {
    EXPECT_TRUE(
        is_one_line_with(error_of([text = text] { parse_workload(text); }), fmt::format("'{}'", text)));
  }
}

TEST(Spec, UnknownNamesGetTheNearest) {
  for (const auto& [text, nearest] : {std::pair{"red_only", "read_only"},
                                      {"cornel_box", "cornell_box"},
                                      {"read_only:recods=3", "records"},
                                      {"read_only:order=unifrm", "uniform"},
                                      {"read_only:scene=lit_flor", "lit_floor"},
                                      {"cornell_box:tiles=scan_line", "scanline"},
                                      {"cornell_box:integrator=pat", "path"}}) {
    EXPECT_TRUE(is_one_line_with(error_of([text = text] { parse_workload(text); }),
                                 fmt::format("did you mean '{}'?", nearest)));
  }
}

TEST(Names, AccuraciesReadAsTheyWereTyped) {
  EXPECT_EQ(shortest_decimal(0.3f), 0.3);
  EXPECT_EQ(shortest_decimal(0.001f), 0.001);
  EXPECT_EQ(shortest_decimal(1.0f), 1.0);
}

class MemoryOf : public ::testing::Test {
 protected:
  void says(const std::string& text) {
    std::filesystem::create_directory(folder / "proc");
    std::ofstream(folder / "proc/meminfo") << text;
  }

  TemporaryFolder folder;
};

TEST_F(MemoryOf, MachineIsComparedWithWhatIsAsked) {
  says("MemTotal:       3000000 kB\nHugePages_Total:       0\nMemAvailable:    1000000 kB\nCached: 5 kB\n");
  require_memory("it", 1'000'000ull * 1024, folder / "");
  EXPECT_TRUE(is_one_line_with(error_of([&] { require_memory("it", 1'000'001ull * 1024, folder / ""); }),
                               "it needs at least 1.0 GB"));
}

TEST_F(MemoryOf, UnknownMachineIsTrusted) {
  require_memory("it", ~0ull, folder / "");
  says("nothing of use\n");
  require_memory("it", ~0ull, folder / "");
}

class SweepPoints : public ::testing::Test {
 protected:
  static SweepRequest request(std::vector<unsigned> threads) {
    SweepRequest r;
    r.workloads = {parse_workload("read_only"), parse_workload("cornell_box:integrator=path:size=4x4")};
    r.caches = {"sequential", "global_mutex", "wait_free"};
    r.threads = std::move(threads);
    return r;
  }

  Topology topology = Topology::of_this_process();
};

TEST_F(SweepPoints, SingleThreadCachesRunWithOneThread) {
  const Sweep sweep(request({1, 4}), topology);
  std::set<std::string> names;
  for (const SweepPoint& p : sweep.points(0, 0)) names.insert(sweep.name_of(p));
  EXPECT_EQ(names, (std::set<std::string>{
                       "sweep/read_only/sequential/threads:1", "sweep/read_only/global_mutex/threads:1",
                       "sweep/read_only/wait_free/threads:1", "sweep/read_only/global_mutex/threads:4",
                       "sweep/read_only/wait_free/threads:4"}));
}

TEST_F(SweepPoints, WorkloadsWithoutCacheRunOnce) {
  const Sweep sweep(request({1, 4}), topology);
  const std::vector<SweepPoint> points = sweep.points(1, 0);
  ASSERT_EQ(points.size(), 2u);
  EXPECT_EQ(points[0].cache, nullptr);
  EXPECT_EQ(points[0].cache_name(), "none");
}

TEST_F(SweepPoints, CachesThatCannotTidyAreLeftOutWhereThatIsAskedFor) {
  SweepRequest tidied = request({2});
  tidied.workloads = {parse_workload("read_only:layout=tidied"), parse_workload("read_only")};
  tidied.caches = {"local_write", "packed_wait_free"};
  const Sweep sweep(tidied, topology);
  ASSERT_EQ(sweep.points(0, 0).size(), 1u);
  EXPECT_EQ(sweep.points(0, 0)[0].cache_name(), "packed_wait_free");
  EXPECT_EQ(sweep.points(1, 0).size(), 2u);
  tidied.workloads.resize(1);
  tidied.caches = {"local_write"};
  EXPECT_TRUE(is_one_line_with(error_of([&] { Sweep(tidied, topology); }), "layout=tidied"));
}

TEST_F(SweepPoints, EveryRepetitionHasAnOrderOfItsOwn) {
  const Sweep sweep(request({1, 2, 3, 4, 5, 6, 7, 8}), topology);
  std::set<std::vector<std::string>> orders, sets;
  for (unsigned repetition = 0; repetition < 4; ++repetition) {
    std::vector<std::string> names;
    for (const SweepPoint& p : sweep.points(0, repetition)) names.push_back(sweep.name_of(p));
    orders.insert(names);
    std::sort(names.begin(), names.end());
    sets.insert(names);
  }
  EXPECT_EQ(orders.size(), 4u);
  EXPECT_EQ(sets.size(), 1u);
}

TEST_F(SweepPoints, NoPointsOrUnknownCachesAreRefused) {
  SweepRequest none = request({2});
  none.workloads.resize(1);
  none.caches = {"sequential"};
  EXPECT_TRUE(is_one_line_with(error_of([&] { Sweep(none, topology); }), "--threads 1"));
  none.caches = {"waitfree"};
  EXPECT_TRUE(is_one_line_with(error_of([&] { Sweep(none, topology); }), "did you mean 'wait_free'?"));
}

}  // namespace
}  // namespace icbench
