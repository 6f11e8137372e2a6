// A linear list of records: slow, and obviously right. The oracle every other structure is checked against.
//
// Query: every record is tested by the shared predicate, in order of insertion. Insert: one copy. One thread. Only the
// pool's counter counts as shared memory (one step to visit, two to insert): nobody else ever touches the records.
#pragma once

#include "caches/session.h"
#include "core/arena.h"

namespace icbench {

template <class Sync = PlainSync>
class LinearList {
  static_assert(!Sync::kConcurrent, "records are ordinary memory");

  static constexpr std::size_t kRecordBytes = sizeof(Record);
  using Pool = Arena<Sync, kRecordBytes>;

 public:
  using SharedSync = Sync;
  static constexpr std::string_view kPrefix = "";
  static constexpr std::string_view kStructure = "list";
  static constexpr CacheTraits kTraits{"brute_force",
                                       kStructure,
                                       "none",
                                       ProgressGuarantee::wait_free,
                                       ProgressGuarantee::wait_free,
                                       Consistency::linearizable,
                                       true,
                                       "linear search; the oracle"};

  class Workspace {
    friend LinearList;
    std::size_t records_ = 0;
  };

  // Step bounds (caches/session.h).
  static constexpr std::string_view kInsertBound = "2", kVisitBound = "1";
  static constexpr std::uint32_t insert_steps(const Record&) noexcept { return Pool::kTakeSteps; }
  static constexpr std::uint32_t kVisitSteps = 1, kMostLists = 0;
  static constexpr std::uint64_t list_steps(std::uint32_t) noexcept { return 0; }

  explicit LinearList(const CacheConfig& config) : pool_(config.capacity) {}

  template <class Counters>
  bool insert(Workspace& workspace, const Record& r, Counters&) noexcept {
    const UnitIndex i = pool_.take(1);
    if (i == 0) return false;
    record(i) = r;
    ++workspace.records_;
    return true;
  }

  template <class Counters, class F>
  void visit(const SurfacePoint& x, float a, Counters& counters, F&& f) const noexcept {
    const UnitIndex end = pool_.end();
    counters.template add<&Counts::records_read>(end - 1);
    for (UnitIndex i = 1; i < end; ++i) {
      const float weight = split_sphere_weight(x, record(i), a);
      if (weight > 0.0f) {
        counters.template add<&Counts::records_valid>(1);
        f(static_cast<const Record&>(record(i)), weight);
      }
    }
  }

  template <class F>
  void update(F&& f) {
    const UnitIndex end = pool_.end();
    std::vector<UpdateResult> verdicts(end, UpdateResult::keep);
    FirstException exception;
    exception.guard([&] {
      parallel_chunks(end - 1, kUpdateGrain, [&](std::size_t first, std::size_t last) {
        for (std::size_t i = first + 1; i <= last; ++i) verdicts[i] = f(record(static_cast<UnitIndex>(i)));
      });
    });
    UnitIndex kept = 1;
    for (UnitIndex i = 1; i < end; ++i) {
      if (verdicts[i] == UpdateResult::keep) record(kept++) = record(i);
    }
    pool_.shrink(kept);
    exception.rethrow();
  }

  template <class F>
  void for_each(F&& f) const {
    for (UnitIndex i = 1; i < pool_.end(); ++i) f(static_cast<const Record&>(record(i)));
  }

  void clear() { pool_.reset(); }
  std::uint64_t room(std::uint64_t /*live*/) const noexcept { return pool_.left(); }
  void prefault(Workspace&, std::uint32_t n) noexcept { pool_.touch(0, n); }
  static std::size_t bytes(const Workspace& workspace) noexcept { return workspace.records_ * kRecordBytes; }

 private:
  static constexpr std::size_t kUpdateGrain = 1024;

  Record& record(UnitIndex i) const noexcept { return *std::launder(static_cast<Record*>(pool_.at(i))); }

  Pool pool_;
};

}  // namespace icbench
