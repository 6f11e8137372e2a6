// What the readers of file formats have in common: a file's content before it is a Scene, and the step to
// one.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "scene/import_rig.h"
#include "scene/import_scene.h"
#include "scene/scene.h"

namespace icbench::importing {

/// Most names in a note; those beyond are counted.
inline constexpr std::size_t kMostNamed = 20;

/// What a file's user should know, each thing once.
class Notes {
 public:
  void add(std::string note);

  /// Counts one more thing of a kind that is left out; all kinds make one line.
  void drop(std::string_view kind);

  /// One line each.
  std::vector<std::string> lines() const;

 private:
  struct Dropped {
    std::string kind;
    std::size_t count;
  };
  std::vector<std::string> notes_;
  std::vector<Dropped> dropped_;
};

/// Triangles with one material, in the space of the nodes that show them.
struct Shape {
  std::string name;
  std::vector<glm::dvec3> positions;
  std::vector<glm::vec3> normals;  ///< of any length, one per position, or none for flat shading
  std::vector<glm::vec2> uvs;      ///< one per position or none
  std::vector<glm::uvec3> triangles;
  std::uint32_t material = 0;
};

struct Surfacing {
  Material material;
  bool thin = false;  ///< a dielectric that has no thickness of its own
};

/// A camera in its node's space.
struct Lens {
  float fov_y = 0.8f;
  glm::dvec3 eye{0.0}, forward{0.0, 0.0, -1.0}, up{0.0, 1.0, 0.0};
};

/// A light in its node's space.
struct Lamp {
  glm::dvec3 p{0.0}, axis{0.0, 0.0, -1.0};
  glm::vec3 intensity{0.0f};  ///< W/sr; of a directional one the irradiance, W/m^2
  float cos_inner = -1.0f, cos_outer = -1.0f;
  bool directional = false;
};

/// What stands at a node.
template <class Thing>
struct Placed {
  std::uint32_t node;
  Thing thing;
};

/// What notes call a texture of whose place on a mesh the file says nothing: its corner stands for it.
inline constexpr std::string_view kNoCoordinates = "textures on meshes without texture coordinates";

/// Most that a channel of a light's intensity may be, W/sr (a directional one's irradiance, W/m^2).
inline constexpr double kMostIntensity = 1e20;

/// A file's content.
struct Model {
  std::string file;  ///< for messages
  Rig rig;
  std::vector<Surfacing> materials;
  std::vector<Texture> textures;
  std::vector<Shape> shapes;
  std::vector<Placed<std::uint32_t>> placed_shapes;  ///< by index into shapes
  std::vector<Placed<Lamp>> lamps;
  std::optional<Placed<Lens>> lens;
  glm::dvec3 up{0.0, 1.0, 0.0};     ///< of a camera that the file does not bring
  glm::dvec3 front{0.0, 0.0, 1.0};  ///< from the scene to that camera
  Notes notes;
};

/// An index of refraction for a dielectric: 1, which would bend nothing, becomes 1.0001, and one outside [1, 10]
/// becomes 1.5 with a note.
float refracting_index(double n, Notes& notes);

/// What a file says that a material emits, W/(m^2 sr): within [0, 1e12], with a note if it was not; what is no number
/// becomes 0.
glm::vec3 emitted_radiance(const glm::dvec3& stated, Notes& notes);

/// Places, joins and recentres everything. Throws std::runtime_error with one line.
ImportedScene assemble(Model model);

/// Decodes a PNG or JPEG file's bytes to a texture. Throws std::runtime_error with a reason to which the
/// caller adds the place; nothing beyond kMaxTexels, or beyond what the bytes can hold, is allocated.
Texture decode_texture(std::string_view bytes, std::string name);

/// Whether an image is of a format that `decode_texture` reads, by how it begins.
bool is_texture(std::string_view bytes) noexcept;

/// Mean linear colour of a texture.
glm::vec3 mean_colour(const Texture& texture);

// The readers; each throws std::runtime_error with one line.
Model read_gltf(const std::filesystem::path& file, const std::string& bytes);
Model read_radiance(const std::filesystem::path& file, const std::string& text);
Model read_with_assimp(const std::filesystem::path& file);

}  // namespace icbench::importing
