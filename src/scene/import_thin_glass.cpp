#include "scene/import_thin_glass.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <set>
#include <utility>
#include <vector>

#include "scene/import_placing.h"

namespace icbench::importing {
namespace {

using Place = std::array<double, 3>;  // in multiples of the tolerance
constexpr std::uint32_t kNone = UINT32_MAX;

// The vertices that triangles join, as sheets, by index.
class Sheets {
 public:
  explicit Sheets(const Shape& shape) : parent_(shape.positions.size()) {
    std::iota(parent_.begin(), parent_.end(), 0u);
    for (const glm::uvec3& t : shape.triangles) {
      parent_[of(t.y)] = of(t.x);
      parent_[of(t.z)] = of(t.x);
    }
  }
  // The sheet of a vertex, named after one of its own.
  std::uint32_t of(std::uint32_t vertex) {
    while (parent_[vertex] != vertex) vertex = parent_[vertex] = parent_[parent_[vertex]];
    return vertex;
  }

 private:
  std::vector<std::uint32_t> parent_;
};

template <class T>
std::vector<T> sorted_set(std::vector<T> items) {
  std::sort(items.begin(), items.end());
  items.erase(std::unique(items.begin(), items.end()), items.end());
  return items;
}

}  // namespace

bool drop_second_faces(std::span<const StandingGlass> glass, double tolerance) {
  // Sheets by group and the places of their vertices.
  std::set<std::pair<std::uint32_t, std::vector<Place>>> known;
  bool found = false;
  for (const StandingGlass& g : glass) {
    const auto place_of = [&](std::uint32_t vertex) {
      const glm::dvec3 p = transform(g.matrix, g.shape->positions[vertex]) / tolerance;
      return Place{std::round(p.x), std::round(p.y), std::round(p.z)};
    };
    Sheets sheets(*g.shape);
    std::map<std::uint32_t, std::vector<Place>> places;  // by sheet
    std::set<std::pair<std::uint32_t, std::vector<Place>>> seen;
    std::vector<std::uint32_t> sheet_of;  // by triangle; kNone once it is dropped
    for (const glm::uvec3& t : g.shape->triangles) {
      const std::uint32_t sheet = sheets.of(t.x);
      const std::vector<Place> corners = sorted_set<Place>({place_of(t.x), place_of(t.y), place_of(t.z)});
      // Of what is smaller than the tolerance nothing is said.
      const bool is_second = corners.size() == 3 && !seen.insert({sheet, corners}).second;
      sheet_of.push_back(is_second ? kNone : sheet);
      auto& all = places[sheet];
      all.insert(all.end(), corners.begin(), corners.end());
    }
    std::set<std::uint32_t> second;
    for (auto& [sheet, all] : places)
      if (!known.insert({g.group, sorted_set(std::move(all))}).second) second.insert(sheet);
    std::vector<glm::uvec3> kept;
    for (std::size_t t = 0; t < sheet_of.size(); ++t)
      if (sheet_of[t] != kNone && !second.contains(sheet_of[t])) kept.push_back(g.shape->triangles[t]);
    found |= kept.size() < sheet_of.size();
    g.shape->triangles = std::move(kept);
  }
  return found;
}

void add_back(Shape& shape, double thickness, const glm::dmat4& m) {
  const std::size_t count = shape.positions.size();
  const std::vector<glm::dvec3> n = face_sums(shape);
  const auto first = static_cast<std::uint32_t>(count);
  const glm::dmat3 turn = cofactors(m);
  // Directions return by the inverse, the transposed cofactors over the determinant. Of a mirrored shape both the
  // front and the determinant have the other sign.
  const glm::dmat3 back = glm::transpose(turn) * (thickness / std::abs(glm::determinant(glm::dmat3(m))));
  for (std::size_t v = 0; v < count; ++v)
    shape.positions.push_back(shape.positions[v] - back * unit_or(turn * n[v], glm::dvec3(0.0)));
  for (std::size_t v = 0, end = shape.normals.size(); v < end; ++v)
    shape.normals.push_back(-shape.normals[v]);
  for (std::size_t v = 0, end = shape.uvs.size(); v < end; ++v) shape.uvs.push_back(shape.uvs[v]);
  for (std::size_t t = 0, end = shape.triangles.size(); t < end; ++t) {
    const glm::uvec3 front = shape.triangles[t];
    shape.triangles.emplace_back(first + front.x, first + front.z, first + front.y);
  }
}

}  // namespace icbench::importing
