#include "scene/registry.h"

#include <fmt/format.h>

#include <stdexcept>
#include <string>
#include <utility>

#include "scene/import_scene.h"

namespace icbench {

Scene make_scene(std::string_view name, std::vector<std::string>* notes) {
  std::string known;
  for (const SceneEntry& entry : kScenes) {
    if (entry.name == name) {
      Scene scene = entry.make();
      scene.name = name;
      return scene;
    }
    known += known.empty() ? "" : ", ";
    known += entry.name;
  }
  if (names_a_file(name)) {
    ImportedScene imported = import_scene(name);
    if (notes) *notes = std::move(imported.notes);
    return std::move(imported.scene);
  }
  throw std::runtime_error(
      fmt::format("unknown scene '{}'; give a file or one of the built-in scenes: {}", name, known));
}

}  // namespace icbench
