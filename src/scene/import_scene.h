// Scenes from files: glTF 2.0 (.gltf, .glb), Radiance (.rad) and every other format that assimp reads, glTF 1.0 (.gltf)
// among them; a file without an extension is read by how it begins.
//
// What becomes of a file
// - Materials: diffuse, mirror or dielectric, whichever is nearest; base-colour textures (PNG, JPEG). glTF: KHR
//   transmission of 0.5 or more of what is not metal, or an alpha below 0.5 that blends, is a dielectric; metallic >=
//   0.5 with roughness <= 0.1 is a mirror; all else is diffuse with the base colour. An index of refraction of 1 is
//   taken as 1.0001, one outside [1, 10] as 1.5. Radiance: plastic is diffuse with all it reflects, and so is metal
//   unless it is a mirror by specularity >= 0.5 and roughness <= 0.05; mirror; glass and dielectric are dielectrics;
//   light, glow, illum and spotlight emit. Glass without thickness gets a second sheet behind the first, so that rays
//   leave it in the direction in which they came; each tints by the root of the base colour (what assimp reads has
//   one sheet, which tints by all of it).
//   What assimp reads may name images that are not there, or neither PNG nor JPEG: a note tells, and the colour of the
//   material stands for them. glTF 2.0 with such a one is refused, and any file with a damaged one.
// - Light: emissive surfaces emit from the front, by the mean of an emissive texture. Photometric figures are
//   taken as radiometric ones of the same number (1 cd as 1 W/sr, 1 cd/m^2 as 1 W/(m^2 sr)). A directional
//   light becomes a point light kSunDistance scene radii away that gives the same irradiance at the centre, and shines
//   on the scene alone. Spot lights fade from the inner cone to the outer one by a smooth step of the cosine.
// - Camera: the file's first perspective one; Radiance: the view of FILE.vf beside FILE.rad, else of the last
//   "# view" comment. Without one the scene is framed from the front, a little to the right and above.
// - A file without any light gets a point light at the camera, strong enough that white in the middle of the
//   scene has radiance 1.
// - Motion: all node animations of a file at once, at kFramesPerSecond, over the longest of them. Nothing
//   else moves. What moves and has a scale of 0 all along is left out.
// - Units: metres. FBX and Collada state theirs and are converted; all other numbers are taken as metres.
// - Coordinates are held as doubles until a scene that lies far from its origin, by more than four times its radius,
//   has been moved there; a note says by how much. So one that lies 1e6 m away gives the picture it would give at the
//   origin. What a format itself stores as floats (vertices of glTF and FBX, all that assimp reads) is as coarse as
//   these are, 6 cm there, unless the offset is in a node's transformation.
//
// Guarantees: any file gives a scene or one line that names file and place, whatever its bytes. Memory stays
// within a constant times the bytes of the file and those it names, plus its textures (kMaxTexels) and the
// surfaces it describes (kMaxVertices). What assimp reads it reads first in a process of its own, so that
// neither a fault nor its appetite reaches this one: twice the time, and an end to files on which it would
// have none. No command in a file is ever carried out.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "scene/scene.h"

namespace icbench {

inline constexpr double kFramesPerSecond = 24.0;
inline constexpr std::uint32_t kMaxFrames = 10'000;
inline constexpr double kSunDistance = 50.0;

/// Most vertices, and triangles, that a file may describe, instances counted each, second sheets of glass not.
inline constexpr std::size_t kMaxVertices = std::size_t{1} << 25;
/// Most texels of all textures of a file.
inline constexpr std::size_t kMaxTexels = std::size_t{1} << 26;

struct ImportedScene {
  Scene scene;
  std::vector<std::string> notes;  ///< a line each: what was left out, approximated or added
};

/// Reads a scene, its name being the path as given. Throws std::runtime_error with one line.
ImportedScene import_scene(const std::filesystem::path& file);

/// Whether a name looks like a file's: it has a folder or an extension, or there is a file of that name.
bool names_a_file(std::string_view name);

}  // namespace icbench
