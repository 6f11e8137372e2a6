// Captures a trace (workload/trace_file.h) of the operations that a render asks of its cache.
//
// Which passes capture is decided where the cache is: make_cached_pass makes a TracedPass (workload/traced_pass.h) if
// it is given a recorder, else the pass without one, whose code knows nothing of traces. A traced tile runs through one
// TracedSession for all caches: a virtual call for each operation, and the operation's bytes to the thread's own
// buffer, touched beforehand. The clock is read at misses only, around what makes the record: its cost holds whatever
// else kept the thread from inserting, being descheduled included.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "core/sync.h"
#include "harness/ticks.h"
#include "render/irradiance_cache.h"
#include "workload/trace_file.h"
#include "workload/validation.h"

namespace icbench {

/// A session of any cache.
class AnySession {
 public:
  virtual ~AnySession() = default;
  virtual void visit(const SurfacePoint& x, const RecordCallback& f) noexcept = 0;
  virtual std::optional<Irradiance> query(const SurfacePoint& x) noexcept = 0;
  virtual InsertResult insert(const Record& r) noexcept = 0;
};

template <class Session>
class ErasedSession final : public AnySession {
 public:
  explicit ErasedSession(Session& session) noexcept : session_(session) {}
  void visit(const SurfacePoint& x, const RecordCallback& f) noexcept override { session_.visit(x, f); }
  std::optional<Irradiance> query(const SurfacePoint& x) noexcept override { return session_.query(x); }
  InsertResult insert(const Record& r) noexcept override { return session_.insert(r); }

 private:
  Session& session_;
};

/// What one thread did in a frame.
class alignas(kNoSharing) TraceLog {
 public:
  TraceLog(std::uint64_t operations, const TickRate& rate) : encoder_(operations), rate_(rate) {}

  void begin_tile(std::uint32_t segment, std::uint32_t order) noexcept;
  void end_tile() noexcept;

  /// A visit begins: for a query, or, after a miss, of the record's neighbours.
  void visit() noexcept;
  void visited(std::uint32_t records) noexcept;
  void asked(const SurfacePoint& x, bool is_hit) noexcept;
  /// A record has been made; the first call after a miss counts.
  void made() noexcept {
    if (evaluated_ == 0) evaluated_ = ticks();
  }
  void inserted(const Record& r, InsertResult result) noexcept;

 private:
  friend class TraceRecorder;

  struct Tile {
    std::uint32_t segment, order, operations, records;
    std::size_t begin, end;  // bytes
  };

  TraceEncoder encoder_;
  TickRate rate_;
  std::vector<Tile> tiles_;
  Tile tile_{};
  std::uint64_t missed_ = 0, evaluated_ = 0;  // ticks
  std::uint32_t valid_ = 0;                   // records that the query was shown
  bool is_open_ = false;                      // after a miss, until its record is inserted
  std::uint8_t flags_ = 0;                    // of that record
};

/// What irradiance_cache_tile takes for a cache's session.
class TracedSession {
 public:
  TracedSession(AnySession& session, TraceLog& log) noexcept : session_(session), log_(log) {}

  template <class F>
  void visit(const SurfacePoint& x, F&& f) noexcept {
    struct Shown {
      std::remove_reference_t<F>* f;
      std::uint32_t records;
    } shown{&f, 0};
    log_.visit();
    session_.visit(x, {[](void* context, const Record& r, float weight) noexcept {
                         auto* const s = static_cast<Shown*>(context);
                         ++s->records;
                         (*s->f)(r, weight);
                       },
                       &shown});
    log_.visited(shown.records);
  }
  std::optional<Irradiance> query(const SurfacePoint& x) noexcept { return session_.query(x); }
  void asked(const SurfacePoint& x, bool is_hit) noexcept { log_.asked(x, is_hit); }
  InsertResult insert(const Record& r) noexcept {
    log_.made();
    const InsertResult result = session_.insert(r);
    log_.inserted(r, result);
    return result;
  }

 private:
  AnySession& session_;
  TraceLog& log_;
};

/// What all threads did.
class TraceRecorder {
 public:
  /// Memory for `operations` queries a frame is touched.
  TraceRecorder(unsigned threads, std::uint64_t operations);

  // Quiescent.
  void begin_frame(FrameStart start, std::vector<Record> first);
  void begin_segment() noexcept;
  /// The frame since begin_frame; `for_each_record` calls its argument for every record in the cache.
  CapturedFrame frame(
      std::uint32_t number,
      const std::function<void(const std::function<void(const Record&)>&)>& for_each_record) const;

  /// irradiance_cache_tile, captured. By many threads at once, each with a log of its own.
  void tile(AnySession& session, RecordSource& source, unsigned thread, Tracer& tracer,
            const PrimaryHits& primary, const SampleKey& key, const Tile& tile, Image& indirect,
            CacheUse& use, AskAgain ask_again) noexcept;

  /// For those that capture by other means: between the two calls, `log(thread)` takes the operations of a tile.
  void begin_tile(unsigned thread) noexcept;
  TraceLog& log(unsigned thread) noexcept { return *logs_[thread]; }

 private:
  std::vector<std::unique_ptr<TraceLog>> logs_;
  FrameStart start_ = FrameStart::stay;
  std::vector<Record> first_;
  std::uint32_t segments_ = 0;
  alignas(kNoSharing) std::atomic<std::uint32_t> begun_{
      0};  // tiles of the segment; every thread counts on it
};

}  // namespace icbench
