// Any cache behind virtual functions, so that the tests of all caches are compiled once and not for each cache.
//
// The operations that run are the shipping templates; what is erased is the type and what a visit calls. Tests of the
// whole registry take registered_caches() as parameters; tests of other instances make theirs with tested<Cache>().
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <optional>
#include <ostream>
#include <span>
#include <string>
#include <vector>

#include "core/cache.h"

namespace icbench {

/// Offers what the concept IrradianceCache demands of a cache.
class AnyCache {
 public:
  using Visitor = std::function<void(const Record&, float)>;
  /// The same of a batch, told which of its points.
  using BatchVisitor = std::function<void(std::size_t, const Record&, float)>;

  /// The operations of one session.
  struct SessionFunctions {
    virtual ~SessionFunctions() = default;
    virtual void visit(const SurfacePoint& x, const Visitor& f) = 0;
    virtual void visit_batch(std::span<const SurfacePoint> points, const BatchVisitor& f) = 0;
    virtual std::optional<Irradiance> query(const SurfacePoint& x) = 0;
    virtual void query_batch(std::span<const SurfacePoint> points,
                             std::span<std::optional<Irradiance>> out) = 0;
    virtual InsertResult insert(const Record& r) = 0;
    virtual void prefault(std::uint32_t n) = 0;
  };

  /// The operations of the cache itself.
  struct CacheFunctions {
    virtual ~CacheFunctions() = default;
    virtual std::unique_ptr<SessionFunctions> open_session(std::uint32_t thread) = 0;
    virtual void begin_frame() = 0;
    virtual void end_frame() = 0;
    virtual void clear() = 0;
    virtual void update_records(const std::function<UpdateResult(Record&)>& f) = 0;
    virtual bool tidy() = 0;
    virtual void for_each_record(const std::function<void(const Record&)>& f) const = 0;
    virtual Counts counters() const = 0;
    virtual std::size_t memory_bytes() const = 0;
  };

  /// How a cache is made, and what it declares.
  struct Maker {
    CacheTraits traits;
    std::unique_ptr<CacheFunctions> (*make)(const CacheConfig& config);

    friend void PrintTo(const Maker& maker, std::ostream* out) { *out << maker.traits.name; }
  };

  class Session {
   public:
    explicit Session(std::unique_ptr<SessionFunctions> functions) : functions_(std::move(functions)) {}

    void visit(const SurfacePoint& x, const Visitor& f) { functions_->visit(x, f); }
    void visit_batch(std::span<const SurfacePoint> points, const BatchVisitor& f) {
      functions_->visit_batch(points, f);
    }
    std::optional<Irradiance> query(const SurfacePoint& x) { return functions_->query(x); }
    void query_batch(std::span<const SurfacePoint> points, std::span<std::optional<Irradiance>> out) {
      functions_->query_batch(points, out);
    }
    InsertResult insert(const Record& r) { return functions_->insert(r); }
    void prefault(std::uint32_t n) { functions_->prefault(n); }

   private:
    std::unique_ptr<SessionFunctions> functions_;
  };

  AnyCache(const Maker& maker, const CacheConfig& config) : functions_(maker.make(config)), config_(config) {}

  Session open_session(std::uint32_t thread) { return Session(functions_->open_session(thread)); }
  void begin_frame() { functions_->begin_frame(); }
  void end_frame() { functions_->end_frame(); }
  void clear() { functions_->clear(); }
  void update_records(const std::function<UpdateResult(Record&)>& f) { functions_->update_records(f); }
  /// False where the cache has none.
  bool tidy() { return functions_->tidy(); }
  void for_each_record(const std::function<void(const Record&)>& f) const { functions_->for_each_record(f); }
  Counts counters() const { return functions_->counters(); }
  std::size_t memory_bytes() const { return functions_->memory_bytes(); }
  const CacheConfig& config() const { return config_; }

 private:
  std::unique_ptr<CacheFunctions> functions_;
  CacheConfig config_;
};

template <class Cache>
class TestedCache final : public AnyCache::CacheFunctions {
 public:
  explicit TestedCache(const CacheConfig& config) : cache_(config) {}

  static std::unique_ptr<AnyCache::CacheFunctions> make(const CacheConfig& config) {
    return std::make_unique<TestedCache>(config);
  }

 private:
  class Session final : public AnyCache::SessionFunctions {
   public:
    explicit Session(const typename Cache::Session& session) : session_(session) {}

    void visit(const SurfacePoint& x, const AnyCache::Visitor& f) override { session_.visit(x, f); }
    void visit_batch(std::span<const SurfacePoint> points, const AnyCache::BatchVisitor& f) override {
      session_.visit_batch(points, Told{f});
    }
    std::optional<Irradiance> query(const SurfacePoint& x) override { return session_.query(x); }
    void query_batch(std::span<const SurfacePoint> points,
                     std::span<std::optional<Irradiance>> out) override {
      session_.query_batch(points, out);
    }
    InsertResult insert(const Record& r) override { return session_.insert(r); }
    void prefault(std::uint32_t n) override { session_.prefault(n); }

   private:
    /// The visitors of a batch, made as they are asked for.
    struct Told {
      const AnyCache::BatchVisitor& f;
      auto operator[](std::size_t i) const {
        return [this, i](const Record& r, float weight) { f(i, r, weight); };
      }
    };

    typename Cache::Session session_;
  };

  std::unique_ptr<AnyCache::SessionFunctions> open_session(std::uint32_t thread) override {
    return std::make_unique<Session>(cache_.open_session(thread));
  }
  void begin_frame() override { cache_.begin_frame(); }
  void end_frame() override { cache_.end_frame(); }
  void clear() override { cache_.clear(); }
  void update_records(const std::function<UpdateResult(Record&)>& f) override { cache_.update_records(f); }
  bool tidy() override {
    if constexpr (TidyCache<Cache>) {
      cache_.tidy();
      return true;
    } else {
      return false;
    }
  }
  void for_each_record(const std::function<void(const Record&)>& f) const override {
    cache_.for_each_record(f);
  }
  Counts counters() const override { return cache_.counters(); }
  std::size_t memory_bytes() const override { return cache_.memory_bytes(); }

  Cache cache_;
};

template <class Cache>
AnyCache::Maker tested() {
  return {Cache::kTraits, &TestedCache<Cache>::make};
}

/// Every cache of the registry, with its counters switched on.
std::vector<AnyCache::Maker> registered_caches();

/// Names a parameter of a test.
inline std::string cache_name(const testing::TestParamInfo<AnyCache::Maker>& info) {
  return std::string(info.param.traits.name);
}

}  // namespace icbench
