// An append-only list of items, records as a rule, that any number of threads extend and read at once: what a node of a
// tree keeps.
//
// A slot's place is fixed by one fetch_add on the list's count; nothing is retried. Slots lie in segments that are
// installed when first needed: six chunks of 4, 8, ... 128 slots, then directories of height 1, 2 and 3 over blocks of
// 256 slots. So a list of one record is small, a list of 10^8 is reached in twelve steps, and who loses the race to
// install a segment sets aside 13 KiB at most, whatever the length of the list.
//
// Publication pairs
//
//   P1  publish -> shows, by the slot's mark (caches/visibility.h); publishes the item
//
//   P3  install: link CAS release          -> follow, visit: link load acquire; publishes the segment, and with it the
//                                             zeroing of its memory by a session that took it ahead
//
// Progress: append is wait-free; at most 12 links are followed, each by one load and, if it is empty, one allocation
// (4 steps, core/arena.h) and one CAS; with the count's load and fetch_add 12 * 6 + 2 = 74 steps, and those that
// publish (kAppendSteps). visit is wait-free: the count is read once, and is its extent; one mark a slot below that,
// one load a segment (visit_steps).
#pragma once

#include <array>
#include <bit>
#include <new>
#include <utility>

#include "caches/visibility.h"
#include "core/arena.h"
#include "core/counters.h"
#include "core/types.h"

namespace icbench {

/// Puts `fresh` into an empty `word` unless another thread was faster; returns the winner. One CAS. The loser's unit
/// becomes `spare`. A CAS that fails acquires what the winner published.
template <class Sync, class Counters>
UnitIndex install(typename Sync::template Atomic<UnitIndex>& word, UnitIndex fresh, UnitIndex& spare,
                  Counters& counters) noexcept {
  UnitIndex winner = 0;
  if constexpr (Sync::kConcurrent) counters.template add<&Counts::cas_attempts>(1);
  if (word.compare_exchange_strong(winner, fresh, std::memory_order_release /* P2, P3 */,
                                   std::memory_order_acquire /* P2, P3 */)) {
    return fresh;
  }
  counters.template add<&Counts::cas_failures>(1);
  counters.template add<&Counts::nodes_discarded>(1);
  spare = fresh;
  return winner;
}

/// The memory of all lists of one structure. `PoolSync` is the policy of the pool, `Sync` that of the lists,
/// `Visibility` (caches/visibility.h) says when a query sees an item.
template <class Sync, class PoolSync, class Visibility, class Item = Record>
class SlotPool {
  template <class T>
  using Atomic = typename Sync::template Atomic<T>;

  static constexpr std::size_t kUnitBytes = 16;
  static constexpr int kChunks = 6;              // chunk k has 4 * 2^k slots
  static constexpr int kHeights = 3;             // directories after the chunks
  static constexpr int kBlock = kChunks;         // kind of segment: a block is the chunk that would come next
  static constexpr int kDirectory = kBlock + 1;  // kind of segment
  static constexpr int kKinds = kDirectory + 1;
  static constexpr int kMostLinks = kChunks + kHeights + kHeights;  // down the last directory
  static constexpr std::uint32_t kFirst = 4;
  static constexpr std::uint32_t kInChunks = kFirst * ((1u << kChunks) - 1);
  static constexpr unsigned kFanBits = 8;  // a directory has 2^8 entries, a block 2^8 slots
  static constexpr std::uint32_t kMaxCount = 1u << 31;
  static_assert(kFirst << kChunks == 1u << kFanBits, "a block is the chunk that follows the last one");

  using Marks = typename Visibility::template In<Sync>;
  using Mark = typename Marks::Mark;

  // Marks lie together behind the header, so that a short list's share its cache line.
  struct Segment {
    Atomic<UnitIndex> next;  // of chunks and top directories: the following segment
    std::uint32_t padding[3];
    Mark* marks() noexcept { return reinterpret_cast<Mark*>(this + 1); }
    Item* items(int kind) noexcept { return reinterpret_cast<Item*>(marks() + slots_of(kind)); }
    Atomic<UnitIndex>* entries() noexcept { return reinterpret_cast<Atomic<UnitIndex>*>(this + 1); }
  };
  static_assert(sizeof(Segment) == kUnitBytes, "a segment's header is one pool unit");
  static_assert(alignof(Mark) <= kUnitBytes && sizeof(Mark) % alignof(Item) == 0,
                "marks and items lie side by side");

  struct Slot {
    Mark* mark;
    Item* item;
    bool is_empty() const noexcept { return mark->word.load(std::memory_order_relaxed) == 0; }  // quiescent
  };

