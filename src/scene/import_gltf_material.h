// glTF materials and their textures; the mapping is that of import_scene.h.
#pragma once

#include <cstdint>
#include <glm/mat3x3.hpp>
#include <vector>

#include "scene/import_gltf_data.h"
#include "scene/import_json.h"
#include "scene/import_model.h"

namespace icbench::importing {

/// How a primitive's texture coordinates become those of its material's texture.
struct TextureUse {
  bool used = false;
  std::uint64_t set = 0;      ///< of TEXCOORD_n
  glm::dmat3 transform{1.0};  ///< from the file's coordinates to those of Texture
};

/// Adds all materials of a document to a model, followed by the one of primitives that name none; a texture
/// use for each. Throws std::runtime_error with the place.
std::vector<TextureUse> read_gltf_materials(const Element& document, const GltfData& data, Model& model);

}  // namespace icbench::importing
