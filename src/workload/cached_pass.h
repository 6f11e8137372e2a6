// The pass through a cache, for any source of records. Instantiated once per cache, in a translation unit of its own.
#pragma once

#include <algorithm>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/cache.h"
#include "core/sync.h"
#include "render/irradiance_cache.h"
#include "render/waves.h"
#include "workload/trial.h"

namespace icbench {

class TraceRecorder;

/// What a cached pass is set up with.
struct CachedPassSetup {
  CacheConfig cache{};              ///< max_sessions: the crew's size
  std::uint32_t prefault = 0;       ///< records that memory is touched for beforehand, by each thread
  std::uint32_t latency_every = 0;  ///< one operation in so many is timed, at random; 0 none
  std::uint64_t seed = 0;           ///< of which operations are timed
  /// Of the pictures, if they are to be made in waves (render/waves.h).
  const RayTracer* deterministic = nullptr;
  bool overture = false;  ///< of a sample of the pixels first all records, then the picture
  /// Told by any thread what share of a sample was done before tiles are asked for it or after: all of it in waves, the
  /// share kOvertureWork where all records are made first.
  std::function<void(double)> did{};
  TraceRecorder* trace = nullptr;       ///< captures what tiles do; not of pictures in waves
  std::span<ThreadAccount> accounts{};  ///< of the crew's threads, if their time is accounted for
};

/// What is told of a sample's work when all records are made, where its picture comes after them.
inline constexpr double kOvertureWork = 0.9;

template <template <class> class CacheTemplate>
class CachedPass : public IndirectPass, protected WaveCache {
 public:
  using Cache = CacheTemplate<WithCounters>;

  CachedPass(const CachedPassSetup& setup, std::unique_ptr<RecordSource> source, Crew& crew)
      : crew_(crew),
        source_(std::move(source)),
        has_overture_(setup.overture),
        did_(setup.did),
        accuracy_(setup.cache.a),
        cache_(setup.cache),
        workers_(crew.size()) {
    if (setup.deterministic != nullptr) waves_.emplace(*setup.deterministic, *source_, crew, did_);
    crew.run([&](unsigned t, Tracer&) {
      auto session = cache_.open_session(t);
      session.prefault(setup.prefault);
      ThreadAccount* const account = t < setup.accounts.size() ? &setup.accounts[t] : nullptr;
      workers_[t] =
          std::make_unique<Worker>(session, setup.latency_every, hash_keys(setup.seed, t, 7), account);
    });
    cache_.reset_counters();
  }

  void begin_frame(const SceneChange& change) override {
    const CacheUse last = use();
    if (last.full > last.queries / kFewRefused) source_->found_no_room();
    for (const auto& w : workers_) w->use = {};
    if (waves_) waves_->reset_use();
    lock_wait_before_ = cache_.counters().lock_wait_ns;
    then_ = source_->begin_frame(change, crew_);
    switch (then_) {
      case RecordsThen::stay:
        break;
      case RecordsThen::update:
        cache_.update_records([this](Record& r) noexcept { return source_->update(r); });
        source_->updated();
        insert_again();
        break;
      case RecordsThen::go:
        cache_.clear();
        break;
    }
  }

  void begin_sample(const PrimaryHits& primary, const SampleKey& key) override {
    cache_.begin_frame();
    key_ = key;
    if (has_overture_ && !waves_) fill(primary);
  }

  void tile(unsigned thread, Tracer& tracer, const PrimaryHits& primary, const SampleKey& key,
            const Tile& tile, Image& out) noexcept override {
    if (waves_) return;  // all at once, at the end
    Worker& w = *workers_[thread];
    irradiance_cache_tile(w.session, *source_, thread, tracer, primary, key, tile, out, w.use, ask_again());
  }

  void end_sample(const PrimaryHits& primary, Image& out) override {
    if (waves_) waves_->render(*this, primary, key_, has_overture_, out);
    cache_.end_frame();
  }

  bool keeps_plain_records() const noexcept override { return source_->makes_plain_records(); }

  std::uint64_t take_records(std::span<const Record> records) override {
    const std::vector<InsertResult> results = insert_all(records);
    return static_cast<std::uint64_t>(std::count(results.begin(), results.end(), InsertResult::inserted));
  }

  void for_each_record(const std::function<void(const Record&)>& f) const override {
    cache_.for_each_record(f);
  }

  PassFigures figures() const override {
    PassFigures out;
    out.use = use();
    cache_.for_each_record([&](const Record&) { ++out.records; });
    out.lock_wait_ns = cache_.counters().lock_wait_ns - lock_wait_before_;
    source_->report(out);
    return out;
  }

