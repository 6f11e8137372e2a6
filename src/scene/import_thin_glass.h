// Sheets of glass that a file gives no thickness: a ray has to enter and to leave them.
#pragma once

#include <cstdint>
#include <span>

#include "scene/import_model.h"

namespace icbench::importing {

/// A shape of thin glass where it stands. Sheets are compared within a group: those that may be meant as the two faces
/// of one.
struct StandingGlass {
  Shape* shape;
  glm::dmat4 matrix;
  std::uint32_t group;
};

/// Takes away the second faces of sheets that a file gives both of, be they triangles of the same vertices or of
/// others, within `tolerance` in place: each would get a back of its own, on the other's outside. Whether there was
/// any.
bool drop_second_faces(std::span<const StandingGlass> glass, double tolerance);

/// Gives a sheet its back: the same triangles, reversed, `thickness` behind them where a matrix puts them, whose
/// determinant is not 0.
void add_back(Shape& shape, double thickness, const glm::dmat4& m);

}  // namespace icbench::importing
