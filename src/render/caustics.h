// Where mirrors and glass focus the light of lamps: caustics, found by light particles (Jensen 1996).
//
// What a record sees tells how light changes beside it, but for light that comes straight from a lamp by way of a
// specular surface: a step aside a lens may show nothing but the lamp, and from the dark around a caustic no ray finds
// it. A record there that was valid across the caustic would put it out. So particles are sent from the lamps, those
// that meet a specular surface first are followed to the first diffuse one, and where they land close together a record
// of less light than they bring is valid up to there at most. Where a record is, they also stand for such light in what
// decides its reach, instead of what its own rays find by chance: or luck would make the bright records small. They
// only limit distances: what light a record has is what its own rays find, hence nothing is counted twice, and what
// the particles miss costs accuracy, not light.
//
// Scenes without specular surfaces send none. Costs with them: kParticles light paths whenever light changes, 32 bytes
// for each that lands, two passes over these per record. Point lights send none, for no ray of a record meets them.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "render/crew.h"
#include "render/ray_tracer.h"

namespace icbench {

class Caustics {
 public:
  static constexpr std::uint32_t kParticles = 1u << 14;

  /// Finds those of the scene as it stands; the same for any number of threads. Quiescent.
  void find(const RayTracer& rays, Crew& crew, std::uint64_t seed);

  /// Distance from p to the nearest place that faces about as `n` (unit) and gets more than `irradiance` (luminance,
  /// W/m^2) from a caustic, metres; infinite if there is none. Called by many threads at once.
  float distance_to_brighter(const glm::vec3& p, const glm::vec3& n, float irradiance) const noexcept;

  /// Irradiance by caustics at p on a surface that faces as `n`, luminance, W/m^2: by the nearest particles, hence to
  /// 38 % at best, but of random numbers of its own. Called by many threads at once.
  float irradiance_at(const glm::vec3& p, const glm::vec3& n) const noexcept;

  std::size_t count() const noexcept { return landings_.size(); }  ///< particles that landed

 private:
  struct Landing {
    glm::vec3 p{0.0f}, n{0.0f};
    float flux = 0.0f;        // of the particle, luminance, W
    float irradiance = 0.0f;  // there, of all particles, luminance, W/m^2
  };

  void land(const RayTracer& rays, Crew& crew, std::uint64_t seed);

  std::vector<Landing> landings_;  // the brightest first
};

}  // namespace icbench