  Cache& cache() noexcept { return cache_; }
  const RecordSource& source() const noexcept { return *source_; }

  /// Calls f(timed session) for every thread's.
  template <class F>
  void for_each_session(F&& f) const {
    for (const auto& w : workers_) f(w->session);
  }

 protected:
  /// With an overture all records that the sample makes are there before its picture asks.
  AskAgain ask_again() const noexcept { return has_overture_ ? AskAgain::never : AskAgain::where_outdated; }

  void publish() override {
    cache_.end_frame();
    cache_.begin_frame();
  }

  struct alignas(kNoSharing) Worker {
    Worker(typename Cache::Session s, std::uint32_t latency_every, std::uint64_t seed, ThreadAccount* account)
        : session(s, latency_every, seed, account) {}
    TimedSession<typename Cache::Session> session;
    CacheUse use;
  };

 private:
  // One query in so many may compute a record for nobody else before all records are made anew.
  static constexpr std::uint64_t kFewRefused = 16;

  CacheUse use() const noexcept {
    CacheUse sum;
    for (const auto& w : workers_) sum += w->use;
    if (waves_) sum += waves_->use();
    return sum;
  }

  std::vector<InsertResult> insert_all(std::span<const Record> records) {
    std::vector<InsertResult> results(records.size());
    cache_.begin_frame();
    crew_.for_each(records.size(), 64, [&](unsigned t, Tracer&, std::size_t i) {
      results[i] = workers_[t]->session.insert(records[i]);
    });
    cache_.end_frame();
    return results;
  }

  void insert_again() {
    const std::span<const Record> records = source_->to_insert();
    if (records.empty()) return;
    const std::vector<InsertResult> results = insert_all(records);
    for (std::size_t i = 0; i < records.size(); ++i)
      if (results[i] != InsertResult::inserted) source_->refused(records[i]);
  }

  // Records for all pixels, as the tiles would make them; their picture is thrown away.
  void fill(const PrimaryHits& primary) {
    Image thrown_away = make_image(primary.width, primary.height);
    const std::vector<Tile> tiles = make_tiles(primary.width, primary.height, kFrameTile, TileOrder::morton);
    crew_.for_each(tiles.size(), 1, [&](unsigned thread, Tracer& tracer, std::size_t i) {
      tile(thread, tracer, primary, key_, tiles[i], thrown_away);
      if (did_) did_(kOvertureWork / static_cast<double>(tiles.size()));
    });
    publish();
  }

  void ask(unsigned thread, std::span<const SurfacePoint> points, Answers& answers,
           std::span<Reply> replies) noexcept override {
    auto& session = workers_[thread]->session;
    for (std::size_t i = 0; i < points.size(); i += Answers::kAtOnce) {
      const std::size_t n = std::min(Answers::kAtOnce, points.size() - i);
      answers.ask_at(points.subspan(i, n));
      session.visit_batch(points.subspan(i, n), answers);
      for (std::size_t k = 0; k < n; ++k) replies[i + k] = answers.settle(k);
    }
  }

  float accuracy() const noexcept override { return accuracy_; }

  InsertResult insert(unsigned thread, const Record& record) noexcept override {
    return workers_[thread]->session.insert(record);
  }

 protected:
  Crew& crew_;
  std::uint64_t lock_wait_before_ = 0;  // the frame began
  std::unique_ptr<RecordSource> source_;
  bool has_overture_;
  std::function<void(double)> did_;
  float accuracy_;              // of queries
  std::optional<Waves> waves_;  // if deterministic
  SampleKey key_;               // of the sample that was begun last
  Cache cache_;
  std::vector<std::unique_ptr<Worker>> workers_;  // each made by its thread
  RecordsThen then_ = RecordsThen::stay;          // became of the records as the frame began
};

/// Captures what it does (workload/traced_pass.h).
template <template <class> class CacheTemplate>
std::unique_ptr<IndirectPass> make_traced_pass(const CachedPassSetup& setup,
                                               std::unique_ptr<RecordSource> source, Crew& crew);

template <template <class> class CacheTemplate>
std::unique_ptr<IndirectPass> make_cached_pass(const CachedPassSetup& setup,
                                               std::unique_ptr<RecordSource> source, Crew& crew) {
  if (setup.trace != nullptr) return make_traced_pass<CacheTemplate>(setup, std::move(source), crew);
  return std::make_unique<CachedPass<CacheTemplate>>(setup, std::move(source), crew);
}

}  // namespace icbench
