#include "render/instant_gi.h"

#include "render/instant_caching.h"
#include "render/integrators.h"

namespace icbench {
namespace {

class InstantGiPass final : public IndirectPass {
 public:
  explicit InstantGiPass(const PassSetup& s)
      : crew_(s.crew), vpls_(s.rays, {s.vpls, s.seed, s.vpl_paths}), shading_(shading_of(vpls_)) {}

  void begin_frame(const SceneChange&) override { retrace_all(vpls_, crew_); }

  void tile(unsigned, Tracer& tracer, const PrimaryHits& primary, const SampleKey&, const Tile& tile,
            Image& out) noexcept override {
    instant_gi_tile(tracer, primary, vpls_.vpls(), shading_, tile, out);
  }

  PassFigures figures() const override {
    PassFigures figures;
    figures.light_paths = figures.light_paths_retraced = vpls_.paths();
    figures.vpls_in_use = vpls_.count();
    return figures;
  }

 private:
  Crew& crew_;
  VplSet vpls_;
  VplShading shading_;
};

}  // namespace

VplShading shading_of(const VplSet& set) noexcept {
  return {.clamp = vpl_clamp(set.rays().scene().bounds), .key = compensation_key(set.seed())};
}

Irradiance instant_irradiance(Tracer& tracer, const Hit& hit, const VplArrays& some, const VplArrays& all,
                              const VplShading& shading) noexcept {
  return gather_vpls(tracer, hit, some, shading.clamp, Packing::fast) +
         compensate(tracer, hit, all, shading.clamp, shading.compensation, shading.key, Packing::fast).E;
}

void instant_gi_tile(Tracer& tracer, const PrimaryHits& primary, const VplArrays& vpls,
                     const VplShading& shading, const Tile& tile, Image& indirect) noexcept {
  const RayTracer& rays = tracer.shared();
  for_each_visible(tile, primary, [&](const Visible& x) {
    glm::vec3 L(0.0f);
    if (reflects(rays, x.hit))
      L = reflected_radiance(rays, x.hit, instant_irradiance(tracer, x.hit, vpls, vpls, shading));
    x.show(indirect, L);
  });
}

void retrace_all(VplSet& set, Crew& crew) {
  VplUpdate update(set);
  update_vpls(update, crew);
}

std::unique_ptr<IndirectPass> make_instant_gi(const PassSetup& setup) {
  return std::make_unique<InstantGiPass>(setup);
}

}  // namespace icbench
