#include "render/primary.h"

#include <array>
#include <utility>

#include "render/specular.h"

namespace icbench {
namespace {

// A ray on its way through the tree of a pixel.
struct Branch {
  Ray ray;
  glm::vec3 weight;
  std::uint32_t depth;  // specular bounces so far
};

float importance(const glm::vec3& weight) noexcept { return std::max({weight.x, weight.y, weight.z}); }

// Branches that wait to be followed: depth first, so that at most one waits per level and a last one.
class Branches {
 public:
  std::uint32_t size() const noexcept { return size_; }
  Branch pop() noexcept { return items_[--size_]; }

  // Unless roulette drops it.
  void push(Branch branch, Pcg32& random) noexcept {
    const float w = importance(branch.weight);
    if (!(w > 0.0f)) return;
    if (w < kMinWeight) {
      if (!(random.uniform() * kMinWeight < w)) return;
      branch.weight *= kMinWeight / w;
    }
    items_[size_++] = branch;
  }

 private:
  std::array<Branch, kSplitDepth + 1> items_;
  std::uint32_t size_ = 0;
};

bool shows_anything(const RayTracer& rays, const Hit& hit) noexcept {
  return reflects(rays, hit) || rays.emitted(hit) != glm::vec3(0.0f);
}

}  // namespace

PrimaryHits::PrimaryHits(const Scene& scene, int w, int h)
    : width(w), height(h), hits(static_cast<std::size_t>(w) * static_cast<std::size_t>(h)) {
  if (!scene.has_specular()) return;
  weights.resize(hits.size());
  extra.resize(hits.size());
  through.resize(hits.size());
}

std::uint32_t PrimaryHits::layers() const noexcept {
  std::size_t most = 0;
  for (const auto& of_pixel : extra) most = std::max(most, of_pixel.size());
  return static_cast<std::uint32_t>(1 + most);
}

std::size_t PrimaryHits::count() const noexcept {
  std::size_t sum = hits.size();
  for (const auto& of_pixel : extra) sum += of_pixel.size();
  return sum;
}

Ray jittered_ray(const CameraView& view, int x, int y, Pcg32& random) noexcept {
  const float u = random.uniform(), v = random.uniform();
  return view.ray(static_cast<float>(x) + u, static_cast<float>(y) + v);
}

Hit primary_hit(Tracer& tracer, const CameraView& view, Lens lens, const SampleKey& key, int x, int y,
                std::uint32_t pixel) noexcept {
  if (lens == Lens::centre)
    return tracer.intersect(view.ray(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f));
  Pcg32 random(key.of_pixel(pixel, Purpose::lens));
  return tracer.intersect(jittered_ray(view, x, y, random));
}

bool trace_visible(Tracer& tracer, const Ray& ray, Pcg32& random, std::vector<WeightedHit>& out) noexcept {
  const RayTracer& rays = tracer.shared();
  bool is_through = false;
  out.clear();
  Branches branches;
  branches.push({ray, glm::vec3(1.0f), 0}, random);
  while (branches.size() > 0) {
    Branch at = branches.pop();
    const Hit hit = tracer.intersect(at.ray);
    if (hit.missed()) continue;
    const Material& material = rays.material(hit);
    if (!material.is_specular()) {
      if (at.depth == 0 || shows_anything(rays, hit)) out.push_back({hit, at.weight});
      continue;
    }
    is_through = true;
    // Every waiting branch ends in one leaf at most, and splitting makes one more of them.
    const bool may_split = at.depth < kSplitDepth && out.size() + branches.size() + 2 <= kMaxVisible;
    if (material.surface == Surface::dielectric && may_split) {
      const SpecularSplit split = split_specular(material, hit, at.ray.d);
      const glm::vec3 weight = at.weight * rays.albedo(hit);
      const glm::vec3 through = (1.0f - split.reflectance) * split.through_factor * weight;
      branches.push({reflected_ray(rays, hit, split), split.reflectance * weight, at.depth + 1}, random);
      branches.push({refracted_ray(rays, hit, split), through, at.depth + 1}, random);
    } else if (scatter_specular(rays, hit, at.ray.d, at.depth, random, at.weight, at.ray)) {
      ++at.depth;
      branches.push(at, random);
    }
  }
  return is_through;
}

void primary_tile(Tracer& tracer, const CameraView& view, Lens lens, const SampleKey& key, const Tile& tile,
                  PrimaryHits& out) noexcept {
  int x = tile.x0, y = tile.y0;
  const auto each = [&](auto&& f) {
    for_each_pixel(tile, out.width, [&](std::uint32_t pixel) {
      f(pixel);
      if (++x == tile.x1) {
        x = tile.x0;
        ++y;
      }
    });
  };
  if (out.is_plain()) {
    each([&](std::uint32_t pixel) { out.hits[pixel] = primary_hit(tracer, view, lens, key, x, y, pixel); });
    return;
  }
  std::vector<WeightedHit> seen;
  each([&](std::uint32_t pixel) {
    // Through the centre, the same branches are taken for every sample and frame.
    Pcg32 random((lens == Lens::jittered ? key : SampleKey{}).of_pixel(pixel, Purpose::lens));
    const Ray ray = lens == Lens::jittered
                        ? jittered_ray(view, x, y, random)
                        : view.ray(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f);
    out.through[pixel] = trace_visible(tracer, ray, random, seen);
    if (seen.empty()) {
      out.hits[pixel] = missed_hit();
      out.weights[pixel] = glm::vec3(0.0f);
      out.extra[pixel].clear();
      return;
    }
    const auto main =
        std::max_element(seen.begin(), seen.end(), [](const WeightedHit& a, const WeightedHit& b) {
          return importance(a.weight) < importance(b.weight);
        });
    std::swap(*main, seen.front());
    out.hits[pixel] = seen.front().hit;
    out.weights[pixel] = seen.front().weight;
    out.extra[pixel].assign(seen.begin() + 1, seen.end());
  });
}

}  // namespace icbench
