#include "workload/picture.h"

#include <atomic>
#include <memory>

namespace icbench {

std::uint64_t picture_bytes(const PictureRequest& r) {
  const std::uint64_t pixels = static_cast<std::uint64_t>(r.width) * static_cast<std::uint64_t>(r.height);
  return pixels * (r.integrator.needs_cache ? sizeof(Hit) + 3 * sizeof(glm::vec3) : sizeof(glm::vec3));
}

double picture_work(const PictureRequest& r) {
  return static_cast<double>(make_tiles(r.width, r.height, kPictureTile, r.tiles, r.seed).size()) * r.spp;
}

PictureOutcome render_plain_picture(const PictureRequest& r) {
  PictureOutcome out;
  out.picture = make_image(r.width, r.height);
  const std::vector<Tile> tiles = make_tiles(r.width, r.height, kPictureTile, r.tiles, r.seed);
  const PictureJob job{CameraView(r.rays.scene().camera, r.width, r.height), r.spp, SampleKey{r.seed, 0, 0}};
  std::vector<std::unique_ptr<Tracer>> tracers(r.team.size());
  TileCursor cursor(tiles);
  const TeamTimes times = r.team.run([&](unsigned t) {
    tracers[t] = std::make_unique<Tracer>(r.rays);
    while (const Tile* tile = cursor.next()) {
      r.integrator.tile(*tracers[t], job, *tile, out.picture);
      r.progress(r.spp);
    }
  });
  out.seconds = 1e-9 * static_cast<double>(times.wall_ns());
  for (const auto& tracer : tracers) out.rays += tracer->counts;
  return out;
}

}  // namespace icbench
