// Polygons to triangles.
#pragma once

#include <glm/vec3.hpp>
#include <span>
#include <vector>

namespace icbench::importing {

/// Most corners of a polygon: the time grows with their square, as a rule.
inline constexpr std::size_t kMaxCorners = 10'000;

/// Cuts a planar polygon into triangles of its corners, by ear clipping (Meisters 1975). It may be concave,
/// and have holes that a seam joins to the outline: an edge walked in both directions, as Radiance wants
/// them. Triangles run the way the polygon does. A polygon that crosses itself is covered somehow. Fewer than
/// 3 corners, or no area: no triangle. At most kMaxCorners corners, of finite coordinates.
std::vector<glm::uvec3> triangulate(std::span<const glm::dvec3> corners);

}  // namespace icbench::importing
