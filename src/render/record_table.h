// What temporal instant caching keeps of each record beside the cache: 48 bytes, and a bit for every slot of a virtual
// light. Slots come in words of 64, which costs 4 bytes a record on average. Irradiance is in the cache alone.
//
// Records are named by a 32-bit id, which is their place here. Blocks of 16 are taken from the system as they are
// needed, so memory follows the number of records, but for a pointer a block of the capacity; threads draw free ids in
// batches of a block. What a thread writes to an id of its own is read by others only between frames, when all is
// quiescent.
#pragma once

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
  };  ///< live: in the cache; unused: no pixel asked for it lately

  glm::vec3 p{0.0f};   ///< metres
  PackedNormal n, ng;  ///< shading and geometric normal
  std::uint32_t met =
      0;  ///< compensation rays that met a surface so near that the clamp took light (a bit each)
  std::uint16_t mesh = 0;  ///< that it lies on; kManyMeshes for that one and all beyond
  std::uint8_t state = free;
  DistanceCodes distances{};
};
static_assert(
    sizeof(KeptRecord) <= 48,
    "64 bytes a record is what may be kept beside the cache, words of bits filled up and free ids included");

inline constexpr std::uint16_t kManyMeshes = std::numeric_limits<std::uint16_t>::max();

class RecordTable {
 public:
  static constexpr std::uint32_t kBlock = RecordDetails::kBlock;  // theirs go by the same ids
  static constexpr std::uint32_t kNone = ~0u;                     ///< no id

  /// For `capacity` records at most, drawn by `threads` threads.
  RecordTable(std::uint32_t capacity, unsigned threads)
      : blocks_(capacity / kBlock + threads + 1), purses_(threads) {}

  /// Makes room for this many words of visibilities in each record, no fewer than there are; new ones are 0. Quiescent.
  void widen(std::size_t words);

  /// An id that nobody uses, the same until `keep`; kNone if there is none left. By one thread for itself.
  std::uint32_t draft(unsigned thread) {
    Purse& purse = purses_[thread];
    if (purse.ids.empty()) refill(purse);
    return purse.ids.empty() ? kNone : purse.ids.back();
  }
  /// The drafted id is in use from now on.
  void keep(unsigned thread) noexcept { purses_[thread].ids.pop_back(); }

  KeptRecord& operator[](std::uint32_t id) noexcept { return block(id)->records[id % kBlock]; }
  std::span<std::uint64_t> visible(std::uint32_t id) noexcept {
    return {block(id)->bits.get() + (id % kBlock) * words_, words_};
  }

  /// Ids below this may be in use; those of blocks. Quiescent.
  std::uint32_t end() const noexcept { return blocks_used() * kBlock; }

  /// Gives ids back. Quiescent.
  void release(std::span<const std::uint32_t> ids) {
    for (const std::uint32_t id : ids) (*this)[id].state = KeptRecord::free;
    released_.erase(released_.begin(), released_.begin() + static_cast<std::ptrdiff_t>(taken()));
    released_.insert(released_.end(), ids.begin(), ids.end());
    taken_.store(0, std::memory_order_relaxed);  // quiescent
  }

  /// Bytes taken so far, pointers to blocks that are not in use aside.
  std::size_t bytes() const noexcept {
    return blocks_used() * (sizeof(blocks_[0]) + sizeof(Block) + kBlock * words_ * sizeof(std::uint64_t));
  }

 private:
  struct Block {
    explicit Block(std::size_t words) : bits(std::make_unique<std::uint64_t[]>(kBlock * words)) {}
    KeptRecord records[kBlock];
    std::unique_ptr<std::uint64_t[]> bits;
  };
  struct alignas(kNoSharing) Purse {
    std::vector<std::uint32_t> ids;
  };

  Block* block(std::uint32_t id) const noexcept { return blocks_[id / kBlock].get(); }
  std::uint32_t blocks_used() const noexcept {
    return std::min(next_block_.load(std::memory_order_relaxed), static_cast<std::uint32_t>(blocks_.size()));
  }
  std::size_t taken() const noexcept {
    return std::min<std::size_t>(taken_.load(std::memory_order_relaxed), released_.size());
  }

  // Relaxed throughout: counters only have to give distinct places; the lists behind them change when quiescent, and
  // a block is used by the thread that took it until the next quiescent point.
  void refill(Purse& purse) {
    if (taken() < released_.size()) {
      const std::size_t first = taken_.fetch_add(kBlock, std::memory_order_relaxed);
      for (std::size_t i = first; i < std::min<std::size_t>(first + kBlock, released_.size()); ++i)
        purse.ids.push_back(released_[i]);
      if (!purse.ids.empty()) return;
    }
    if (next_block_.load(std::memory_order_relaxed) >= blocks_.size()) return;
    const std::uint32_t b = next_block_.fetch_add(1, std::memory_order_relaxed);
    if (b >= blocks_.size()) return;
    blocks_[b] = std::make_unique<Block>(words_);
    for (std::uint32_t i = kBlock; i > 0; --i) purse.ids.push_back(b * kBlock + i - 1);
  }

  std::size_t words_ = 0;
  std::vector<std::unique_ptr<Block>> blocks_;
  std::vector<Purse> purses_;
  std::vector<std::uint32_t> released_;
  alignas(kNoSharing) std::atomic<std::uint32_t> next_block_{0};
  alignas(kNoSharing) std::atomic<std::size_t> taken_{0};  // of released_
};

}  // namespace icbench
