#include "scene/registry.h"

#include <fmt/format.h>

#include <stdexcept>
#include <string>

namespace icbench {

Scene make_scene(std::string_view name) {
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
  throw std::runtime_error(fmt::format("unknown scene '{}'; the built-in scenes are {}", name, known));
}

}  // namespace icbench
