#include "render/solid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/ext/vector_double3.hpp>
#include <glm/geometric.hpp>
#include <numbers>
#include <numeric>

#include "scene/shapes.h"

namespace icbench {
namespace {

constexpr int kCells = 24, kBlock = 6;   // of the grid, along each axis; of a box around triangles
constexpr std::size_t kMostInside = 24;  // boxes
constexpr float kMargin = 1e-3f;         // of the mesh's extent along an axis: far more than any rounding
static_assert(kCells % kBlock == 0);

using Cell = glm::ivec3;

// Cells of the mesh's box.
class Grid {
 public:
  explicit Grid(const Bounds& box) : lower_(box.lower), cell_((box.upper - box.lower) / float(kCells)) {}

  template <class F>
  static void for_each(const Cell& from, const Cell& to, F&& f) {  // both included
    for (int z = from.z; z <= to.z; ++z)
      for (int y = from.y; y <= to.y; ++y)
        for (int x = from.x; x <= to.x; ++x) f(Cell(x, y, z));
  }

  Cell at(const glm::vec3& p) const {
    return glm::clamp(Cell(glm::floor((p - lower_) / cell_)), Cell(0), Cell(kCells - 1));
  }
  glm::vec3 middle(const Cell& c) const { return lower_ + (glm::vec3(c) + 0.5f) * cell_; }
  glm::vec3 margin() const { return kMargin * float(kCells) * cell_; }
  // Of the cells between these two, both included; on each side larger by `by`.
  Solid::Box box(const Cell& from, const Cell& to, const glm::vec3& by) const {
    return {lower_ + 0.5f * glm::vec3(from + to + 1) * cell_, 0.5f * glm::vec3(to - from + 1) * cell_ + by};
  }

