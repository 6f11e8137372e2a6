#include "scene/lights.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numeric>

#include "scene/scene.h"

namespace icbench {

LightTable::LightTable(const Scene& scene, float frame) {
  std::vector<double> powers;
  for (std::size_t i = 0; i < scene.meshes.size(); ++i) {
    const Material& material = scene.materials[scene.meshes[i].material];
    if (!material.emits()) continue;
    const Mesh& mesh = scene.shape(i);
    const Pose pose = scene.meshes[i].pose ? scene.meshes[i].pose(frame) : Pose{};
    for (const glm::uvec3& t : mesh.triangles) {
      const glm::vec3 p0 = pose(mesh.positions[t.x]);
      const glm::vec3 e1 = pose(mesh.positions[t.y]) - p0;
      const glm::vec3 e2 = pose(mesh.positions[t.z]) - p0;
      const glm::vec3 cross = glm::cross(e1, e2);
      const float length = glm::length(cross);
      lights_.push_back({p0, e1, e2, cross / length, material.emission, 1.0f, 0});
      powers.push_back(0.5 * length * power_share(material.emission));
    }
  }
  if (!lights_.empty()) build_alias_table(powers);
}

void LightTable::build_alias_table(const std::vector<double>& powers) {
  const double total = std::accumulate(powers.begin(), powers.end(), 0.0);
  inverse_power_ = static_cast<float>(1.0 / total);
  std::vector<double> share(powers.size());  // 1 is the average
  std::vector<std::uint32_t> below, above;
  for (std::uint32_t i = 0; i < share.size(); ++i) {
    share[i] = powers[i] / total * static_cast<double>(powers.size());
    lights_[i].alias = i;
    (share[i] < 1.0 ? below : above).push_back(i);
  }
  while (!below.empty() && !above.empty()) {
    const std::uint32_t small = below.back(), large = above.back();
    below.pop_back();
    lights_[small].keep = static_cast<float>(share[small]);
    lights_[small].alias = large;
    share[large] -= 1.0 - share[small];
    if (share[large] < 1.0) {
      above.pop_back();
      below.push_back(large);
    }
  }  // what is left on either side has share 1 up to rounding and keeps itself
}

LightPoint LightTable::sample(float u_light, float u1, float u2) const noexcept {
  // In double: 24 random bits times the table size leave too few bits for the fraction in float.
  const double scaled = static_cast<double>(u_light) * static_cast<double>(lights_.size());
  const auto entry = std::min(static_cast<std::size_t>(scaled), lights_.size() - 1);
  const bool keep = scaled - static_cast<double>(entry) < static_cast<double>(lights_[entry].keep);
  const Light& light = keep ? lights_[entry] : lights_[lights_[entry].alias];
  const float root = std::sqrt(u1);
  const glm::vec3 p = light.p0 + (root * (1.0f - u2)) * light.e1 + (root * u2) * light.e2;
  return {p, light.n, light.emission, pdf_area(light.emission)};
}

}  // namespace icbench
