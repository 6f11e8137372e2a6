// What shared memory may answer under the C++20 memory model: release/acquire by views, executed step by step.
//
// Every location keeps all values stored to it, oldest first: its modification order, which is the order in which the
// stores were executed. A load may read any of them that coherence does not hide from its thread, so it may be stale;
// an acquire load that reads a release store, or a read-modify-write in the release sequence of one (C++20: the store
// and the read-modify-writes that follow it without a break), takes over what the storing thread knew.
// Read-modify-writes read the latest value. A failed compare-exchange is a load, and may fail by an old value.
//
// Two accesses to plain memory, one of them a write, that nothing orders are a data race. So are a step on a word and
// the setting of its memory to zero, by which words of pools come to be.
//
// What the model does not do, though C++ allows it:
//   - load buffering: a load never reads a store that is executed later (out of thin air, or a dependency cycle);
//   - a modification order that contradicts the order of execution: of two relaxed stores to one location, the one
//     executed later is the later one.
// Seq_cst steps are acquire and release, and their one order is that in which they are executed: at each location one of
// them sees nothing older than the one before did. They order nothing else: two threads may both miss what the other
// stored if only their stores, or only their loads, are seq_cst.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace icbench::stress::explore {

inline constexpr unsigned kMaxThreads = 4;
/// Atomic words that the threads of one execution may touch.
inline constexpr unsigned kMaxLocations = 256;

/// A vector clock: how many of each thread's steps are known.
struct VectorClock {
  std::array<std::uint32_t, kMaxThreads> at{};

  void join(const VectorClock& o) noexcept {
    for (unsigned i = 0; i < kMaxThreads; ++i) at[i] = std::max(at[i], o.at[i]);
  }
};

/// Per location the oldest store that may still be read.
struct View {
  std::array<std::uint16_t, kMaxLocations> oldest{};

  void join(const View& o) noexcept {
    for (unsigned i = 0; i < kMaxLocations; ++i) oldest[i] = std::max(oldest[i], o.oldest[i]);
  }
};

/// One step on an atomic word, or on a modelled lock: a word that is 0 when free, kExclusive when held, else the number
/// of its readers.
struct Access {
  enum class Kind : std::uint8_t {
    load,
    store,
    add,
    exchange,
    compare_exchange,
    lock,
    lock_shared,
    unlock,
    unlock_shared
  };
  static constexpr std::uint64_t kExclusive = std::uint64_t{1} << 32;

  Kind kind = Kind::load;
  std::memory_order order = std::memory_order_relaxed;
  std::memory_order failure = std::memory_order_relaxed;  ///< compare_exchange
  const void* address = nullptr;
  std::uint64_t in_place = 0;  ///< value in memory; the first one, if nobody has touched the word yet
  std::uint64_t operand = 0;
  std::uint64_t expected = 0;              ///< compare_exchange
  std::uint64_t mask = ~std::uint64_t{0};  ///< of the word's bits

  bool may_write() const noexcept { return kind != Kind::load; }
  /// Does not read: follows the latest store whatever it is.
  bool is_blind() const noexcept { return kind == Kind::store || kind == Kind::unlock; }
  bool is_seq_cst() const noexcept {
    return order == std::memory_order_seq_cst ||
           (kind == Kind::compare_exchange && failure == std::memory_order_seq_cst);
  }
};

using Location = std::uint16_t;

/// What a step did.
struct Effect {
  std::uint64_t read = 0;     ///< the value read, or followed
  std::uint64_t written = 0;  ///< if it wrote
  bool wrote = false;
  unsigned index = 0;  ///< of the store that was read or followed
  bool is_stale = false;
};

/// A race, found by its second access.
struct Race {
  const void* begin;
  std::size_t bytes;
  unsigned first, second;  ///< threads
  bool first_writes, second_writes;
  bool is_of_word = false;  ///< one access is a step on an atomic word, the other sets memory to zero
};

/// Stores that a step can read or follow, by index in the modification order, the latest first.
struct Choices {
  static constexpr unsigned kMost = 32;
  std::array<std::uint16_t, kMost> index;
  std::uint8_t count = 0;
};

