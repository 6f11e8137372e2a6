// Plane figures to model solids from: arcs, arched openings, rounded slabs; and their triangulation.
#pragma once

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

namespace icbench {

/// Corners of a simple closed figure in order, metres; the last joins the first.
using Polygon = std::vector<glm::vec2>;

/// steps + 1 points on a circle from one angle to the other. Radians.
Polygon arc(const glm::vec2& centre, float radius, float from, float to, int steps);

/// Regular polygon whose corners lie on a circle, counter-clockwise.
Polygon circle(const glm::vec2& centre, float radius, int corners);

/// Axis-aligned rectangle, counter-clockwise.
Polygon rectangle(const glm::vec2& lower, const glm::vec2& upper);

/// Opening with a round head, counter-clockwise: `width` wide, centred on x, from y `sill` to the springing line, where
/// the half circle begins.
Polygon arched_opening(float x, float width, float sill, float springing, int steps);

/// |x / a|^n + |y / b|^n = 1, counter-clockwise: n = 2 is an ellipse, larger n a rectangle with soft corners.
Polygon superellipse(float a, float b, float n, int corners);

/// Moves each corner inwards so that the sides of a counter-clockwise polygon lie `distance` deeper (outwards if
/// negative). The polygon must be wide enough for that.
Polygon inset(const Polygon& polygon, float distance);

/// Twice the area, positive if counter-clockwise.
double doubled_area(const Polygon& polygon);

/// Triangulates the region inside `outline` and outside the holes, by ear clipping; of the ears there are the best
/// shaped goes first. Both directions of running are accepted; holes must lie inside the outline, apart from it and
/// from one another. Indices count through the outline's corners, then each hole's; triangles run counter-clockwise.
/// Quadratic in the number of corners, cubic where there are holes. Throws std::runtime_error if the figure crosses
/// itself.
std::vector<glm::uvec3> triangulate(const Polygon& outline, std::span<const Polygon> holes = {});

}  // namespace icbench
