// What temporal instant caching keeps of each record beside the cache: 48 bytes, and a bit for every slot of a virtual
// light, unless the record does without. Slots come in words of 64, which costs 4 bytes a record on average. Irradiance
// is in the cache alone.
//
// Records are named by a 32-bit id, which is their place here. Blocks of 16, with bits or without, are taken from the
// system as they are needed, and kept, so memory is that of the most records there were, but for a pointer a block of
// the capacity; threads draw free ids in batches of a block. What a thread writes to an id of its own is read by others
// only between frames, when all is quiescent.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <cstring>
#include <glm/vec3.hpp>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "core/sync.h"
#include "core/types.h"
#include "render/extrapolation.h"
#include "render/packed_normal.h"
#include "render/radius_rays.h"

namespace icbench {

/// A record as it is kept, but for its visibilities and its radius, which follows from `distances`.
struct KeptRecord {
  enum State : std::uint8_t {
    free,
    unused,
    live
  };  ///< live: in the cache; unused: the same, but no query has told of it since a sweep began

  glm::vec3 p{0.0f};   ///< metres
  PackedNormal n, ng;  ///< shading and geometric normal
  /// Compensation rays that met a surface so near that the clamp took light (a bit each).
  std::uint32_t met = 0;
  std::uint16_t mesh = 0;  ///< that it lies on; kManyMeshes for that one and all beyond
  std::uint8_t state = free;
  DistanceCodes distances{};
};
static_assert(
    sizeof(KeptRecord) <= 48,
    "64 bytes a record is what may be kept beside the cache, words of bits filled up and free ids included");

inline constexpr std::uint16_t kManyMeshes = std::numeric_limits<std::uint16_t>::max();

/// Whether a bit is kept for each virtual light of a record.
enum class LightBits : std::uint8_t { no, yes };

class RecordTable {
 public:
  static constexpr std::uint32_t kBlock = RecordDetails::kBlock;  // theirs go by the same ids
  static constexpr std::uint32_t kNone = ~0u;                     ///< no id

  /// For `capacity` records at most, drawn by `threads` threads.
  RecordTable(std::uint32_t capacity, unsigned threads)
      : blocks_(RecordDetails::blocks_for(capacity, threads)), purses_(threads) {}

  /// Makes room for this many words of bits in each record that has any, no fewer than there are; new ones are 0.
  /// Quiescent.
  void widen(std::size_t words);

  /// An id that nobody uses, with bits or, unless all that are left have some, without; the same until `keep`. kNone if
  /// there is none. By one thread for itself.
  std::uint32_t draft(unsigned thread, LightBits bits) {
    std::vector<std::uint32_t>& ids = purses_[thread].ids[static_cast<std::size_t>(bits)];
    if (ids.empty()) refill(ids, bits);
    return ids.empty() ? kNone : ids.back();
  }
  /// The drafted id is in use from now on.
  void keep(unsigned thread, std::uint32_t id) noexcept {
    for (std::vector<std::uint32_t>& ids : purses_[thread].ids) {
      if (!ids.empty() && ids.back() == id) return ids.pop_back();
    }
  }

  KeptRecord& operator[](std::uint32_t id) noexcept { return block(id)->records[id % kBlock]; }
  /// Bit i of word w for the light in slot 64 w + i; of an id with bits.
  std::span<std::uint64_t> visible(std::uint32_t id) noexcept {
    return {block(id)->bits.get() + (id % kBlock) * words_, words_};
  }

  /// Ids below this may be in use; those of blocks. Quiescent.
  std::uint32_t end() const noexcept { return blocks_used() * kBlock; }

  /// Gives ids back. Quiescent.
  void release(std::span<const std::uint32_t> ids);

  /// Gives all back, and the memory. Quiescent.
  void clear() noexcept;

  /// Bytes taken so far, pointers to blocks that are not in use aside. Quiescent.
  std::size_t bytes() const noexcept;

 private:
  struct Block {
    KeptRecord records[kBlock];
    std::unique_ptr<std::uint64_t[]> bits;  // LightBits::yes
  };
  struct alignas(kNoSharing) Purse {
    std::vector<std::uint32_t> ids[2];  // by LightBits
  };
  // Ids that were given back.
  struct alignas(kNoSharing) Released {
    std::vector<std::uint32_t> ids;
    std::atomic<std::size_t> taken{0};  // of the first; may count on beyond the last

    std::size_t gone() const noexcept {
      return std::min<std::size_t>(taken.load(std::memory_order_relaxed), ids.size());
    }
  };

  Block* block(std::uint32_t id) const noexcept { return blocks_[id / kBlock].get(); }
  LightBits bits_of(std::uint32_t id) const noexcept {
    return block(id)->bits != nullptr ? LightBits::yes : LightBits::no;
  }
  std::uint32_t blocks_used() const noexcept {
    return std::min(next_block_.load(std::memory_order_relaxed), static_cast<std::uint32_t>(blocks_.size()));
  }
  static void take_released(Released& released, std::vector<std::uint32_t>& purse);
  void refill(std::vector<std::uint32_t>& purse, LightBits bits);

  std::size_t words_ = 0;
  std::vector<std::unique_ptr<Block>> blocks_;
  std::vector<Purse> purses_;
  Released released_[2];  // by LightBits
  alignas(kNoSharing) std::atomic<std::uint32_t> next_block_{0};
};

}  // namespace icbench