class Memory {
 public:
  Memory();

  /// Forgets everything; what is in place is what every thread knows.
  void reset(unsigned threads) noexcept;

  /// The location of an access; 0, and is_exhausted(), if there are too many.
  Location locate(const Access& a);
  /// All that `thread` may do next at a location; none if it has to wait.
  Choices choices(unsigned thread, const Access& a, Location l) const noexcept;
  Effect perform(unsigned thread, const Access& a, Location l, unsigned index);

  /// Stores at a location, the initial value among them.
  unsigned stores(Location l) const noexcept { return locations_[l].count; }

  /// A loop of `thread` begins that may wait.
  void begin_waiting(unsigned thread) noexcept { threads_[thread].has_changed = false; }
  /// `thread` will not read again what it read last: it waits for something newer there.
  void await_newer(unsigned thread) noexcept;
  bool is_waiting(unsigned thread) const noexcept { return threads_[thread].is_waiting; }
  /// Whether what a waiting thread does once it goes on may matter: it has changed something in this turn of its loop.
  /// So for the first such wait of each thread; no schedule is endless that way.
  bool may_go_on(unsigned thread) const noexcept { return threads_[thread].may_go_on; }

  /// An access to plain memory, and the race it ends, if any.
  std::optional<Race> touch(unsigned thread, const void* begin, std::size_t bytes, bool writes);
  /// Memory of words and other is set to zero: a write of plain memory, which must precede all steps on its words.
  std::optional<Race> zero(unsigned thread, const void* begin, std::size_t bytes);
  /// The race of a step that `thread` is about to make with a zeroing of its word, if nothing orders the two.
  std::optional<Race> race_with_zeroing(unsigned thread, const Access& a) const noexcept;

  /// Steps of each thread that precede the next one of `thread`, through program order, what was read, and the
  /// modification orders: the order that every equivalent execution shares.
  const VectorClock& past(unsigned thread) const noexcept { return threads_[thread].past; }

  /// Set when an execution touched more than the model has room for.
  bool is_exhausted() const noexcept { return exhausted_; }

 private:
  struct Store {
    std::uint64_t value;
    VectorClock released;  ///< what an acquire load of it learns
    View view;
    VectorClock past;
  };
  struct Word {
    const void* address;
    unsigned count;
    std::vector<Store> stores;  ///< the first `count` are in use
  };
  struct Thread {
    VectorClock known;  ///< happens-before
    View view;
    VectorClock past;
    Location last = 0;  ///< read last
    unsigned last_index = 0;
    bool has_read = false;
    bool is_waiting = false;   ///< for a store newer than the one it read last
    bool may_go_on = false;    ///< when that has come
    bool has_changed = false;  ///< something, since its loop began or it last waited
    bool went_on = false;      ///< it has done so before
  };

  /// The last access of one thread, of one sort, to one range of plain memory.
  struct Touch {
    const std::byte* begin;
    std::size_t bytes;
    std::uint32_t time;
    std::uint8_t thread;
    bool writes;
    bool zeroes;
  };

  Store& add_store(Word& w);
  std::optional<Race> touch(unsigned thread, const void* begin, std::size_t bytes, bool writes, bool zeroes);

  std::array<Thread, kMaxThreads> threads_;
  std::vector<Word> locations_;
  Location used_ = 0;
  static constexpr unsigned kBuckets = 512;
  static_assert(kBuckets >= 2 * kMaxLocations, "probing stays short, and ends");
  struct Bucket {
    const void* address;
    std::uint64_t execution;
    Location location;
  };
  std::vector<Bucket> buckets_;
  std::uint64_t execution_ = 0;
  std::vector<Touch> touches_;
  VectorClock total_past_;  ///< of seq_cst steps
  View total_view_;         ///< at each location, of the last of them
  bool exhausted_ = false;
};

/// "store", "add", ...
const char* name_of(Access::Kind kind) noexcept;
const char* name_of(std::memory_order order) noexcept;

}  // namespace icbench::stress::explore
