// Less noise in what gradients and Hessians are taken from.
//
// Both add up differences between neighbouring cells of a gather, each of them one path's radiance: much of such a
// difference is noise, and the magnitudes of eigenvalues, which set radii, only grow by that. Cells that met the same
// surface in like directions see like radiance, so each takes the mean of those around it; where surfaces end, which is
// what the derivatives tell of, nothing is mixed, but for surfaces seen at such a slant that distances vary from cell
// to cell as much as from one surface to the next. Irradiance itself does not pass through here.
#pragma once

#include <cstdint>
#include <vector>

#include "render/hemisphere.h"

namespace icbench {

class RadianceSmoother {
 public:
  static constexpr std::uint32_t kRadius = 2;    ///< cells, to all sides
  static constexpr float kLikeDistance = 0.35f;  ///< of the nearer one, that distances may differ by
  static constexpr float kLikeNormals = 0.8f;    ///< least cosine between normals

  /// Replaces the radiance of every cell by the mean over those within kRadius elevations and azimuths whose samples
  /// seem to be of the same surface; itself is always one of them. Keeps its memory from call to call; out of memory
  /// ends the program.
  void operator()(Hemisphere& seen) noexcept;

 private:
  // A row for each elevation, continued by kRadius cells at either end, since azimuths go round.
  struct Rows {
    std::vector<float> t, nx, ny, nz, red, green, blue;
  };
  struct Sums {  // of one elevation
    std::vector<float> red, green, blue, cells;
  };

  Rows rows_;
  Sums sums_;
};

}  // namespace icbench
