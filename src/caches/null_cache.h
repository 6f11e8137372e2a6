// A cache that keeps nothing: every query misses, every insert finds it full. Measures the harness around it.
#pragma once

#include "caches/session.h"

namespace icbench {

template <class Counters = NoCounters>
class NullCache {
  struct State {
    [[no_unique_address]] Counters counters;
  };

 public:
  static constexpr CacheTraits kTraits{"null",
                                       "none",
                                       "none",
                                       ProgressGuarantee::wait_free,
                                       ProgressGuarantee::wait_free,
                                       Consistency::none,
                                       false,
                                       "floor of the harness"};
  using Session = icbench::Session<NullCache, State>;

  explicit NullCache(const CacheConfig& config) : config_(checked(config)), sessions_(config, false) {}

  Session open_session(std::uint32_t thread) { return Session(*this, sessions_[thread]); }
  void begin_frame() noexcept {}
  void end_frame() noexcept {}
  void clear() noexcept {}
  template <class F>
  void update_records(F&&) noexcept {}
  template <class F>
  void for_each_record(F&&) const noexcept {}
  std::size_t memory_bytes() const noexcept { return sessions_.bytes(); }
  /// Step bounds (caches/session.h).
  static constexpr std::uint32_t insert_steps(const Record&) noexcept { return 0; }
  static constexpr std::uint64_t query_steps(std::span<const std::uint32_t>) noexcept { return 0; }
  static constexpr std::uint32_t most_lists() noexcept { return 0; }
  static constexpr std::string_view insert_bound() noexcept { return "0"; }
  static constexpr std::string_view query_bound() noexcept { return "0"; }

  Counts counters() const { return sessions_.counts(); }
  void reset_counters() { sessions_.reset_counters(); }
  const CacheConfig& config() const noexcept { return config_; }

 private:
  friend Session;
  template <class F>
  void visit(State&, const SurfacePoint&, F&&) noexcept {}
  bool insert(State&, const Record&) noexcept { return false; }
  void prefault(State&, std::uint32_t) noexcept {}

  CacheConfig config_;
  SessionTable<State> sessions_;
};

}  // namespace icbench
