#include "render/indirect_pass.h"

namespace icbench {

void visible_tile(Tracer& tracer, Light light_of_pass, const CameraView& view, Lens lens,
                  const SampleKey& key, std::uint32_t light_samples, const Tile& tile, PrimaryHits& primary,
                  Image& direct) noexcept {
  primary_tile(tracer, view, lens, key, tile, primary);
  if (light_of_pass != Light::all) {
    // Estimates of one sample of a pixel are none of another's.
    const SampleKey first{key.seed, key.frame, key.sample * light_samples};
    direct_tile(tracer, primary, light_samples, first, tile, direct);
    return;
  }
  for_each_visible(tile, primary, [&](const Visible& x) { x.show(direct, tracer.shared().emitted(x.hit)); });
}

}  // namespace icbench
