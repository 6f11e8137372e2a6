#include "render/integrators.h"

#include "core/names.h"
#include "render/irradiance_cache.h"

namespace icbench {
namespace {

class WhittedPass final : public IndirectPass {
 public:
  Light light() const noexcept override { return Light::direct; }
  void begin_frame(const SceneChange&) override {}
  void tile(unsigned, Tracer&, const PrimaryHits& primary, const SampleKey&, const Tile& tile,
            Image& out) noexcept override {
    for_each_pixel(tile, primary.width, [&](std::uint32_t pixel) { out.pixels[pixel] = glm::vec3(0.0f); });
  }
};

class PathPass final : public IndirectPass {
 public:
  Light light() const noexcept override { return Light::all; }
  void begin_frame(const SceneChange&) override {}
  void tile(unsigned, Tracer& tracer, const PrimaryHits& primary, const SampleKey& key, const Tile& tile,
            Image& out) noexcept override {
    const RayTracer& rays = tracer.shared();
    for_each_visible(tile, primary, [&](const Visible& x) {
      glm::vec3 L(0.0f);
      if (reflects(rays, x.hit)) {
        Pcg32 random(x.key(key, Purpose::path));
        L = reflected_radiance(rays, x.hit, sample_irradiance(tracer, x.hit, Light::all, random));
      }
      x.show(out, L);
    });
  }
};

}  // namespace

std::unique_ptr<IndirectPass> make_whitted(const PassSetup&) { return std::make_unique<WhittedPass>(); }

std::unique_ptr<IndirectPass> make_path(const PassSetup&) { return std::make_unique<PathPass>(); }

std::unique_ptr<RecordSource> make_irradiance_cache(const PassSetup& s) {
  if (s.interpolation != Interpolation::split_sphere || s.leak_guard)
    return std::make_unique<ShapedHemisphereSource>(s);
  return std::make_unique<HemisphereSource>(Strata::for_rays(s.gather_rays),
                                            radius_limits(s.rays.scene().bounds),
                                            RecordNames(s.rays.scene(), s.width, s.height));
}

const IntegratorEntry& find_integrator(std::string_view name) {
  return find_named("integrator", name, kIntegrators);
}

}  // namespace icbench
