// The caches under every schedule: promises hold, broken caches are caught, and a schedule can be had again.
#include <gtest/gtest.h>

#include <mutex>

#include "caches/locked.h"
#include "caches/packed_octree.h"
#include "caches/ward_tree.h"
#include "stress/explore/explore.h"
#include "stress/progress/step_sync.h"

namespace icbench::stress::explore {
namespace {

void ignore(const std::string&) {}

std::string_view structure_of(std::string_view cache) {
  for (const ExploreSubject& s : all_explore_subjects())
    if (s.name == cache) return s.traits.structure;
  return {};
}

/// Names of the scenarios that the short form has for caches of a structure.
std::vector<std::string_view> short_scenarios(std::string_view structure) {
  std::vector<std::string_view> names;
  for (const Scenario& s : all_scenarios())
    if (!s.is_long && (s.structure.empty() || s.structure == structure)) names.push_back(s.name);
  return names;
}

class Explored : public ::testing::TestWithParam<std::string> {};

TEST(ExploredScenarios, OfThePackedOctreeAreItsOwn) {
  EXPECT_EQ(short_scenarios("").size(), 19u);
  EXPECT_EQ(short_scenarios("packed").size(), 35u);
  EXPECT_EQ(short_scenarios("ward").size(), 19u);
}

TEST_P(Explored, KeepsItsPromiseUnderEverySchedule) {
  ExploreOptions options;
  options.caches = {GetParam()};
  const std::vector<Exploration> explorations = explore_all(options, ignore);
  EXPECT_EQ(explorations.size(), short_scenarios(structure_of(GetParam())).size() * kStampingNames.size());
  for (const Exploration& e : explorations) {
    EXPECT_TRUE(e.coverage.complete) << e.scenario;
    EXPECT_GT(e.coverage.schedules, 0u) << e.scenario;
    EXPECT_EQ(e.violations, 0u) << e.scenario << "\n" << e.witness << "\n" << e.replay;
  }
}

std::vector<std::string> driven_caches() {
  std::vector<std::string> names;
  for (const ExploreSubject& s : all_explore_subjects()) {
    if (s.explore != nullptr) names.emplace_back(s.name);
  }
  return names;
}

INSTANTIATE_TEST_SUITE_P(All, Explored, ::testing::ValuesIn(driven_caches()),
                         [](const auto& at) { return at.param; });

/// Bytes that the packed octree takes for the first insert of a scenario's first thread.
std::size_t taken_by_insert(const Scenario& s) {
  using Octree = Packed<PlainSync>;
  const Stage stage;
  const unsigned records = s.nearby + thread_count(s) + 1;
  Octree octree({.capacity = std::max(capacity_for(records, 1), s.capacity)});
  Octree::Workspace workspace;
  NoCounters uncounted;
  std::uint32_t id = 0;
  const auto insert = [&](std::uint32_t place, std::uint32_t size) {
    EXPECT_TRUE(octree.insert(workspace, stage.record(Stage::kind(place, size), id++), uncounted));
  };
  for (unsigned i = 0; i < s.nearby; ++i) insert(Stage::kNearby, 0);
  for (unsigned t = 0; t < thread_count(s); ++t) insert(Stage::kElsewhere, 1);
  const std::size_t before = Octree::bytes(workspace);
  insert(Stage::kHere, static_cast<std::uint32_t>(s.threads[0][1] - '0'));
  return Octree::bytes(workspace) - before;
}

TEST(ExploredScenarios, OfThePackedOctreeReachThePartsTheyAreNamedAfter) {
  constexpr std::size_t kRecord = 48, kNode = 64, kCell = 192, kMore = 384, kBrick = 864;
  // A first chunk, without the share of pieces' ends that a record counts for.
  constexpr std::size_t kListChunk = std::size_t{16} * (PackedCells<PlainSync>::List::kWorstUnits - 1);
  const std::pair<std::string_view, std::size_t> parts[] = {
      {"node", kNode + kCell}, {"brick", kBrick + kCell}, {"further", kMore}, {"last", 0},
      {"split", kCell},        {"list", kListChunk}};
  unsigned scenarios = 0;
  for (const Scenario& s : all_scenarios()) {
    if (s.structure != "packed") continue;
    unsigned named = 0;
    for (const auto& [part, bytes] : parts) {
      if (s.name.find(part) == s.name.npos) continue;
      ++named;
      EXPECT_EQ(taken_by_insert(s), kRecord + bytes) << s.name;
    }
    EXPECT_EQ(named, 1u) << s.name;
    ++scenarios;
  }
  EXPECT_EQ(scenarios, 20u);
}

TEST(ExploredControls, AreAllCaughtAndCanBeReplayed) {
  const std::vector<ExploredControl> controls = explore_controls({}, ignore);
  ASSERT_EQ(controls.size(), all_explore_controls().size());
  for (const ExploredControl& c : controls) {
    ASSERT_TRUE(c.is_caught) << c.control << ": " << c.fault;
    EXPECT_FALSE(c.witness.empty()) << c.control;
    const Replay first = replay(c.replay);
    EXPECT_TRUE(first.is_violated) << c.replay;
    EXPECT_NE(first.text.find(c.witness), std::string::npos) << first.text;
    EXPECT_EQ(first.text, replay(c.replay).text);
  }
}

TEST(ExploredControls, AreCaughtAfterTheSameSchedulesAgain) {
  const std::vector<ExploredControl> once = explore_controls({}, ignore),
                                     again = explore_controls({}, ignore);
  for (std::size_t i = 0; i < once.size(); ++i) {
    EXPECT_EQ(once[i].schedules, again[i].schedules) << once[i].control;
    EXPECT_EQ(once[i].replay, again[i].replay);
  }
}

TEST(ExploredControls, AStaleReadIsNamedInTheTrace) {
  for (const ExploredControl& c : explore_controls({}, ignore)) {
    if (c.control != "clock_read_late") continue;
    EXPECT_NE(replay(c.replay).text.find("stale"), std::string::npos) << c.replay;
  }
}

TEST(ExploredCaches, KeepTheirPromisesWithinABoundToo) {
  ExploreOptions options;
  options.caches = {"wait_free"};
  options.preemptions = 1;
  for (const Exploration& e : explore_all(options, ignore)) {
    EXPECT_EQ(e.violations, 0u) << e.scenario;
    EXPECT_TRUE(e.coverage.complete) << e.scenario;
    EXPECT_EQ(e.preemptions, 1u);
  }
}

// A lock that no model knows by name.
struct RecursiveMutex {
  static constexpr std::string_view kName = "recursive_mutex", kSource = "std::recursive_mutex";
  using Mutex = std::recursive_mutex;
  using Read = ExclusiveScope<Mutex>;
  using Write = ExclusiveScope<Mutex>;
};

// All threads of an execution are one thread of the system: the real mutex would let each of them in.
TEST(ExploredCaches, AnUnknownLockIsModelled) {
  using Cache = Locked<WardTree<PlainSync>, RecursiveMutex, NoCounters>;
  const Scenario* scenario = find_scenario("install");
  ASSERT_NE(scenario, nullptr);
  const ScenarioOutcome out = explore_cache<InModel<Cache>>(*scenario, Stamping::stamped, {}, 0);
  EXPECT_TRUE(out.coverage.complete);
  EXPECT_GT(out.coverage.schedules, 1u);
  for (const ScenarioOutcome::Finding& finding : out.findings)
    EXPECT_EQ(finding.violations, 0u) << finding.witness;
  static_assert(!std::is_same_v<Stepped<Cache>, Cache>, "its steps are counted on a model too");
}

void expect_refused(const std::string& id, const std::string& hint) {
  try {
    replay(id);
    ADD_FAILURE() << id << " was replayed";
  } catch (const std::runtime_error& e) {
    EXPECT_NE(std::string(e.what()).find(hint), std::string::npos) << e.what();
  }
}

TEST(Replay, RefusesWhatIsNoSchedule) {
  expect_refused("wait_free", "CACHE:SCENARIO");
  expect_refused("wait_fre:install:stamped:0", "did you mean 'wait_free'");
  expect_refused("wait_free:instal:stamped:0", "did you mean 'install'");
  expect_refused("wait_free:install:stampd:0", "did you mean 'stamped'");
  expect_refused("wait_free:install:stamped:", "looks like");
  expect_refused("wait_free:install:stamped:1x2", "looks like");
  expect_refused("wait_free:install:stamped:0t3", "no such schedule");
  expect_refused("wait_free:install:stamped:0r9", "no such schedule");
  expect_refused("wait_free:install:stamped:900t1", "no such schedule");
  EXPECT_FALSE(replay("wait_free:install:stamped:0").is_violated);
}

}  // namespace
}  // namespace icbench::stress::explore
