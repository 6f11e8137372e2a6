// Furniture and fittings of rooms, each as parts of closed solids.
//
// What stands has its foot on the origin, kGap above it, and its front to +z; what hangs on a wall has its middle, and
// what is let into one its bottom middle, on the origin, with the wall behind it in the plane z = 0. Metres, radians.
#pragma once

#include <cstdint>

#include "scene/solids.h"

namespace icbench {

struct ChairMaterials {
  std::uint32_t fabric, frame, arms;
};

/// Upholstered armchair on a frame of bent tubes, 0.95 high.
Parts conference_chair(const ChairMaterials& m);

/// Swivel armchair on a five-armed foot with castors, 1.08 high.
Parts swivel_chair(const ChairMaterials& m);

/// Long table with softly bowed sides on three pedestals.
Parts conference_table(float length, float width, float height, std::uint32_t top, std::uint32_t base);

/// Writing desk with a pedestal of drawers at each side, 0.75 high.
Parts desk_with_drawers(float width, float depth, std::uint32_t wood, std::uint32_t handles);

/// Screen on a foot, with keyboard and mouse before it.
Parts computer(std::uint32_t body, std::uint32_t screen);

/// Table lamp with a conical shade open below, 0.45 high; no light of its own.
Parts table_lamp(std::uint32_t metal, std::uint32_t shade);

/// Open bookcase against a wall at its back, full of books in the colours of `bindings`.
Parts bookcase(const glm::vec3& size, int shelves, std::uint32_t wood,
               std::span<const std::uint32_t> bindings);

/// Open conical basket with a thick wall and a rim, 0.32 high.
Parts waste_basket(std::uint32_t material);

/// Cup with a handle, 0.09 high.
Parts mug(std::uint32_t material);

/// Pot with a plant of long bent leaves, 1.1 high.
Parts pot_plant(std::uint32_t pot, std::uint32_t leaves);

/// Picture in a moulded frame with a margin; hangs.
Parts picture(float width, float height, std::uint32_t frame, std::uint32_t margin, std::uint32_t image);

/// Board in a thin frame with a tray, pens and a wiper; hangs.
Parts whiteboard(float width, float height, std::uint32_t board, std::uint32_t frame, std::uint32_t pens);

/// Panelled door with its casing and a handle; let into a wall, stands on the floor.
Parts door(float width, float height, std::uint32_t leaf, std::uint32_t casing, std::uint32_t metal);

/// Casing, sash bars and sill for an opening in a wall; let into it.
Parts window_frame(float width, float height, int columns, int rows, std::uint32_t frame);

/// Blind of curved slats under a head rail, with tapes and a bottom rail; its top middle is on the origin.
Parts venetian_blind(float width, float height, float pitch, float tilt, std::uint32_t slats);

/// Moulding along the foot of walls; walls lie to the right of the path as seen from above.
Mesh skirting(const Path& path, float height);

}  // namespace icbench
