#include "render/integrators.h"

#include <fmt/format.h>

#include <numbers>
#include <stdexcept>
#include <string>

#include "render/path.h"
#include "render/primary.h"

namespace icbench {
namespace {

void picture_tile(Tracer& tracer, const PictureJob& job, Light light, const Tile& tile,
                  Image& picture) noexcept {
  const RayTracer& rays = tracer.shared();
  for (int y = tile.y0; y < tile.y1; ++y)
    for (int x = tile.x0; x < tile.x1; ++x) {
      const auto pixel = static_cast<std::uint32_t>(y) * static_cast<std::uint32_t>(picture.width) +
                         static_cast<std::uint32_t>(x);
      glm::dvec3 sum(0.0);
      for (std::uint32_t s = 0; s < job.spp; ++s) {
        const SampleKey key = job.key.next_sample(s);
        const Hit hit = primary_hit(tracer, job.view, Lens::jittered, key, x, y, pixel);
        sum += rays.emitted(hit);
        if (!reflects(rays, hit)) continue;
        Pcg32 random(key.of_pixel(pixel, Purpose::path));
        sum += std::numbers::inv_pi_v<float> * rays.albedo(hit) *
               sample_irradiance(tracer, hit, light, random);
      }
      picture.pixels[pixel] = sum / static_cast<double>(job.spp);
    }
}

}  // namespace

void path_tile(Tracer& tracer, const PictureJob& job, const Tile& tile, Image& picture) noexcept {
  picture_tile(tracer, job, Light::all, tile, picture);
}

void whitted_tile(Tracer& tracer, const PictureJob& job, const Tile& tile, Image& picture) noexcept {
  picture_tile(tracer, job, Light::direct, tile, picture);
}

const IntegratorEntry& find_integrator(std::string_view name) {
  std::string known;
  for (const IntegratorEntry& entry : kIntegrators) {
    if (entry.name == name) return entry;
    known += known.empty() ? "" : ", ";
    known += entry.name;
  }
  throw std::runtime_error(fmt::format("unknown integrator '{}'; the integrators are {}", name, known));
}

}  // namespace icbench
