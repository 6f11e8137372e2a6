// Traces: what is captured comes back bit for bit, on one thread any cache is led to the same records, many threads
// leave what a cache must hold, and a file that is not whole is never taken.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <atomic>
#include <bit>
#include <cstring>
#include <fstream>
#include <map>
#include <memory>
#include <tuple>

#include "broken_caches.h"
#include "caches/registry.h"
#include "file_bytes.h"
#include "made_points.h"
#include "temporary_folder.h"
#include "workload/dispatch.h"
#include "workload/trace_capture.h"
#include "workload/trace_trial.h"

namespace icbench {
namespace {

template <class T>
bool same_bytes(const T& a, const T& b) {
  return std::memcmp(&a, &b, sizeof a) == 0;
}

constexpr std::uint32_t kTile = 64, kPoints = 20 * kTile;

/// A render without rays: frames of two passes over points on the walls of a box. Frame 0 begins with nothing, 1 with
/// what 0 left, 2 with nothing, 3 with the last records, but for their light.
class MadeRender {
 public:
  MadeRender() : made_(box_points(2 * kPoints, 1)) {}

  TraceContext context(unsigned threads) const {
    TraceContext c;
    c.scene = "a box";
    c.integrator = "made by hand";
    c.cache = "wait_free";
    c.width = kTile;
    c.height = kPoints / kTile;
    c.seed = 7;
    c.config.a = c.config.a_max = 0.2f;
    c.config.capacity = capacity_for(kPoints * 10, threads);
    c.config.max_sessions = threads;
    return c;
  }

  void capture(const std::string& path, unsigned threads) {
    TraceWriter writer(path, context(threads));
    TraceRecorder recorder(threads, 10);  // little, so that it has to grow
    WaitFree<> cache(context(threads).config);
    ThreadTeam team(Topology::of_this_process(), Placement::none, threads);
    std::vector<WaitFree<>::Session> sessions;
    for (unsigned t = 0; t < threads; ++t) sessions.push_back(cache.open_session(t));
    for (std::uint32_t frame = 0; frame < 4; ++frame) {
      std::vector<Record> first;
      if (frame == 3) {
        cache.for_each_record([&](const Record& r) { first.push_back(r); });
        for (Record& r : first) r.E *= 0.5f;
      }
      if (frame >= 2) cache.clear();
      for (const Record& r : first) sessions[0].insert(r);
      constexpr FrameStart kStarts[] = {FrameStart::clear, FrameStart::stay, FrameStart::clear,
                                        FrameStart::replace};
      recorder.begin_frame(kStarts[frame], first);
      for (std::uint32_t pass = 0; pass < 2; ++pass) {
        recorder.begin_segment();
        std::atomic<std::uint32_t> next{0};
        team.run([&](unsigned t) {
          ErasedSession session(sessions[t]);
          TracedSession traced(session, recorder.log(t));
          for (;;) {
            // Relaxed: tiles only have to be distinct; the team orders what they leave.
            const std::uint32_t tile = next.fetch_add(1, std::memory_order_relaxed);
            if (tile >= kPoints / kTile) return;
            recorder.begin_tile(t);
            for (std::uint32_t i = 0; i < kTile; ++i)
              ask(traced, frame, pass * kPoints + tile * kTile + i, threads == 1);
            recorder.log(t).end_tile();
          }
        });
      }
      writer.add(recorder.frame(frame, [&](const auto& f) { cache.for_each_record(f); }));
    }
    writer.finish();
  }

  std::vector<SurfacePoint> asked;  ///< by one thread
  std::vector<Record> inserted;
  std::uint64_t hits = 0;

 private:
  void ask(TracedSession& session, std::uint32_t frame, std::uint32_t i, bool log) {
    const std::uint32_t point = (frame * 577 + i) % (2 * kPoints);
    const SurfacePoint& x = made_.points[point];
    const auto E = session.query(x);
    session.asked(x, E.has_value());
    if (log) asked.push_back(x);
    if (log) hits += E.has_value();
    if (E) return;
    const Record r{x.p, x.n, made_.radii[point], smooth_irradiance(x.p), frame << 24 | i};
    EXPECT_EQ(session.insert(r), InsertResult::inserted);
    if (log) inserted.push_back(r);
  }

