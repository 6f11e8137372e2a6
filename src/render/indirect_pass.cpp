#include "render/indirect_pass.h"

namespace icbench {

void visible_tile(Tracer& tracer, Light light_of_pass, const CameraView& view, Lens lens,
                  const SampleKey& key, const Tile& tile, PrimaryHits& primary, Image& direct) noexcept {
  primary_tile(tracer, view, lens, key, tile, primary);
  if (light_of_pass != Light::all) {
    direct_tile(tracer, primary, 1, key, tile, direct);
    return;
  }
  for_each_visible(tile, primary, [&](const Visible& x) { x.show(direct, tracer.shared().emitted(x.hit)); });
}

}  // namespace icbench
