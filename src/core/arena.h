// Pool memory: address space reserved once, handed out by fetch_add, zero when handed out.
//
// An Arena reserves its whole capacity as address space; pages become memory when first touched, on the memory node of
// the thread that does. A Cursor is one session's view: it takes pieces of the arena by one fetch_add and allocates
// from its piece without sharing anything. A piece is a page or a few, and begins anywhere on one, so the node is the
// session's own only where it takes many pieces at a time (prefault); else neighbours share pages, on large ones some
// hundred pieces of all sessions.
//
// Progress: take is wait-free, one load and one fetch_add; allocate is two of these at most; take_ahead, and with it
// prefault, is lock-free. No lock, no malloc.
#pragma once

#include <sys/mman.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>

#include "core/large_pages.h"
#include "core/parallel.h"
#include "core/setup_error.h"
#include "core/sync.h"

namespace icbench {

/// Index of a unit in an arena; 0 is no unit.
using UnitIndex = std::uint32_t;

/// An arena of units of `kUnitBytes` bytes, at most 2^32 - 1 of them.
///
/// Beside those that are taken when they are needed it has some for who takes them ahead of that: what a session holds
/// so, and does not use, is missing to nobody.
template <class Sync, std::size_t kUnitBytes>
class Arena {
 public:
  /// Reserves address space for `units` units. Fails at set-up with one line if the system has none. `ahead`: units
  /// over these for take_ahead, as far as there are indices. `expected`: those that will be used, as a rule;
  /// `when_large` asks for as many large pages as these fill, since one that is used in part is resident as a whole.
  explicit Arena(std::uint64_t units, std::uint64_t ahead = 0, LargePages large_pages = LargePages::never,
                 std::uint64_t expected = 0)
      : units_(std::min<std::uint64_t>(units + ahead + 1, UINT32_MAX)),
        ahead_(units_ > units + 1 ? units_ - (units + 1) : 0),
        ahead_left_(ahead_) {
    // From where a large page begins, if there are to be any.
    const std::size_t alignment = large_pages == LargePages::never ? 1 : kLargePage;
    std::size_t reserved = bytes(units_) + alignment - 1;
    void* memory =
        ::mmap(nullptr, reserved, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (memory == MAP_FAILED)
      fail_setup("cannot reserve address space for the cache's pool; lower its capacity");
    reserved_ = memory;
    reserved_bytes_ = reserved;
    base_ = static_cast<std::byte*>(std::align(alignment, bytes(units_), memory, reserved));
#if defined(MADV_HUGEPAGE)
    const std::size_t filled = bytes(std::min(expected, units_)) / kLargePage * kLargePage;
    const std::size_t large = large_pages == LargePages::always       ? bytes(units_)
                              : large_pages == LargePages::when_large ? filled
                                                                      : 0;
    if (large != 0) ::madvise(base_, large, MADV_HUGEPAGE);  // advice: may be refused
#endif
  }
  ~Arena() { ::munmap(reserved_, reserved_bytes_); }
  Arena(const Arena&) = delete;
  Arena& operator=(const Arena&) = delete;

  /// Most steps of `take`.
  static constexpr std::uint32_t kTakeSteps = 2;

  /// First of `n` consecutive units, all bytes zero; 0 if the arena is used up.
  UnitIndex take(std::uint32_t n) noexcept { return take_if(n, true); }

  /// The same for a session's next piece, which may be refused while single allocations are not.
  UnitIndex take_piece(std::uint32_t n) noexcept { return take_if(n, Sync::may_take_pieces()); }

  /// The same before they are needed: 0 as well once as many have been taken so as the arena has for that. Lock-free.
  UnitIndex take_ahead(std::uint32_t n) noexcept {
    // Relaxed: a budget, by which nothing is published.
    std::uint64_t left = ahead_left_.load(std::memory_order_relaxed);
    do {
      if (left < n) return 0;
    } while (!ahead_left_.compare_exchange_strong(left, left - n, std::memory_order_relaxed,
                                                  std::memory_order_relaxed));
    return take(n);
  }

  void* at(UnitIndex i) const noexcept { return base_ + bytes(i); }

  /// Touches the pages of `n` units from `first` on, which the caller has taken and nobody has used, by setting them to
  /// zero.
  void touch_taken(UnitIndex first, std::uint32_t n) noexcept {
    std::memset(at(first), 0, bytes(n));
    Sync::zeroes(at(first), bytes(n));
  }

  /// One past the last unit ever taken since the last reset. Quiescent.
  UnitIndex end() const noexcept {
    return static_cast<UnitIndex>(std::min<std::uint64_t>(next_.load(std::memory_order_relaxed), units_));
  }

  /// Units not yet taken, but for those that may still be taken ahead. Quiescent.
  std::uint64_t left() const noexcept {
    const std::uint64_t kept = end() + ahead_left_.load(std::memory_order_relaxed);
    return units_ > kept ? units_ - kept : 0;
  }

  /// Gives back the units from `end_unit` on. Quiescent; the caller has no use for what is in them.
  void shrink(UnitIndex end_unit) noexcept {
    std::memset(at(end_unit), 0, bytes(end() - end_unit));
    next_.store(end_unit, std::memory_order_relaxed);  // relaxed: quiescent
  }

  /// Touches the pages of `n` units that start `offset` behind the next one, without taking them. Quiescent.
  void touch(std::uint64_t offset, std::uint64_t n) noexcept {
    const std::uint64_t first = std::min(end() + offset, units_);
    std::memset(base_ + bytes(first), 0, bytes(std::min(n, units_ - first)));
  }

  /// Has the system put memory behind the first `n` units, if it can, on the calling thread's node; whatever is in them
  /// stays. At any time.
  void populate([[maybe_unused]] std::uint64_t n) noexcept {
#if defined(MADV_POPULATE_WRITE)
    ::madvise(base_, bytes(std::min(n + 1, units_)), MADV_POPULATE_WRITE);  // advice: may be refused
#endif
  }

  /// Zeroes everything that was taken and starts afresh. Quiescent, parallel.
  void reset() noexcept {
    constexpr std::size_t kGrain = std::size_t{1} << 20;
    // From unit 1 on: where nothing was taken no page is touched.
    parallel_chunks(bytes(end() - 1), kGrain, [this](std::size_t begin, std::size_t end_byte) {
      std::memset(base_ + bytes(1) + begin, 0, end_byte - begin);
    });
    // Relaxed: the caller's synchronisation orders quiescent points.
    next_.store(1, std::memory_order_relaxed);
    ahead_left_.store(ahead_, std::memory_order_relaxed);
  }

 private:
  UnitIndex take_if(std::uint32_t n, bool may) noexcept {
    // The load keeps the counter from running away when many threads knock on an empty arena. Relaxed, like
    // the fetch_add: uniqueness of the ranges is all that is needed; what is built in them is published by
    // other words.
    if (next_.load(std::memory_order_relaxed) + n > units_ || !may || !Sync::may_allocate()) return 0;
    const std::uint64_t first = next_.fetch_add(n, std::memory_order_relaxed);
    return first + n > units_ ? 0 : static_cast<UnitIndex>(first);
  }

  static constexpr std::size_t bytes(std::uint64_t units) noexcept { return units * kUnitBytes; }

  void* reserved_;  // in which base_ is
  std::size_t reserved_bytes_;
  std::byte* base_;
  std::uint64_t units_, ahead_;  // the former with 0 and the latter
  typename Sync::template Atomic<std::uint64_t> ahead_left_;
  alignas(kNoSharing) typename Sync::template Atomic<std::uint64_t> next_{1};
};

/// One session's share of an arena.
///
/// Invariant: begin_ <= end_, and the units in [begin_, end_) are zero and nobody else's.
template <class Arena>
class ArenaCursor {
 public:
  /// Most steps of `allocate`.
  static constexpr std::uint32_t kAllocateSteps = 2 * Arena::kTakeSteps;

