// The records of a packed octree (caches/packed_octree.h): each once, beside its mark, in a table; and the places that
// dropped ones left, which later inserts take first.
//
// Publication is by the mark: P1, P4 and P5 of caches/visibility.h.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <mutex>
#include <new>
#include <utility>
#include <vector>

#include "caches/visibility.h"
#include "core/arena.h"
#include "core/at_end.h"
#include "core/cache.h"
#include "core/parallel.h"

namespace icbench {

template <class Sync, class SharedSync, class Visibility>
class PackedRecords {
 public:
  using Marks = typename Visibility::template In<Sync>;
  using Moment = typename Marks::Moment;

  struct alignas(16) Stored {
    Record record;
    typename Marks::Mark mark;
  };
  static_assert(sizeof(Stored) <= 64, "a record is two cache lines at most");

 private:
  using Table = Arena<SharedSync, sizeof(Stored)>;
  static constexpr std::uint32_t kFreedBatch = 16, kPiece = 64;
  static constexpr std::size_t kUpdateGrain = 1024;
  // What a session may hold without a record in it: the rest of two pieces, and spares.
  static constexpr std::uint64_t kIdlePlaces = 2 * kPiece + kFreedBatch + 1;

  // A place is where a record lies in steps of so many bytes, which processors multiply by as they load.
  static constexpr std::size_t kPlaceBytes = 8;
  static constexpr std::uint64_t kUnitPlaces = sizeof(Stored) / kPlaceBytes;
  static_assert(sizeof(Stored) % kPlaceBytes == 0 &&
                    (2 * kMaxCapacity + 2 * kMaxSessions * kIdlePlaces + 1) * kUnitPlaces <= UINT32_MAX,
                "every record has a place");
  static constexpr UnitIndex place_of(UnitIndex unit) noexcept {
    return unit * static_cast<UnitIndex>(kUnitPlaces);
  }

 public:
  /// Most steps of taking a place.
  static constexpr std::uint32_t kTakeSteps = 2 + ArenaCursor<Table>::kAllocateSteps;

  /// A session's own allocation state.
  class Workspace {
    friend PackedRecords;
    ArenaCursor<Table> table_;
    std::array<UnitIndex, kFreedBatch> freed_{};  // places that dropped records left, this session's
    std::uint32_t freed_left_ = 0;
    UnitIndex spare_ = 0;  // of an insert that failed
  };

  PackedRecords(std::uint64_t capacity, std::uint64_t sessions, LargePages large_pages)
      : sessions_(sessions), table_(capacity + 2 * sessions * kIdlePlaces, capacity, large_pages, capacity) {
    at(kNobodys).record = {.p = {}, .n = {0.0f, 0.0f, 1.0f}, .R = 1.0f, .E = {}, .id = 0};
  }

  /// The place of a record that can be reckoned with and is never shown, for where there has to be one.
  static constexpr UnitIndex kNobodys = 0;

  Stored& at(UnitIndex place) const noexcept {
    auto* const base = static_cast<std::byte*>(table_.at(0));
    return *std::launder(reinterpret_cast<Stored*>(base + std::size_t{place} * kPlaceBytes));
  }
  static bool is_empty(const Stored& s) noexcept {
    return s.mark.word.load(std::memory_order_relaxed) == 0;  // relaxed: quiescent
  }

  /// A place for one more record; 0 if the table is full.
  UnitIndex take(Workspace& w) noexcept {
    if (w.spare_ != 0) return std::exchange(w.spare_, 0);
    // Relaxed, as in Arena::take.
    if (w.freed_left_ == 0 && next_freed_.load(std::memory_order_relaxed) < freed_.size()) {
      const std::uint64_t first = next_freed_.fetch_add(kFreedBatch, std::memory_order_relaxed);
      const std::uint64_t end = std::min<std::uint64_t>(first + kFreedBatch, freed_.size());
      for (std::uint64_t i = first; i < end; ++i) w.freed_[w.freed_left_++] = freed_[i];
    }
    if (w.freed_left_ != 0) return w.freed_[--w.freed_left_];
    return place_of(w.table_.allocate(table_, 1, kPiece));
  }
  /// The place goes to the session's next insert.
  static void give_back(Workspace& w, UnitIndex place) noexcept { w.spare_ = place; }

