// The simulator: deterministic, on one core the same as the real thing, and where a closed form is known, as that says.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cmath>
#include <fstream>
#include <set>

#include "caches/registry.h"
#include "made_points.h"
#include "simulate/calibration.h"
#include "simulate/engine.h"
#include "simulate/validation.h"
#include "temporary_folder.h"
#include "workload/dispatch.h"

namespace icbench {
namespace {

constexpr std::uint64_t kSeed = 5;
/// Who waits notices at once.
constexpr WaitCosts kAtOnce{0.0, 0.0, {}, {}, 0.0, 0.0, 0.0, 0.0, {}, {}};

/// Every query and insert takes as long as every other.
CacheCosts flat_costs(double query_ns, double insert_ns, double outside_ns = 0.0) {
  CacheCosts c;
  c.operations.query = SizeCost({query_ns});
  c.operations.insert = SizeCost({insert_ns});
  c.outside_query_ns = c.outside_insert_ns = outside_ns;
  return c;
}

MachineModel machine_of(unsigned cores, double transfer_ns) {
  MachineModel m;
  m.cores = cores;
  m.transfers.ns.fill(transfer_ns);
  return m;
}

SimulatedOutcome run(const SyntheticPlan& plan, std::string_view name, const MachineModel& machine,
                     const CacheCosts& costs, std::uint64_t seed = kSeed, const WaitCosts& waits = kAtOnce) {
  const auto program = simulated_program(plan, machine.cores, seed);
  const CacheEntry& entry = find_cache(name);
  const Mechanism mechanism = mechanism_of(entry.traits);
  const CacheConfig config = program->config(machine.cores);
  const auto cache = mechanism.node_locks == Mechanism::NodeLocks::none
                         ? entry.stepped(config)
                         : make_logged_node_locks(entry.traits, config);
  return simulate(*program, *cache, {machine, waits, costs, mechanism, seed});
}

/// `n` points so far apart that a record answers at its own only.
SyntheticPlan lonely_points(const std::string& workload, std::uint32_t n) {
  PlanPoints points;
  for (std::uint32_t i = 0; i < n; ++i) {
    points.queries.points.push_back(
        {{(static_cast<float>(i) + 0.5f) / static_cast<float>(n), 0.5f, 0.0f}, {0, 0, 1}});
    points.queries.radii.push_back(0.1f / static_cast<float>(n));
  }
  return {parse_workload(workload), std::move(points), 1};
}

TEST(Simulator, EqualInputsGiveEqualOutcomes) {
  const SyntheticPlan plan = made_plan("miss_driven:operations=3000:cost=1");
  for (const char* cache : {"packed_global_mutex", "global_spin", "queuing_mutex", "shared_mutex",
                            "spin_rw_mutex", "packed_distributed_rw", "node_lock", "packed_node_lock",
                            "packed_local_write", "wait_free_snapshot", "tbb_hash_grid", "append_log"}) {
    const auto once = run(plan, cache, machine_of(12, 30.0), flat_costs(200.0, 500.0, 20.0));
    const auto again = run(plan, cache, machine_of(12, 30.0), flat_costs(200.0, 500.0, 20.0));
    EXPECT_EQ(once.wall_ns, again.wall_ns) << cache;
    EXPECT_EQ(once.busy_ns, again.busy_ns) << cache;
    EXPECT_EQ(once.lock_wait_ns, again.lock_wait_ns) << cache;
    EXPECT_EQ(once.lock_contended, again.lock_contended) << cache;
    EXPECT_EQ(once.digest, again.digest) << cache;
    EXPECT_EQ(once.queries, 3000u) << cache;
    EXPECT_EQ(once.inserts, once.records) << cache;
    const auto other = run(plan, cache, machine_of(12, 30.0), flat_costs(200.0, 500.0, 20.0), kSeed + 1);
    EXPECT_NE(once.digest, other.digest) << cache;
  }
}

TEST(Simulator, OneCoreLeavesTheRecordsOfOneRealThread) {
  for (const char* workload : {"miss_driven:operations=2000", "mix_50_50:records=200:operations=1000"}) {
    const SyntheticPlan plan = made_plan(workload);
    const Streams streams = plan.streams(1, kSeed);
    Sequential<> real(plan.config(1));
    auto session = real.open_session(0);
    for (std::uint32_t i = 0; i < plan.prefilled(); ++i) session.insert(plan.records()[i]);
    std::uint64_t hits = 0;
    for (std::uint32_t i = 0; i < streams.operations.size(); ++i) {
      const std::uint32_t operation = streams.operations[i];
      if ((operation & Streams::kInsert) != 0) {
        session.insert(plan.records()[operation & Streams::kIndex]);
      } else if (session.query(plan.points()[operation])) {
        ++hits;
      } else if (plan.spec().kind == WorkloadKind::miss_driven) {
        session.insert(plan.record_at(streams, i));
      }
    }
    RecordsDigest digest;
    std::uint64_t records = 0;
    real.for_each_record([&](const Record& r) {
      digest.add(r);
      ++records;
    });
    for (const CacheEntry& entry : all_caches()) {
      if (entry.traits.consistency == Consistency::none || !has_model(entry.traits)) continue;
      const auto o = run(plan, entry.traits.name, machine_of(1, 30.0), flat_costs(200.0, 500.0));
      EXPECT_EQ(o.digest, digest.value()) << entry.traits.name << ", " << workload;
      EXPECT_EQ(o.records, records) << entry.traits.name;
      EXPECT_EQ(o.hits, hits) << entry.traits.name;
      EXPECT_EQ(o.lock_wait_ns, 0.0) << entry.traits.name;
      EXPECT_EQ(o.transfer_ns, 0.0) << entry.traits.name;
    }
  }
}

TEST(Simulator, LocalWriteRepeatsWhatEveryThreadNeeds) {
  const SyntheticPlan plan = lonely_points("miss_driven:operations=6400:cost=1", 40);
  for (const unsigned cores : {1u, 2u, 16u, 64u}) {
    const Streams streams = plan.streams(cores, kSeed);
    std::uint64_t needed = 0;  // by each thread alone
    for (unsigned t = 0; t < cores; ++t) {
      const auto mine = streams.of(t);
      needed += std::set<std::uint32_t>(mine.begin(), mine.end()).size();
    }
    EXPECT_EQ(run(plan, "packed_local_write", machine_of(cores, 30.0), flat_costs(100.0, 100.0)).records,
              needed);
    EXPECT_GE(needed, 35u * cores);
    if (cores == 16) {
      EXPECT_LT(run(plan, "packed_wait_free", machine_of(cores, 30.0), flat_costs(100.0, 100.0)).records,
                400u);
    }
  }
}

// A record is there when its computation and its insert are over: who asks before computes one too.
TEST(Simulator, WhoAsksBeforeARecordIsThereMakesOneToo) {
  constexpr unsigned kCores = 6;
  const SyntheticPlan plan = lonely_points("miss_driven:operations=18:cost=1", 1);
  for (const char* cache : {"wait_free", "packed_distributed_rw", "append_log"}) {
    const auto o = run(plan, cache, machine_of(kCores, 0.0), flat_costs(100.0, 100.0));
    EXPECT_EQ(o.records, kCores) << cache;
    EXPECT_EQ(o.hits, 2 * kCores) << cache;
  }
}

TEST(Simulator, WithoutContentionCoresShareTheWork) {
  const SyntheticPlan plan = made_plan("read_only:records=100:operations=1600");
  for (const char* cache : {"wait_free", "packed_local_write", "distributed_rw"}) {
    const auto o = run(plan, cache, machine_of(16, 0.0), flat_costs(100.0, 0.0, 20.0));
    EXPECT_NEAR(o.wall_ns, 100 * 120.0, 1e-6) << cache;
    EXPECT_NEAR(o.busy_ns, 16 * o.wall_ns, 1e-6) << cache;
  }
}

TEST(Simulator, ComputingTakesWhatItTakesOnThatManyCores) {
  const SyntheticPlan queries = made_plan("read_only:records=100:operations=1600");
  const SyntheticPlan work = lonely_points("miss_driven:operations=18:cost=1", 18);
  const auto at_pace = [](unsigned cores) {
    MachineModel m = machine_of(cores, 0.0);
    m.pace = {1.25, 1.5};
    return m;
  };
  // Records by what they are called, operations by what they were measured at: alone.
  const auto alone = run(work, "wait_free", at_pace(1), flat_costs(0.0, 0.0));
  const auto together = run(work, "wait_free", at_pace(2), flat_costs(0.0, 0.0));
  ASSERT_GT(alone.inserts, 9u);
  EXPECT_NEAR(alone.wall_ns, static_cast<double>(alone.inserts) * 1250.0, 1e-6);
  EXPECT_NEAR(together.work_ns, static_cast<double>(together.inserts) * 1500.0, 1e-6);
  EXPECT_NEAR(run(queries, "wait_free", at_pace(1), flat_costs(100.0, 0.0)).wall_ns, 1600 * 100.0, 1e-6);
  EXPECT_NEAR(run(queries, "wait_free", at_pace(2), flat_costs(100.0, 0.0)).wall_ns, 800 * 120.0, 1e-6);
}

TEST(Simulator, AGlobalLockServesOneSectionAtATime) {
  const SyntheticPlan plan = made_plan("read_only:records=100:operations=1600");
  const auto o = run(plan, "queuing_mutex", machine_of(16, 0.0), flat_costs(100.0, 0.0, 50.0));
  EXPECT_NEAR(o.wall_ns, 50.0 + 1600 * 100.0, 1e-6);
  // Each hand-over moves the word of who leaves there, that of who comes away and back, and nobody is inside meanwhile.
  const auto moved = run(plan, "queuing_mutex", machine_of(16, 30.0), flat_costs(100.0, 0.0, 50.0));
  EXPECT_NEAR(moved.wall_ns / 1600, 190.0, 1.0);
  for (const char* cache : {"global_mutex", "global_spin"}) {
    EXPECT_GE(run(plan, cache, machine_of(16, 30.0), flat_costs(100.0, 0.0, 50.0)).wall_ns, 1600 * 100.0)
        << cache;
  }
}

TEST(Simulator, WhoQueuesWaitsForAllBefore) {
  constexpr double kSection = 100.0;
  constexpr unsigned kThreads = 8, kEach = 50;
  const SyntheticPlan plan = made_plan("read_only:records=100:operations=400");
  const auto o = run(plan, "queuing_mutex", machine_of(kThreads, 0.0), flat_costs(kSection, 0.0));
  // The first time behind those who came first, then always behind all the others.
  constexpr double kSections = kThreads * (kThreads - 1) / 2 + (kEach - 1) * kThreads * (kThreads - 1);
  EXPECT_NEAR(o.lock_wait_ns, kSection * kSections, 1e-6);
  EXPECT_EQ(o.lock_contended, kThreads * kEach - 1);
}

// All queries go through the region at the root, if one record reaches all of the space; else most do not meet.
TEST(Simulator, RegionsAreHeldUntilTheOperationIsOver) {
  PlanPoints points;
  points.queries.points.assign(1, {{0.5f, 0.5f, 0.0f}, {0, 0, 1}});
  points.queries.radii.assign(1, 0.1f);
  const SyntheticPlan one{parse_workload("miss_driven:operations=1600:cost=0"), std::move(points), 1};
  const auto o = run(one, "packed_node_lock", machine_of(16, 0.0), flat_costs(100.0, 100.0));
  EXPECT_NEAR(o.wall_ns, 1600 * 100.0, 50 * 100.0);  // a query after the other
  EXPECT_GT(o.lock_wait_ns, 0.8 * 16 * o.wall_ns);
  const auto apart = run(lonely_points("miss_driven:operations=20000:cost=0", 20000), "packed_node_lock",
                         machine_of(16, 0.0), flat_costs(100.0, 100.0));
  EXPECT_LT(apart.wall_ns, 0.5 * 20000 * 200.0);
}

/// What an operation takes beyond what it takes by itself is around it, and the sum stays.
TEST(Simulator, OperationsHoldNoLongerThanByThemselves) {
  CacheCosts costs = flat_costs(200.0, 400.0, 20.0);
  costs.query_ns = 200.0;
  costs.insert_ns = 400.0;
  EXPECT_EQ(costs.by_themselves().to_json(), costs.to_json());  // not measured
  costs.query_alone_ns = 150.0;
  costs.insert_alone_ns = 500.0;
  const CacheCosts split = costs.by_themselves();
  EXPECT_DOUBLE_EQ(split.operations.query.at(1), 150.0);
  EXPECT_DOUBLE_EQ(split.outside_query_ns, 70.0);
  EXPECT_EQ(split.operations.insert.at(1), 400.0);
  EXPECT_EQ(split.outside_insert_ns, 20.0);
  EXPECT_EQ(split.by_themselves().to_json(), split.to_json());
  EXPECT_DOUBLE_EQ(costs.by_themselves(160.0).operations.query.at(1), 160.0);  // what its lock takes at least

  const SyntheticPlan plan = made_plan("read_only:records=100:operations=1000");
  EXPECT_NEAR(run(plan, "global_mutex", machine_of(1, 0.0), costs).wall_ns, 1000 * 220.0, 1e-6);
  // Two threads wait for what is held, not for what is around it.
  EXPECT_NEAR(run(plan, "global_mutex", machine_of(2, 0.0), costs).wall_ns, 1000 * 150.0, 1000.0);
}

/// How long operations take by themselves decides nothing but times; their mean is the cost.
TEST(Simulator, OperationsLieAboutTheirMean) {
  std::vector<double> ratios;
  for (int i = 0; i < 1000; ++i) ratios.push_back(i % 4 == 0 ? 2.5 : 0.5);
  const Spread spread = Spread::of(ratios);
  double sum = 0.0;
  for (const double factor : spread.factors()) sum += factor;
  EXPECT_NEAR(sum / static_cast<double>(spread.factors().size()), 1.0, 1e-12);
  EXPECT_EQ(Spread::of({}).factors(), std::vector<double>{1.0});
  EXPECT_EQ(Spread::of(std::vector<double>(100, 0.0)).factors(), std::vector<double>{1.0});

  const SyntheticPlan plan = made_plan("read_only:records=100:operations=16000");
  CacheCosts costs = flat_costs(100.0, 0.0);
  costs.operations.query_spread = spread;
  const auto o = run(plan, "wait_free", machine_of(1, 0.0), costs);
  EXPECT_NEAR(o.wall_ns, 16000 * 100.0, 4 * 87.0 * std::sqrt(16000.0));  // standard deviation of one: 87
  EXPECT_NE(o.wall_ns, 16000 * 100.0);
}

/// Whoever lets go before the kernel has looked need not wake, and costs nobody a wake-up.
TEST(Simulator, WhoIsLetInBeforeTheKernelLooksDoesNotSleep) {
  const SyntheticPlan plan = made_plan("read_only:records=100:operations=400");
  WaitCosts waits = kAtOnce;
  waits.wake_delay_ns = BySleep::always(1e6);
  waits.check_ns = 150.0;
  waits.park_ns = 200.0;
  // Two threads that arrive together: one is in for 100 ns, so the other is called back.
  const auto awake = run(plan, "global_mutex", machine_of(2, 0.0), flat_costs(100.0, 0.0), kSeed, waits);
  EXPECT_LT(awake.wall_ns, 1e6);
  EXPECT_GT(awake.lock_contended, 0u);
  waits.check_ns = 50.0;
  const auto asleep = run(plan, "global_mutex", machine_of(2, 0.0), flat_costs(100.0, 0.0), kSeed, waits);
  EXPECT_GT(asleep.wall_ns, 1e6);
}

/// How long waking takes depends on how long the sleep was.
TEST(Simulator, WhoWaitsInAQueueLooksNowAndThen) {
  // Looks are after 0, 10, 30, 70, 150, 310 ns, and then every 100.
  const QueueHandOver reckoned = QueueHandOver::reckoned(10.0, 100.0, 0.0);
  EXPECT_EQ(reckoned.ns[0], 30.0 - 12.5);
  EXPECT_EQ(reckoned.ns[1], 70.0 - 37.5);
  EXPECT_EQ(reckoned.ns[12], 410.0 - 312.5);
  EXPECT_EQ(reckoned.ns[16], 510.0 - 412.5);
  EXPECT_EQ(reckoned.leaving(0.0), 0.0);
  // Two journeys until it can be seen at 40.5, and one of what is seen.
  EXPECT_EQ(QueueHandOver::reckoned(10.0, 100.0, 14.0).ns[0], 70.0 - 12.5 + 14.0);

  QueueHandOver measured{.leave_ns = 8.0, .transfer_ns = 20.0};
  for (std::size_t i = 0; i < QueueHandOver::kWaits; ++i) measured.ns[i] = static_cast<double>(i);
  EXPECT_EQ(measured.after(0.0, 20.0, 100.0), 0.0);
  EXPECT_EQ(measured.after(30.0, 20.0, 100.0), 1.0);
  EXPECT_EQ(measured.after(30.0, 30.0, 100.0),
            20.0 + 2.0 + 10.0);  // as let in 20 later, and 10 on the way back
  EXPECT_EQ(measured.after(30.0, 0.0, 100.0), 0.0);
  EXPECT_EQ(measured.after(1'610.0, 20.0, 100.0), 60.0);  // as 100 before
  EXPECT_EQ(measured.after(8'510.0, 20.0, 100.0), 60.0);
  EXPECT_EQ(measured.after(1'610.0, 20.0, 0.0), 63.0);
  EXPECT_GE(measured.after(1e20, 20.0, 100.0), 0.0);
  EXPECT_LE(measured.after(1e20, 20.0, 100.0), 63.0);
  EXPECT_EQ(measured.leaving(20.0), 8.0);
  EXPECT_EQ(measured.leaving(50.0), 38.0);
  EXPECT_EQ(measured.leaving(0.0), 0.0);

  // Two threads that take turns: each hand-over takes what it takes after such a wait.
  constexpr double kSection = 100.0, kHandOver = 40.0, kLeaving = 5.0;
  WaitCosts waits = kAtOnce;
  waits.queue.ns.fill(kHandOver);
  waits.queue.leave_ns = kLeaving;
  const SyntheticPlan plan = made_plan("read_only:records=100:operations=400");
  const auto o = run(plan, "queuing_mutex", machine_of(2, 0.0), flat_costs(kSection, 0.0), kSeed, waits);
  EXPECT_EQ(o.lock_contended, 399u);
  EXPECT_NEAR(o.wall_ns, 400 * kSection + 399 * kHandOver + kLeaving, kLeaving);
}

TEST(Simulator, WakingTakesWhatItTakesAfterSuchASleep) {
  BySleep times;
  for (std::size_t i = 0; i < BySleep::kSleeps; ++i) times.ns[i] = 100.0 * static_cast<double>(i);
  EXPECT_EQ(times.after(0.0), 0.0);
  EXPECT_EQ(times.after(500.0), 0.0);
  EXPECT_NEAR(times.after(500.0 * std::sqrt(2.0)), 50.0, 1e-9);
  EXPECT_NEAR(times.after(4'000.0), 300.0, 1e-9);
  EXPECT_EQ(times.after(64'000.0), 700.0);
  EXPECT_EQ(times.after(1e20), 700.0);

  WaitCosts waits = kAtOnce;
  waits.wake_delay_ns = times;
  std::vector<double> woken;
  const MachineModel machine = machine_of(2, 0.0);
  const auto lock = make_lock(LockKind::mutex, machine, waits, kSeed,
                              [&](unsigned, double time) { woken.push_back(time); });
  EXPECT_TRUE(lock->enter({0, 0, true}, 0.0).is_in);
  EXPECT_FALSE(lock->enter({1, 1, true}, 1'000.0).is_in);
  lock->leave({0, 0, true}, 9'000.0);  // 8 us later
  EXPECT_EQ(woken, std::vector<double>{9'400.0});
}

// Readers that count themselves on one line wait for the line, twice a query; those with lines of their own do not.
TEST(Simulator, AWordThatAllWriteServesOneTransferAtATime) {
  const SyntheticPlan plan = made_plan("read_only:records=100:operations=3200");
  for (const char* cache : {"shared_mutex", "spin_rw_mutex"}) {
    const auto o = run(plan, cache, machine_of(32, 30.0), flat_costs(100.0, 0.0));
    EXPECT_NEAR(o.wall_ns / 3200, 2 * 30.0, 2.0) << cache;
  }
  EXPECT_NEAR(run(plan, "distributed_rw", machine_of(32, 30.0), flat_costs(100.0, 0.0)).wall_ns, 100 * 100.0,
              1e-6);
  Line line;
  const MachineModel machine = machine_of(3, 30.0);
  EXPECT_EQ(line.write(machine, 0, 100.0), 100.0);
  EXPECT_EQ(line.write(machine, 0, 200.0), 200.0);
  EXPECT_EQ(line.write(machine, 1, 200.0), 230.0);
  EXPECT_EQ(line.write(machine, 2, 200.0), 260.0);  // after the one before
  EXPECT_EQ(line.read(machine, 0, 300.0), 330.0);
  EXPECT_EQ(line.read(machine, 0, 400.0), 400.0);
  EXPECT_EQ(line.write(machine, 2, 500.0), 530.0);  // it tells the reader
}

TEST(Simulator, SocketsAndComplexesAreApart) {
  MachineModel m;
  m.cores = 256;
  m.cores_per_complex = 8;
  m.cores_per_socket = 64;
  m.transfers.ns = {1.0, 2.0, 3.0};
  EXPECT_EQ(m.transfer_ns(5, 5), 0.0);
  EXPECT_EQ(m.transfer_ns(0, 7), 1.0);
  EXPECT_EQ(m.transfer_ns(7, 8), 2.0);
  EXPECT_EQ(m.transfer_ns(63, 64), 3.0);
  // What is far costs no less than what is near.
  EXPECT_EQ(Transfers().with_near(20.0).ns, (std::array{20.0, 107.0, 197.0}));
  EXPECT_EQ(Transfers().with_near(130.0).ns, (std::array{130.0, 130.0, 197.0}));
}

TEST(Simulator, EveryLockLetsEverybodyInWhoeverWrites) {
  const SyntheticPlan plan = made_plan("mix_50_50:records=100:operations=4000");
  for (const CacheEntry& entry : all_caches()) {
    if (entry.traits.single_thread || entry.traits.consistency == Consistency::none ||
        !has_model(entry.traits))
      continue;
    const auto o = run(plan, entry.traits.name, machine_of(40, 30.0), flat_costs(150.0, 300.0, 10.0));
    EXPECT_EQ(o.operations, 4000u) << entry.traits.name;
    EXPECT_EQ(o.records, 2100u) << entry.traits.name;
    EXPECT_LE(o.busy_ns, 40 * o.wall_ns * (1 + 1e-12)) << entry.traits.name;
    EXPECT_GE(o.busy_ns, 0.0) << entry.traits.name;
  }
}

TEST(SimulatorValidation, RowsCarryItsOutcomeWhateverWasKnownBefore) {
  ComparedPoint compared{};
  compared.entries.resize(3);
  compared.simulated.throughput = compared.measured.throughput = {2e6, 3e6, 4e6};
  compared.simulated.redundant = compared.measured.redundant = {1, 1, 1};
  compared.simulated.records = compared.measured.records = {10, 10, 10};
  compared.simulated.waiting = compared.measured.waiting = {0.0, 0.0, 0.0};
  for (const unsigned before : {0u, 2u, 64u}) {
    for (Entry& e : compared.entries) e.counters["validated_to_threads"] = before;
    Validation outcome{.threads = 8, .points = 60, .throughput_error = 0.05, .waiting_error = 0.09};
    for (Entry& e : compared.entries) e.counters["validated_error"] = 0.0123;
    compared.point.cores = 2;
    EXPECT_EQ(row_of(compared, outcome).counters["validated_to_threads"], 8u) << before;
    EXPECT_EQ(row_of(compared, outcome).counters["validated_error"], compared.throughput_error());
    compared.point.cores = 1;
    EXPECT_FALSE(row_of(compared, outcome).counters.contains("validated_error"));
    outcome.file_error = 0.5;
    EXPECT_EQ(row_of(compared, outcome).counters["validated_to_threads"], 0u) << before;
    EXPECT_FALSE(row_of(compared, outcome).counters.contains("validated_error"));
  }
}

TEST(SimulatorValidation, ARowIsOneRoundWithAllOfItsFigures) {
  for (const std::vector<double>& throughput : {std::vector{4e6, 2e6, 3e6}, {4e6, 3e6, 2e6, 5e6}}) {
    ComparedPoint compared{};
    for (const double rate : throughput) {
      Entry e;
      e.items_per_second = rate;
      e.real_time = 1e3 * 6e6 / rate;
      e.counters = {{"redundant_records", rate / 1e6}, {"records", 10}, {"lock_wait_share", 0.5}};
      compared.simulated.add(e);
      compared.measured.add(e);
      compared.entries.push_back(e);
    }
    const Entry row = row_of(compared, {});
    EXPECT_EQ(row.items_per_second, 3e6);
    EXPECT_EQ(row.real_time, 2e3);
    EXPECT_EQ(row.counters["redundant_records"], 3.0);
  }
}

TEST(Calibration, ComesBackFromItsFileAndIsRefusedDamaged) {
  const TemporaryFolder folder;
  const std::string path = (folder / "deep" / "calibration.json").string();
  EXPECT_FALSE(read_calibration(path));
  Calibration c;
  c.host_name = "a host";
  c.transfers.ns = {1.5, 2.5, 3.5};
  c.waits.park_ns = 17.0;
  c.waits.queue.ns[3] = 7.0;
  c.waits.queue.leave_ns = 2.0;
  c.pace = {1.25, 1.5};
  c.costs["a cache under a workload"] = flat_costs(1.0, 2.0, 3.0);
  c.validation = Validation{.threads = 2,
                            .cores_per_complex = 8,
                            .cores_per_socket = 64,
                            .points = 60,
                            .records_points = 36,
                            .waiting_points = 40,
                            .throughput_error = 0.05,
                            .waiting_error = 0.09,
                            .file_error = 0.08,
                            .date = "today",
                            .commit = "a build",
                            .errors = {{"a cache under a workload", 0.07}}};
  write_calibration(c, path);
  EXPECT_EQ(read_calibration(path)->to_json(), c.to_json());
  EXPECT_TRUE(read_calibration(path)->validation->holds());
  // Another process's costs and validation stay.
  Calibration before = c;
  before.validation.reset();
  before.costs["another"] = flat_costs(4.0, 5.0, 6.0);
  add_costs(before, "another", path);
  EXPECT_TRUE(read_calibration(path)->validation);
  EXPECT_EQ(read_calibration(path)->costs.size(), 2u);
  write_validated(c, path);
  EXPECT_EQ(read_calibration(path)->costs.size(), 2u);
  before.date = "another day";
  add_costs(before, "another", path);
  EXPECT_FALSE(read_calibration(path)->validation) << "it was of another measurement";
  write_calibration(c, path);

  EXPECT_THROW(read_calibration((folder / "deep").string()), std::runtime_error);
  const std::string pipe = (folder / "pipe").string();
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_THROW(read_calibration(pipe), std::runtime_error) << "nobody writes to it";
  for (const auto& [key, value] : std::initializer_list<std::pair<const char*, nlohmann::ordered_json>>{
           {"format", "something else"},
           {"version", 1},
           {"transfer_ns", {1.0, 2.0}},
           {"waits", 3},
           {"pace", {1.0}},
           {"pace", {0.0, 1.0}},
           {"pace", {1.0, 0.0}},
           {"harness_query_ns", -1.0},
           {"costs", {{"a", {{"query_ns", 3}}}}},
           {"validation", {{"threads", "two"}}}}) {
    nlohmann::ordered_json damaged = c.to_json();
    damaged[key] = value;
    std::ofstream(path) << damaged;
    EXPECT_THROW(read_calibration(path), std::runtime_error) << key;
  }
}

}  // namespace
}  // namespace icbench
