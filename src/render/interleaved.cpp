#include "render/interleaved.h"

#include <algorithm>
#include <glm/geometric.hpp>
#include <iterator>

#include "render/integrators.h"
#include "render/irradiance_cache.h"
#include "render/tiles.h"

namespace icbench {
namespace {

// What lies on one smooth surface: normals within 37 degrees, points no farther out of each other's tangent planes than
// three tenths of their distance, and that no more than a twentieth of the scene.
constexpr float kSameNormal = 0.8f, kSamePlane = 0.3f, kNear = 0.05f;

bool one_surface(const Hit& a, const Hit& b, float near2) noexcept {
  const glm::vec3 d = b.p - a.p;
  const float d2 = glm::dot(d, d), out_a = glm::dot(d, a.n), out_b = glm::dot(d, b.n);
  return glm::dot(a.n, b.n) > kSameNormal && d2 <= near2 &&
         std::max(out_a * out_a, out_b * out_b) <= kSamePlane * kSamePlane * d2;
}

class InterleavedPass final : public IndirectPass {
 public:
  explicit InterleavedPass(const PassSetup& s)
      : rays_(s.rays),
        crew_(s.crew),
        vpls_(s.rays, {s.vpls, s.seed, s.vpl_paths}),
        groups_(vpls_, kInterleave),
        shading_(shading_of(vpls_)),
        tiles_(make_tiles(s.width, s.height, 32, TileOrder::scanline)),
        E_(static_cast<std::size_t>(s.width) * static_cast<std::size_t>(s.height)) {}

  void begin_frame(const SceneChange&) override {
    retrace_all(vpls_, crew_);
    groups_ = VplGroups(vpls_, kInterleave);
  }

  void tile(unsigned, Tracer& tracer, const PrimaryHits& primary, const SampleKey&, const Tile& tile,
            Image& out) noexcept override {
    interleaved_tile(tracer, primary, vpls_.vpls(), groups_, shading_, tile, E_, out);
  }

  void end_sample(const PrimaryHits& primary, Image& out) override {
    const Bounds& box = rays_.scene().bounds;
    const float diagonal = glm::length(box.upper - box.lower);
    crew_.for_each(tiles_.size(), 1, [&](unsigned, Tracer&, std::size_t i) {
      filter_tile(rays_, primary, E_, kInterleave, diagonal, tiles_[i], out);
    });
  }

  PassFigures figures() const override {
    PassFigures figures;
    figures.light_paths = figures.light_paths_retraced = vpls_.paths();
    figures.vpls_in_use = vpls_.count();
    return figures;
  }

 private:
  const RayTracer& rays_;
  Crew& crew_;
  VplSet vpls_;
  VplGroups groups_;
  VplShading shading_;
  std::vector<Tile> tiles_;
  std::vector<Irradiance> E_;
};

}  // namespace

VplGroups::VplGroups(const VplSet& set, std::uint32_t n) : n_(n) {
  const std::uint32_t paths = set.paths(), count = std::min(n * n, paths);
  for (std::uint32_t k = 0; k < count; ++k) {
    const auto first = static_cast<std::uint32_t>(std::uint64_t{paths} * k / count);
    const auto end = static_cast<std::uint32_t>(std::uint64_t{paths} * (k + 1) / count);
    shares_.push_back(static_cast<float>(end - first) / static_cast<float>(paths));
    std::vector<std::uint32_t> slots;
    for (std::uint32_t path = first; path < end; ++path)
      std::ranges::copy_if(set.slots(path), std::back_inserter(slots),
                           [](std::uint32_t slot) { return slot != kNoSlot; });
    std::sort(slots.begin(), slots.end());
    VplArrays& group = groups_.emplace_back(slots.size());
    const float scale = count == 1 ? 1.0f : 1.0f / shares_.back();
    for (std::size_t i = 0; i < slots.size(); ++i) {
      const Vpl vpl = set.vpls()[slots[i]];
      group.set(i, {vpl.p, vpl.n, scale * vpl.flux});
    }
  }
}

void interleaved_tile(Tracer& tracer, const PrimaryHits& primary, const VplArrays& all,
                      const VplGroups& groups, const VplShading& shading, const Tile& tile,
                      std::vector<Irradiance>& E, Image& indirect) noexcept {
  const RayTracer& rays = tracer.shared();
  for_each_visible(tile, primary, [&](const Visible& x) {
    const bool lit = reflects(rays, x.hit);
    if (x.layer == 0) {
      const VplArrays& some = groups.of_pixel(x.pixel, primary.width);
      E[x.pixel] = lit ? instant_irradiance(tracer, x.hit, some, all, shading) : glm::vec3(0.0f);
      x.show(indirect, glm::vec3(0.0f));
    } else if (lit) {
      x.show(indirect, reflected_radiance(rays, x.hit, instant_irradiance(tracer, x.hit, all, all, shading)));
    }
  });
}

void filter_tile(const RayTracer& rays, const PrimaryHits& primary, const std::vector<Irradiance>& E,
                 std::uint32_t n, float diagonal, const Tile& tile, Image& indirect) noexcept {
  const int half = static_cast<int>(n / 2), w = primary.width, h = primary.height;
  const auto index = [w](int x, int y) {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(w) + static_cast<std::size_t>(x);
  };
  const float near2 = kNear * kNear * diagonal * diagonal;
  for (int y = tile.y0; y < tile.y1; ++y)
    for (int x = tile.x0; x < tile.x1; ++x) {
      const std::size_t pixel = index(x, y);
      const Hit& hit = primary.hits[pixel];
      if (!reflects(rays, hit)) continue;
      glm::vec3 sum = E[pixel];
      float count = 1.0f;
      for (int j = std::max(0, y - half); j <= std::min(h - 1, y + half); ++j)
        for (int i = std::max(0, x - half); i <= std::min(w - 1, x + half); ++i) {
          const std::size_t other = index(i, j);
          if (other == pixel || !reflects(rays, primary.hits[other]) ||
              !one_surface(hit, primary.hits[other], near2))
            continue;
          sum += E[other];
          count += 1.0f;
        }
      const glm::vec3 weight = primary.is_plain() ? glm::vec3(1.0f) : primary.weights[pixel];
      indirect.pixels[pixel] += weight * reflected_radiance(rays, hit, sum / count);
    }
}

std::unique_ptr<IndirectPass> make_instant_gi_interleaved(const PassSetup& setup) {
  return std::make_unique<InterleavedPass>(setup);
}

}  // namespace icbench