  /// Writes a record to its place, where nobody sees it.
  Stored& write(UnitIndex place, const Record& r) noexcept {
    Stored& stored = at(place);
    Sync::writes(&stored.record, sizeof r);
    stored.record = r;
    return stored;
  }
  /// Shows it to everybody.
  void publish(Stored& stored) noexcept { marks_.publish(stored.mark); }

  Moment moment() const noexcept { return marks_.moment(); }
  bool shows(Stored& stored, Moment moment) noexcept { return marks_.shows(stored.mark, moment); }
  // The same in steps (caches/visibility.h).
  typename Marks::Word look(const Stored& stored) const noexcept { return marks_.look(stored.mark); }
  typename Marks::Word settled(Stored& stored, typename Marks::Word word) noexcept {
    return marks_.settled(stored.mark, word);
  }

  /// f(Record&) -> UpdateResult for every record, in parallel over the table, then, if any was dropped, once forget(),
  /// also where f throws. Quiescent.
  template <class F, class Forget>
  void update(F&& f, Forget&& forget) {
    std::mutex mutex;
    const std::size_t freed_before = freed_.size();
    const AtEnd settle{[&] {
      if (freed_.size() == freed_before) return;
      settle_freed(freed_before);
      forget();
    }};
    parallel_chunks(table_.end() - 1, kUpdateGrain, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first + 1; i <= last; ++i) {
        const UnitIndex place = place_of(static_cast<UnitIndex>(i));
        Stored& s = at(place);
        if (is_empty(s) || f(s.record) == UpdateResult::keep) continue;
        {
          // First, for if there is no memory for it the record stays.
          const std::scoped_lock lock(mutex);
          freed_.push_back(place);
        }
        s.mark.word.store(0, std::memory_order_relaxed);  // relaxed: quiescent, as all here
      }
    });
  }

  /// f(const Record&) for every record. Quiescent.
  template <class F>
  void for_each(F&& f) const {
    for (UnitIndex i = 1; i < table_.end(); ++i) {
      const Stored& s = at(place_of(i));
      if (!is_empty(s)) f(s.record);
    }
  }

  /// Quiescent; workspaces must be made anew.
  void clear() {
    table_.reset();
    marks_.clear();
    freed_.clear();
    next_freed_.store(0, std::memory_order_relaxed);  // relaxed: quiescent
  }

  /// Places that are left for certain, whichever sessions take them. Quiescent.
  std::uint64_t room() const noexcept {
    const std::uint64_t freed = freed_.size();
    const std::uint64_t left =
        table_.left() + freed - std::min(next_freed_.load(std::memory_order_relaxed), freed);
    const std::uint64_t idle = sessions_ * kIdlePlaces;
    return left > idle ? left - idle : 0;
  }

  /// Takes and touches memory for about n records of one session, ahead.
  void prefault(Workspace& workspace, std::uint32_t n) noexcept { workspace.table_.prefault(table_, n); }
  /// Touches memory for about n records behind `offset` others. Quiescent.
  void touch(std::uint32_t offset, std::uint32_t n) noexcept { table_.touch(offset, n); }

  /// Bytes that `workspace` has allocated.
  static std::size_t bytes(const Workspace& workspace) noexcept {
    return workspace.table_.units_used() * sizeof(Stored);
  }

 private:
  /// Forgets those of the first `before` freed places that sessions took.
  void settle_freed(std::size_t before) noexcept {
    const auto taken = static_cast<std::ptrdiff_t>(next_freed_.load(std::memory_order_relaxed));  // quiescent
    freed_.erase(freed_.begin(), freed_.begin() + std::min(taken, static_cast<std::ptrdiff_t>(before)));
    next_freed_.store(0, std::memory_order_relaxed);
  }

  std::uint64_t sessions_;
  Table table_;
  [[no_unique_address]] Marks marks_;
  // Places that dropped records left. Changed at rest only; sessions take batches of it, as of an arena.
  std::vector<UnitIndex> freed_;
  alignas(kNoSharing) typename SharedSync::template Atomic<std::uint64_t> next_freed_{0};
};

}  // namespace icbench
