// Tiles: every pixel exactly once, in every order; the cursor hands each tile out once.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <limits>
#include <set>
#include <stdexcept>
#include <thread>
#include <utility>
#include <vector>

#include "render/primary.h"
#include "render/tiles.h"

namespace icbench {
namespace {

constexpr TileOrder kOrders[] = {TileOrder::scanline, TileOrder::morton, TileOrder::random};

TEST(RenderTiles, CoverEveryPixelExactlyOnce) {
  const std::pair<int, int> sizes[] = {{1, 1}, {64, 64}, {65, 31}, {7, 200}};
  for (const TileOrder order : kOrders)
    for (const auto& [width, height] : sizes)
      for (const int size : {1, 8, 16, 1000}) {
        std::vector<int> covered(static_cast<std::size_t>(width) * height);
        for (const Tile& t : make_tiles(width, height, size, order, 3))
          for (int y = t.y0; y < t.y1; ++y)
            for (int x = t.x0; x < t.x1; ++x) ++covered.at(static_cast<std::size_t>(y) * width + x);
        for (const int count : covered) ASSERT_EQ(count, 1) << width << "x" << height << " tiles of " << size;
      }
}

TEST(RenderTiles, CoarseToFineVisitsEveryPixelOnceAndTheMiddleFirst) {
  constexpr int kWidth = 40;
  for (const Tile& t : {Tile{0, 0, 16, 16}, Tile{32, 16, 40, 29}, Tile{3, 5, 4, 6}, Tile{0, 0, 40, 7}}) {
    std::vector<std::uint32_t> visited;
    for_each_pixel_coarse_to_fine(t, kWidth, [&](std::uint32_t pixel) { visited.push_back(pixel); });
    std::vector<std::uint32_t> rows;
    for_each_pixel(t, kWidth, [&](std::uint32_t pixel) { rows.push_back(pixel); });
    std::vector<std::uint32_t> sorted = visited;
    std::sort(sorted.begin(), sorted.end());
    ASSERT_EQ(sorted, rows);
    if (t.x1 - t.x0 == 16) {
      EXPECT_EQ(visited.front(), 8u * kWidth + 8u);
    }
  }
}

TEST(RenderTiles, ATileLargerThanAnyImageIsTheImage) {
  const auto tiles = make_tiles(640, 480, std::numeric_limits<int>::max(), TileOrder::scanline);
  ASSERT_EQ(tiles.size(), 1u);
  EXPECT_EQ(tiles[0].x1, 640);
  EXPECT_EQ(tiles[0].y1, 480);
}

TEST(RenderTiles, MortonOrderVisitsEachQuadrantWholly) {
  const auto tiles = make_tiles(64, 64, 8, TileOrder::morton);
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    const Tile& first = tiles[i / 16 * 16];
    EXPECT_EQ(tiles[i].x0 / 32, first.x0 / 32);
    EXPECT_EQ(tiles[i].y0 / 32, first.y0 / 32);
  }
}

TEST(RenderTiles, TheSeedDecidesTheRandomOrder) {
  const auto order = [](std::uint64_t seed) {
    std::vector<int> out;
    for (const Tile& t : make_tiles(128, 128, 8, TileOrder::random, seed)) out.push_back(t.y0 * 128 + t.x0);
    return out;
  };
  EXPECT_EQ(order(1), order(1));
  EXPECT_NE(order(1), order(2));
}

TEST(RenderTiles, ImpossibleSizesAreRefused) {
  for (const auto& [w, h, s] : {std::tuple{0, 4, 4}, std::tuple{4, -1, 4}, std::tuple{4, 4, 0}})
    EXPECT_THROW(make_tiles(w, h, s, TileOrder::scanline), std::runtime_error);
}

TEST(RenderTiles, OrdersHaveNames) {
  EXPECT_EQ(parse_tile_order("scanline"), TileOrder::scanline);
  EXPECT_EQ(parse_tile_order("morton"), TileOrder::morton);
  EXPECT_EQ(parse_tile_order("random"), TileOrder::random);
  EXPECT_THROW(parse_tile_order("hilbert"), std::runtime_error);
}

TEST(RenderTiles, TheCursorGivesEachTileToOneThread) {
  const auto tiles = make_tiles(256, 256, 4, TileOrder::scanline);
  TileCursor cursor(tiles);
  std::vector<std::vector<const Tile*>> taken(4);
  {
    std::vector<std::jthread> threads;
    for (auto& mine : taken)
      threads.emplace_back([&] {
        while (const Tile* t = cursor.next()) mine.push_back(t);
      });
  }
  std::multiset<const Tile*> all;
  for (const auto& mine : taken) all.insert(mine.begin(), mine.end());
  EXPECT_EQ(all.size(), tiles.size());
  for (const Tile& t : tiles) ASSERT_EQ(all.count(&t), 1u);
  EXPECT_EQ(cursor.next(), nullptr);
}

}  // namespace
}  // namespace icbench
