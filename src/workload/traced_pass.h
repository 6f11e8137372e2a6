// The cached pass that captures a trace of what it does. Instantiated once per cache, apart from the pass that does
// not, whose machine code is then the same as if there were no traces.
#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "workload/cached_pass.h"
#include "workload/trace_capture.h"

namespace icbench {

template <template <class> class CacheTemplate>
class TracedPass final : public CachedPass<CacheTemplate> {
  using Base = CachedPass<CacheTemplate>;

 public:
  TracedPass(const CachedPassSetup& setup, std::unique_ptr<RecordSource> source, Crew& crew)
      : Base(setup, std::move(source), crew), recorder_(*setup.trace) {}

  void begin_frame(const SceneChange& change) override {
    Base::begin_frame(change);
    std::vector<Record> first;
    FrameStart start = FrameStart::stay;
    if (this->then_ == RecordsThen::go) start = FrameStart::clear;
    if (this->then_ == RecordsThen::update) {
      start = FrameStart::replace;
      this->cache().for_each_record([&](const Record& r) { first.push_back(r); });
    }
    recorder_.begin_frame(start, std::move(first));
  }

  void begin_sample(const PrimaryHits& primary, const SampleKey& key) override {
    recorder_.begin_segment();
    Base::begin_sample(primary, key);
  }

  void tile(unsigned thread, Tracer& tracer, const PrimaryHits& primary, const SampleKey& key,
            const Tile& tile, Image& out) noexcept override {
    auto& worker = *this->workers_[thread];
    ErasedSession session(worker.session);
    recorder_.tile(session, *this->source_, thread, tracer, primary, key, tile, out, worker.use,
                   this->ask_again());
  }

 private:
  void publish() override {
    Base::publish();
    recorder_.begin_segment();
  }

  TraceRecorder& recorder_;
};

template <template <class> class CacheTemplate>
std::unique_ptr<IndirectPass> make_traced_pass(const CachedPassSetup& setup,
                                               std::unique_ptr<RecordSource> source, Crew& crew) {
  return std::make_unique<TracedPass<CacheTemplate>>(setup, std::move(source), crew);
}

}  // namespace icbench
