// Where time goes: the accounting on made-up stamps, the timeline's bounds and format, hardware counters where there
// are none, and a thread that is held.
#include <gtest/gtest.h>
#include <linux/perf_event.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <future>
#include <map>
#include <random>
#include <semaphore>
#include <set>
#include <string>
#include <thread>

#include "core/sanitizers.h"
#include "core/sync.h"
#include "harness/held_thread.h"
#include "harness/perf_counters.h"
#include "harness/time_account.h"
#include "harness/timeline.h"

namespace icbench {
namespace {

// ThreadSanitizer keeps signals back until their thread makes a call that it intercepts.
constexpr bool kSignalsWait = kThreadSanitizer;

constexpr TickRate kHalf{.ns_per_tick = 0.5};

TEST(ThreadTicks, PutsEveryTickOfAStretchWhereItBelongs) {
  ThreadTicks t;
  t.add(Doing::query, 100, 30, 50);  // asleep for all of the wait, and off for 20 more while holding
  EXPECT_EQ(t.query, 50u);
  EXPECT_EQ(t.wanting, 30u);
  EXPECT_EQ(t.holding, 20u);
  EXPECT_EQ(t.lock_wait, 0u);
  t.add(Doing::insert, 100, 60, 10);  // spinning for 50 of the wait
  EXPECT_EQ(t.insert, 40u);
  EXPECT_EQ(t.lock_wait, 50u);
  EXPECT_EQ(t.wanting, 40u);
  t.add(Doing::record, 1000, 0, 300);
  EXPECT_EQ(t.record, 700u);
  EXPECT_EQ(t.displaced, 300u);
  t.add(Doing::other, 7, 0, 0);
  EXPECT_EQ(t.other, 7u);
  EXPECT_EQ(t.records, 1u);
  EXPECT_EQ(t.sum(), 1207u);
}

TEST(ThreadTicks, AddsUpToTheStretchesWhateverTheReadingsSay) {
  std::mt19937_64 random(1);
  ThreadTicks t;
  std::uint64_t sum = 0;
  for (int i = 0; i < 10'000; ++i) {
    const std::uint64_t length = random() % 1000;
    t.add(static_cast<Doing>(random() % 4), length, random() % 1500, random() % 1500);
    sum += length;
    ASSERT_EQ(t.sum(), sum);
  }
}

/// Two threads, the second late and done early, 1000 ns in all; then a merge of 100 ns.
TeamTimes made_times() {
  TeamTimes times;
  times.threads = {{0, 5000, 6000, 900}, {0, 5040, 5900, 800}};
  return times;
}

TEST(TimeBreakdown, PartsOfMadeUpReadingsAddUpToWallTimeTimesThreads) {
  TimeBreakdown b;
  b.add_region(made_times(), 100.0, 150.0);
  EXPECT_EQ(b.total, 2 * 1100.0);
  EXPECT_EQ(b.merge, 150.0);
  EXPECT_EQ(b.barrier, 40.0 + 100.0 + 50.0);
  ThreadTicks first, second;
  first.add(Doing::query, 2000, 500, 400);  // 1000 ns
  second.add(Doing::record, 1720, 0, 20);   // 860 ns
  b.add_thread(first, kHalf);
  b.add_thread(second, kHalf);
  EXPECT_EQ(b.query, 750.0);
  EXPECT_EQ(b.wanting, 200.0);
  EXPECT_EQ(b.lock_wait, 50.0);
  EXPECT_EQ(b.work, 850.0);
  EXPECT_EQ(b.displaced, 10.0);
  EXPECT_EQ(b.records, 1u);
  EXPECT_EQ(b.sum(), b.total);
}

TEST(TimeBreakdown, MergingByMoreThreadsThanTheTeamHasIsNotMoreThanThereIs) {
  TimeBreakdown b;
  b.add_region(made_times(), 100.0, 1000.0);
  EXPECT_EQ(b.merge, 200.0);
  EXPECT_EQ(b.barrier, 140.0);
}

TEST(ThreadAccount, LeavesNothingBetweenItsStamps) {
  const TickRate rate = calibrate_ticks();
  ThreadAccount account(rate, 8);
  account.begin();
  const std::uint64_t begin = account.begin_ticks();
  std::uint64_t waited_ns = 0, last = begin;
  for (int i = 0; i < 100; ++i) {
    const bool inserts = i % 3 == 2;
    const Doing doing = inserts ? Doing::insert : Doing::query;
    const std::uint64_t start = account.enter(doing, waited_ns);
    ASSERT_GE(start, last);
    last = ticks();
    const std::uint64_t before = account.thread_ticks().sum();
    ASSERT_EQ(before, start - begin);
    waited_ns += inserts ? 1'000'000 : 0;  // more than the operation took: clamped to it
    account.leave(doing, last, waited_ns, i % 3 == 1);
    ASSERT_GE(account.thread_ticks().sum(), last - begin);  // and what looking at the processor clock took
  }
  account.end();
  const ThreadTicks& t = account.thread_ticks();
  EXPECT_GE(t.sum(), last - begin);
  EXPECT_EQ(t.records, 33u) << "a record lies between a miss and the insert that follows, nowhere else";
  EXPECT_EQ(t.insert, 0u) << "all of it was waiting";
  EXPECT_GT(t.lock_wait + t.wanting, 0u);
  EXPECT_LE(account.log().spans().size(), 8u);
}

TEST(ThreadAccount, StandsStampsOfACounterThatIsBehind) {
  constexpr std::uint64_t kBehind = 1'000'000'000;
  ThreadAccount account(kHalf);
  account.begin();
  account.enter(Doing::query, 0);
  account.leave(Doing::query, ticks() - kBehind, 0, false);
  account.enter(Doing::query, 0);
  account.leave(Doing::query, ticks(), 0, false);
  account.end();
  EXPECT_LE(account.thread_ticks().sum(), ticks() - account.begin_ticks());
}

TEST(ThreadAccount, OnlyWhatLiesBetweenAMissAndItsInsertIsARecord) {
  ThreadAccount account(kHalf);
  const auto query = [&](bool missed) {
    account.enter(Doing::query, 0);
    account.leave(Doing::query, ticks(), 0, missed);
  };
  const auto insert = [&] {
    account.enter(Doing::insert, 0);
    account.leave(Doing::insert, ticks(), 0, false);
  };
  account.begin();
  for (const bool missed : {true, false, true, false}) {
    query(missed);
    insert();
    insert();
  }
  EXPECT_EQ(account.thread_ticks().records, 2u);
  query(true);
  account.end();
  account.begin();  // in another region nothing is left of it
  insert();
  account.end();
  EXPECT_EQ(account.thread_ticks().records, 2u);
}

TEST(ThreadAccount, ASpanHasWaitedNoLongerThanItLasted) {
  ThreadAccount account(kHalf, 8);
  account.begin();
  account.enter(Doing::query, 0);
  account.leave(Doing::query, ticks(), 1'000'000'000'000, false);
  account.end();
  const std::vector<Span>& spans = account.log().spans();
  EXPECT_TRUE(std::any_of(spans.begin(), spans.end(), [](const Span& s) { return s.doing == Doing::query; }));
  for (const Span& s : spans) EXPECT_LE(s.waited, s.length);
}

TEST(SpanLog, KeepsTheLongestAndCountsTheRest) {
  std::mt19937_64 random(2);
  SpanLog log(64);
  std::set<std::uint64_t> lengths;
  while (lengths.size() < 5000) lengths.insert(1 + random() % 1'000'000);
  for (const std::uint64_t length : lengths) log.add({0, length, 0, 0, Doing::query});
  EXPECT_LE(log.spans().size(), 64u);
  EXPECT_EQ(log.spans().size() + log.left_out(), lengths.size());
  std::set<std::uint64_t> kept;
  for (const Span& s : log.spans()) kept.insert(s.length);
  for (const std::uint64_t length : lengths)
    EXPECT_EQ(kept.contains(length), length >= log.least()) << length;
  log.clear();
  EXPECT_EQ(log.left_out(), 0u);
}

TEST(SpanLog, SpansOfOneLengthThatAreTooManyAreLeftOut) {
  SpanLog log(16);
  for (int i = 0; i < 1000; ++i) log.add({0, 5, 0, 0, Doing::query});
  EXPECT_LE(log.spans().size(), 16u);
  EXPECT_EQ(log.spans().size() + log.left_out(), 1000u);
}

/// Accounts of two threads with so many operations each.
std::vector<ThreadAccount> made_accounts(const Timeline& timeline, int operations) {
  std::vector<ThreadAccount> accounts;
  for (int t = 0; t < 2; ++t) {
    ThreadAccount& a = accounts.emplace_back(kHalf, timeline.spans_of(2));
    a.begin();
    for (int i = 0; i < operations; ++i) {
      a.enter(Doing::query, 0);
      a.leave(Doing::query, ticks(), i % 2 == 0 ? 0 : 10, false);
      a.enter(Doing::insert, 0);
      a.leave(Doing::insert, ticks(), 0, false);
    }
    a.end();
  }
  return accounts;
}

TEST(Timeline, StaysBelowItsBoundAndKeepsOperationsWithTheirWaits) {
  for (const int operations : {3, 5000}) {
    Timeline timeline(400, kHalf);
    for (int region = 0; region < 3; ++region) {
      std::vector<ThreadAccount> accounts = made_accounts(timeline, operations);
      timeline.add_region(made_times(), accounts, 100.0);
    }
    EXPECT_LE(timeline.events().size(), 400u);
    EXPECT_GE(timeline.events().size(), 30u);
    const TimelineEvent* last = nullptr;
    for (const TimelineEvent& e : timeline.events()) {
      EXPECT_GE(e.begin_ns, 0.0);
      EXPECT_GE(e.length_ns, 0.0);
      if (e.is_within) {
        ASSERT_NE(last, nullptr);
        EXPECT_EQ(e.row, last->row);
        EXPECT_EQ(e.begin_ns, last->begin_ns);
        EXPECT_LE(e.length_ns, last->length_ns);
      }
      last = &e;
    }
  }
}

TEST(Timeline, KeepsTheLongestHoweverManyAreOfTheLeastLengthKept) {
  constexpr TickRate kOne{.ns_per_tick = 1.0};
  Timeline timeline(100, kOne);
  std::vector<ThreadAccount> accounts;
  ThreadAccount& a = accounts.emplace_back(kOne, 1000);
  std::uint64_t at = a.begin_ticks();
  const auto add = [&](int times, std::uint64_t length) {
    for (int i = 0; i < times; ++i, at += length) a.log().add({at, length, 0, 0, Doing::query});
  };
  add(200, 40);
  add(10, 5000);
  TeamTimes times;
  times.threads.push_back({0, 0, static_cast<std::int64_t>(at - a.begin_ticks()), 0});
  timeline.add_region(times, accounts, 0.0);
  std::map<double, int> kept;
  for (const TimelineEvent& e : timeline.events()) ++kept[e.length_ns];
  EXPECT_EQ(kept, (std::map<double, int>{{40.0, 40}, {5000.0, 10}}));
  const auto about = timeline.to_json("a trial", {}).at("otherData");
  EXPECT_EQ(about.at("spans_left_out"), 161);  // the end of the frame, which took no time, among them
}

TEST(Timeline, IsWhatTraceEventReadersExpect) {
  Timeline timeline(400, kHalf);
  std::vector<ThreadAccount> accounts = made_accounts(timeline, 20);
  timeline.add_region(made_times(), accounts, 100.0);
  const nlohmann::ordered_json json = timeline.to_json("a trial", {{"cache", "none"}});
  ASSERT_TRUE(json.at("traceEvents").is_array());
  EXPECT_TRUE(json.at("displayTimeUnit") == "ms" || json.at("displayTimeUnit") == "ns");
  EXPECT_EQ(json.at("otherData").at("cache"), "none");
  std::map<int, std::string> names;
  std::set<int> rows;
  for (const auto& e : json.at("traceEvents")) {
    ASSERT_TRUE(e.at("name").is_string());
    ASSERT_TRUE(e.at("pid").is_number_integer());
    ASSERT_TRUE(e.at("tid").is_number_integer());
    const std::string kind = e.at("ph");
    if (kind == "M") {
      ASSERT_TRUE(e.at("args").is_object());
      if (e.at("name") == "thread_name") names[e.at("tid")] = e.at("args").at("name");
      continue;
    }
    ASSERT_EQ(kind, "X");
    ASSERT_TRUE(e.at("ts").is_number());
    ASSERT_GE(e.at("ts").get<double>(), 0.0);
    ASSERT_GE(e.at("dur").get<double>(), 0.0);
    ASSERT_TRUE(e.at("cat").is_string());
    rows.insert(e.at("tid").get<int>());
  }
  EXPECT_EQ(rows, (std::set{0, 1, 2}));
  for (const int row : rows) EXPECT_TRUE(names.contains(row)) << "row " << row << " has no name";
}

int none_offered(perf_event_attr&) {
  errno = ENOENT;
  return -1;
}
int forbidden(perf_event_attr&) {
  errno = EACCES;
  return -1;
}
int out_of_files(perf_event_attr&) {
  errno = EMFILE;
  return -1;
}
/// A descriptor that holds what the kernel would say: a value, and that half of the time was counted.
int made_up(perf_event_attr& attr) {
  if (attr.type != PERF_TYPE_HARDWARE) {
    errno = ENOENT;
    return -1;
  }
  int ends[2];
  if (pipe(ends) != 0) return -1;
  const std::uint64_t said[3] = {1000 + attr.config, 20, 10};
  EXPECT_EQ(write(ends[1], said, sizeof said), static_cast<ssize_t>(sizeof said));
  close(ends[1]);
  return ends[0];
}

TEST(PerfCounters, AMachineWithoutThemIsToldInOneLine) {
  for (const auto& [open, says] : {std::pair{&none_offered, "not offered by this machine"},
                                   {&forbidden, "perf_event_paranoid"},
                                   {&out_of_files, "Too many open files"}}) {
    const PerfOffer offer = perf_offer(perf_events(), *open);
    EXPECT_TRUE(offer.names.empty());
    EXPECT_TRUE(offer.note.starts_with("no hardware counters: ")) << offer.note;
    EXPECT_NE(offer.note.find(says), std::string::npos) << offer.note;
    EXPECT_EQ(offer.note.find('\n'), std::string::npos);
    PerfGroup group;
    group.open(perf_events(), *open);
    group.start();
    group.stop();
    EXPECT_FALSE(group.value("cycles").has_value());
  }
}

TEST(PerfCounters, WhatIsOfferedIsCountedAndTheRestIsNamed) {
  const std::vector<PerfEvent> events = perf_events_of("GenuineIntel", 6, 0x55);
  const PerfOffer offer = perf_offer(events, made_up);
  EXPECT_EQ(offer.names, (std::vector<std::string_view>{"cycles", "instructions", "cache_misses"}));
  EXPECT_TRUE(offer.note.starts_with("l1d_misses: not offered")) << offer.note;
  EXPECT_NE(offer.note.find("; line_transfers: "), std::string::npos) << offer.note;
  const PerfOffer other = perf_offer(perf_events_of("AuthenticAMD", 0x1a, 2), made_up);
  EXPECT_NE(other.note.find("; line_transfers: no documented event"), std::string::npos) << other.note;
  PerfGroup group;
  group.open(events, made_up);
  EXPECT_EQ(group.value("instructions"), 2.0 * (1000 + PERF_COUNT_HW_INSTRUCTIONS)) << "scaled up";
  EXPECT_FALSE(group.value("line_transfers").has_value());
  EXPECT_FALSE(group.value("cycles") == 0.0);
  EXPECT_FALSE(group.value("cycles").has_value()) << "a second read finds nothing here";
}

TEST(PerfCounters, LineTransfersAreCountedWhereAnEventIsDocumented) {
  const auto has = [](const std::vector<PerfEvent>& events) {
    return events.back().name == "line_transfers";
  };
  EXPECT_TRUE(has(perf_events_of("GenuineIntel", 6, 0x55)));
  EXPECT_TRUE(has(perf_events_of("AuthenticAMD", 0x19, 1)));
  EXPECT_FALSE(has(perf_events_of("GenuineIntel", 6, 0x37))) << "an Atom";
  EXPECT_FALSE(has(perf_events_of("AuthenticAMD", 0x17, 1)));
  EXPECT_FALSE(has(perf_events_of("", 0, 0)));
}

TEST(PerfCounters, CountWhatTheThreadDoesBetweenStartAndStop) {
  // A clock of the kernel's own: virtual machines have no other events, and some systems not even that one.
  const PerfEvent clock[] = {
      {"task_clock", PERF_TYPE_SOFTWARE, PERF_COUNT_SW_TASK_CLOCK, "ns on a processor"}};
  if (!perf_offer(clock).note.empty()) GTEST_SKIP() << perf_offer(clock).note;
  PerfGroup group;
  group.open(clock);
  EXPECT_FALSE(group.value("task_clock").value_or(0.0) > 0.0) << "it has not started";
  group.start();
  for (int i = 0; i < 1000; ++i) ticks();
  group.stop();
  const auto once = group.value("task_clock");
  ASSERT_TRUE(once.has_value());
  EXPECT_GT(*once, 0.0);
  EXPECT_EQ(group.value("task_clock"), once) << "it has stopped";
}

TEST(HeldThread, IsHeldWithinAnOperationAndNotBetween) {
  if (kSignalsWait) GTEST_SKIP() << "signals come late here";
  HeldThread held(1);
  // 0 between operations, 1 to begin one, 2 within it, 3 to end it. The victim runs all the time, as it must.
  std::atomic<int> stage{0};
  std::thread victim([&] {
    held.attach();
    while (stage.load(std::memory_order_acquire) != 1) spin_pause();
    held.mark(true);
    stage.store(2, std::memory_order_release);
    while (stage.load(std::memory_order_acquire) != 3) spin_pause();
    held.mark(false);
  });
  ASSERT_TRUE(held.await_attached());
  EXPECT_FALSE(held.hold());
  EXPECT_EQ(held.missed(), 1u);
  stage.store(1, std::memory_order_release);
  while (stage.load(std::memory_order_acquire) != 2) std::this_thread::yield();
  EXPECT_TRUE(held.hold());
  EXPECT_TRUE(held.hold());
  EXPECT_EQ(held.holds(), 2u);
  EXPECT_GT(held.held_ns(), 0.0);
  held.ended();
  EXPECT_FALSE(held.hold()) << "the region is over";
  EXPECT_FALSE(held.pause(std::chrono::hours(1)));
  stage.store(3, std::memory_order_release);
  victim.join();
}

/// One who waits in the kernel is not preempted, and a region that ends meanwhile is not kept up by that.
TEST(HeldThread, IsNotWaitedForWhenItSleepsAsTheRegionEnds) {
  if (kSignalsWait) GTEST_SKIP() << "signals come late here";
  HeldThread held(60'000);
  std::binary_semaphore done{0};
  std::thread victim([&] {
    held.attach();
    held.mark(true);
    done.acquire();
  });
  ASSERT_TRUE(held.await_attached());
  auto holding = std::async(std::launch::async, [&] { return held.hold(); });
  held.ended();  // before, while or after the hold is asked for
  holding.wait();
  done.release();
  victim.join();
}

TEST(HeldThread, IsLetGoWhenTheRegionEnds) {
  if (kSignalsWait) GTEST_SKIP() << "signals come late here";
  HeldThread held(60'000);
  std::binary_semaphore within{0};
  std::atomic<bool> over{false};
  std::thread victim([&] {
    held.attach();
    held.mark(true);
    within.release();
    while (!over.load(std::memory_order_acquire)) std::this_thread::yield();
  });
  ASSERT_TRUE(held.await_attached());
  within.acquire();
  auto holding = std::async(std::launch::async, [&] { return held.hold(); });
  held.ended();  // before or during the hold: it does not last its minute
  holding.wait();
  over.store(true, std::memory_order_release);
  victim.join();
}

TEST(HeldThread, IsNotWaitedForWhenTheRegionEndedWithoutIt) {
  HeldThread held(1);
  held.ended();
  EXPECT_FALSE(held.await_attached());
}

TEST(HeldThread, IsOneAtATime) {
  HeldThread first(1);
  EXPECT_THROW(HeldThread second(1), std::runtime_error);
}

}  // namespace
}  // namespace icbench