  SurfacePoints made_;
};

/// Runs replays with teams that are made once.
class Bench {
 public:
  template <class Run>
  TrialOutcome operator()(Run&& run, const TracePlan& plan, unsigned threads) {
    auto& team = teams_[threads];
    if (!team) team = std::make_unique<ThreadTeam>(topology_, Placement::none, threads);
    return run(plan, TrialSetup{*team, work_, 3, 1});
  }

 private:
  Topology topology_ = Topology::of_this_process();
  Work work_{WorkCalibration{}};
  std::map<unsigned, std::unique_ptr<ThreadTeam>> teams_;
};

class Traces : public ::testing::Test {
 protected:
  TemporaryFolder folder_;
  std::string path_ = folder_ / "a.trace";
  MadeRender render_;
  Bench bench_;
};

TEST_F(Traces, WhatIsAskedAndInsertedComesBackBitForBit) {
  render_.capture(path_, 1);
  const Trace trace = read_trace(path_);
  EXPECT_EQ(trace.context.scene, "a box");
  EXPECT_EQ(trace.context.integrator, "made by hand");
  EXPECT_EQ(trace.context.cache, "wait_free");
  EXPECT_EQ(trace.context.seed, 7u);
  const CacheConfig config = trace.context.config, expected = render_.context(1).config;
  EXPECT_TRUE(same_bytes(config.bounds, expected.bounds));
  EXPECT_EQ(config.a_max, expected.a_max);
  EXPECT_EQ(config.a, expected.a);
  EXPECT_EQ(config.capacity, expected.capacity);
  EXPECT_EQ(config.max_sessions, expected.max_sessions);
  ASSERT_EQ(trace.points.size(), render_.asked.size());
  std::size_t inserted = 0;
  std::uint64_t hits = 0;
  for (std::size_t i = 0; i < trace.points.size(); ++i) {
    ASSERT_TRUE(same_bytes(trace.points[i], render_.asked[i])) << i;
    hits += trace.made[i] == Trace::kHit;
    if (trace.made[i] == Trace::kHit) continue;
    const TracedRecord& r = trace.records[trace.made[i]];
    ASSERT_TRUE(same_bytes(r.record, render_.inserted[inserted++])) << i;
    EXPECT_EQ(r.flags, 0);
    EXPECT_EQ(r.result, InsertResult::inserted);
  }
  EXPECT_EQ(inserted, render_.inserted.size());
  EXPECT_EQ(hits, render_.hits);
  EXPECT_GT(hits, trace.points.size() / 4);
  ASSERT_EQ(trace.frames.size(), 4u);
  EXPECT_EQ(trace.segments.size(), 8u);
  EXPECT_EQ(trace.frames[3].first.end - trace.frames[3].first.begin, trace.frames[2].stored);
  EXPECT_EQ(trace.bytes, std::filesystem::file_size(path_));
}

TEST_F(Traces, OneThreadLeavesTheSameRecordsInEveryCache) {
  render_.capture(path_, 1);
  for (const double scale : {0.0, 1.0}) {
    const TracePlan plan(read_trace(path_), scale);
    for (const CacheEntry& cache : all_caches()) {
      SCOPED_TRACE(cache.traits.name);
      const TrialOutcome out = bench_(cache.trace, plan, 1);
      EXPECT_EQ(out.error, "");
      EXPECT_EQ(out.counts.queries, plan.trace().points.size());
      if (cache.traits.consistency == Consistency::none) {
        EXPECT_FALSE(out.same_records);
        EXPECT_EQ(out.records, 0u);
        continue;
      }
      EXPECT_TRUE(out.same_records);
      EXPECT_EQ(out.stand_ins, 0u);
      EXPECT_EQ(out.counts.hits, render_.hits);
      EXPECT_EQ(out.counts.inserted, render_.inserted.size());
      EXPECT_EQ(out.records, plan.records_of_one_thread());
      EXPECT_EQ(out.query_ticks.count() + out.insert_ticks.count(), out.operations);
    }
  }
}

TEST_F(Traces, ManyThreadsLeaveWhatTheyInserted) {
  for (const unsigned captured : {1u, 3u}) {
    render_.capture(path_, captured);
    const TracePlan plan(read_trace(path_), 0.0);
    for (const CacheEntry& cache : all_caches()) {
      for (const unsigned threads : {1u, 2u, 8u}) {
        if (cache.traits.single_thread && threads > 1) continue;
        SCOPED_TRACE(fmt::format("{}, {} threads, captured from {}", cache.traits.name, threads, captured));
        const TrialOutcome out = bench_(cache.trace, plan, threads);
        EXPECT_EQ(out.error, "");
        EXPECT_EQ(out.counts.queries, plan.trace().points.size());
        if (cache.traits.consistency == Consistency::none) continue;
        EXPECT_EQ(out.counts.queries - out.counts.hits, out.counts.inserted);
        EXPECT_GE(out.counts.inserted, out.stand_ins);
      }
    }
  }
}

TEST_F(Traces, AsCapturedAnyNumberOfThreadsLeavesTheRecordsOfTheRender) {
  for (const unsigned captured : {1u, 3u}) {
    render_.capture(path_, captured);
    const TracePlan plan(read_trace(path_), 0.0, true);
    for (const CacheEntry& cache : all_caches()) {
      if (cache.traits.consistency == Consistency::none) continue;
      for (const unsigned threads : {1u, 2u, 8u}) {
        if (cache.traits.single_thread && threads > 1) continue;
        SCOPED_TRACE(fmt::format("{}, {} threads, captured from {}", cache.traits.name, threads, captured));
        const TrialOutcome out = bench_(cache.trace, plan, threads);
        EXPECT_EQ(out.error, "");
        EXPECT_TRUE(out.same_records);
        EXPECT_EQ(out.stand_ins, 0u);
      }
    }
  }
}

TEST_F(Traces, WhatCachesDoWrongIsFoundOut) {
  render_.capture(path_, 1);
  const TracePlan plan(read_trace(path_), 0.0);
  EXPECT_EQ(bench_(run_trace_trial<WaitFree>, plan, 2).error, "");
  EXPECT_TRUE(is_one_line_with(bench_(run_trace_trial<Losing>, plan, 2).error, "accepted but"));
  EXPECT_TRUE(is_one_line_with(bench_(run_trace_trial<Tearing>, plan, 2).error, "was not given"));
}

/// A trace of one tile.
void write_tile(const std::string& path, const TraceEncoder& encoder, std::uint32_t operations,
                std::uint32_t records, const TraceContext& context) {
  TraceWriter writer(path, context);
  CapturedFrame frame;
  frame.segments = 1;
  frame.tiles.push_back({0, 0, 0, operations, records, std::span(encoder.data(), encoder.size())});
  writer.add(frame);
  writer.finish();
}

TEST_F(Traces, AnyBitsComeBack) {
  TraceContext context = render_.context(1);
  Pcg32 random(1);
  const auto any = [&] {
    glm::vec3 v;
    for (int axis = 0; axis < 3; ++axis) v[axis] = std::bit_cast<float>(random());
    return v;
  };
  std::vector<SurfacePoint> points;
  std::vector<TracedRecord> records;
  TraceEncoder encoder(1);
  encoder.begin_tile();
  std::vector<glm::vec3> normals;
  for (std::uint32_t i = 0; i < 40; ++i) normals.push_back(any());
  for (std::uint32_t i = 0; i < 3000; ++i) {
    // No cache takes any of this: all of it misses and is rejected.
    const SurfacePoint x{i % 7 == 0 && i > 0 ? points.back().p : any(), normals[random.below(1 + i % 40)]};
    points.push_back(x);
    TracedRecord r;
    r.record = {any(), any(), -1.0f, any(), random()};
    if (i % 2 == 0) std::tie(r.record.p, r.record.n) = std::tie(x.p, x.n);
    r.flags = static_cast<std::uint8_t>(random.below(4));
    r.result = InsertResult::rejected;
    r.cost_ns = std::uint64_t{1} << random.below(39);
    records.push_back(r);
    encoder.query(x, false);
    encoder.record(r);
  }
  write_tile(path_, encoder, 3000, 3000, context);
  const Trace trace = read_trace(path_);
  ASSERT_EQ(trace.points.size(), 3000u);
  for (std::uint32_t i = 0; i < 3000; ++i) {
    ASSERT_TRUE(same_bytes(trace.points[i], points[i])) << i;
    const TracedRecord& r = trace.records[trace.made[i]];
    ASSERT_TRUE(same_bytes(r.record, records[i].record)) << i;
    EXPECT_EQ(r.flags & 3, records[i].flags);
    EXPECT_EQ(r.cost_ns, records[i].cost_ns);
  }
  const TrialOutcome out = bench_(find_cache("packed_wait_free").trace, TracePlan(trace, 0.0), 1);
  EXPECT_EQ(out.error, "");
  EXPECT_EQ(out.counts.inserted, 0u);
  EXPECT_EQ(out.counts.rejected, 0u) << "what the render's cache refused is not offered";
}

TEST_F(Traces, AnswersThatTheRendererRefusedAreRefusedAgain) {
  const SurfacePoint x{{0.5f, 0.5f, 0.0f}, {0, 0, 1}};
  TraceEncoder encoder(4);
  encoder.begin_tile();
  for (std::uint32_t i = 0; i < 2; ++i) {
    TracedRecord r;
    r.record = {x.p, x.n, 1.0f, {1, 2, 3}, i};
    r.flags = i == 0 ? 0 : TracedRecord::kRefusedAnswer | TracedRecord::kAskedNeighbours;
    encoder.query(x, false);
    encoder.record(r);
  }
  encoder.query(x, true);
  write_tile(path_, encoder, 3, 2, render_.context(1));
  const TracePlan plan(read_trace(path_), 0.0);
  const TrialOutcome out = bench_(find_cache("wait_free").trace, plan, 1);
  EXPECT_EQ(out.error, "");
  EXPECT_EQ(out.counts.inserted, 2u);
}

TEST_F(Traces, RecordsThatTwoThreadsMadeAtOnceAreMadeTwiceAsCapturedOnly) {
  const SurfacePoint x{{0.5f, 0.5f, 0.0f}, {0, 0, 1}};
  TraceEncoder encoder(4);
  encoder.begin_tile();
  for (std::uint32_t i = 0; i < 2; ++i) {
    TracedRecord r;
    r.record = {x.p, x.n, 0.1f, glm::vec3(1.0f), i};
    r.result = InsertResult::inserted;
    encoder.query(x, false);
    encoder.record(r);
  }
  write_tile(path_, encoder, 2, 2, render_.context(1));
  const auto inserted = [&](bool as_captured) {
    const TracePlan plan(read_trace(path_), 0.0, as_captured);
    return bench_(find_cache("packed_wait_free").trace, plan, 1).counts.inserted;
  };
  EXPECT_EQ(inserted(false), 1u);
  EXPECT_EQ(inserted(true), 2u);
}

TEST_F(Traces, AnAnswerWithoutARecordIsRefused) {
  TraceEncoder encoder(4);
  encoder.begin_tile();
  encoder.query({{0.5f, 0.5f, 0.0f}, {0, 0, 1}}, true);
  write_tile(path_, encoder, 1, 0, render_.context(1));
  EXPECT_TRUE(is_one_line_with(error_of([&] { TracePlan(read_trace(path_), 1.0); }), "contradicts itself"));
  const WorkloadSpec spec = parse_workload("trace:file=" + path_);
  EXPECT_TRUE(
      is_one_line_with(error_of([&] { plan_of_trace(spec, 1.0); }), "cannot use the trace '" + path_));
}

TEST_F(Traces, AFileThatChangedSinceTheRunBeganIsRefused) {
  render_.capture(path_, 1);
  WorkloadSpec spec = parse_workload("trace:file=" + path_);
  spec.checksum = read_trace_header(path_).checksum;
  EXPECT_NO_THROW(plan_of_trace(spec, 1.0));
  MadeRender().capture(path_, 2);
  EXPECT_TRUE(is_one_line_with(error_of([&] { plan_of_trace(spec, 1.0); }), path_ + "' has changed"));
}

class SmallTrace : public Traces {
 protected:
  SmallTrace() {
    TraceEncoder encoder(4);
    encoder.begin_tile();
    for (std::uint32_t i = 0; i < 3; ++i) {
      const SurfacePoint x{{0.25f * static_cast<float>(i), 0.5f, 0.0f}, {0, 0, 1}};
      TracedRecord r;
      r.record = {x.p, x.n, 0.1f, {1, 2, 3}, i};
      r.cost_ns = 1000;
      encoder.query(x, false);
      encoder.record(r);
      encoder.query(x, true);
    }
    write_tile(path_, encoder, 6, 3, render_.context(1));
    bytes_ = bytes_of(path_);
  }

