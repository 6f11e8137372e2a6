// Any cache, to be driven operation by operation by one real thread that stands for many: what the simulator runs.
// Instantiated once per cache, beside what replays traces, whose traversals it shares.
#pragma once

#include <memory>
#include <vector>

#include "core/cache.h"
#include "workload/trace_capture.h"

namespace icbench {

/// A cache of any kind. One real thread calls; sessions stand for virtual threads.
class SteppedCache {
 public:
  virtual ~SteppedCache() = default;
  /// Of virtual thread `thread`, below max_sessions; opened when first asked for.
  virtual AnySession& session(unsigned thread) = 0;
  /// Touches memory for about n inserts of that session.
  virtual void prefault(unsigned thread, std::uint32_t n) = 0;
  virtual void begin_frame() = 0;
  virtual void end_frame() = 0;
  virtual void clear() = 0;
  /// Calls f for every record, weight 0. Quiescent.
  virtual void for_each_record(const RecordCallback& f) const = 0;
  virtual Counts counters() const = 0;
  virtual void reset_counters() = 0;
};

template <class Cache>
class SteppedOf final : public SteppedCache {
 public:
  explicit SteppedOf(const CacheConfig& config) : cache_(config), opened_(config.max_sessions) {}

  AnySession& session(unsigned thread) override { return opened(thread).erased; }
  void prefault(unsigned thread, std::uint32_t n) override { opened(thread).session.prefault(n); }
  void begin_frame() override { cache_.begin_frame(); }
  void end_frame() override { cache_.end_frame(); }
  void clear() override { cache_.clear(); }
  void for_each_record(const RecordCallback& f) const override {
    cache_.for_each_record([&](const Record& r) { f(r, 0.0f); });
  }
  Counts counters() const override { return cache_.counters(); }
  void reset_counters() override { cache_.reset_counters(); }

 private:
  using Session = typename Cache::Session;
  struct Opened {
    explicit Opened(Session s) : session(s), erased(session) {}
    Session session;
    ErasedSession<Session> erased;
  };

  Opened& opened(unsigned thread) {
    auto& slot = opened_[thread];
    if (slot == nullptr) slot = std::make_unique<Opened>(cache_.open_session(thread));
    return *slot;
  }

  Cache cache_;
  std::vector<std::unique_ptr<Opened>> opened_;
};

template <template <class> class CacheTemplate>
std::unique_ptr<SteppedCache> make_stepped_cache(const CacheConfig& config) {
  return std::make_unique<SteppedOf<CacheTemplate<WithCounters>>>(config);
}

}  // namespace icbench