  /// `n` zeroed units, or 0. Takes a piece of `piece` units when its own is too short; larger requests go
  /// straight to the arena, so that the rest of the piece is not lost.
  UnitIndex allocate(Arena& arena, std::uint32_t n, std::uint32_t piece) noexcept {
    if (end_ - begin_ < n) {
      if (n >= piece) return count(arena.take(n), n);
      const UnitIndex first = arena.take_piece(piece);
      if (first == 0) return count(arena.take(n), n);  // the arena's last units, too few for a whole piece
      begin_ = first;
      end_ = first + piece;
    }
    const UnitIndex result = begin_;
    begin_ += n;
    return count(result, n);
  }

  /// Takes a piece of `units` ahead, if it may, and touches its pages, unless that much is at hand already.
  void prefault(Arena& arena, std::uint32_t units) noexcept {
    if (end_ - begin_ >= units) return;
    const UnitIndex first = arena.take_ahead(units);
    if (first == 0) return;
    arena.touch_taken(first, units);
    begin_ = first;
    end_ = first + units;
  }

  std::uint64_t units_used() const noexcept { return used_; }

 private:
  UnitIndex count(UnitIndex first, std::uint32_t n) noexcept {
    if (first != 0) used_ += n;
    return first;
  }

  UnitIndex begin_ = 0;
  UnitIndex end_ = 0;
  std::uint64_t used_ = 0;
};

}  // namespace icbench
