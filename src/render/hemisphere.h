// What a hemisphere gather saw, cell by cell, and what follows from it besides irradiance: how irradiance changes as
// the point moves and as its normal turns.
//
// Cells are those of Strata: M elevations of equal projected solid angle times N azimuths. The sample of cell (m, n)
// has direction d, meets the first surface at distance t and brings radiance L, so that E = pi / (M N) sum L.
//
//   gradients   Ward & Heckbert 1992, "Irradiance gradients", eqs. 1-3: as the point moves, the borders between cells
//               move, by the nearer of the two surfaces; as the normal turns, cosines change.
//
//   Hessians    of the irradiance of the luminance under translation in the tangent plane. `occlusion_hessian`:
//               Schwarzhaupt, Jensen, Jarosz 2012. The samples' hit points span a surface of patches, each of the
//               radiance of its farthest corner; what a patch sends follows from its edges by Lambert's formula,
//               whose derivatives are known. Corners stay where they are, whereas the outline of a round body moves
//               over it: under a sphere 46 degrees wide the Hessian is off by half. `geometric_hessian` knows nothing
//               of occlusion and of who is bright: it sums magnitudes, with the mean radiance everywhere (after Jarosz,
//               Schoenefeld, Kobbelt, Jensen 2012).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/mat2x2.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "core/types.h"
#include "render/ray_tracer.h"
#include "scene/directions.h"

namespace icbench {

/// Division of the hemisphere; M N rays.
struct Strata {
  std::uint32_t elevations;  ///< M
  std::uint32_t azimuths;    ///< N

  /// M N as close to `rays` as M within 30 % of sqrt(rays / pi) allows: exact for 4, 16, 64, 256, 1024. At
  /// least 1.
  static Strata for_rays(std::uint32_t rays) noexcept;

  std::uint32_t count() const noexcept { return elevations * azimuths; }
};

/// Luminance of linear RGB (Rec. 709), in the unit of `E`.
inline float luminance(const glm::vec3& E) noexcept { return 0.2126f * E.x + 0.7152f * E.y + 0.0722f * E.z; }

/// One cell's sample. Nothing met: t is infinite and L is 0.
struct HemisphereSample {
  glm::vec3 d;        ///< unit direction
  float t;            ///< distance, metres
  glm::vec3 L{0.0f};  ///< radiance, W/(m^2 sr)
  glm::vec3 ng;       ///< unit geometric normal of the surface met, of either side
};

/// The gradient of each channel of irradiance.
struct IrradianceGradients {
  std::array<glm::vec3, 3> translational{};  ///< W/m^3 in the tangent plane; 0 along the normal
  std::array<glm::vec3, 3> rotational{};     ///< W/(m^2 rad), by axis of rotation, in the tangent plane
};

/// The samples of one gather. Sample of cell (m, n): samples[m N + n].
struct Hemisphere {
  Strata strata{};
  Basis basis{glm::vec3(0, 0, 1)};
  std::vector<HemisphereSample> samples;
  Irradiance apart{
      0.0f};  ///< by lamps seen in mirrors and behind glass, W/m^2 (FocusedLight, render/gather.h)

  const HemisphereSample& at(std::uint32_t m, std::uint32_t n) const noexcept {
    return samples[static_cast<std::size_t>(m) * strata.azimuths + n];
  }
};

/// Relative standard error of the irradiance of the luminance up to which its derivatives mean something.
inline constexpr double kMostErrorOfLight = 0.15;

/// Whether the cells tell irradiance that well. Where a few of them found all the light, records that found none would,
/// by their derivatives, reach farthest and those that were lucky least, and pictures be too dark: with 256 rays by up
/// to 84 % in rooms lit by a small patch or through a slit (bench/TRIED.md).
bool is_light_known(const Hemisphere& seen) noexcept;

/// Ward & Heckbert's gradients. Finite: distances count as `near` at least (metres, > 0).
IrradianceGradients gradients_of(const Hemisphere& seen, float near) noexcept;

/// Fewest cells of which Hessians can be told: with fewer they are noise alone. As many as Radiance's 7 divisions a
/// side.
inline constexpr std::uint32_t kLeastCellsForHessian = 49;

/// Second derivatives of the irradiance of the luminance, W/m^4, along the axes x and y of the basis; symmetric,
/// finite. Distances count as `near` at least.
glm::mat2 occlusion_hessian(const Hemisphere& seen, float near) noexcept;

/// The same by geometry alone: positive semidefinite.
glm::mat2 geometric_hessian(const Hemisphere& seen, float near) noexcept;

/// That over the irradiance, 1/m^2: it does not depend on what light the samples found.
glm::mat2 relative_geometric_hessian(const Hemisphere& seen, float near) noexcept;

/// What the surfaces that are near say of how far light stays as it is.
struct NearSurfaces {
  /// Sum of (n_g . u) (n_g . u)^T / t over the cells, along the axes of the basis: how much what is near faces each
  /// direction of the tangent plane. Symmetric, positive semidefinite, finite.
  glm::mat2 facing{0.0f};
  /// Harmonic mean of distances by the radiance of each, metres; infinite in the dark.
  float distance_of_light;
};

/// Distances count as `near` at least (metres, > 0).
NearSurfaces near_surfaces(const Hemisphere& seen, float near) noexcept;

/// Magnitudes of the eigenvalues, the larger first, and the direction that goes with it, for a symmetric matrix.
struct Eigen2 {
  float large, small;
  glm::vec2 axis;  ///< unit
};
Eigen2 magnitudes_of(const glm::mat2& symmetric) noexcept;

}  // namespace icbench
