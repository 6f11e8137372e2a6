#include "workload/trace_capture.h"

#include <cmath>
#include <utility>

namespace icbench {

void TraceLog::begin_tile(std::uint32_t segment, std::uint32_t order) noexcept {
  encoder_.begin_tile();
  tile_ = {segment, order, 0, 0, encoder_.size(), 0};
}

void TraceLog::end_tile() noexcept {
  tile_.end = encoder_.size();
  tiles_.push_back(tile_);
}

void TraceLog::visit() noexcept {
  if (!is_open_) return;
  made();
  flags_ |= TracedRecord::kAskedNeighbours;
}

void TraceLog::visited(std::uint32_t records) noexcept {
  if (!is_open_) valid_ = records;
}

void TraceLog::asked(const SurfacePoint& x, bool is_hit) noexcept {
  encoder_.query(x, is_hit);
  ++tile_.operations;
  is_open_ = !is_hit;
  flags_ = valid_ != 0 ? TracedRecord::kRefusedAnswer : 0;
  valid_ = 0;
  evaluated_ = 0;
  if (!is_hit) missed_ = ticks();
}

void TraceLog::inserted(const Record& r, InsertResult result) noexcept {
  const double cost = rate_.to_ns(ticks_between(missed_, evaluated_));
  encoder_.record({r, flags_, result, static_cast<std::uint64_t>(std::llround(cost))});
  ++tile_.records;
  is_open_ = false;
}

TraceRecorder::TraceRecorder(unsigned threads, std::uint64_t operations) {
  const TickRate rate = calibrate_ticks();
  // A little more than a fair share each.
  for (unsigned t = 0; t < threads; ++t)
    logs_.push_back(std::make_unique<TraceLog>(operations / threads * 5 / 4, rate));
}

void TraceRecorder::begin_frame(FrameStart start, std::vector<Record> first) {
  start_ = start;
  first_ = std::move(first);
  segments_ = 0;
  for (const auto& log : logs_) {
    log->encoder_.clear();
    log->tiles_.clear();
  }
}

void TraceRecorder::begin_segment() noexcept {
  ++segments_;
  begun_.store(0, std::memory_order_relaxed);  // relaxed: the caller synchronises
}

CapturedFrame TraceRecorder::frame(
    std::uint32_t number,
    const std::function<void(const std::function<void(const Record&)>&)>& for_each_record) const {
  CapturedFrame out;
  out.number = number;
  out.start = start_;
  out.first = first_;
  out.segments = segments_;
  for (std::uint32_t t = 0; t < logs_.size(); ++t) {
    const TraceLog& log = *logs_[t];
    for (const TraceLog::Tile& tile : log.tiles_) {
      out.tiles.push_back({tile.segment, tile.order, t, tile.operations, tile.records,
                           std::span(log.encoder_.data() + tile.begin, tile.end - tile.begin)});
    }
  }
  RecordsDigest digest;
  for_each_record([&](const Record& r) {
    digest.add(r);
    ++out.stored;
  });
  out.digest = digest.value();
  return out;
}

void TraceRecorder::begin_tile(unsigned thread) noexcept {
  // relaxed: only that numbers are distinct and rise matters; each thread's log is its own until the tiles have ended.
  logs_[thread]->begin_tile(segments_ - 1, begun_.fetch_add(1, std::memory_order_relaxed));
}

void TraceRecorder::tile(AnySession& session, RecordSource& source, unsigned thread, Tracer& tracer,
                         const PrimaryHits& primary, const SampleKey& key, const Tile& tile, Image& indirect,
                         CacheUse& use, AskAgain ask_again) noexcept {
  begin_tile(thread);
  TracedSession traced(session, log(thread));
  irradiance_cache_tile(traced, source, thread, tracer, primary, key, tile, indirect, use, ask_again);
  log(thread).end_tile();
}

}  // namespace icbench
