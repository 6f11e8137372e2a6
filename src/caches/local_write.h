// Thread-local writes, merged at the end of each frame (Dubla 2012, 7.2.2: LW).
//
// Every session writes a structure of its own and reads that and the shared one, which nobody writes during a
// frame; so no operation is synchronised at all. The price is repeated work: what another thread computed is
// not seen before end_frame. Local copies are merged in parallel, one task a session, into the shared
// structure, which for that is the concurrent instantiation.
//
// Consistency: frame. Progress: visit as the structures' own; insert adds one load and one fetch_add for its
// ticket, which reserves the room in the shared structure: what was accepted is never lost in the merge. In a session's
// own structure steps are plain reads and writes.
#pragma once

#include <cstdlib>
#include <memory>

#include "caches/session.h"

namespace icbench {

template <class SharedStructure, class LocalStructure, class Counters = NoCounters>
class LocalWrite {
  using Tickets = TicketOffice<typename SharedStructure::SharedSync>;

  struct State {
    std::unique_ptr<LocalStructure> local;  // made by open_session
    typename LocalStructure::Workspace local_workspace;
    typename SharedStructure::Workspace merge_workspace;
    std::size_t most_local_bytes = 0;  // emptied memory stays with the process
    typename Tickets::Purse purse;
    [[no_unique_address]] Counters counters;
  };
  static constexpr std::string_view kMechanism = "local_write", kTwice = ", shared and local";
  using Name = JoinedName<SharedStructure::kPrefix, kMechanism>;

 public:
  static constexpr CacheTraits kTraits{Name::value,
                                       SharedStructure::kStructure,
                                       kMechanism,
                                       ProgressGuarantee::wait_free,
                                       ProgressGuarantee::wait_free,
                                       Consistency::frame,
                                       false,
                                       "Dubla 2012, 7.2.2 (LW)"};
  using Session = icbench::Session<LocalWrite, State>;

  explicit LocalWrite(const CacheConfig& config)
      : config_(checked(config)), sessions_(config, false), tickets_(config.capacity), shared_(config) {
    local_config_ = config;
    local_config_.max_sessions = 1;
    // A session's own records are a share of all, as a rule.
    if (config.large_pages == LargePages::when_large)
      local_config_.large_pages = large_pages_of(config.large_pages, config.capacity / config.max_sessions);
  }

  Session open_session(std::uint32_t thread) {
    State& s = sessions_[thread];
    if (s.local == nullptr) s.local = std::make_unique<LocalStructure>(local_config_);
    return Session(*this, s);
  }

  void begin_frame() noexcept {}

  /// Merges the local structures into the shared one and empties them.
  void end_frame() {
    parallel_chunks(sessions_.size(), 1, [this](std::size_t i, std::size_t) {
      State& s = sessions_[static_cast<std::uint32_t>(i)];
      if (s.local == nullptr) return;
      s.local->for_each([&](const Record& r) {
        // The ticket of every record reserved its room, so this cannot fail; a lost record would break a promise.
        if (!shared_.insert(s.merge_workspace, r, s.counters)) std::abort();
      });
      empty_local(s);
    });
  }

  void clear() {
    shared_.clear();
    sessions_.for_each([](State& s) {
      empty_local(s);
      s.merge_workspace = {};
      s.purse = {};
    });
    tickets_.restart(0);
  }

  template <class F>
  void update_records(F&& f) {
    const AtEnd restart{[this] {
      std::uint64_t live = count_of(shared_);
      sessions_.for_each([&live](State& s) {
        s.purse = {};
        if (s.local != nullptr) live += count_of(*s.local);
      });
      tickets_.restart(live);
    }};
    const auto checked = keeping_storable(f, config_.bounds);
    const auto fresh_workspace = [this]() -> auto& {
      sessions_.for_each([](State& s) { s.merge_workspace = {}; });
      return sessions_[0].merge_workspace;
    };
    update_and_then(shared_, checked, [&] { keep_room(shared_, config_.capacity, fresh_workspace); });
    sessions_.for_each([&](State& s) {
      if (s.local == nullptr) return;
      const auto fresh_local = [&s]() -> auto& { return s.local_workspace = {}; };
      update_and_then(*s.local, checked, [&] { keep_room(*s.local, local_config_.capacity, fresh_local); });
    });
  }

  template <class F>
  void for_each_record(F&& f) const {
    shared_.for_each(f);
    sessions_.for_each([&](const State& s) {
      if (s.local != nullptr) s.local->for_each(f);
    });
  }

  std::size_t memory_bytes() const {
    std::size_t bytes = sessions_.bytes() + fixed_bytes(shared_);
    sessions_.for_each([&](const State& s) {
      if (s.local != nullptr) bytes += fixed_bytes(*s.local);
      bytes += std::max(s.most_local_bytes, LocalStructure::bytes(s.local_workspace)) +
               SharedStructure::bytes(s.merge_workspace);
    });
    return bytes;
  }

  /// Queries under way at once in a batch, where the structure does that.
  static constexpr std::size_t kBatch = batch_of<SharedStructure>();
  static_assert(batch_of<LocalStructure>() == kBatch, "a batch goes to both structures");
  /// Step bounds (caches/session.h).
  std::uint32_t insert_steps(const Record& r) const noexcept {
    // A session's own structure is addressed as the shared one is.
    return shared_.insert_steps(r) + Tickets::kSteps;
  }
  static constexpr std::uint64_t query_steps(std::span<const std::uint32_t> extents) noexcept {
    return visit_steps<SharedStructure>(extents) + LocalStructure::kVisitSteps;
  }
  static constexpr std::uint32_t most_lists() noexcept {
    return SharedStructure::kMostLists + LocalStructure::kMostLists;
  }
  static constexpr std::string_view insert_bound() noexcept {
    return JoinedName<LocalStructure::kInsertBound, Tickets::kBound>::value;
  }
  static constexpr std::string_view query_bound() noexcept {
    return JoinedName<SharedStructure::kVisitBound, kTwice>::value;
  }

  Counts counters() const { return sessions_.counts(); }
  void reset_counters() { sessions_.reset_counters(); }
  const CacheConfig& config() const noexcept { return config_; }

 private:
  friend Session;

  template <class F>
  void visit(State& s, const SurfacePoint& x, F&& f) noexcept {
    shared_.visit(x, config_.a, s.counters, f);
    s.local->visit(x, config_.a, s.counters, f);
  }

  template <class Visitors>
  void visit_batch(State& s, std::span<const SurfacePoint> points, Visitors visitors) noexcept {
    shared_.visit_batch(points, config_.a, s.counters, visitors);
    s.local->visit_batch(points, config_.a, s.counters, visitors);
  }

  bool insert(State& s, const Record& r) noexcept {
    return tickets_.insert(s.purse, [&] { return s.local->insert(s.local_workspace, r, s.counters); });
  }

  void prefault(State& s, std::uint32_t n) noexcept {
    s.local->prefault(s.local_workspace, n);
    shared_.prefault(s.merge_workspace, n);
  }

  static void empty_local(State& s) {
    if (s.local != nullptr) s.local->clear();
    s.most_local_bytes = std::max(s.most_local_bytes, LocalStructure::bytes(s.local_workspace));
    s.local_workspace = {};
  }

  CacheConfig config_;
  CacheConfig local_config_;
  SessionTable<State> sessions_;
  Tickets tickets_;
  SharedStructure shared_;
};

}  // namespace icbench
