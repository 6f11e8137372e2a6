// The checkers against an exhaustive search over random small histories, and against violations made by hand.
//
// ICBENCH_STRESS_HISTORIES sets the number of random histories (default 1,000,000).
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <string>

#include "core/random.h"
#include "stress/checker.h"
#include "stress_oracle.h"

namespace icbench::stress {
namespace {

/// Builds histories by hand: one line per operation.
class Builder {
 public:
  explicit Builder(std::uint32_t places = 1, std::uint32_t sizes = 1) : validity_(places, sizes) {
    for (std::uint32_t kind = 0; kind < validity_.kinds(); ++kind) validity_.set_valid(kind / sizes, kind);
    history_.epochs.emplace_back();
  }

  ValidityTable& validity() { return validity_; }

  Builder& insert(std::uint32_t thread, Stamp call, Stamp ret, std::uint32_t id, std::uint32_t kind = 0,
                  InsertResult result = InsertResult::inserted) {
    return add({call, ret, thread, kind, id, 0, Operation::Type::insert, result});
  }

  Builder& query(std::uint32_t thread, Stamp call, Stamp ret, std::vector<std::uint32_t> seen,
                 std::uint32_t place = 0) {
    const auto first = static_cast<std::uint32_t>(history_.seen.size());
    history_.seen.insert(history_.seen.end(), seen.begin(), seen.end());
    return add({call, ret, thread, place, first, static_cast<std::uint32_t>(seen.size()),
                Operation::Type::query, InsertResult::inserted});
  }

  Builder& contents(std::vector<std::uint32_t> ids) {
    history_.epochs.back().has_contents = true;
    history_.epochs.back().contents = std::move(ids);
    return *this;
  }
  Builder& drop(std::vector<std::uint32_t> ids) {
    history_.epochs.back().dropped = std::move(ids);
    return *this;
  }
  Builder& clear() {
    history_.epochs.back().clears = true;
    return *this;
  }
  Builder& barrier() {
    Epoch next;
    next.first = next.end = history_.epochs.back().end;
    history_.epochs.push_back(next);
    return *this;
  }

  Judgement judge() {
    history_.validity = &validity_;
    history_.ids = 100;
    return stress::judge(history_);
  }

 private:
  // Operations are to be added thread by thread within an epoch.
  Builder& add(const Operation& o) {
    history_.operations.push_back(o);
    history_.epochs.back().end = static_cast<std::uint32_t>(history_.operations.size());
    return *this;
  }

