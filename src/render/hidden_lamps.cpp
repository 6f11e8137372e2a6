#include "render/hidden_lamps.h"

#include <algorithm>
#include <map>

#include "core/random.h"

namespace icbench {

std::optional<HiddenLamps> hidden_lamps(const RayTracer& rays) {
  constexpr std::uint32_t kDraws = 1024;
  const LightTable& lights = rays.scene().lights;
  if (lights.empty()) return std::nullopt;
  Tracer tracer(rays);
  Pcg32 random(1);
  std::map<std::uint32_t, std::uint32_t> met;  // by mesh
  std::uint32_t drawn = 0, hidden = 0;
  for (std::uint32_t i = 0; i < kDraws; ++i) {
    const float u_light = random.uniform(), u1 = random.uniform(), u2 = random.uniform();
    const float v1 = random.uniform(), v2 = random.uniform();
    const EmittedRay start = lights.emit(u_light, u1, u2, v1, v2);
    if (!start.on_surface) continue;
    ++drawn;
    const float reach = 4.0f * rays.epsilon();
    const Hit hit = tracer.intersect({start.p + reach * start.d, 2.0f * reach, -start.d});
    if (hit.missed() || rays.emitted(hit) != glm::vec3(0.0f)) continue;
    ++hidden;
    ++met[hit.mesh];
  }
  if (hidden == 0) return std::nullopt;
  const auto most = std::max_element(met.begin(), met.end(),
                                     [](const auto& a, const auto& b) { return a.second < b.second; });
  return HiddenLamps{static_cast<double>(hidden) / drawn, most->first};
}

}  // namespace icbench
