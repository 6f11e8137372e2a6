// A structure that nobody writes while it is read, and a log of what is new: as Open PGL treats its samples, whose
// field is read-only within a frame while samples go to concurrent vectors, and is updated from them between frames.
//
// Use: AppendLog<Packed<PlainSync>>, a rival. Insert appends to one tbb::concurrent_vector that all sessions share;
// end_frame puts what is in it into the structure. Open PGL's samples take no effect before that. Of a cache that would
// mean a record for every pixel of its first frame, so a session also finds those that it has inserted itself since: it
// tests them all, one after the other, by a distance first. That is the price of an unsorted log: a query slows down
// with every record that its own session has inserted in the frame, and not with anybody else's.
//
// The structure is the octree that grows, not its read-only form: end_frame adds what is new, on one thread, where that
// form would have to be built anew from all records. Queries take as long as the octree's own; on an image those to the
// read-only form are faster, by what packed_live_over_frozen says (bench/MEASURED.md).
//
// Consistency: frame (own inserts at once, everybody's after end_frame; before an update of records, too).
//
// Progress: a query is wait-free; it takes the steps that reading the structure takes (visit_steps), and reads memory
// that nobody writes, or only its own session. Insert is blocking: threads whose elements lie in the same new segment
// of the vector wait for the one that allocates it, and the allocator may lock. Memory that the system does not have
// ends the process, as with any container.
//
// Publication: none during a frame; the caller's synchronisation at quiescent points publishes what end_frame built.
#pragma once

#include <oneapi/tbb/concurrent_vector.h>

#include <cstdlib>

#include "caches/session.h"
#include "caches/tidy.h"

namespace icbench {

/// A session's own records since the last frame, for a linear search.
class OwnRecords {
 public:
  /// `record` must stay where it is; a_max: coarsest accuracy that will be asked for.
  void add(const Record& record, float a_max) {
    if (used_ % kBlock == 0 && used_ / kBlock == blocks_.size()) blocks_.emplace_back();
    Block& b = blocks_[used_ / kBlock];
    const std::size_t k = used_++ % kBlock;
    const float reach = a_max * record.R;
    for (int axis = 0; axis < 3; ++axis) b.p[axis][k] = record.p[axis];
    // What rounding adds, of numbers of usual size and of such that are not.
    b.reach2[k] = 1.0001f * reach * reach + 1e-37f;
    b.record[k] = &record;
  }

  template <class Counters, class F>
  void visit(const SurfacePoint& x, float a, Counters& counters, F&& f) const noexcept {
    counters.template add<&Counts::records_read>(used_);
    for (std::size_t begin = 0; begin < used_; begin += kBlock) {
      const Block& b = blocks_[begin / kBlock];
      std::array<bool, kBlock> is_near;
      bool is_any = false;
      for (std::size_t k = 0; k < kBlock; ++k) {
        const float dx = x.p.x - b.p[0][k], dy = x.p.y - b.p[1][k], dz = x.p.z - b.p[2][k];
        is_near[k] = dx * dx + dy * dy + dz * dz <= b.reach2[k];
        is_any |= is_near[k];
      }
      if (!is_any) continue;
      for (std::size_t k = 0; k < std::min(kBlock, used_ - begin); ++k) {
        if (!is_near[k]) continue;
        const float weight = split_sphere_weight(x, *b.record[k], a);
        if (weight > 0.0f) {
          counters.template add<&Counts::records_valid>(1);
          f(*b.record[k], weight);
        }
      }
    }
  }

  void reserve(std::size_t n) { blocks_.reserve(blocks_.size() + n / kBlock + 1); }
  /// Keeps the memory.
  void clear() noexcept { used_ = 0; }
  std::size_t bytes() const noexcept { return blocks_.capacity() * sizeof(Block); }

 private:
  static constexpr std::size_t kBlock = 16;
  struct Block {
    float p[3][kBlock];
    float reach2[kBlock];
    const Record* record[kBlock];
  };

  std::vector<Block> blocks_;
  std::size_t used_ = 0;
};

/// Sync: of the tickets, the one word of ours that inserts share.
template <class Structure, class Sync = StdSync, class Counters = NoCounters>
class AppendLog {
  static_assert(Structure::kTraits.single_thread, "nobody writes it while it is read");

  using Tickets = TicketOffice<Sync>;

  struct State {
    OwnRecords own;
    typename Tickets::Purse purse;
    [[no_unique_address]] Counters counters;
  };

