// Reads the triangles of a model file through assimp.
#pragma once

#include <filesystem>
#include <string>

#include "scene/scene.h"

namespace icbench {

/// All triangles of a file as one mesh with smooth normals, in the file's own units. Throws
/// std::runtime_error with one line if the file cannot be read or holds no triangle.
Mesh import_mesh(const std::filesystem::path& file, std::string name, std::uint32_t material);

/// The Stanford bunny of the Debian package glmark2-data (69,666 triangles), 1 m high, standing on the origin
/// and looking along -x. Read once, then copied. The error names the package if the file is absent.
Mesh stanford_bunny(std::uint32_t material);

}  // namespace icbench
