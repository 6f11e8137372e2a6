#include "render/integrators.h"

#include <fmt/format.h>

#include <numbers>
#include <stdexcept>
#include <string>
#include <vector>

#include "render/path.h"
#include "render/primary.h"
#include "render/specular.h"

namespace icbench {
namespace {

// Calls f(key, ray, its random numbers, pixel, sum) for every sample of every pixel; f adds to the sum of the pixel.
template <class F>
void picture_tile(const PictureJob& job, const Tile& tile, Image& picture, F&& f) noexcept {
  for (int y = tile.y0; y < tile.y1; ++y)
    for (int x = tile.x0; x < tile.x1; ++x) {
      const auto pixel = static_cast<std::uint32_t>(y) * static_cast<std::uint32_t>(picture.width) +
                         static_cast<std::uint32_t>(x);
      glm::dvec3 sum(0.0);
      for (std::uint32_t s = 0; s < job.spp; ++s) {
        const SampleKey key = job.key.next_sample(s);
        Pcg32 random(key.of_pixel(pixel, Purpose::lens));
        const Ray ray = jittered_ray(job.view, x, y, random);
        f(key, ray, random, pixel, sum);
      }
      picture.pixels[pixel] = sum / static_cast<double>(job.spp);
    }
}

}  // namespace

void path_tile(Tracer& tracer, const PictureJob& job, const Tile& tile, Image& picture) noexcept {
  const RayTracer& rays = tracer.shared();
  picture_tile(job, tile, picture,
               [&](const SampleKey& key, Ray ray, Pcg32&, std::uint32_t pixel, glm::dvec3& sum) {
                 Pcg32 random(key.of_pixel(pixel, Purpose::path));
                 glm::vec3 weight(1.0f);
                 std::uint32_t bounces;
                 const Hit hit = intersect_beyond_specular(tracer, ray, random, weight, bounces);
                 sum += weight * rays.emitted(hit);
                 if (reflects(rays, hit))
                   sum += weight * (std::numbers::inv_pi_v<float> * rays.albedo(hit)) *
                          sample_irradiance(tracer, hit, Light::all, random);
               });
}

void whitted_tile(Tracer& tracer, const PictureJob& job, const Tile& tile, Image& picture) noexcept {
  const RayTracer& rays = tracer.shared();
  std::vector<WeightedHit> seen;
  picture_tile(
      job, tile, picture,
      [&](const SampleKey& key, const Ray& ray, Pcg32& random, std::uint32_t pixel, glm::dvec3& sum) {
        trace_visible(tracer, ray, random, seen);
        std::uint32_t layer = 0;
        for (const WeightedHit& s : seen) {
          const Visible x{s.hit, s.weight, pixel, layer++};
          sum += x.weight * rays.emitted(x.hit);
          if (!reflects(rays, x.hit)) continue;
          Pcg32 of_hit(x.key(key, Purpose::path));
          sum += x.weight * (std::numbers::inv_pi_v<float> * rays.albedo(x.hit)) *
                 sample_irradiance(tracer, x.hit, Light::direct, of_hit);
        }
      });
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
