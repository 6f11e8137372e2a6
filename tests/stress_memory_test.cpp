// What loads, locks and waits of the schedule explorer's threads may show.
#include <gtest/gtest.h>

#include <functional>
#include <optional>
#include <set>

#include "litmus.h"

namespace icbench::stress::explore {
namespace {

struct Found {
  std::set<Outcome> outcomes;
  unsigned races = 0, blocked = 0;
  Coverage coverage;
  bool has(const Outcome& o) const { return outcomes.contains(o); }
};

/// Explores threads that are given as functions on a Litmus; outcomes are what they read, cut to `reads` values.
Found explore(const std::vector<std::function<void(Litmus&)>>& threads, unsigned reads,
              const SearchOptions& options = {}) {
  Found found;
  std::optional<Litmus> state;
  Engine engine;
  Program program;
  program.threads = static_cast<unsigned>(threads.size());
  program.prepare = [&](bool) { state.emplace(); };
  program.body = [&](unsigned t) { threads[t](*state); };
  program.judge = [&](const Ending& ending) {
    if (ending.kind == Ending::Kind::finished)
      found.outcomes.insert(Outcome(state->r.begin(), state->r.begin() + reads));
    found.races += ending.kind == Ending::Kind::raced;
    found.blocked += ending.kind == Ending::Kind::blocked;
    return true;
  };
  found.coverage = engine.explore(program, options);
  return found;
}

/// Message passing: data in word 0, flag in word 1.
Found message_passing(std::memory_order store, std::memory_order load) {
  return explore({[=](Litmus& l) {
                    l.w[0].store(1, kRelaxed);
                    l.w[1].store(1, store);
                  },
                  [=](Litmus& l) {
                    l.r[0] = l.w[1].load(load);
                    l.r[1] = l.w[0].load(kRelaxed);
                  }},
                 2);
}

TEST(Memory, MessagePassingNeedsReleaseAndAcquire) {
  EXPECT_TRUE(message_passing(kRelaxed, kRelaxed).has({1, 0}));
  EXPECT_TRUE(message_passing(kRelease, kRelaxed).has({1, 0}));
  EXPECT_TRUE(message_passing(kRelaxed, kAcquire).has({1, 0}));
  const Found ordered = message_passing(kRelease, kAcquire);
  EXPECT_EQ(ordered.outcomes, (std::set<Outcome>{{0, 0}, {0, 1}, {1, 1}}));
  EXPECT_TRUE(ordered.coverage.complete);
}

Found store_buffering(std::memory_order store, std::memory_order load) {
  const auto thread = [=](unsigned mine, unsigned other) {
    return [=](Litmus& l) {
      l.w[mine].store(1, store);
      l.r[mine] = l.w[other].load(load);
    };
  };
  return explore({thread(0, 1), thread(1, 0)}, 2);
}

TEST(Memory, StoreBufferingIsSeenUnlessSequentiallyConsistent) {
  EXPECT_TRUE(store_buffering(kRelease, kAcquire).has({0, 0}));
  EXPECT_EQ(store_buffering(kSeqCst, kSeqCst).outcomes, (std::set<Outcome>{{0, 1}, {1, 0}, {1, 1}}));
  // Nor is it enough for the stores alone, or the loads.
  EXPECT_TRUE(store_buffering(kSeqCst, kAcquire).has({0, 0}));
  EXPECT_TRUE(store_buffering(kRelease, kSeqCst).has({0, 0}));
}

TEST(Memory, ReadsOfOneWordNeverGoBack) {
  const Found found = explore({[](Litmus& l) {
                                 l.w[0].store(1, kRelaxed);
                                 l.w[0].store(2, kRelaxed);
                               },
                               [](Litmus& l) {
                                 l.r[0] = l.w[0].load(kRelaxed);
                                 l.r[1] = l.w[0].load(kRelaxed);
                               }},
                              2);
  EXPECT_EQ(found.outcomes, (std::set<Outcome>{{0, 0}, {0, 1}, {0, 2}, {1, 1}, {1, 2}, {2, 2}}));
}

Found independent_reads(std::memory_order store, std::memory_order load) {
  const auto writer = [=](unsigned word) { return [=](Litmus& l) { l.w[word].store(1, store); }; };
  const auto reader = [=](unsigned first, unsigned at) {
    return [=](Litmus& l) {
      l.r[at] = l.w[first].load(load);
      l.r[at + 1] = l.w[1 - first].load(load);
    };
  };
  return explore({writer(0), writer(1), reader(0, 0), reader(1, 2)}, 4);
}

TEST(Memory, IndependentReadsMayDisagreeUnlessSequentiallyConsistent) {
  EXPECT_TRUE(independent_reads(kRelease, kAcquire).has({1, 0, 1, 0}));
  EXPECT_FALSE(independent_reads(kSeqCst, kSeqCst).has({1, 0, 1, 0}));
}

/// The flag is released by one thread, and changed by another before a third acquires it.
Found release_sequence(bool by_read_modify_write) {
  return explore({[](Litmus& l) {
                    l.w[0].store(1, kRelaxed);
                    l.w[1].store(1, kRelease);
                  },
                  [=](Litmus& l) {
                    std::uint32_t one = 1;
                    if (by_read_modify_write) {
                      l.w[1].compare_exchange_strong(one, 2, kRelaxed, kRelaxed);
                    } else if (l.w[1].load(kRelaxed) == 1) {
                      l.w[1].store(2, kRelaxed);
                    }
                  },
                  [](Litmus& l) {
                    l.r[0] = l.w[1].load(kAcquire);
                    l.r[1] = l.w[0].load(kRelaxed);
                  }},
                 2);
}

TEST(Memory, ReadModifyWritesGoOnWithAReleaseSequence) {
  const Found goes_on = release_sequence(true);
  EXPECT_TRUE(goes_on.has({2, 1}));
  EXPECT_FALSE(goes_on.has({2, 0}));
  EXPECT_TRUE(release_sequence(false).has({2, 0}));
}

TEST(Memory, TheFirstThreadsOwnRelaxedStoreBreaksItsReleaseSequence) {
  const Found found = explore({[](Litmus& l) {
                                 l.w[0].store(1, kRelaxed);
                                 l.w[1].store(1, kRelease);
                                 l.w[1].store(2, kRelaxed);
                               },
                               [](Litmus& l) {
                                 l.r[0] = l.w[1].load(kAcquire);
                                 l.r[1] = l.w[0].load(kRelaxed);
                               }},
                              2);
  EXPECT_TRUE(found.has({2, 0}));
  EXPECT_FALSE(found.has({1, 0}));
}

TEST(Memory, OfTwoCompareExchangesOneWins) {
  const auto thread = [](unsigned t) {
    return [=](Litmus& l) {
      std::uint32_t zero = 0;
      l.r[t] = l.w[0].compare_exchange_strong(zero, t + 1, kAcqRel, kAcquire);
      l.r[t + 2] = zero;
    };
  };
  EXPECT_EQ(explore({thread(0), thread(1)}, 4).outcomes, (std::set<Outcome>{{1, 0, 0, 1}, {0, 1, 2, 0}}));
}

TEST(Memory, AFailedCompareExchangeMayReadAnOldValue) {
  const Found found = explore({[](Litmus& l) {
                                 l.w[0].store(1, kRelaxed);
                                 l.w[0].store(2, kRelaxed);
                                 l.w[0].store(3, kRelaxed);
                               },
                               [](Litmus& l) {
                                 l.r[0] = 2;
                                 l.w[0].compare_exchange_strong(l.r[0], 9, kRelaxed, kRelaxed);
                               }},
                              1);
  // 2 stays where it succeeded; an old 2 is no reason to fail.
  EXPECT_EQ(found.outcomes, (std::set<Outcome>{{0}, {1}, {2}, {3}}));
}

Found published(std::memory_order store, std::memory_order load) {
  return explore({[=](Litmus& l) {
                    ModelSync::writes(&l.plain, sizeof l.plain);
                    l.plain = 7;
                    l.w[0].store(1, store);
                  },
                  [=](Litmus& l) {
                    if (l.w[0].load(load) == 0) return;
                    ModelSync::reads(&l.plain, sizeof l.plain);
                    l.r[0] = l.plain;
                  }},
                 1);
}

TEST(Memory, PlainMemoryThatIsNotPublishedIsARace) {
  EXPECT_GT(published(kRelaxed, kAcquire).races, 0u);
  EXPECT_GT(published(kRelease, kRelaxed).races, 0u);
  const Found ordered = published(kRelease, kAcquire);
  EXPECT_EQ(ordered.races, 0u);
  EXPECT_EQ(ordered.outcomes, (std::set<Outcome>{{0}, {7}}));
}

/// Word 1 is set to zero and published in word 0, then used.
Found zeroed(std::memory_order store, std::memory_order load, const std::function<void(Litmus&)>& use) {
  return explore({[=](Litmus& l) {
                    ModelSync::zeroes(&l.w[1], sizeof l.w[1]);
                    l.w[0].store(1, store);
                    l.w[1].fetch_add(1, kRelaxed);
                  },
                  [=](Litmus& l) {
                    if (l.w[0].load(load) == 1) use(l);
                  }},
                 1);
}

TEST(Memory, StepsOnAWordWhoseZeroIsNotPublishedAreARace) {
  const auto reads = [](Litmus& l) { l.r[0] = l.w[1].load(kAcquire) + 1; };
  const auto adds = [](Litmus& l) { l.r[0] = l.w[1].fetch_add(1, kAcqRel) + 1; };
  for (const auto& use : {std::function<void(Litmus&)>(reads), std::function<void(Litmus&)>(adds)}) {
    EXPECT_GT(zeroed(kRelaxed, kAcquire, use).races, 0u);
    EXPECT_GT(zeroed(kRelease, kRelaxed, use).races, 0u);
    const Found ordered = zeroed(kRelease, kAcquire, use);
    EXPECT_EQ(ordered.races, 0u);
    EXPECT_EQ(ordered.outcomes, (std::set<Outcome>{{0}, {1}, {2}}));
  }
}

TEST(Memory, WordsInUseAreNotSetToZero) {
  const auto found = explore({[](Litmus& l) {
                                l.w[1].store(1, kRelaxed);
                                l.w[0].store(1, kRelease);
                              },
                              [](Litmus& l) {
                                if (l.w[0].load(kAcquire) == 1) ModelSync::zeroes(&l.w[1], sizeof l.w[1]);
                              }},
                             0);
  EXPECT_GT(found.races, 0u) << "though all is ordered";
  EXPECT_FALSE(found.outcomes.empty());
}

TEST(Memory, PlainMemoryThatIsSetToZeroIsWritten) {
  const auto found = explore({[](Litmus& l) {
                                ModelSync::zeroes(&l.plain, sizeof l.plain);
                                l.w[0].store(1, kRelaxed);
                              },
                              [](Litmus& l) {
                                if (l.w[0].load(kAcquire) == 1) ModelSync::reads(&l.plain, sizeof l.plain);
                              }},
                             0);
  EXPECT_GT(found.races, 0u);
}

TEST(Memory, ALockOrdersWhatIsDoneUnderIt) {
  const auto thread = [](unsigned t) {
    return [=](Litmus& l) {
      l.mutex.lock();
      ModelSync::writes(&l.plain, sizeof l.plain);
      l.r[t] = l.plain++;
      l.mutex.unlock();
    };
  };
  const Found found = explore({thread(0), thread(1), thread(2)}, 3);
  EXPECT_EQ(found.races + found.blocked, 0u);
  EXPECT_EQ(found.outcomes.size(), 6u);
  EXPECT_EQ(found.coverage.schedules, 6u);
}

TEST(Memory, ReadersShareALockAndWritersDoNot) {
  const auto read = [](Litmus& l) {
    l.mutex.lock_shared();
    ModelSync::reads(&l.plain, sizeof l.plain);
    l.r[0] += l.plain;
    l.mutex.unlock_shared();
  };
  const auto write = [](Litmus& l) {
    l.mutex.lock();
    ModelSync::writes(&l.plain, sizeof l.plain);
    ++l.plain;
    l.mutex.unlock();
  };
  const Found found = explore({read, read, write}, 1);
  EXPECT_EQ(found.races + found.blocked, 0u);
  EXPECT_EQ(found.outcomes, (std::set<Outcome>{{0}, {1}, {2}}));
}

TEST(Memory, AWaitThatNobodyEndsIsReported) {
  const Found found = explore({[](Litmus& l) { l.mutex.lock(); }, [](Litmus& l) { l.mutex.lock(); }}, 0);
  EXPECT_GT(found.blocked, 0u);
  const auto spin = [](Litmus& l) {
    for (unsigned turn = 0; l.w[0].load(kAcquire) == 0; ++turn) ModelSync::wait_turn(turn);
  };
  EXPECT_EQ(explore({spin, [](Litmus& l) { l.w[1].store(1, kRelease); }}, 0).outcomes.size(), 0u);
  const Found woken = explore({spin, [](Litmus& l) { l.w[0].store(1, kRelease); }}, 0);
  EXPECT_EQ(woken.blocked, 0u);
  EXPECT_EQ(woken.outcomes.size(), 1u);
}

TEST(Memory, ASpinLockLetsOneInAtATime) {
  struct State {
    SpinLock<ModelSync> lock;
    std::uint32_t plain = 0;
    std::array<std::uint32_t, 3> order{};
  };
  std::optional<State> state;
  std::set<std::array<std::uint32_t, 3>> orders;
  Engine engine;
  Program program;
  program.threads = 3;
  program.prepare = [&](bool) { state.emplace(); };
  program.body = [&](unsigned t) {
    state->lock.lock();
    ModelSync::writes(&state->plain, sizeof state->plain);
    state->order[t] = state->plain++;
    state->lock.unlock();
  };
  program.judge = [&](const Ending& ending) {
    EXPECT_EQ(ending.kind, Ending::Kind::finished) << ending.what;
    orders.insert(state->order);
    return true;
  };
  EXPECT_TRUE(engine.explore(program, {}).complete);
  EXPECT_EQ(orders.size(), 6u);
}

// The readers' half of DistributedRwLock, and a writer of it. With a fault: a reader that has waited once does not mark
// itself again.
struct MarkedReader {
  Word writing{0}, reading{0};
  std::uint32_t plain = 0;

