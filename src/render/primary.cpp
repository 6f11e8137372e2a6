#include "render/primary.h"

#include "core/random.h"

namespace icbench {

Hit primary_hit(Tracer& tracer, const CameraView& view, Lens lens, const SampleKey& key, int x, int y,
                std::uint32_t pixel) noexcept {
  float u = 0.5f, v = 0.5f;
  if (lens == Lens::jittered) {
    Pcg32 random(key.of_pixel(pixel, Purpose::lens));
    u = random.uniform();
    v = random.uniform();
  }
  return tracer.intersect(view.ray(static_cast<float>(x) + u, static_cast<float>(y) + v));
}

void primary_tile(Tracer& tracer, const CameraView& view, Lens lens, const SampleKey& key, const Tile& tile,
                  PrimaryHits& out) noexcept {
  int x = tile.x0, y = tile.y0;
  for_each_pixel(tile, out.width, [&](std::uint32_t pixel) {
    out.hits[pixel] = primary_hit(tracer, view, lens, key, x, y, pixel);
    if (++x == tile.x1) {
      x = tile.x0;
      ++y;
    }
  });
}

}  // namespace icbench
