// One lock around a whole unsynchronised structure, taken for every access (Dubla 2012, 7.2.1: LCK).
//
// Progress: blocking. Linearization point of every operation: any point at which it holds the lock; a query
// therefore sees an atomic snapshot. A reader under a readers-writer policy holds the lock shared.
#pragma once

#include "caches/locks.h"
#include "caches/session.h"
#include "caches/tidy.h"

namespace icbench {

template <class Structure, class Policy, class Counters = NoCounters>
class Locked {
  static_assert(Structure::kTraits.single_thread,
                "wrap the plain instantiation of a structure: the lock is the synchronisation");

  using Tickets = TicketOffice<typename Structure::SharedSync>;
  using Part = PartOfSession<Policy>;

  struct State {
    [[no_unique_address]] Counters counters;
    [[no_unique_address]] typename Part::type part;
  };
  using Name = JoinedName<Structure::kPrefix, Policy::kName>;

 public:
  static constexpr CacheTraits kTraits{Name::value,
                                       Structure::kStructure,
                                       Policy::kName,
                                       ProgressGuarantee::blocking,
                                       ProgressGuarantee::blocking,
                                       Consistency::linearizable,
                                       false,
                                       Policy::kSource};
  using Session = icbench::Session<Locked, State>;

  explicit Locked(const CacheConfig& config)
      : config_(checked(config)), sessions_(config, false), tickets_(config.capacity), structure_(config) {
    if constexpr (Part::kOn) sessions_.for_each([this](State& s) { mutex_.admit(s.part); });
  }

  Session open_session(std::uint32_t thread) { return Session(*this, sessions_[thread]); }
  void begin_frame() noexcept {}
  void end_frame() noexcept {}

  void clear() {
    structure_.clear();
    prefaulted_ = 0;
    workspace_ = {};
    purse_ = {};
    tickets_.restart(0);
  }

  template <class F>
  void update_records(F&& f) {
    const AtEnd restart{[this] {
      purse_ = {};
      tickets_.restart(count_of(structure_));
    }};
    const auto fresh_workspace = [this]() -> auto& {
      prefaulted_ = 0;
      return workspace_ = {};
    };
    update_and_then(structure_, keeping_storable(f, config_.bounds),
                    [&] { keep_room(structure_, config_.capacity, fresh_workspace); });
  }

  /// Lays the records out in the order of space (caches/tidy.h).
  void tidy() {
    const auto fresh_workspace = [this] {
      workspace_ = {};
      purse_ = {};
      prefaulted_ = 0;
    };
    tickets_.restart(lay_out_in_space(
        structure_, OctreeAddressing(config_.bounds), 1,
        fresh_workspace, [this](std::size_t) -> auto& { return workspace_; }));
  }

  template <class F>
  void for_each_record(F&& f) const {
    structure_.for_each(f);
  }

  /// Queries under way at once in a batch, where the structure does that.
  static constexpr std::size_t kBatch = batch_of<Structure>();

  std::size_t memory_bytes() const {
    return sessions_.bytes() + fixed_bytes(structure_) + Structure::bytes(workspace_);
  }
  Counts counters() const { return sessions_.counts(); }
  void reset_counters() { sessions_.reset_counters(); }
  const CacheConfig& config() const noexcept { return config_; }

 private:
  friend Session;

  /// What a query of session `s` locks.
  auto& to_read(State& s) noexcept {
    if constexpr (Part::kOn) {
      return s.part;
    } else {
      return mutex_;
    }
  }

  template <class F>
  void visit(State& s, const SurfacePoint& x, F&& f) noexcept {
    typename Policy::Read scope(to_read(s), s.counters);
    structure_.visit(x, config_.a, s.counters, f);
  }

  // One acquisition for all of them.
  template <class Visitors>
  void visit_batch(State& s, std::span<const SurfacePoint> points, Visitors visitors) noexcept {
    typename Policy::Read scope(to_read(s), s.counters);
    structure_.visit_batch(points, config_.a, s.counters, visitors);
  }

  bool insert(State& s, const Record& r) noexcept {
    typename Policy::Write scope(mutex_, s.counters);
    return tickets_.insert(purse_, [&] { return structure_.insert(workspace_, r, s.counters); });
  }

  // All sessions share one workspace, so each touches what lies behind the others' share. Nothing is taken by it, so
  // that the capacity bounds it.
  void prefault(State& s, std::uint32_t n) noexcept {
    typename Policy::Write scope(mutex_, s.counters);
    n = std::min(n, config_.capacity - prefaulted_);
    structure_.touch(prefaulted_, n);
    prefaulted_ += n;
  }

  CacheConfig config_;
  SessionTable<State> sessions_;
  alignas(kNoSharing) typename Policy::Mutex mutex_;
  // Everything below is protected by mutex_ while sessions are in operation.
  alignas(kNoSharing) Tickets tickets_;
  typename Tickets::Purse purse_;
  typename Structure::Workspace workspace_;
  std::uint32_t prefaulted_ = 0;  // records that sessions have touched memory for, at most the capacity
  Structure structure_;
};

}  // namespace icbench
