// Area lights: every emitting triangle, drawn with probability proportional to its power.
//
// Cost: one alias-table look-up per sample whatever the number of triangles (Walker 1977; Vose 1991); the
// density of a point hit by chance follows from its emission alone.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

namespace icbench {

struct Scene;

/// A point on a light.
struct LightPoint {
  glm::vec3 p;         ///< metres
  glm::vec3 n;         ///< unit geometric normal, on the emitting side
  glm::vec3 emission;  ///< W/(m^2 sr)
  float pdf_area;      ///< density with which it is drawn, 1/m^2
};

class LightTable {
 public:
  LightTable() = default;

  /// All emitting triangles of a checked scene, with rigid meshes where they stand at a frame.
  LightTable(const Scene& scene, float frame);

  bool empty() const noexcept { return lights_.empty(); }
  std::size_t size() const noexcept { return lights_.size(); }

  /// Draws a point from three numbers uniform in [0, 1). The table must not be empty.
  LightPoint sample(float u_light, float u1, float u2) const noexcept;

  /// Density, 1/m^2, with which `sample` draws any one point that emits this radiance.
  float pdf_area(const glm::vec3& emission) const noexcept { return power_share(emission) * inverse_power_; }

 private:
  struct Light {
    glm::vec3 p0, e1, e2;
    glm::vec3 n;
    glm::vec3 emission;
    float keep;           // probability of staying with this entry of the alias table
    std::uint32_t alias;  // the entry taken otherwise
  };

  static float power_share(const glm::vec3& emission) noexcept {
    return emission.x + emission.y + emission.z;
  }

  void build_alias_table(const std::vector<double>& powers);

  std::vector<Light> lights_;
  float inverse_power_ = 0.0f;  // 1 / sum of area times power_share
};

}  // namespace icbench
