// Parts of vaulted stone buildings, each a closed solid or parts of several.
//
// Standing parts have their foot on the origin; walls run along x with their front in the plane z = 0 and their
// thickness behind it, towards -z. Half circles spring from the springing line. Metres, radians.
#pragma once

#include <cstdint>

#include "scene/solids.h"

namespace icbench {

/// Round column: square plinth, Attic base, shaft with entasis, capital of two rings of leaves, abacus. `radius` is
/// that of the shaft's foot.
Parts column(float radius, float height, std::uint32_t stone);

/// Slender engaged shaft with a simple base and capital, to stand in corners.
Parts colonnette(float radius, float height, std::uint32_t stone);

/// Wall with openings through it.
Mesh wall(const Polygon& outline, float thickness, std::span<const Polygon> openings = {});

/// Outline of an arcade wall: `bays` half-round arches of this radius, `pitch` apart, centred on x = 0, between its
/// foot on the springing line and its top; it reaches `overlap` beyond the outer bays.
Polygon arcade(int bays, float pitch, float radius, float springing, float top, float overlap, int steps);

/// Moulded band around the head of an arched opening, in front of a wall; its ends reach `stilt` below the springing.
Mesh archivolt(const glm::vec2& springing_centre, float radius, float width, float stilt, int steps);

/// Half-round shell over the z axis from z = -length to 0, springing at y = 0, `thickness` over its inner radius; its
/// feet reach `skirt` below.
Mesh barrel_vault(float radius, float length, float thickness, float skirt, int steps);

/// Moulded transverse rib of a barrel vault in the plane z = 0, standing `depth` out of its inner radius.
Mesh vault_rib(float radius, float width, float depth, float skirt, int steps);

/// Half dome over the half disc z <= 0, springing at y = 0, with its wall continued `skirt` below.
Mesh half_dome(float radius, float thickness, float skirt, int steps);

/// Band of stone along a path; it stands out to the left of the path as seen from above, by as much as it is high.
Mesh cornice(const Path& path, float height);

struct WindowMaterials {
  std::uint32_t stone, bars, pane;  ///< the pane is a sheet, its front into the room
};

/// Surround, bars and pane for an arched opening of a wall; the pane lies `depth` behind the front.
Parts arched_window(float x, float width, float sill, float springing, float depth, int steps,
                    const WindowMaterials& m);

/// Rose window: a round pane behind spokes and rings of stone, around `centre`, `depth` behind the front.
Parts rose_window(const glm::vec2& centre, float radius, float depth, const WindowMaterials& m);

}  // namespace icbench