  static constexpr std::uint32_t slots_of(int kind) noexcept { return kFirst << kind; }
  static constexpr std::uint32_t units_of(int kind) noexcept {
    const std::size_t bytes = kind == kDirectory ? (std::size_t{1} << kFanBits) * sizeof(UnitIndex)
                                                 : slots_of(kind) * (sizeof(Mark) + sizeof(Item));
    return static_cast<std::uint32_t>(1 + (bytes + kUnitBytes - 1) / kUnitBytes);
  }
  static constexpr std::uint32_t kPiece = 1024;  // 16 KiB
  static constexpr std::uint32_t kSpareUnits = [] {
    std::uint32_t units = 0;
    for (int kind = 0; kind < kKinds; ++kind) units += units_of(kind);
    return units;
  }();

  using Pool = Arena<PoolSync, kUnitBytes>;
  static constexpr std::uint32_t kFollowSteps = 1 + ArenaCursor<Pool>::kAllocateSteps + 1;

 public:
  /// Most steps of `append`.
  static constexpr std::uint32_t kAppendSteps = 2 + kMostLinks * kFollowSteps + Marks::kPublishSteps;

  /// Steps of `moment`, and the most of `shows` for one slot.
  static constexpr std::uint32_t kMomentSteps = Marks::kMomentSteps, kShowsSteps = Marks::kShowsSteps;

  /// Most steps of `visit` to a list that had `extent` slots when its count was read: the count, the links, and the
  /// slots.
  static constexpr std::uint64_t visit_steps(std::uint32_t extent) noexcept {
    return 1 + links_of(extent) + std::uint64_t{extent} * kShowsSteps;
  }

  /// Units that a record takes at worst, on average: a first chunk of its own, and one for the ends of pieces, which are
  /// too short for a chunk. Longer lists take less for each, though a segment that does not fit may leave as much of a
  /// piece behind as it takes itself.
  static constexpr std::uint32_t kWorstUnits = units_of(0) + 1;

  /// Units that an item takes at least.
  static constexpr std::uint32_t kLeastUnits = (sizeof(Mark) + sizeof(Item)) / kUnitBytes;

  /// Units that a session may hold without a record in them: the rest of its last two pieces, and a spare of each kind.
  static constexpr std::uint32_t kIdleUnits = 2 * kPiece + kSpareUnits;

  /// A list; all-zero bytes are an empty one.
  ///
  /// Invariants: slots 0 .. count - 1 have been handed out, and those whose segment could not be had stay empty; a
  /// slot's mark never becomes empty again between quiescent points; a link goes from 0 to an index once between
  /// resets.
  struct List {
    Atomic<std::uint32_t> count;
    Atomic<UnitIndex> head;
  };

  /// A session's own allocation state.
  class Workspace {
    friend SlotPool;
    ArenaCursor<Pool> cursor_;
    std::array<UnitIndex, kKinds> spares_{};  // set aside by lost races; zero, as allocated
  };

  /// `ahead`: items that memory may be taken for beforehand, and that are expected, as far as large pages go.
  explicit SlotPool(std::uint64_t units, std::uint64_t ahead = 0, LargePages large_pages = LargePages::never)
      : pool_(units, ahead * kWorstUnits, large_pages, ahead * kLeastUnits) {}

  /// A slot that has been handed out to one thread and is not visible yet; none is false.
  class Place {
    friend SlotPool;
    Mark* mark_;
    Item* item_;

   public:
    explicit operator bool() const noexcept { return mark_ != nullptr; }
  };

  /// Stores an item; false if the pool is used up, and then no visit ever sees anything of it.
  template <class Counters>
  bool append(Workspace& workspace, List& list, const Item& item, Counters& counters) noexcept {
    const Place place = reserve(workspace, list, counters);
    if (!place) return false;
    publish(place, item);
    return true;
  }

  /// The first half of `append`, all of its steps but the last kPublishSteps.
  template <class Counters>
  Place reserve(Workspace& workspace, List& list, Counters& counters) noexcept {
    const Place none{};
    // Relaxed: the count only fixes places and extents; what lies behind it is published by P1 and P3. The load keeps
    // the count from wrapping round.
    if (list.count.load(std::memory_order_relaxed) >= kMaxCount) return none;
    const Address at = address_of(list.count.fetch_add(1, std::memory_order_relaxed));
    Atomic<UnitIndex>* link = &list.head;
    Segment* s = nullptr;
    for (int k = 0; k <= at.segment; ++k) {
      s = follow(workspace, *link, kind_of(k), counters);
      if (s == nullptr) return none;
      link = &s->next;
    }
    for (int level = at.segment - kChunks + 1; level > 0; --level) {
      s = follow(workspace, s->entries()[digit(at.rest, level)], level == 1 ? kBlock : kDirectory, counters);
      if (s == nullptr) return none;
    }
    const Slot slot = at.slot_in(*s);
    Place place;
    place.mark_ = slot.mark;
    place.item_ = slot.item;
    return place;
  }