  std::string refusal() const {
    return error_of([&] { read_trace(path_); });
  }

  Bytes bytes_;
};

TEST_F(SmallTrace, IsRefusedWithAnyBitFlipped) {
  std::fstream file(path_, std::ios::binary | std::ios::in | std::ios::out);
  const auto put_byte = [&](std::size_t i, unsigned byte) {
    file.seekp(static_cast<std::streamoff>(i)).put(static_cast<char>(byte)).flush();
  };
  for (std::size_t i = 0; i < bytes_.size(); ++i) {
    for (unsigned bit = 0; bit < 8; ++bit) {
      put_byte(i, bytes_[i] ^ (1u << bit));
      ASSERT_TRUE(is_one_line_with(refusal(), path_ + "': at byte ")) << "byte " << i << ", bit " << bit;
    }
    put_byte(i, bytes_[i]);
  }
  EXPECT_EQ(refusal(), "");
}

TEST_F(SmallTrace, IsRefusedIfItIsCutOffOrTooLong) {
  for (std::size_t size = bytes_.size(); size-- > 0;) {
    std::filesystem::resize_file(path_, size);
    ASSERT_TRUE(is_one_line_with(refusal(), "at byte ")) << size;
  }
  Bytes more = bytes_;
  more.push_back(0);
  put(path_, more);
  EXPECT_TRUE(is_one_line_with(refusal(), "follow the header"));
  EXPECT_TRUE(is_one_line_with(error_of([&] { read_trace(folder_ / "missing"); }), "No such file"));
  EXPECT_TRUE(is_one_line_with(error_of([&] { read_trace(folder_ / "."); }), "no regular file"));
  EXPECT_TRUE(is_one_line_with(error_of([&] { read_trace("/dev/zero"); }), "no regular file"));
}

// Files made by somebody else, whose checksums are right: every byte of them may say anything.
TEST_F(SmallTrace, IsTakenOrRefusedWithAnyByteChangedAndTheChecksumsMended) {
  constexpr std::size_t kHeader = 400, kBodyCrcAt = 384, kHeaderCrcAt = 392;
  std::size_t refused = 0;
  for (std::size_t i = 12; i < bytes_.size(); ++i) {
    if (i >= kBodyCrcAt && i < kHeader) continue;
    for (const unsigned value : {0u, 0x7fu, 0x80u, 0xffu, bytes_[i] ^ 1u, bytes_[i] + 1u}) {
      Bytes other = bytes_;
      other[i] = static_cast<unsigned char>(value);
      cache_file::Writer(other.data() + kBodyCrcAt)
          .number(cache_file::crc_of(other.data() + kHeader, other.size() - kHeader), 8);
      cache_file::Writer(other.data() + kHeaderCrcAt)
          .number(cache_file::crc_of(other.data(), kHeaderCrcAt), 8);
      put(path_, other);
      const std::string said = error_of([&] { TracePlan(read_trace(path_), 1.0); });
      EXPECT_EQ(said.find('\n'), said.npos);
      refused += !said.empty();
    }
  }
  EXPECT_GT(refused, 200u);
}

TEST_F(SmallTrace, NothingStandsUnderItsNameBeforeItIsWhole) {
  const std::string other = folder_ / "other";
  {
    TraceWriter writer(other, render_.context(1));
    CapturedFrame frame;
    frame.segments = 1;
    writer.add(frame);
    EXPECT_FALSE(std::filesystem::exists(other));
  }
  EXPECT_EQ(folder_.entries(), 1) << "one that is given up leaves nothing";
  EXPECT_TRUE(
      is_one_line_with(error_of([&] { TraceWriter(folder_ / "no/such", render_.context(1)); }), "trace"));
}

}  // namespace
}  // namespace icbench