 public:
  static constexpr CacheTraits kTraits{"append_log",
                                       Structure::kStructure,
                                       "append_log",
                                       ProgressGuarantee::blocking,
                                       ProgressGuarantee::wait_free,
                                       Consistency::frame,
                                       false,
                                       "as Open PGL updates its field",
                                       true};
  using Session = icbench::Session<AppendLog, State>;

  explicit AppendLog(const CacheConfig& config)
      : config_(checked(config)), sessions_(config, false), tickets_(config.capacity), structure_(config) {}

  Session open_session(std::uint32_t thread) { return Session(*this, sessions_[thread]); }
  void begin_frame() noexcept {}

  /// Puts the log into the structure. One thread: the structure is the plain one.
  void end_frame() {
    NoCounters uncounted;
    for (const Record& r : log_) {
      // The ticket of every record reserved its room, so this cannot fail; a lost record would break a promise.
      if (!structure_.insert(workspace_, r, uncounted)) std::abort();
    }
    empty_log();
  }

  void clear() {
    structure_.clear();
    workspace_ = {};
    empty_log();
    sessions_.for_each([](State& s) { s.purse = {}; });
    tickets_.restart(0);
  }

  template <class F>
  void update_records(F&& f) {
    end_frame();
    const AtEnd restart{[this] {
      sessions_.for_each([](State& s) { s.purse = {}; });
      tickets_.restart(count_of(structure_));
    }};
    const auto fresh_workspace = [this]() -> auto& { return workspace_ = {}; };
    update_and_then(structure_, keeping_storable(f, config_.bounds),
                    [&] { keep_room(structure_, config_.capacity, fresh_workspace); });
  }

  /// Lays the records out in the order of space (caches/tidy.h), those of the log among them.
  void tidy() {
    end_frame();
    const auto fresh_workspace = [this] {
      workspace_ = {};
      sessions_.for_each([](State& s) { s.purse = {}; });
    };
    tickets_.restart(lay_out_in_space(
        structure_, OctreeAddressing(config_.bounds), 1,
        fresh_workspace, [this](std::size_t) -> auto& { return workspace_; }));
  }

  template <class F>
  void for_each_record(F&& f) const {
    structure_.for_each(f);
    for (const Record& r : log_) f(r);
  }

  std::size_t memory_bytes() const {
    std::size_t bytes = sessions_.bytes() + fixed_bytes(structure_) + Structure::bytes(workspace_) +
                        log_.capacity() * sizeof(Record);
    sessions_.for_each([&](const State& s) { bytes += s.own.bytes(); });
    return bytes;
  }

  /// Queries under way at once in a batch, where the structure does that.
  static constexpr std::size_t kBatch = batch_of<Structure>();
  /// Step bounds of queries (caches/session.h).
  static constexpr std::uint64_t query_steps(std::span<const std::uint32_t> extents) noexcept {
    return visit_steps<Structure>(extents);
  }
  static constexpr std::uint32_t most_lists() noexcept { return Structure::kMostLists; }
  static constexpr std::string_view query_bound() noexcept { return Structure::kVisitBound; }

  Counts counters() const { return sessions_.counts(); }
  void reset_counters() { sessions_.reset_counters(); }
  const CacheConfig& config() const noexcept { return config_; }

 private:
  friend Session;

  template <class F>
  void visit(State& s, const SurfacePoint& x, F&& f) noexcept {
    structure_.visit(x, config_.a, s.counters, f);
    s.own.visit(x, config_.a, s.counters, f);
  }

  template <class Visitors>
  void visit_batch(State& s, std::span<const SurfacePoint> points, Visitors visitors) noexcept {
    structure_.visit_batch(points, config_.a, s.counters, visitors);
    for (std::size_t i = 0; i < points.size(); ++i)
      s.own.visit(points[i], config_.a, s.counters, visitors[i]);
  }

  bool insert(State& s, const Record& r) noexcept {
    return tickets_.insert(s.purse, [&] {
      s.own.add(*log_.push_back(r), config_.a_max);
      return true;
    });
  }

  // The log cannot be asked for memory from several threads at once. More than the capacity is never needed.
  void prefault(State& s, std::uint32_t n) noexcept { s.own.reserve(std::min(n, config_.capacity)); }

  void empty_log() {
    log_.clear();
    sessions_.for_each([](State& s) { s.own.clear(); });
  }

  CacheConfig config_;
  SessionTable<State> sessions_;
  Tickets tickets_;
  tbb::concurrent_vector<Record> log_;
  typename Structure::Workspace workspace_;
  Structure structure_;
};

}  // namespace icbench