  ValidityTable validity_;
  History history_;
};

/// The checks that fail, in order of kCheckNames: i, r, p, l, f.
std::string failing(const Judgement& j) {
  std::string out;
  for (std::size_t i = 0; i < kCheckNames.size(); ++i) {
    if (!j.holds(static_cast<Check>(i))) out += "irplf"[i];
    EXPECT_EQ(j.findings[i].violations == 0, j.findings[i].witness.empty());
  }
  return out;
}

TEST(StressChecker, AcceptsASequentialHistory) {
  Builder b;
  b.query(0, 1, 2, {}).insert(0, 3, 4, 7).query(0, 5, 6, {7}).contents({7});
  EXPECT_EQ(failing(b.judge()), "");
}

TEST(StressChecker, OverlappingInsertMayBeSeenOrNot) {
  EXPECT_EQ(failing(Builder().insert(0, 1, 10, 7).query(1, 2, 9, {7}).judge()), "f");
  EXPECT_EQ(failing(Builder().insert(0, 1, 10, 7).query(1, 2, 9, {}).judge()), "");
}

TEST(StressChecker, EqualStampsOverlap) {
  EXPECT_EQ(failing(Builder().insert(0, 1, 5, 7).query(1, 5, 9, {}).judge()), "");
  EXPECT_EQ(failing(Builder().insert(0, 5, 9, 7).query(1, 1, 5, {7}).judge()), "f");
}

TEST(StressChecker, QueriesOfABatchOverlapAndAreEachHeldToAll) {
  // One sees what the other does not: in either order, but not if it had returned.
  EXPECT_EQ(failing(Builder().insert(0, 1, 10, 7).query(1, 2, 9, {7}).query(1, 2, 9, {}).judge()), "f");
  EXPECT_EQ(failing(Builder().insert(0, 1, 10, 7).query(1, 2, 9, {}).query(1, 2, 9, {7}).judge()), "f");
  EXPECT_EQ(failing(Builder().insert(0, 1, 2, 7).query(1, 3, 9, {7}).query(1, 3, 9, {}).judge()), "rplf");
  // Two that disagree on the order of two inserts.
  Builder b;
  b.insert(0, 1, 10, 1).insert(1, 1, 10, 2).query(2, 2, 9, {1}).query(2, 2, 9, {2});
  EXPECT_EQ(failing(b.judge()), "lf");
  // What a batch has seen, the next query must see.
  b = Builder();
  b.insert(0, 1, 100, 7).query(1, 2, 3, {7}).query(1, 2, 3, {}).query(1, 4, 5, {});
  EXPECT_EQ(failing(b.judge()), "plf");
}

TEST(StressChecker, MissingAReturnedInsertIsIrregular) {
  const Judgement j = Builder().insert(0, 1, 2, 7).query(1, 3, 4, {}).judge();
  EXPECT_EQ(failing(j), "rpl");
  EXPECT_EQ(j[Check::regular].witness_operations, (std::vector<std::uint32_t>{0, 1}));
  EXPECT_NE(j[Check::regular].witness.find("record 7"), std::string::npos) << j[Check::regular].witness;
}

TEST(StressChecker, SeeingAFutureInsertIsIrregular) {
  EXPECT_EQ(failing(Builder().insert(0, 3, 4, 7).query(1, 1, 2, {7}).judge()), "rplf");
}

TEST(StressChecker, ARecordThatVanishesIsNotPerRecordLinearizable) {
  Builder b;
  b.insert(0, 1, 100, 7).query(1, 2, 3, {7}).query(2, 4, 5, {});
  const Judgement j = b.judge();
  EXPECT_EQ(failing(j), "plf");
  EXPECT_EQ(j[Check::per_record_linearizable].witness_operations.size(), 3u);
}

TEST(StressChecker, SeeingTheLaterOfTwoInsertsAloneIsNotLinearizable) {
  Builder b;
  b.insert(0, 2, 3, 1).insert(0, 4, 5, 2).query(1, 1, 6, {2});
  const Judgement j = b.judge();
  EXPECT_EQ(failing(j), "lf");
  EXPECT_EQ(j[Check::linearizable].witness_operations.size(), 3u);
  EXPECT_NE(j[Check::linearizable].witness.find("did not see"), std::string::npos);
}

TEST(StressChecker, QueriesThatDisagreeOnTheOrderAreNotLinearizable) {
  Builder b;
  b.insert(0, 1, 10, 1).insert(1, 1, 10, 2).query(2, 2, 9, {1}).query(3, 2, 9, {2});
  EXPECT_EQ(failing(b.judge()), "lf");
}

TEST(StressChecker, APendingInsertMayTakeEffectOrNot) {
  EXPECT_EQ(failing(Builder().insert(0, 1, kPending, 1).query(1, 2, 3, {}).query(1, 4, 5, {}).judge()), "");
  EXPECT_EQ(failing(Builder().insert(0, 1, kPending, 1).query(1, 2, 3, {}).query(1, 4, 5, {1}).judge()), "f");
  EXPECT_EQ(failing(Builder().insert(0, 1, kPending, 1).query(1, 2, 3, {1}).query(1, 4, 5, {}).judge()),
            "plf");
  EXPECT_EQ(failing(Builder().insert(0, 1, kPending, 1).contents({}).judge()), "");
  EXPECT_EQ(failing(Builder().insert(0, 1, kPending, 1).contents({1}).judge()), "");
}

TEST(StressChecker, PlacesFilterWhatAQueryMustSee) {
  EXPECT_EQ(failing(Builder(2).insert(0, 1, 2, 7, 1).query(1, 3, 4, {}, 0).judge()), "");
  EXPECT_EQ(failing(Builder(2).insert(0, 1, 2, 7, 1).query(1, 3, 4, {}, 1).judge()), "rpl");
  EXPECT_EQ(failing(Builder(2).insert(0, 1, 2, 7, 1).query(1, 3, 4, {7}, 0).judge()), "irplf");
}

TEST(StressChecker, RefusedInsertsMayNotBeSeen) {
  EXPECT_EQ(
      failing(Builder().insert(0, 1, 2, 7, 0, InsertResult::full).query(0, 3, 4, {}).contents({}).judge()),
      "");
  EXPECT_EQ(failing(Builder().insert(0, 1, 2, 7, 0, InsertResult::full).query(0, 3, 4, {7}).judge()),
            "irplf");
  EXPECT_EQ(failing(Builder().insert(0, 1, 2, 7, 0, InsertResult::full).contents({7}).judge()), "i");
}

TEST(StressChecker, FindsFaultyRecords) {
  EXPECT_EQ(failing(Builder().insert(0, 1, 2, 7).query(0, 3, 4, {7 | kTorn}).judge()), "i");
  EXPECT_EQ(failing(Builder().insert(0, 1, 2, 7).query(0, 3, 4, {7, 7}).judge()), "i");
  EXPECT_EQ(failing(Builder().query(0, 3, 4, {8}).judge()), "irplf");
  EXPECT_EQ(failing(Builder().query(0, 3, 4, {kTorn - 1}).judge()), "irplf");
  EXPECT_EQ(failing(Builder().insert(0, 1, 2, 7).contents({}).judge()), "i");
  EXPECT_EQ(failing(Builder().insert(0, 1, 2, 7).contents({7, 7}).judge()), "i");
  EXPECT_EQ(failing(Builder().insert(0, 1, 2, 7).contents({7, 8}).judge()), "i");
  EXPECT_EQ(failing(Builder().insert(0, 1, 2, 7).contents({7 | kTorn}).judge()), "i");
}

TEST(StressChecker, RecordsOutliveBarriersButNotClearAndDrop) {
  const auto next = [](Builder& b, std::vector<std::uint32_t> seen) {
    b.barrier().query(1, 11, 12, seen).contents(seen);
    return failing(b.judge());
  };
  const auto start = [] { return Builder().insert(0, 1, 2, 7).insert(0, 3, 4, 8).contents({7, 8}); };
  Builder kept = start(), lost = start(), dropped = start(), undead = start(), cleared = start(),
          resurrected = start();
  EXPECT_EQ(next(kept, {7, 8}), "");
  EXPECT_EQ(next(lost, {8}), "irplf");
  EXPECT_EQ(next(dropped.drop({7}), {8}), "");
  EXPECT_EQ(next(undead.drop({7}), {7, 8}), "irplf");
  EXPECT_EQ(next(cleared.clear(), {}), "");
  EXPECT_EQ(next(resurrected.clear(), {7}), "irplf");
}

TEST(StressChecker, FrameConsistencyShowsOwnRecordsAtOnceAndOthersAfterTheFrame) {
  Builder b;
  b.insert(0, 1, 2, 7).query(0, 3, 4, {7}).query(1, 5, 6, {}).barrier().query(1, 11, 12, {7});
  EXPECT_EQ(failing(b.judge()), "rpl");
  EXPECT_EQ(failing(Builder().insert(0, 1, 2, 7).query(0, 3, 4, {}).judge()), "rplf");
}

TEST(StressChecker, CountsEveryRecordThatAQueryMissed) {
  Builder b;
  b.insert(0, 1, 2, 1).insert(0, 3, 4, 2).insert(0, 5, 6, 3).query(1, 7, 8, {2}).query(1, 9, 10, {2, 3});
  const Judgement j = b.judge();
  EXPECT_EQ(failing(j), "rplf");
  EXPECT_EQ(j[Check::regular].violations, 3u);
  EXPECT_EQ(j[Check::per_record_linearizable].violations, 3u);
  EXPECT_EQ(j[Check::linearizable].violations, 1u) << "epochs";
}

TEST(StressChecker, CountsThePairsThatOverlapWhereTheRecordIsValid) {
  Builder b(2);
  b.insert(0, 1, 10, 1, 1).insert(1, 2, 9, 2, 1, InsertResult::full).insert(2, 3, 4, 3, 1);
  b.query(3, 3, 5, {3}, 1).query(3, 6, 8, {3}, 1).query(3, 9, 11, {}, 0).query(3, 12, 13, {1, 3}, 1);
  const Judgement j = b.judge();
  EXPECT_EQ(failing(j), "f");
  EXPECT_EQ(j.concurrent_pairs, 3u) << "two with record 1, one with record 3";
  EXPECT_EQ(j.operations, 7u);
}

TEST(StressChecker, AWitnessTellsWhatCameBeforeWhatAndWhy) {
  Builder b(2, 3);
  b.insert(0, 12, 13, 1, 4).insert(0, 14, 15, 2, 5).query(1, 11, 16, {2}, 1);
  EXPECT_EQ(b.judge()[Check::linearizable].witness,
            "cycle of 3 operations, each of which must precede the next\n"
            "  thread 0 [1, 2] insert of record 1, place 1, size 1\n"
            "    returned before the next was called\n"
            "  thread 0 [3, 4] insert of record 2, place 1, size 2\n"
            "    was seen by the next\n"
            "  thread 1 [0, 5] query at place 1, saw 1 records\n"
            "    did not see the first");
}

/// `operations` of history `h` and the records they inserted, nothing else, without the indices in `except`.
History restricted(const History& h, const std::vector<std::uint32_t>& operations, std::size_t except) {
  History out;
  out.validity = h.validity;
  out.ids = h.ids;
  std::vector<std::uint32_t> kept;
  for (std::size_t i = 0; i < operations.size(); ++i) {
    if (i != except) kept.push_back(operations[i]);
  }
  std::sort(kept.begin(), kept.end());
  std::vector<bool> is_inserted(h.ids);
  for (const std::uint32_t i : kept) {
    if (!h.operations[i].is_query()) is_inserted[h.operations[i].first] = true;
  }
  for (const std::uint32_t i : kept) {
    Operation o = h.operations[i];
    if (o.is_query()) {
      const auto seen = h.seen_by(o);
      o.first = static_cast<std::uint32_t>(out.seen.size());
      for (const std::uint32_t id : seen) {
        if (is_inserted[id & ~kTorn]) out.seen.push_back(id);
      }
      o.count = static_cast<std::uint32_t>(out.seen.size()) - o.first;
    }
    out.operations.push_back(o);
  }
  out.epochs.push_back({0, static_cast<std::uint32_t>(kept.size()), false, {}, {}, false});
  return out;
}

TEST(StressChecker, AgreesWithExhaustiveSearchOnRandomHistories) {
  const char* wanted = std::getenv("ICBENCH_STRESS_HISTORIES");
  const std::uint64_t histories = wanted != nullptr ? std::strtoull(wanted, nullptr, 10) : 1'000'000;
  ASSERT_GT(histories, 0u);
  std::array<std::uint64_t, kCheckNames.size()> violated{};
  std::uint64_t cycles = 0;
  for (std::uint64_t seed = 0; seed < histories; ++seed) {
    const RandomHistory random(seed);
    const History& h = random.history();
    const Judgement judged = judge(h);
    const OracleVerdict expected = oracle(h);
    for (std::size_t i = 0; i < kCheckNames.size(); ++i) {
      ASSERT_EQ(judged.findings[i].violations == 0, expected[i])
          << kCheckNames[i] << ", seed " << seed << "\n"
          << to_string(h) << judged.findings[i].witness;
      violated[i] += !expected[i];
    }
    const auto& cycle = judged[Check::linearizable].witness_operations;
    if (!expected[1] || expected[3] || cycle.empty()) continue;
    ++cycles;
    ASSERT_FALSE(oracle(restricted(h, cycle, cycle.size()))[3]) << "not a counterexample, seed " << seed;
    for (std::size_t i = 0; i < cycle.size(); ++i) {
      ASSERT_TRUE(oracle(restricted(h, cycle, i))[3]) << "not minimal, seed " << seed << "\n"
                                                      << judged[Check::linearizable].witness;
    }
  }
  // The histories must put every verdict to the test.
  for (std::size_t i = 0; i < kCheckNames.size(); ++i) {
    EXPECT_GT(violated[i], histories / 50) << kCheckNames[i];
    EXPECT_LT(violated[i], histories - histories / 50) << kCheckNames[i];
  }
  EXPECT_GT(cycles, histories / 100);
}

}  // namespace
}  // namespace icbench::stress
