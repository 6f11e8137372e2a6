#include "render/instant_gi.h"

#include "render/instant_caching.h"
#include "render/integrators.h"

namespace icbench {
namespace {

class InstantGiPass final : public IndirectPass {
 public:
  explicit InstantGiPass(const PassSetup& s)
      : crew_(s.crew), vpls_(s.rays, {s.vpls, s.seed}), shading_{vpl_clamp(s.rays.scene().bounds)} {}

  void begin_frame(const SceneChange&) override { retrace_all(vpls_, crew_); }

  void tile(unsigned, Tracer& tracer, const PrimaryHits& primary, const SampleKey& key, const Tile& tile,
            Image& out) noexcept override {
    instant_gi_tile(tracer, primary, vpls_.vpls(), shading_, key, tile, out);
  }

  PassFigures figures() const override {
    PassFigures figures;
    figures.light_paths = figures.light_paths_retraced = vpls_.paths();
    return figures;
  }

 private:
  Crew& crew_;
  VplSet vpls_;
  VplShading shading_;
};

}  // namespace

Irradiance instant_irradiance(Tracer& tracer, const Visible& x, const VplArrays& vpls,
                              const VplShading& shading, const SampleKey& key) noexcept {
  return gather_vpls(tracer, x.hit, vpls, shading.clamp, Packing::fast) +
         compensate(tracer, x.hit, vpls, shading.clamp, shading.compensation, x.key(key, Purpose::gather),
                    Packing::fast)
             .E;
}

void instant_gi_tile(Tracer& tracer, const PrimaryHits& primary, const VplArrays& vpls,
                     const VplShading& shading, const SampleKey& key, const Tile& tile,
                     Image& indirect) noexcept {
  const RayTracer& rays = tracer.shared();
  for_each_visible(tile, primary, [&](const Visible& x) {
    glm::vec3 L(0.0f);
    if (reflects(rays, x.hit))
      L = reflected_radiance(rays, x.hit, instant_irradiance(tracer, x, vpls, shading, key));
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
