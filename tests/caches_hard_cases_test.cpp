// Every cache with what a renderer should never send, but does: values at and past the edge of what is allowed, bounds
// of every size, and thousands of records at one point; each with the failure it guards against.
#include <pthread.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <string>

#include "cache_contract.h"
#include "caches/registry.h"
#include "core/octree.h"
#include "trap_invalid.h"

namespace icbench {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kLargest = std::numeric_limits<float>::max();
constexpr float kDenormal = std::numeric_limits<float>::denorm_min();

float above(float f) { return std::nextafter(f, kInfinity); }

/// A value that is at the edge, and whether it is on the right side of it.
struct Coordinate {
  float value;
  bool is_good;
};

/// In the unit box.
const Coordinate kCoordinates[] = {
    {0.0f, true},        {-0.0f, true},     {kDenormal, true},  {1.0f, true},  {above(1.0f), false},
    {-kDenormal, false}, {kLargest, false}, {-1e-6f, false},    {1.5f, false}, {-kLargest, false},
    {kInfinity, false},  {kNaN, false},     {-kInfinity, false}};
const Coordinate kRadii[] = {{kDenormal, true},  {std::numeric_limits<float>::min(), true},
                             {1e-20f, true},     {1e20f, true},
                             {kLargest, true},   {0.0f, false},
                             {-0.0f, false},     {-kDenormal, false},
                             {-1.0f, false},     {-kLargest, false},
                             {kInfinity, false}, {-kInfinity, false},
                             {kNaN, false}};
const Coordinate kIrradiances[] = {{0.0f, true},
                                   {-0.0f, true},
                                   {kDenormal, true},
                                   {kMaxIrradiance, true},
                                   {above(kMaxIrradiance), false},
                                   {kLargest, false},
                                   {-kDenormal, false},
                                   {-1e-6f, false},
                                   {kInfinity, false},
                                   {-kInfinity, false},
                                   {kNaN, false}};

struct Normal {
  glm::vec3 n;
  bool is_good;
};
const Normal kNormals[] = {{{0, 0, 1}, true},
                           {{0, 0, -1}, true},
                           {{-0.0f, -0.0f, 1}, true},
                           {{kDenormal, -kDenormal, 1}, true},
                           {{0.6f, 0, 0.8f}, true},
                           {{0, 0, 0}, false},
                           {{-0.0f, -0.0f, -0.0f}, false},
                           {{kDenormal, kDenormal, kDenormal}, false},
                           {{0, 0, 0.9999f}, false},
                           {{0, 0, 1.0001f}, false},
                           {{1, 1, 1}, false},
                           {{1e20f, 0, 0}, false},
                           {{kLargest, kLargest, kLargest}, false},
                           {{kInfinity, 0, 0}, false},
                           {{0, -kInfinity, 0}, false},
                           {{kNaN, 0, 1}, false},
                           {{0, 0, kNaN}, false},
                           {{kInfinity, -kInfinity, kNaN}, false}};

struct RecordCase {
  std::string what;
  Record record;
  bool is_good;
};

/// Records that are ordinary but for one field; ids count from 0.
std::vector<RecordCase> record_cases() {
  std::vector<RecordCase> cases;
  const auto add = [&](const std::string& what, bool is_good, auto&& change) {
    Record r{{0.5f, 0.25f, 0.0f}, {0, 0, 1}, 0.1f, {1, 2, 3}, static_cast<std::uint32_t>(cases.size())};
    change(r);
    cases.push_back({what, r, is_good});
  };
  for (int axis = 0; axis < 3; ++axis) {
    for (const auto& [value, is_good] : kCoordinates)
      add("p[" + std::to_string(axis) + "] = " + std::to_string(value), is_good,
          [&, v = value](Record& r) { r.p[axis] = v; });
    for (const auto& [value, is_good] : kIrradiances)
      add("E[" + std::to_string(axis) + "] = " + std::to_string(value), is_good,
          [&, v = value](Record& r) { r.E[axis] = v; });
  }
  for (const auto& [value, is_good] : kRadii)
    add("R = " + std::to_string(value), is_good, [v = value](Record& r) { r.R = v; });
  for (const auto& [n, is_good] : kNormals) {
    add("n = " + std::to_string(n.x) + " " + std::to_string(n.y) + " " + std::to_string(n.z), is_good,
        [v = n](Record& r) { r.n = v; });
  }
  return cases;
}

struct PointCase {
  SurfacePoint x;
  bool is_good;
};

std::vector<PointCase> point_cases() {
  std::vector<PointCase> cases;
  for (int axis = 0; axis < 3; ++axis) {
    for (const auto& [value, is_good] : kCoordinates) {
      cases.push_back({{{0.5f, 0.25f, 0.0f}, {0, 0, 1}}, is_good});
      cases.back().x.p[axis] = value;
    }
  }
  for (const auto& [n, is_good] : kNormals) cases.push_back({{{0.5f, 0.25f, 0.0f}, n}, is_good});
  return cases;
}

class HardCases : public Contract {};
INSTANTIATE_TEST_SUITE_P(AllCaches, HardCases, ::testing::ValuesIn(registered_caches()), cache_name);

// Guards against: records that are kept in part, or taken and never found: a NaN, zero or denormal that a comparison
// let through.
TEST_P(HardCases, RecordsAreStoredOrRejectedAndNothingBetween) {
  AnyCache cache(GetParam(), config());
  auto session = cache.open_session(0);
  const auto cases = record_cases();
  std::vector<Record> accepted;
  std::uint64_t bad = 0;
  for (const RecordCase& c : cases) {
    const InsertResult good = keeps() ? InsertResult::inserted : InsertResult::full;
    EXPECT_EQ(session.insert(c.record), c.is_good ? good : InsertResult::rejected) << c.what;
    bad += !c.is_good;
    if (c.is_good && keeps()) accepted.push_back(c.record);
  }
  EXPECT_EQ(cache.counters().rejected, bad);
  cache.end_frame();
  EXPECT_EQ(stored(cache).size(), accepted.size());
  for (const Record& r : accepted) {
    const SurfacePoint x{r.p, r.n};
    const auto ids = seen(session, x);
    EXPECT_TRUE(std::binary_search(ids.begin(), ids.end(), r.id)) << cases[r.id].what;
    EXPECT_EQ(ids, oracle(accepted, x, cache.config().a)) << cases[r.id].what;
  }
}

// Guards against: a NaN in a picture, from a point or a normal that no renderer should ask for, and searches that such
// a point leads astray.
TEST_P(HardCases, QueriesAnswerWithFiniteIrradianceOrMiss) {
  AnyCache cache(GetParam(), config());
  auto session = cache.open_session(0);
  std::vector<Record> accepted;
  for (const RecordCase& c : record_cases()) {
    if (session.insert(c.record) == InsertResult::inserted) accepted.push_back(c.record);
  }
  std::uint64_t bad = 0;
  for (const auto& [x, is_good] : point_cases()) {
    const std::string what = std::to_string(x.p.x) + " " + std::to_string(x.p.y) + " " +
                             std::to_string(x.p.z) + ", n = " + std::to_string(x.n.x) + " " +
                             std::to_string(x.n.y) + " " + std::to_string(x.n.z);
    const auto expected = is_good ? oracle(accepted, x, cache.config().a) : std::vector<std::uint32_t>{};
    EXPECT_EQ(seen(session, x), expected) << what;
    const auto E = session.query(x);
    EXPECT_EQ(E.has_value(), !expected.empty()) << what;
    if (E) {
      EXPECT_TRUE(is_irradiance(*E)) << what;
    }
    bad += 2 * !is_good;
  }
  EXPECT_EQ(cache.counters().invalid_queries, bad);
}

// Guards against: cells of size 0, places beyond the last cell on the faces of the bounds, and squares of distances
// that vanish or overflow.
TEST_P(HardCases, BoundsMayBeOfAnySizeAndTheirFacesBelongToThem) {
  if (!keeps()) GTEST_SKIP() << "keeps nothing";
  const Bounds kBounds[] = {
      {{0.5f, 0.5f, 0.5f}, {0.5f, 0.5f, 0.5f}},              // a point
      {{-1, -1, 2}, {1, 1, 2}},                              // flat
      {{-1e18f, -1e18f, -1e18f}, {1e18f, 1e18f, 1e18f}},     // squares of distances just fit
      {{-1e38f, -1e38f, -1e38f}, {1e38f, 1e38f, 1e38f}},     // and do not
      {{-1e-20f, 0, 0}, {1e-20f, 1e-20f, 1e-20f}},           // squares of distances vanish
      {{1e6f, -1e6f, 1e6f}, {1e6f + 1, 1 - 1e6f, 1e6f + 1}}  // few bits are left for the place
  };
  constexpr std::uint32_t kRecords = 200;
  for (const Bounds& bounds : kBounds) {
    CacheConfig config = this->config(kRecords);
    config.bounds = bounds;
    AnyCache cache(GetParam(), config);
    auto session = cache.open_session(0);
    const glm::vec3 size = bounds.upper - bounds.lower;
    const float side = std::max({size.x, size.y, size.z, 1e-30f});
    std::vector<Record> records;
    Pcg32 rng(96);
    for (std::uint32_t i = 0; i < kRecords; ++i) {
      glm::vec3 p;
      for (int axis = 0; axis < 3; ++axis) {
        const float inside = bounds.lower[axis] + rng.uniform() * size[axis];
        // Corners, then places anywhere.
        p[axis] = i >= 64            ? std::min(inside, bounds.upper[axis])
                  : (i >> axis) & 1u ? bounds.upper[axis]
                                     : bounds.lower[axis];
      }
      records.push_back(make_record(i, p, {0, 0, 1}, side * std::exp2(-21.0f * rng.uniform())));
      ASSERT_EQ(session.insert(records.back()), InsertResult::inserted) << i << " in a box of " << side;
      ASSERT_EQ(seen(session, {p, {0, 0, 1}}), oracle(records, {p, {0, 0, 1}}, config.a))
          << i << " in a box of " << side;
    }
    for (int axis = 0; axis < 3; ++axis) {
      for (const float outside :
           {above(bounds.upper[axis]), std::nextafter(bounds.lower[axis], -kInfinity)}) {
        Record r = records[0];
        r.p[axis] = outside;
        EXPECT_EQ(session.insert(r), InsertResult::rejected) << "axis " << axis << " in a box of " << side;
        EXPECT_TRUE(seen(session, {r.p, r.n}).empty());
      }
    }
  }
}

// Guards against: a pool of nodes that is used up before that of records.
TEST_P(HardCases, HoldsItsCapacityWhateverTheRadii) {
  if (!keeps()) GTEST_SKIP() << "keeps nothing";
  // Tiny radii far apart: every record needs a path of nodes of its own.
  constexpr std::uint32_t kCapacity = 500;
  AnyCache cache(GetParam(), config(kCapacity));
  auto session = cache.open_session(0);
  Pcg32 rng(9);
  for (std::uint32_t i = 0; i < kCapacity; ++i) {
    ASSERT_EQ(session.insert(make_record(i, {rng.uniform(), rng.uniform(), rng.uniform()}, {0, 0, 1}, 1e-9f)),
              InsertResult::inserted);
  }
  EXPECT_EQ(stored(cache).size(), kCapacity);
}

// Guards against: a record that rounding of normals makes invalid where it was made, so that the same point makes
// another one for ever.
TEST_P(HardCases, SeesARecordAtItsOwnPointAtTheFinestAccuracy) {
  if (!keeps()) GTEST_SKIP() << "keeps nothing";
  CacheConfig config = this->config();
  config.a = config.a_max = kMinAccuracy;
  AnyCache cache(GetParam(), config);
  auto session = cache.open_session(0);
  Pcg32 rng(95);
  for (std::uint32_t i = 0; i < 5000; ++i) {
    const glm::vec3 v(rng.uniform() - 0.5f, rng.uniform() - 0.5f, rng.uniform() - 0.5f);
    // Lengths at the edge of what is_unit lets through.
    const glm::vec3 n = glm::normalize(v) * (1.0f + 0.8e-6f * (rng.uniform() - 0.5f));
    const Record r = make_record(i, {rng.uniform(), rng.uniform(), rng.uniform()}, n, 0.1f);
    if (session.insert(r) != InsertResult::inserted) continue;
    const auto ids = seen(session, {r.p, r.n});
    ASSERT_TRUE(std::binary_search(ids.begin(), ids.end(), i));
  }
}

/// Runs `work` on a thread whose stack has `bytes` bytes.
template <class Work>
void run_on_stack(std::size_t bytes, Work& work) {
  pthread_attr_t attributes;
  ASSERT_EQ(pthread_attr_init(&attributes), 0);
  ASSERT_EQ(pthread_attr_setstacksize(&attributes, bytes), 0);
  pthread_t thread;
  const auto body = [](void* w) -> void* {
    (*static_cast<Work*>(w))();
    return nullptr;
  };
  ASSERT_EQ(pthread_create(&thread, &attributes, body, &work), 0);
  pthread_join(thread, nullptr);
  pthread_attr_destroy(&attributes);
}

// 100,000; as many as ICBENCH_COINCIDENT_RECORDS says where it is set (10^6 in the full form of tests/run).
std::uint32_t coincident_records() {
  const char* text = std::getenv("ICBENCH_COINCIDENT_RECORDS");
  return text ? static_cast<std::uint32_t>(std::stoul(text)) : 100'000;
}

// Guards against: recursion, levels or nodes without end where no cell tells records apart, and sums of them that
// overflow or stagnate.
TEST_P(HardCases, AHundredThousandCoincidentRecordsOrMoreOnASmallStack) {
  if (!keeps()) GTEST_SKIP() << "keeps nothing";
  const std::uint32_t records = coincident_records();
  // Sanitizers put red zones around everything, and their own run-time library is called on the same stack.
  constexpr std::size_t kStackBytes = std::size_t{kSanitized ? 512 : 64} << 10;
  const SurfacePoint x{{0.25f, 0.5f, 0.0f}, {0, 0, 1}};
  for (const float R : {1e-12f, 0.1f, 100.0f}) {
    AnyCache cache(GetParam(), config(records));
    auto session = cache.open_session(0);
    std::uint32_t inserted = 0;
    std::vector<bool> is_seen(records);
    std::uint32_t visits = 0;
    std::optional<Irradiance> E;
    auto work = [&] {
      for (std::uint32_t i = 0; i < records; ++i)
        inserted += session.insert({x.p, x.n, R, glm::vec3(kMaxIrradiance), i}) == InsertResult::inserted;
      session.visit(x, [&](const Record& r, float) {
        ++visits;
        is_seen[r.id] = true;
      });
      E = session.query(x);
    };
    run_on_stack(kStackBytes, work);
    std::vector<std::optional<Irradiance>> answers(20);
    auto ask_batch = [&] { session.query_batch(std::vector(answers.size(), x), answers); };
    run_on_stack(2 * kStackBytes, ask_batch);
    for (const std::optional<Irradiance>& answer : answers) EXPECT_EQ(answer, E) << "radius " << R;
    EXPECT_EQ(inserted, records) << "radius " << R;
    EXPECT_EQ(visits, records) << "radius " << R;
    EXPECT_EQ(std::count(is_seen.begin(), is_seen.end(), true), records) << "radius " << R;
    ASSERT_TRUE(E.has_value());
    EXPECT_NEAR(E->x / kMaxIrradiance, 1.0f, 2e-6f) << "radius " << R;
    // One path of nodes, and segments of a list whose size doubles up to 256 slots; in the packed octree, whose records
    // are known in all cells that they reach, four of each: the place is on an edge between cells.
    const std::uint64_t copies = GetParam().traits.structure == "packed" ? 4 : 1;
    EXPECT_LE(cache.counters().nodes_allocated, copies * (kMaxLevel + records / 128));
    cache.end_frame();
    auto look = [&] { session.visit(x, [&](const Record&, float) { --visits; }); };
    run_on_stack(kStackBytes, look);
    EXPECT_EQ(visits, 0u) << "radius " << R;
  }
}

// Records so crowded that cells are full at the level of their reach and below: what is read at a point stays within a
// small multiple of what is valid there. Guards against: queries whose time grows with what the crowd holds elsewhere.
TEST_P(HardCases, ACrowdIsReadInProportionToWhatIsValidAtAPoint) {
  if (GetParam().traits.structure != "packed") GTEST_SKIP() << "said of the packed octree alone";
  constexpr int kQueries = 200;
  constexpr float kSide = 0.02f;  // of the crowd's square, away from all planes of the octree
  const glm::vec3 corner(0.31f, 0.57f, 0.437f);
  for (const auto& [records, reach] :
       {std::pair{20'000u, kSide / 10}, std::pair{60'000u, kSide / 10}, std::pair{60'000u, kSide / 30}}) {
    CacheConfig c = config(records);
    c.a = c.a_max;  // validity ends where lanes do
    AnyCache cache(GetParam(), c);
    auto session = cache.open_session(0);
    Pcg32 random(7);
    const auto somewhere = [&] {
      return corner + kSide * glm::vec3(random.uniform(), random.uniform(), 0.0f);
    };
    for (std::uint32_t i = 0; i < records; ++i) {
      const glm::vec3 p = somewhere();
      ASSERT_EQ(session.insert({p, {0, 0, 1}, reach / c.a_max, glm::vec3(1.0f), i}), InsertResult::inserted);
    }
    cache.end_frame();
    std::uint64_t valid = 0;
    const std::uint64_t before = cache.counters().records_read;
    for (int i = 0; i < kQueries; ++i)
      session.visit({somewhere(), {0, 0, 1}}, [&](const Record&, float) { ++valid; });
    const std::uint64_t read = cache.counters().records_read - before;
    EXPECT_GT(valid, kQueries * kCellLanes / 2) << "the crowd is no crowd";
    EXPECT_LT(read, 6 * valid + kQueries * kCellLanes) << records << " records of reach " << reach;
  }
}

/// Queries by a process to which all memory but its stack and its thread's own is read-only, and what became of it: the
/// status of waitpid. To the thread's own memory, where errno is, the kernel writes whenever it lets the thread go on
/// (restartable sequences), and kills who does not let it.
///
/// Everything that the queries call is called before, so that no symbol is left to be bound, which writes.
template <class Cache>
int queries_in_read_only_memory() {
  Cache cache(CacheConfig{.bounds = {{0, 0, 0}, {1, 1, 1}}, .capacity = 5000});
  auto session = cache.open_session(0);
  for (const Record& r : random_records(3000, 1)) session.insert(r);
  cache.end_frame();
  Pcg32 random(2);
  std::vector<SurfacePoint> points;
  for (int i = 0; i < 500; ++i) points.push_back(random_surface_point(random));
  const auto hits = [&] {
    int n = 0;
    for (const SurfacePoint& x : points) n += session.query(x).has_value();
    return n;
  };
  const int expected = hits();
  struct Range {
    std::uintptr_t begin, end;
  };
  const auto own = reinterpret_cast<std::uintptr_t>(&errno);
  std::vector<Range> writable;
  writable.reserve(10'000);
  std::ifstream maps("/proc/self/maps");
  for (std::string line; std::getline(maps, line);) {
    Range r{};
    char mode[5] = {};
    if (std::sscanf(line.c_str(), "%zx-%zx %4s", &r.begin, &r.end, mode) == 3 && mode[1] == 'w' &&
        line.find("[stack]") == line.npos && !(r.begin <= own && own < r.end))
      writable.push_back(r);
  }
  const auto protect = [](const Range& r, int how) {
    return ::syscall(SYS_mprotect, r.begin, r.end - r.begin, how);
  };
  protect(writable.front(), PROT_READ | PROT_WRITE);
  const pid_t child = ::fork();
  if (child == 0) {
    for (const Range& r : writable) protect(r, PROT_READ);
    ::syscall(SYS_exit_group, hits() == expected ? 0 : 1);
  }
  int status = -1;
  ::waitpid(child, &status, 0);
  return status;
}

// Guards against: queries that write to what they share, be it a counter or a cached hint.
TEST(QueriesWithoutCounters, WriteNothingButTheirStack) {
  if (kSanitized) GTEST_SKIP() << "sanitizers keep books of their own";
  EXPECT_EQ(queries_in_read_only_memory<WaitFree<>>(), 0);
  EXPECT_EQ(queries_in_read_only_memory<PackedWaitFree<>>(), 0);
  EXPECT_EQ(queries_in_read_only_memory<PackedLocalWrite<>>(), 0);
  const int counting = queries_in_read_only_memory<PackedWaitFree<WithCounters>>();
  EXPECT_TRUE(WIFSIGNALED(counting) && WTERMSIG(counting) == SIGSEGV)
      << "the test would not notice a counter";
}

}  // namespace
}  // namespace icbench
