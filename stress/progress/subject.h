// A cache under count: its operations and its step bounds behind one interface, so that the checks are compiled once.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/cache.h"
#include "stress/progress/step_sync.h"

namespace icbench::stress {

class CountedCache {
 public:
  virtual ~CountedCache() = default;

  virtual InsertResult insert(std::uint32_t session, const Record& r) noexcept = 0;
  virtual void visit(std::uint32_t session, const SurfacePoint& x,
                     const std::function<void(const Record&)>& f) noexcept = 0;
  /// f(i, record): of points[i].
  virtual void visit_batch(std::uint32_t session, std::span<const SurfacePoint> points,
                           const std::function<void(std::size_t, const Record&)>& f) noexcept = 0;
  /// Quiescent, as for_each_record and end_frame of the cache.
  virtual void for_each_record(const std::function<void(const Record&)>& f) const = 0;
  virtual void end_frame() = 0;

  /// Most steps of an insert of `r`, and of a query that read lists of these extents; none if the cache does not
  /// promise any.
  virtual std::optional<std::uint64_t> insert_steps(const Record& r) const noexcept = 0;
  virtual std::optional<std::uint64_t> query_steps(std::span<const std::uint32_t> extents) const noexcept = 0;
  /// Most lists that a query reads.
  virtual std::uint32_t most_lists() const noexcept = 0;
};

struct ProgressSubject {
  CacheTraits traits;
  std::string_view insert_bound;  ///< in words; empty if none is promised
  std::string_view query_bound;
  std::unique_ptr<CountedCache> (*make)(const CacheConfig&);
};

/// `Cache` is on Step policies already; `kTraits` is what it declares.
template <class Cache>
class CountedCacheOf final : public CountedCache {
 public:
  static constexpr bool kInsertIsBounded = Cache::kTraits.insert == ProgressGuarantee::wait_free;
  static constexpr bool kQueryIsBounded = Cache::kTraits.query == ProgressGuarantee::wait_free;

  explicit CountedCacheOf(const CacheConfig& config) : cache_(config) {
    for (std::uint32_t s = 0; s < config.max_sessions; ++s) sessions_.push_back(cache_.open_session(s));
  }

  InsertResult insert(std::uint32_t session, const Record& r) noexcept override {
    return sessions_[session].insert(r);
  }
  void visit(std::uint32_t session, const SurfacePoint& x,
             const std::function<void(const Record&)>& f) noexcept override {
    sessions_[session].visit(x, [&](const Record& r, float) noexcept { f(r); });
  }
  void visit_batch(std::uint32_t session, std::span<const SurfacePoint> points,
                   const std::function<void(std::size_t, const Record&)>& f) noexcept override {
    const Watching watching{f};
    sessions_[session].visit_batch(points, watching);
  }
  void for_each_record(const std::function<void(const Record&)>& f) const override {
    cache_.for_each_record(f);
  }
  void end_frame() override { cache_.end_frame(); }

  std::optional<std::uint64_t> insert_steps(const Record& r) const noexcept override {
    if constexpr (kInsertIsBounded) return cache_.insert_steps(r);
    return std::nullopt;
  }
  std::optional<std::uint64_t> query_steps(
      [[maybe_unused]] std::span<const std::uint32_t> extents) const noexcept override {
    if constexpr (kQueryIsBounded) return Cache::query_steps(extents);
    return std::nullopt;
  }
  std::uint32_t most_lists() const noexcept override {
    if constexpr (kQueryIsBounded) return Cache::most_lists();
    return 0;
  }

 private:
  /// The visitors of a batch.
  struct Watching {
    const std::function<void(std::size_t, const Record&)>& f;
    auto operator[](std::size_t i) const noexcept {
      return [this, i](const Record& r, float) noexcept { f(i, r); };
    }
  };

  Cache cache_;
  std::vector<typename Cache::Session> sessions_;
};

template <class Cache>
ProgressSubject progress_subject() {
  using Counted = CountedCacheOf<Cache>;
  ProgressSubject subject{Cache::kTraits, {}, {}, [](const CacheConfig& config) {
                            return std::unique_ptr<CountedCache>(new Counted(config));
                          }};
  if constexpr (Counted::kInsertIsBounded) subject.insert_bound = Cache::insert_bound();
  if constexpr (Counted::kQueryIsBounded) subject.query_bound = Cache::query_bound();
  return subject;
}

/// Instantiated once per cache of the registry in a translation unit of its own (subject_instance.cpp.in).
template <template <class> class CacheTemplate>
ProgressSubject make_progress_subject();

/// All caches, in the order of the registry.
std::span<const ProgressSubject> all_progress_subjects();

}  // namespace icbench::stress
