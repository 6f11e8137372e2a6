#include "scene/registry.h"

#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "core/names.h"
#include "scene/import_scene.h"

namespace icbench {

Scene make_scene(std::string_view name, std::vector<std::string>* notes) {
  std::vector<std::string_view> known;
  for (const SceneEntry& entry : kScenes) {
    if (entry.name == name) {
      Scene scene = entry.make();
      scene.name = name;
      return scene;
    }
    known.push_back(entry.name);
  }
  if (names_a_file(name)) {
    ImportedScene imported = import_scene(name);
    if (notes) *notes = std::move(imported.notes);
    return std::move(imported.scene);
  }
  throw std::runtime_error(unknown_name("scene", name, known) + "; or name a file");
}

}  // namespace icbench
