// Tiles of an image, the order they are rendered in, and the cursor that hands them to threads.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "core/sync.h"

namespace icbench {

inline constexpr int kFrameTile = 16;  ///< edge of the tiles that pictures are made of, pixels

/// Pixels x0 <= x < x1, y0 <= y < y1.
struct Tile {
  int x0, y0, x1, y1;
};

enum class TileOrder : std::uint8_t {
  scanline,  ///< row by row
  morton,    ///< along a Z-curve: neighbours in time are neighbours in the image
  random     ///< seeded shuffle: threads hardly ever work side by side
};

constexpr std::string_view to_string(TileOrder order) noexcept {
  switch (order) {
    case TileOrder::scanline:
      return "scanline";
    case TileOrder::morton:
      return "morton";
    case TileOrder::random:
      return "random";
  }
  return "unknown";
}

/// Throws std::runtime_error naming the orders if there is none of that name.
TileOrder parse_tile_order(std::string_view name);

/// Every pixel of the image in exactly one tile; tiles have edge `size`, less at the right and bottom. `seed`
/// matters for the random order only. Throws std::runtime_error unless width, height and size are positive.
std::vector<Tile> make_tiles(int width, int height, int size, TileOrder order, std::uint64_t seed = 0);

/// Hands out tiles, each once, to any number of threads: wait-free, one fetch_add each.
class TileCursor {
 public:
  explicit TileCursor(const std::vector<Tile>& tiles) noexcept : tiles_(&tiles) {}

  /// The next tile, or nullptr when none is left.
  const Tile* next() noexcept {
    // relaxed: tiles are immutable and were shared before the threads started; only uniqueness matters.
    const std::size_t i = next_.fetch_add(1, std::memory_order_relaxed);
    return i < tiles_->size() ? &(*tiles_)[i] : nullptr;
  }

 private:
  const std::vector<Tile>* tiles_;
  alignas(kNoSharing) std::atomic<std::size_t> next_{0};  // a line of its own: every thread writes it
};

}  // namespace icbench
