// The lights of a scene: every emitting triangle and every point light, drawn with probability proportional to its
// power.
//
// Cost: one alias-table look-up per sample whatever the number of lights (Walker 1977; Vose 1991); the density of a
// point on an area light hit by chance follows from its emission alone.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <limits>
#include <vector>

namespace icbench {

struct Scene;

/// A light without extent, or a spot light.
struct PointLight {
  glm::vec3 p{0.0f};                  ///< metres
  glm::vec3 intensity{0.0f};          ///< along the axis of a spot light, RGB >= 0, W/sr
  glm::vec3 axis{0.0f, -1.0f, 0.0f};  ///< unit
  float cos_inner = -1.0f;            ///< full intensity where the cosine to the axis is at least this
  float cos_outer = -1.0f;            ///< none below this, smooth between; -1 both: shines everywhere

  bool operator==(const PointLight&) const = default;
};

/// A point on a light.
struct LightPoint {
  glm::vec3 p;         ///< metres
  glm::vec3 n;         ///< unit geometric normal, on the emitting side; a point light's axis
  glm::vec3 emission;  ///< W/(m^2 sr); of a point light its intensity along the axis, W/sr
  float pdf_area;      ///< density with which it is drawn, 1/m^2; of a point light its probability
  const PointLight* point = nullptr;  ///< the point light, which no ray can meet; null on an area light
};

/// The start of a light path.
struct EmittedRay {
  glm::vec3 p;  ///< on the light, metres
  glm::vec3 n;  ///< unit geometric normal, on the emitting side; of a point light the direction itself
  glm::vec3 d;  ///< unit direction
  /// Flux it carries over the density of drawing it, W: the mean over draws is the total flux, less what a light far
  /// away sends past the scene.
  glm::vec3 power;
  bool on_surface;  ///< false: it starts at a point light, which no ray meets
};

/// Share of its axial intensity that a light sends in a direction, in [0, 1]: 1 inside the inner cone, 0 outside the
/// outer one, between them a smooth step of the cosine. Not finite cosines count as -1.
float spot_falloff(const PointLight& light, float cosine) noexcept;

class LightTable {
 public:
  LightTable() = default;

  /// All lights of a checked scene that emit anything, with rigid meshes where they stand at a frame.
  LightTable(const Scene& scene, float frame);

  bool empty() const noexcept { return table_.size() == 0; }
  std::size_t size() const noexcept { return table_.size(); }  ///< triangles and point lights

  /// Draws a point from three numbers uniform in [0, 1). The table must not be empty. The result refers to the table.
  LightPoint sample(float u_light, float u1, float u2) const noexcept;

  /// Density, 1/m^2, with which `sample` draws any one point of an area light that emits this radiance.
  float pdf_area(const glm::vec3& emission) const noexcept {
    return channel_sum(emission) * table_.inverse_power();
  }

  /// Draws the start of a light path from five numbers uniform in [0, 1): the light, two for the point, two for the
  /// direction. The direction has the light's own distribution, of a point light far away within the cone that holds
  /// the scene, and lights are drawn by what they send that way, so that all of a colour carry the same power. The table
  /// must not be empty.
  EmittedRay emit(float u_light, float u1, float u2, float v1, float v2) const noexcept;

  /// Which of its directions a point light sends light paths in: a cone around `axis`, or all.
  struct Aim {
    glm::vec3 axis{0.0f};
    float versine = 0.0f;  ///< 1 - cosine of the cone's half angle; 0: all
    float share = 1.0f;    ///< of the light's flux
  };

 private:
  struct AreaLight {
    glm::vec3 p0, e1, e2;
    glm::vec3 n;
    glm::vec3 emission;
  };
  /// Draws lights by their powers.
  class AliasTable {
   public:
    AliasTable() = default;
    explicit AliasTable(const std::vector<double>& powers);

    std::size_t size() const noexcept { return entries_.size(); }
    /// 1 / sum of powers, in units of pi W: area times radiance.
    float inverse_power() const noexcept { return inverse_power_; }
    std::size_t draw(float u_light, float u1, float u2) const noexcept;

   private:
    struct Entry {
      float keep;           // probability of staying with this entry
      std::uint32_t alias;  // the entry taken otherwise
    };
    std::vector<Entry> entries_;
    float inverse_power_ = 0.0f;
  };

  // Finite.
  static float channel_sum(const glm::vec3& rgb) noexcept {
    return std::min(rgb.x + rgb.y + rgb.z, std::numeric_limits<float>::max());
  }

  LightPoint point_on(std::size_t which, float u1, float u2) const noexcept;

  AliasTable table_;        // of the area lights, then the point lights
  AliasTable aimed_table_;  // the same by what goes to the scene, if some lights aim at it
  std::vector<AreaLight> areas_;
  std::vector<PointLight> points_;
  std::vector<Aim> aims_;  // of each
};

}  // namespace icbench
