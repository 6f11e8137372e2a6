// What temporal instant caching keeps of records: ids, their bits, and the memory that these take.
#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <vector>

#include "render/record_table.h"

namespace icbench {
namespace {

constexpr std::uint32_t kBlock = RecordTable::kBlock;

std::vector<std::uint32_t> take(RecordTable& table, std::size_t count, LightBits bits, unsigned thread = 0) {
  std::vector<std::uint32_t> out;
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t id = table.draft(thread, bits);
    if (id == RecordTable::kNone) break;
    EXPECT_EQ(table.draft(thread, bits), id) << "a draft is another before it is kept";
    table.keep(thread, id);
    table[id].state = KeptRecord::live;
    out.push_back(id);
  }
  return out;
}

TEST(RecordTable, NoTwoRecordsHaveOneId) {
  RecordTable table(20 * kBlock, 2);
  table.widen(1);
  std::multiset<std::uint32_t> ids;
  for (const unsigned thread : {0u, 1u})
    for (const LightBits bits : {LightBits::no, LightBits::yes})
      for (const std::uint32_t id : take(table, 40, bits, thread)) ids.insert(id);
  ASSERT_EQ(ids.size(), 160u);
  EXPECT_EQ(std::set<std::uint32_t>(ids.begin(), ids.end()).size(), 160u);
  EXPECT_LT(*ids.rbegin(), table.end());
}

TEST(RecordTable, RecordsWithoutBitsTakeNoMemoryForThem) {
  constexpr std::size_t kWords = 128;
  RecordTable with(100 * kBlock, 1), without(100 * kBlock, 1);
  for (RecordTable* table : {&with, &without}) table->widen(kWords);
  take(with, 50 * kBlock, LightBits::yes);
  take(without, 50 * kBlock, LightBits::no);
  EXPECT_EQ(with.bytes() - without.bytes(), 50 * kBlock * kWords * 8);
  EXPECT_LE(without.bytes(), 50 * kBlock * 50);
}

TEST(RecordTable, IdsThatWereGivenBackAreUsedFirst) {
  RecordTable table(100 * kBlock, 1);
  table.widen(4);
  const std::vector<std::uint32_t> plain = take(table, 3 * kBlock, LightBits::no);
  const std::vector<std::uint32_t> first = take(table, 3 * kBlock, LightBits::yes);
  const std::size_t bytes = table.bytes();
  table.release(first);
  table.release(plain);
  // Each kind by its own kind.
  const std::vector<std::uint32_t> again = take(table, 3 * kBlock, LightBits::yes);
  EXPECT_TRUE(std::is_permutation(again.begin(), again.end(), first.begin(), first.end()));
  EXPECT_EQ(take(table, 3 * kBlock, LightBits::no).size(), plain.size());
  EXPECT_EQ(table.bytes(), bytes);
}

TEST(RecordTable, BitsStayAsTheyBecomeMore) {
  RecordTable table(10 * kBlock, 1);
  table.widen(2);
  const std::vector<std::uint32_t> ids = take(table, 2 * kBlock, LightBits::yes);
  take(table, kBlock, LightBits::no);
  for (const std::uint32_t id : ids) std::ranges::fill(table.visible(id), id + 1);
  table.widen(5);
  for (const std::uint32_t id : ids) {
    const std::span<const std::uint64_t> bits = table.visible(id);
    ASSERT_EQ(std::vector<std::uint64_t>(bits.begin(), bits.end()),
              (std::vector<std::uint64_t>{id + 1, id + 1, 0, 0, 0}));
  }
}

TEST(RecordTable, NothingIsLeftOnceAllIsGivenBack) {
  RecordTable table(10 * kBlock, 1);
  table.widen(2);
  for (int round = 0; round < 3; ++round) {
    take(table, 3 * kBlock + 5, round == 1 ? LightBits::no : LightBits::yes);
    EXPECT_GT(table.bytes(), 0u);
    table.clear();
    EXPECT_EQ(table.bytes(), 0u);
    EXPECT_EQ(table.end(), 0u);
  }
}

TEST(RecordTable, IsFullInTimeAndThenSays) {
  RecordTable table(4 * kBlock, 1);
  table.widen(1);
  const std::vector<std::uint32_t> ids = take(table, 1000, LightBits::yes);
  EXPECT_GE(ids.size(), 4 * kBlock);
  EXPECT_LT(ids.size(), 1000u);
  EXPECT_EQ(table.draft(0, LightBits::no), RecordTable::kNone);
  table.release({ids.data(), 1});
  EXPECT_EQ(table.draft(0, LightBits::yes), ids.front());
}

// Guards against: records of one kind that have no room for good, because those of the other kind had it all once.
TEST(RecordTable, WhatIsFreeDoesForBothKindsOnceItIsFull) {
  for (const LightBits first : {LightBits::no, LightBits::yes}) {
    const LightBits second = first == LightBits::yes ? LightBits::no : LightBits::yes;
    RecordTable table(10 * kBlock, 1);
    table.widen(3);
    std::vector<std::uint32_t> ids = take(table, 1000, first);
    ASSERT_EQ(table.draft(0, second), RecordTable::kNone);
    // Every other one, so that blocks have ids of either kind.
    std::vector<std::uint32_t> free;
    for (std::size_t i = 0; i < ids.size(); i += 2) free.push_back(ids[i]);
    table.release(free);
    const std::vector<std::uint32_t> again = take(table, 1000, second);
    EXPECT_TRUE(std::is_permutation(again.begin(), again.end(), free.begin(), free.end()));
    if (second == LightBits::yes) {
      for (const std::uint32_t id : again) std::ranges::fill(table.visible(id), id);
      for (const std::uint32_t id : again)
        EXPECT_EQ(std::ranges::count(table.visible(id), std::uint64_t{id}), 3) << id;
    }
    table.release(again);
    EXPECT_EQ(take(table, 1000, first).size(), free.size());
  }
}

}  // namespace
}  // namespace icbench
