#include "scene/import_scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <new>
#include <stdexcept>

#include "files/input_file.h"
#include "scene/import_model.h"
#include "scene/import_text.h"

namespace icbench {
namespace {

std::string lower_case(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

// By how a file begins: a binary one, or the object of a text.
bool is_gltf(std::string_view bytes) {
  if (bytes.starts_with("glTF")) return true;
  const std::size_t begin = bytes.find_first_not_of(" \t\r\n");
  return begin != bytes.npos && bytes[begin] == '{';
}

importing::Model read(const std::filesystem::path& file) {
  const std::string extension = lower_case(file.extension().string());
  if (extension == ".rad") return importing::read_radiance(file, load_file(file));
  if (extension == ".gltf" || extension == ".glb") return importing::read_gltf(file, load_file(file));
  if (extension.empty()) {
    const std::string bytes = load_file(file);
    if (is_gltf(bytes)) return importing::read_gltf(file, bytes);
  }
  return importing::read_with_assimp(file);
}

}  // namespace

bool names_a_file(std::string_view name) {
  std::error_code ignored;
  return name.find_first_of("./") != std::string_view::npos || std::filesystem::exists(name, ignored);
}

ImportedScene import_scene(const std::filesystem::path& file) {
  using importing::one_line;
  try {
    ImportedScene imported = importing::assemble(read(file));
    for (std::string& note : imported.notes) note = one_line(std::move(note));
    for (Mesh& mesh : imported.scene.meshes) mesh.name = one_line(std::move(mesh.name));
    return imported;
  } catch (const std::bad_alloc&) {
    throw std::runtime_error(fmt::format("{}: takes more memory than there is", file.string()));
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(one_line(error.what()));
  }
}

}  // namespace icbench
