// What the rendering tests share: estimates with their error, and passes over all tiles.
#pragma once

#include <tbb/global_control.h>

#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <span>
#include <thread>
#include <vector>

#include "image/image.h"
#include "render/camera.h"
#include "render/crew.h"
#include "render/indirect_pass.h"
#include "render/integrators.h"
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

// What lies below a point.
inline Hit down(Tracer& tracer, const glm::vec3& from) {
  return tracer.intersect(Ray{from, std::numeric_limits<float>::infinity(), {0, -1, 0}});
}

inline Image blank(int width, int height) {
  Image image;
  image.width = width;
  image.height = height;
  image.pixels.assign(static_cast<std::size_t>(width) * height, glm::vec3(-1.0f));
  return image;
}

// Mean of the green channel.
inline double mean_of(const Image& image) {
  double sum = 0.0;
  for (const glm::vec3& L : image.pixels) sum += L.y;
  return sum / static_cast<double>(image.pixels.size());
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

// A crew of threads that end with each piece of work.
class ThreadCrew final : public Crew {
 public:
  ThreadCrew(const RayTracer& rays, unsigned threads) : tracers_(threads, Tracer(rays)) {}

  unsigned size() const noexcept override { return static_cast<unsigned>(tracers_.size()); }
  void run(const std::function<void(unsigned, Tracer&)>& f) override {
    std::vector<std::jthread> team;
    for (unsigned t = 0; t < size(); ++t) team.emplace_back([&, t] { f(t, tracers_[t]); });
  }

  RayCounts rays() const {
    RayCounts sum;
    for (const Tracer& tracer : tracers_) sum += tracer.counts;
    return sum;
  }

 private:
  std::vector<Tracer> tracers_;
};

// One sample of all pixels by a pass, whose frame has begun: what is seen, direct and indirect light.
inline void render_sample(IndirectPass& pass, Crew& crew, const CameraView& view, Lens lens,
                          const SampleKey& key, std::span<const Tile> tiles, PrimaryHits& primary,
                          Image& direct, Image& indirect) {
  const auto for_all = [&](const auto& f) {
    crew.for_each(tiles.size(), 1,
                  [&](unsigned t, Tracer& tracer, std::size_t i) { f(t, tracer, tiles[i]); });
  };
  for_all([&](unsigned, Tracer& tracer, const Tile& tile) {
    visible_tile(tracer, pass.light(), view, lens, key, 1, tile, primary, direct);
  });
  pass.begin_sample(primary, key);
  for_all([&](unsigned t, Tracer& tracer, const Tile& tile) {
    pass.tile(t, tracer, primary, key, tile, indirect);
  });
  pass.end_sample(primary, indirect);
}

// A square picture by an integrator that needs no cache: the mean of jittered samples.
inline Image picture(const RayTracer& rays, const IntegratorEntry& integrator, int size, std::uint32_t spp,
                     const SampleKey& first, TileOrder order = TileOrder::scanline, unsigned threads = 1) {
  ThreadCrew crew(rays, threads);
  const auto pass = integrator.pass({rays, crew, size, size});
  const CameraView view(rays.scene().camera, size, size);
  const auto tiles = make_tiles(size, size, 8, order, 5);
  PrimaryHits primary(rays.scene(), size, size);
  Image direct = blank(size, size), indirect = blank(size, size), sum = make_image(size, size);
  pass->begin_frame({});
  for (std::uint32_t s = 0; s < spp; ++s) {
    render_sample(*pass, crew, view, Lens::jittered, first.next_sample(s), tiles, primary, direct, indirect);
    for (std::size_t i = 0; i < sum.pixels.size(); ++i)
      sum.pixels[i] += (direct.pixels[i] + indirect.pixels[i]) / static_cast<float>(spp);
  }
  return sum;
}

}  // namespace icbench
