// What the rendering tests share: estimates with their error, and passes over all tiles.
#pragma once

#include <tbb/global_control.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <thread>
#include <vector>

#include "image/image.h"
#include "render/camera.h"
#include "render/primary.h"
#include "render/ray_tracer.h"
#include "render/tiles.h"

namespace icbench {

// oneTBB and Embree are not built for ThreadSanitizer, which then takes memory that passes between their
// threads for a race: these tests build every BVH in one thread.
inline const tbb::global_control kSerialBuild(tbb::global_control::max_allowed_parallelism, 1);

inline constexpr double kPi = std::numbers::pi;
inline constexpr float kRho = 0.5f;  // albedo of white_furnace

// Mean and standard error of samples.
class Estimate {
 public:
  void add(double x) {
    ++n_;
    const double d = x - mean_;
    mean_ += d / n_;
    squares_ += d * (x - mean_);
  }
  double mean() const { return mean_; }
  double error() const { return std::sqrt(squares_ / (n_ - 1.0) / n_); }

 private:
  double n_ = 0.0, mean_ = 0.0, squares_ = 0.0;
};

inline Image blank(int width, int height) {
  Image image;
  image.width = width;
  image.height = height;
  image.pixels.assign(static_cast<std::size_t>(width) * height, glm::vec3(-1.0f));
  return image;
}

// Calls f(tracer, tile) for all tiles, in `threads` threads.
inline void for_tiles(const RayTracer& rays, int width, int height, TileOrder order, int threads,
                      const std::function<void(Tracer&, const Tile&)>& f) {
  const auto tiles = make_tiles(width, height, 8, order, 5);
  TileCursor cursor(tiles);
  std::vector<std::jthread> team;
  for (int i = 0; i < threads; ++i)
    team.emplace_back([&] {
      Tracer tracer(rays);
      while (const Tile* tile = cursor.next()) f(tracer, *tile);
    });
}

inline PrimaryHits primary_hits(const RayTracer& rays, int width, int height) {
  PrimaryHits out(rays.scene(), width, height);
  const CameraView view(rays.scene().camera, width, height);
  for_tiles(rays, width, height, TileOrder::scanline, 1,
            [&](Tracer& t, const Tile& tile) { primary_tile(t, view, Lens::centre, {}, tile, out); });
  return out;
}

}  // namespace icbench
