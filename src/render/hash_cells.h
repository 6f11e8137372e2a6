// Hash cells: radiance shared through a spatial hash, as renderers on graphics processors do it now (Binder, Fricke,
// Keller, "Massively Parallel Path Space Filtering", arXiv:1902.05942, 2019; Gautron, "Real-Time Ray-Traced Ambient
// Occlusion of Complex Scenes using Spatial Hashing", SIGGRAPH Talks 2020). The rival of interpolation: no radius, no
// validity, no search; what falls into one cell is one.
//
// Every visible point traces paths of its own (sample_irradiance, unbiased) and adds their mean to the cell that its
// quantised position and normal name; then it takes the mean of its cell. Within a cell the sum of irradiance is kept,
// so what the method loses is detail finer than a cell, not light. A cell's edge is a power of two, as near below the
// wanted size in pixels as there is, and so is finer near the eye. The grid is shifted at random with each sample of
// the pixels, and every point is displaced at random in its tangent plane before it is quantised: what would be edges
// of cells becomes noise.
//
// Accumulators are fixed-point integers. Their sum does not depend on the order of additions, so a picture is bit for
// bit the same for any number of threads: the table has room for all that is seen, unless it is given a size (below),
// and then as long as no point was refused. The scale is chosen for
// each sample of the pixels from its largest value and its number of points n:
//     n (max + 1/2 unit) < 2^62 + 2^61 < 2^63     with unit = 2^-k and n max 2^k < 2^62,
// so no sum overflows; a value is rounded by max n 2^-62 at most, 2^-42 of the brightest for a million points.
//
// The table: open addressing with linear probing. A cell is claimed by one CAS on its fingerprint and never given up
// before the sweep, which is quiescent; there is no lock, and no allocation but in begin_sample, for images that show
// mirrors or glass. Who finds no room within kMaxProbes places keeps its own sample. Finding a cell takes kMaxProbes
// loads and as many CAS at most, adding to it four fetch_adds: wait-free.
//
// Cells are told apart by 64 bits of hash alone: among m of them two are taken for one with probability m^2 / 2^65,
// 3e-8 for a million.
//
// Cost beside the paths: one cache line per cell; some 50 ns per point.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>

#include "core/sync.h"
#include "render/indirect_pass.h"

namespace icbench {

/// What the points of a cell brought.
struct CellSum {
  std::int64_t r = 0, g = 0, b = 0;  ///< in units of the scale
  std::uint64_t points = 0;
};

class CellTable {
 public:
  static constexpr std::uint32_t kNone = ~std::uint32_t{0};
  static constexpr std::uint32_t kMaxProbes = 256;

  struct Found {
    std::uint32_t cell;  ///< or kNone: no room
    bool is_new;         ///< claimed by this call
  };

  /// Room for `cells` cells, rounded up to a power of two; all memory is taken here, 64 bytes a cell.
  explicit CellTable(std::size_t cells);

  std::size_t size() const noexcept { return mask_ + 1; }

  /// The cell of a fingerprint (not 0), claimed if it is nobody's. From many threads at once; linearizes at the load or
  /// the CAS that shows the fingerprint.
  Found find_or_claim(std::uint64_t fingerprint) noexcept;

  /// Adds a point to a cell. From many threads at once.
  void add(std::uint32_t cell, const CellSum& point) noexcept;

  /// All that was added. Quiescent: what was added must have happened before, as it has after Crew::run.
  CellSum sum(std::uint32_t cell) const noexcept;

  /// Makes a cell nobody's. Quiescent but for other calls of sweep, of the same cell too. All cells go together: one
  /// that stays may no longer be found.
  void sweep(std::uint32_t cell) noexcept;

 private:
  struct alignas(64) Cell {
    std::atomic<std::uint64_t> fingerprint{0};  ///< 0: nobody's
    std::atomic<std::int64_t> r{0}, g{0}, b{0};
    std::atomic<std::uint64_t> points{0};
  };
  static_assert(sizeof(Cell) == 64, "a cell is one cache line, so that an addition touches one");

  std::size_t mask_;
  std::unique_ptr<Cell[]> cells_;
};

/// Which cell a point is in.
class CellGrid {
 public:
  CellGrid() = default;

  /// `size` in pixels of an image `height` pixels high; shifted as the key says.
  CellGrid(const Scene& scene, int height, float size, const SampleKey& key) noexcept;

  /// Edge of the cells at a point, metres: a power of two.
  double edge(const glm::vec3& p) const noexcept;

  /// Name of a hit's cell, not 0; `random` displaces the hit in its tangent plane.
  std::uint64_t fingerprint(const Hit& hit, Pcg32& random) const noexcept;

 private:
  glm::dvec3 eye_{0.0}, shift_{0.0};
  double size_ = 1.0;  ///< edge wanted per distance from the eye
  int finest_ = 0;     ///< exponent of the smallest edge: coordinates then fit 31 bits
};

/// As make_hash_cells, with room for `cells` cells and no more.
std::unique_ptr<IndirectPass> make_hash_cells(const PassSetup& setup, std::size_t cells);

}  // namespace icbench
