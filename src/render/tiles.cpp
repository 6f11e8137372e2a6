#include "render/tiles.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "core/names.h"
#include "core/random.h"

namespace icbench {
namespace {

// Spreads the low 32 bits so that a zero lies before each.
std::uint64_t spread_bits(std::uint64_t x) {
  x = (x | x << 16) & 0x0000ffff0000ffffULL;
  x = (x | x << 8) & 0x00ff00ff00ff00ffULL;
  x = (x | x << 4) & 0x0f0f0f0f0f0f0f0fULL;
  x = (x | x << 2) & 0x3333333333333333ULL;
  return (x | x << 1) & 0x5555555555555555ULL;
}

std::uint64_t morton_code(const Tile& t, int size) {
  return spread_bits(static_cast<std::uint64_t>(t.x0 / size)) |
         spread_bits(static_cast<std::uint64_t>(t.y0 / size)) << 1;
}

}  // namespace

TileOrder parse_tile_order(std::string_view name) {
  std::vector<std::string_view> known;
  for (const TileOrder order : {TileOrder::scanline, TileOrder::morton, TileOrder::random}) {
    known.push_back(to_string(order));
    if (known.back() == name) return order;
  }
  throw std::runtime_error(unknown_name("tile order", name, known));
}

std::vector<Tile> make_tiles(int width, int height, int size, TileOrder order, std::uint64_t seed) {
  if (width <= 0 || height <= 0 || size <= 0)
    throw std::runtime_error(
        fmt::format("cannot cut {}x{} pixels into tiles of {}; give positive numbers", width, height, size));
  std::vector<Tile> tiles;
  // In 64 bits: the edge of the last tile may lie past INT_MAX.
  const auto end = [size](int begin, int limit) {
    return static_cast<int>(std::min<std::int64_t>(std::int64_t{begin} + size, limit));
  };
  for (std::int64_t y = 0; y < height; y += size)
    for (std::int64_t x = 0; x < width; x += size) {
      const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
      tiles.push_back({x0, y0, end(x0, width), end(y0, height)});
    }
  if (order == TileOrder::morton) {
    std::sort(tiles.begin(), tiles.end(),
              [size](const Tile& a, const Tile& b) { return morton_code(a, size) < morton_code(b, size); });
  } else if (order == TileOrder::random) {
    Pcg32 random(
        hash_keys(seed, tiles.size()));  // Fisher-Yates by hand: std::shuffle differs between libraries
    for (std::size_t i = tiles.size(); i > 1; --i)
      std::swap(tiles[i - 1], tiles[random.below(static_cast<std::uint32_t>(i))]);
  }
  return tiles;
}

}  // namespace icbench