  /// The second half, which cannot fail.
  void publish(const Place& place, const Item& item) noexcept {
    Sync::writes(place.item_, sizeof item);
    *place.item_ = item;
    marks_.publish(*place.mark_);
  }

  /// How far a list reaches.
  std::uint32_t extent(const List& list) const noexcept {
    // Relaxed, as in append; read once by a visit.
    const std::uint32_t n = list.count.load(std::memory_order_relaxed);
    Sync::extent(n);
    return n;
  }

  /// Whether a list had an item, or was to have one.
  bool was_used(const List& list) const noexcept {
    // Relaxed: an append that a visit must see was counted before the visit began, and it need not see more.
    return list.count.load(std::memory_order_relaxed) != 0;
  }

  /// What a query has to read before it visits its first list.
  typename Marks::Moment moment() const noexcept { return marks_.moment(); }

  /// Calls f(const Item&) for every item of a list that is visible at `moment`, as far as the list reached when the
  /// visit began.
  template <class F>
  void visit(const List& list, typename Marks::Moment moment, F&& f) noexcept {
    for_each_slot(list, extent(list), [&](const Slot& slot) {
      if (!marks_.shows(*slot.mark, moment)) return;
      Sync::reads(slot.item, sizeof(Item));
      f(static_cast<const Item&>(*slot.item));
    });
  }

  /// Calls f(const Item&) for every item of a list. Quiescent.
  template <class F>
  void for_each(const List& list, F&& f) const {
    for_each_slot(list, extent(list), [&](const Slot& slot) {
      if (!slot.is_empty()) f(static_cast<const Item&>(*slot.item));
    });
  }
  /// f(Item&) -> UpdateResult for every item of a list; what is kept moves up into the places of what is dropped.
  /// Quiescent.
  template <class F>
  void update(List& list, F&& f) {
    // All orders relaxed: quiescent; the caller's synchronisation publishes.
    const std::uint32_t end = list.count.load(std::memory_order_relaxed);
    std::uint32_t kept = 0;
    for (std::uint32_t i = 0; i < end; ++i) {
      const Slot s = slot_at(list, i);
      if (s.mark == nullptr || s.is_empty()) continue;
      const bool keep = f(*s.item) == UpdateResult::keep;
      const auto mark = s.mark->word.load(std::memory_order_relaxed);
      s.mark->word.store(0, std::memory_order_relaxed);
      if (!keep) continue;
      Slot to = slot_at(list, kept);
      // A segment that could not be had is the last one, unless its successor was got by somebody else: stay put then.
      while (to.mark == nullptr) to = slot_at(list, ++kept);
      if (to.item != s.item) *to.item = *s.item;
      to.mark->word.store(mark, std::memory_order_relaxed);
      ++kept;
    }
    list.count.store(kept, std::memory_order_relaxed);
  }

  /// Takes and touches memory for n records, ahead.
  void prefault(Workspace& workspace, std::uint32_t n) noexcept {
    workspace.cursor_.prefault(pool_, std::min<std::uint32_t>(n, 1u << 26) * kWorstUnits);
  }
  /// Touches memory for n records behind `offset` others, without taking it. Quiescent.
  void touch(std::uint32_t offset, std::uint32_t n) noexcept {
    pool_.touch(std::uint64_t{offset} * kWorstUnits, std::uint64_t{n} * kWorstUnits);
  }

  void reset() {
    pool_.reset();
    marks_.clear();
  }
  std::uint64_t units_left() const noexcept { return pool_.left(); }
  static std::size_t bytes(const Workspace& workspace) noexcept {
    return workspace.cursor_.units_used() * kUnitBytes;
  }

 private:
  /// Where slot i of a list lies: in chunk `segment`, or under top directory `segment` - kChunks at `rest`.
  struct Address {
    int segment;
    std::uint32_t rest;
    /// The slot in `s`, the chunk or block that holds it.
    Slot slot_in(Segment& s) const noexcept {
      const std::uint32_t i = segment < kChunks ? rest : rest & ((1u << kFanBits) - 1);
      return {s.marks() + i, s.items(std::min(segment, kBlock)) + i};
    }
  };