 private:
  glm::vec3 lower_, cell_;
};

template <class T>
struct OfCells {
  std::array<T, kCells * kCells * kCells> values{};
  T& operator[](const Cell& c) {
    return values[static_cast<std::size_t>((c.z * kCells + c.y) * kCells + c.x)];
  }
};

// Whether every directed edge has its opposite, vertices in the same place being one.
bool is_closed(const Mesh& mesh) {
  const auto before = [&](std::uint32_t a, std::uint32_t b) {
    const glm::vec3 &p = mesh.positions[a], &q = mesh.positions[b];
    return p.x != q.x ? p.x < q.x : p.y != q.y ? p.y < q.y : p.z < q.z;
  };
  std::vector<std::uint32_t> sorted(mesh.positions.size()), name(mesh.positions.size());
  std::iota(sorted.begin(), sorted.end(), 0u);
  std::sort(sorted.begin(), sorted.end(), before);
  for (std::size_t i = 1; i < sorted.size(); ++i)
    name[sorted[i]] = name[sorted[i - 1]] + (before(sorted[i - 1], sorted[i]) ? 1u : 0u);

  const auto key = [](std::uint32_t from, std::uint32_t to) { return std::uint64_t{from} << 32 | to; };
  std::vector<std::uint64_t> edges, opposite;
  for (const glm::uvec3& t : mesh.triangles)
    for (int i = 0; i < 3; ++i) {
      const std::uint32_t a = name[t[i]], b = name[t[(i + 1) % 3]];
      edges.push_back(key(a, b));
      opposite.push_back(key(b, a));
    }
  std::sort(edges.begin(), edges.end());
  std::sort(opposite.begin(), opposite.end());
  return edges == opposite;
}

// Winding number of a closed mesh around a point: the solid angles of its triangles (van Oosterom, Strackee 1983) over
// 4 pi.
double winding(const Mesh& mesh, const glm::vec3& at) {
  double sum = 0.0;
  for (const glm::uvec3& t : mesh.triangles) {
    const glm::dvec3 a(mesh.positions[t.x] - at), b(mesh.positions[t.y] - at), c(mesh.positions[t.z] - at);
    const double A = glm::length(a), B = glm::length(b), C = glm::length(c);
    sum += 2.0 * std::atan2(glm::dot(a, glm::cross(b, c)),
                            A * B * C + glm::dot(a, b) * C + glm::dot(b, c) * A + glm::dot(c, a) * B);
  }
  return sum / (4.0 * std::numbers::pi);
}

// Of the cells that no triangle reaches, those inside the solid. All that hang together are inside, or none.
void find_inside(const Mesh& mesh, const Grid& grid, OfCells<bool>& reached, OfCells<bool>& inside) {
  OfCells<bool> seen = reached;
  std::vector<Cell> part;
  Grid::for_each(Cell(0), Cell(kCells - 1), [&](const Cell& seed) {
    if (seen[seed]) return;
    seen[seed] = true;
    part.assign(1, seed);
    bool at_border = false;
    for (std::size_t i = 0; i < part.size(); ++i)
      for (int axis = 0; axis < 3; ++axis)
        for (const int step : {-1, 1}) {
          Cell next = part[i];
          next[axis] += step;
          if (next[axis] < 0 || next[axis] >= kCells) {
            at_border = true;
          } else if (!seen[next]) {
            seen[next] = true;
            part.push_back(next);
          }
        }
    if (!at_border && std::abs(winding(mesh, grid.middle(seed))) > 0.5)
      for (const Cell& c : part) inside[c] = true;
  });
}

// The box of cells inside that grows from one of them, side by side in turn.
void grow(OfCells<bool>& inside, Cell& from, Cell& to) {
  for (bool grown = true; grown;) {
    grown = false;
    for (int side = 0; side < 6; ++side) {
      const int axis = side / 2;
      Cell first = from, last = to;
      const int next = side % 2 == 0 ? from[axis] - 1 : to[axis] + 1;
      if (next < 0 || next >= kCells) continue;
      first[axis] = last[axis] = next;
      bool free = true;
      Grid::for_each(first, last, [&](const Cell& c) { free &= inside[c]; });
      if (!free) continue;
      (side % 2 == 0 ? from : to)[axis] = next;
      grown = true;
    }
  }
}

int volume(const Cell& from, const Cell& to) {
  const Cell size = to - from + 1;
  return size.x * size.y * size.z;
}

// A few large boxes inside, each the one that adds the most cells.
std::vector<Solid::Box> boxes_inside(const Grid& grid, OfCells<bool>& inside) {
  std::vector<Solid::Box> out;
  OfCells<bool> covered;
  while (out.size() < kMostInside) {
    int most = 1;  // a single cell is not worth a box
    Cell from(0), to(0);
    Grid::for_each(Cell(0), Cell(kCells - 1), [&](const Cell& seed) {
      if (seed.x % 2 + seed.y % 2 + seed.z % 2 > 0) return;  // an eighth of them will do
      if (!inside[seed] || covered[seed]) return;
      Cell first = seed, last = seed;
      grow(inside, first, last);
      if (volume(first, last) <= most) return;
      int added = 0;
      Grid::for_each(first, last, [&](const Cell& c) { added += covered[c] ? 0 : 1; });
      if (added <= most) return;
      most = added;
      from = first;
      to = last;
    });
    if (most == 1) break;
    Grid::for_each(from, to, [&](const Cell& c) { covered[c] = true; });
    out.push_back(grid.box(from, to, -grid.margin()));
  }
  return out;
}

// Boxes around the cells that triangles reach, block by block.
std::vector<Solid::Box> boxes_around(const Grid& grid, OfCells<bool>& reached) {
  std::vector<Solid::Box> out;
  Grid::for_each(Cell(0), Cell(kCells / kBlock - 1), [&](const Cell& block) {
    Cell from(kCells), to(-1);
    Grid::for_each(block * kBlock, block * kBlock + (kBlock - 1), [&](const Cell& c) {
      if (!reached[c]) return;
      from = glm::min(from, c);
      to = glm::max(to, c);
    });
    if (to.x >= 0) out.push_back(grid.box(from, to, grid.margin()));
  });
  return out;
}

}  // namespace

Solid make_solid(const Mesh& mesh) {
  constexpr std::size_t kFewTriangles = 256;  // a BVH of these is as fast
  if (mesh.triangles.size() < kFewTriangles) return {};
  const Bounds box = bounds_of(mesh);
  const glm::vec3 extent = box.upper - box.lower, far = glm::max(glm::abs(box.lower), glm::abs(box.upper));
  for (int axis = 0; axis < 3; ++axis)  // flat, or so far off that cells are hardly told apart
    if (!(extent[axis] > 1e-2f * std::max({far.x, far.y, far.z}))) return {};

  const Grid grid(box);
  OfCells<bool> reached, inside;
  for (const glm::uvec3& t : mesh.triangles) {
    const glm::vec3 &a = mesh.positions[t.x], &b = mesh.positions[t.y], &c = mesh.positions[t.z];
    const glm::vec3 lower = glm::min(a, glm::min(b, c)), upper = glm::max(a, glm::max(b, c));
    Grid::for_each(grid.at(lower - grid.margin()), grid.at(upper + grid.margin()),
                   [&](const Cell& cell) { reached[cell] = true; });
  }
  Solid out;
  out.around = boxes_around(grid, reached);
  if (is_closed(mesh)) {
    find_inside(mesh, grid, reached, inside);
    out.inside = boxes_inside(grid, inside);
  }
  return out;
}

}  // namespace icbench