  void read(bool marks_itself_again) {
    const auto try_to = [&](unsigned turn) {
      if (turn == 0 || marks_itself_again) reading.store(1, kSeqCst);
      if (writing.load(kSeqCst) == 0) return true;
      reading.store(0, kRelease);
      return false;
    };
    ModelSync::begin_waiting();
    for (unsigned turn = 0; writing.load(kRelaxed) != 0 || !try_to(turn); ++turn) ModelSync::wait_turn(turn);
    ModelSync::reads(&plain, sizeof plain);
    reading.store(0, kRelease);
  }
  void write() {
    writing.store(1, kSeqCst);
    ModelSync::begin_waiting();
    for (unsigned turn = 0; reading.load(kSeqCst) != 0; ++turn) ModelSync::wait_turn(turn);
    ModelSync::writes(&plain, sizeof plain);
    writing.store(0, kRelease);
  }
};

TEST(Memory, AThreadThatChangedSomethingGoesOnAfterItHasWaited) {
  for (const bool reduce : {true, false})
    for (const bool is_right : {true, false}) {
      std::optional<MarkedReader> state;
      unsigned races = 0;
      Engine engine;
      Program program;
      program.threads = 2;
      program.prepare = [&](bool) { state.emplace(); };
      program.body = [&](unsigned t) {
        if (t == 0) return state->read(is_right);
        state->write();
        state->write();
      };
      program.judge = [&](const Ending& ending) {
        EXPECT_NE(ending.kind, Ending::Kind::blocked) << ending.what;
        races += ending.kind == Ending::Kind::raced;
        return true;
      };
      SearchOptions options;
      options.reduce = reduce;
      EXPECT_TRUE(engine.explore(program, options).complete);
      EXPECT_EQ(races == 0, is_right) << "reduced: " << reduce;
    }
}

}  // namespace
}  // namespace icbench::stress::explore