  static Address address_of(std::uint32_t i) noexcept {
    if (i < kInChunks) {
      const int k = static_cast<int>(std::bit_width(i / kFirst + 1)) - 1;  // unsigned in older libraries
      return {k, i - kFirst * ((1u << k) - 1)};
    }
    i -= kInChunks;
    int height = 1;
    // Heights 1 and 2 hold 2^16 and 2^24 slots; height 3 holds all that are left.
    for (; height < kHeights && i >= 1u << (kFanBits * static_cast<unsigned>(height + 1)); ++height) {
      i -= 1u << (kFanBits * static_cast<unsigned>(height + 1));
    }
    return {kChunks + height - 1, i};
  }

  static std::uint32_t digit(std::uint32_t rest, int level) noexcept {
    return (rest >> (kFanBits * static_cast<unsigned>(level))) & ((1u << kFanBits) - 1);
  }
  static int kind_of(int segment_number) noexcept {
    return segment_number < kChunks ? segment_number : kDirectory;
  }

  Segment& segment(UnitIndex i) const noexcept { return *std::launder(static_cast<Segment*>(pool_.at(i))); }

  /// Loads of links on a visit of the first `left` slots.
  static constexpr std::uint64_t links_of(std::uint32_t left) noexcept {
    std::uint64_t links = 0;
    for (int k = 0; left > 0 && k < kChunks; ++k, ++links) left -= std::min(left, slots_of(k));
    for (int height = 1; left > 0 && height <= kHeights; ++height) {
      const std::uint64_t whole = std::uint64_t{1} << (kFanBits * static_cast<unsigned>(height + 1));
      const auto here = static_cast<std::uint32_t>(std::min<std::uint64_t>(left, whole));
      ++links;
      for (int level = 1; level <= height; ++level) {
        links += ((here - 1) >> (kFanBits * static_cast<unsigned>(level))) + 1;
      }
      left -= here;
    }
    return links;
  }

  /// The segment that `link` points at, installed if missing; nullptr if the pool is used up.
  template <class Counters>
  Segment* follow(Workspace& workspace, Atomic<UnitIndex>& link, int kind, Counters& counters) noexcept {
    if (const UnitIndex next = link.load(std::memory_order_acquire /* P3 */)) return &segment(next);
    UnitIndex& spare = workspace.spares_[static_cast<std::size_t>(kind)];
    UnitIndex fresh = std::exchange(spare, 0);
    if (fresh == 0) {
      fresh = workspace.cursor_.allocate(pool_, units_of(kind), kPiece);
      if (fresh == 0) return nullptr;
      counters.template add<&Counts::nodes_allocated>(1);
    }
    return &segment(install<Sync>(link, fresh, spare, counters));
  }

  /// f(Slot) for the first `left` slots of a list, as far as their segments are there.
  template <class F>
  void for_each_slot(const List& list, std::uint32_t left, F&& f) const {
    const Atomic<UnitIndex>* link = &list.head;
    for (int k = 0; left > 0 && k < kChunks + kHeights; ++k) {
      const UnitIndex i = link->load(std::memory_order_acquire /* P3 */);
      if (i == 0) return;
      Segment& s = segment(i);
      visit_segment(s, k < kChunks ? 0 : k - kChunks + 1, k, left, f);
      link = &s.next;
    }
  }

  template <class F>
  void visit_segment(Segment& s, int height, int chunk, std::uint32_t& left, F& f) const {
    if (height == 0) {
      const std::uint32_t here = std::min(left, slots_of(chunk));
      Mark* marks = s.marks();
      Item* items = s.items(chunk);
      for (std::uint32_t i = 0; i < here; ++i) f(Slot{marks + i, items + i});
      left -= here;
      return;
    }
    for (std::uint32_t e = 0; e < 1u << kFanBits && left > 0; ++e) {
      const UnitIndex i = s.entries()[e].load(std::memory_order_acquire /* P3 */);
      if (i == 0) {  // not there yet: its slots are empty
        left -= std::min(left, 1u << (kFanBits * static_cast<unsigned>(height)));
      } else {
        visit_segment(segment(i), height - 1, kBlock, left, f);
      }
    }
  }

  /// Slot i; nowhere if its segment is missing. Quiescent.
  Slot slot_at(const List& list, std::uint32_t i) const noexcept {
    const Address at = address_of(i);
    UnitIndex at_unit = list.head.load(std::memory_order_relaxed);  // relaxed, as the loads below: quiescent
    for (int k = 0; k < at.segment && at_unit != 0; ++k)
      at_unit = segment(at_unit).next.load(std::memory_order_relaxed);
    for (int level = at.segment - kChunks + 1; level > 0 && at_unit != 0; --level) {
      at_unit = segment(at_unit).entries()[digit(at.rest, level)].load(std::memory_order_relaxed);
    }
    return at_unit == 0 ? Slot{} : at.slot_in(segment(at_unit));
  }

  Pool pool_;
  [[no_unique_address]] Marks marks_;
};

}  // namespace icbench
