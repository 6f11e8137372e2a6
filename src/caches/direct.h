// A structure used as it is, without any wrapper: `sequential` and `brute_force` (ordinary memory, one
// thread), `node_lock` (locks of its own), `wait_free` (atomics of its own) and `tbb_hash_grid` (oneTBB's containers).
//
// Guarantees and costs are the structure's; see its header.
#pragma once

#include "caches/session.h"
#include "caches/tidy.h"

namespace icbench {

template <class Structure, class Counters = NoCounters>
class Direct {
  using Tickets = TicketOffice<typename Structure::SharedSync>;

  struct State {
    typename Structure::Workspace workspace;
    typename Tickets::Purse purse;
    [[no_unique_address]] Counters counters;
  };

 public:
  static constexpr CacheTraits kTraits = Structure::kTraits;
  using Session = icbench::Session<Direct, State>;

  explicit Direct(const CacheConfig& config)
      : config_(checked(config)),
        sessions_(config, kTraits.single_thread),
        tickets_(config.capacity),
        structure_(config) {}

  Session open_session(std::uint32_t thread) { return Session(*this, sessions_[thread]); }
  void begin_frame() noexcept {}
  void end_frame() noexcept {}

  void clear() {
    structure_.clear();
    sessions_.for_each([](State& s) {
      s.workspace = {};
      s.purse = {};
    });
    tickets_.restart(0);
  }

  template <class F>
  void update_records(F&& f) {
    const AtEnd restart{[this] {
      sessions_.for_each([](State& s) { s.purse = {}; });
      tickets_.restart(count_of(structure_));
    }};
    const auto fresh_workspace = [this]() -> auto& {
      sessions_.for_each([](State& s) { s.workspace = {}; });
      return sessions_[0].workspace;
    };
    update_and_then(structure_, keeping_storable(f, config_.bounds),
                    [&] { keep_room(structure_, config_.capacity, fresh_workspace); });
  }

  /// Lays the records out in the order of space (caches/tidy.h).
  void tidy() {
    const auto fresh_workspaces = [this] {
      sessions_.for_each([](State& s) {
        s.workspace = {};
        s.purse = {};
      });
    };
    tickets_.restart(lay_out_in_space(
        structure_, OctreeAddressing(config_.bounds), sessions_.size(),
        fresh_workspaces, [this](std::size_t i) -> auto& {
          return sessions_[static_cast<std::uint32_t>(i)].workspace;
        }));
  }

  template <class F>
  void for_each_record(F&& f) const {
    structure_.for_each(f);
  }

  std::size_t memory_bytes() const {
    std::size_t bytes = sessions_.bytes() + fixed_bytes(structure_);
    sessions_.for_each([&](const State& s) { bytes += Structure::bytes(s.workspace); });
    if constexpr (requires { structure_.memory_bytes(); }) bytes += structure_.memory_bytes();
    return bytes;
  }

  /// Queries under way at once in a batch, where the structure does that.
  static constexpr std::size_t kBatch = batch_of<Structure>();
  /// Step bounds (caches/session.h), of structures that are wait-free.
  std::uint32_t insert_steps(const Record& r) const noexcept {
    return structure_.insert_steps(r) + Tickets::kSteps;
  }
  static constexpr std::uint64_t query_steps(std::span<const std::uint32_t> extents) noexcept {
    return visit_steps<Structure>(extents);
  }
  static constexpr std::uint32_t most_lists() noexcept { return Structure::kMostLists; }
  static constexpr std::string_view insert_bound() noexcept {
    return JoinedName<Structure::kInsertBound, Tickets::kBound>::value;
  }
  static constexpr std::string_view query_bound() noexcept { return Structure::kVisitBound; }

  Counts counters() const { return sessions_.counts(); }
  void reset_counters() { sessions_.reset_counters(); }
  const CacheConfig& config() const noexcept { return config_; }

 private:
  friend Session;

  template <class F>
  void visit(State& s, const SurfacePoint& x, F&& f) noexcept {
    structure_.visit(x, config_.a, s.counters, f);
  }

  template <class Visitors>
  void visit_batch(State& s, std::span<const SurfacePoint> points, Visitors visitors) noexcept {
    structure_.visit_batch(points, config_.a, s.counters, visitors);
  }

  bool insert(State& s, const Record& r) noexcept {
    return tickets_.insert(s.purse, [&] { return structure_.insert(s.workspace, r, s.counters); });
  }

  void prefault(State& s, std::uint32_t n) noexcept { structure_.prefault(s.workspace, n); }

  CacheConfig config_;
  SessionTable<State> sessions_;
  Tickets tickets_;
  Structure structure_;
};

}  // namespace icbench
