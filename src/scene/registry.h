// The built-in scenes: one file each, one entry each in kScenes.
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "scene/scene.h"

namespace icbench {

Scene cornell_box();
Scene white_furnace();
Scene lit_floor();

struct SceneEntry {
  std::string_view name;
  std::string_view description;
  bool analytic;  ///< its irradiance is known in closed form
  Scene (*make)();
};

inline constexpr std::array kScenes{
    SceneEntry{"cornell_box", "Cornell box with the Stanford bunny and a Venus statue", false, cornell_box},
    SceneEntry{"white_furnace", "closed room whose surfaces emit 1 - albedo: radiance 1 everywhere", true,
               white_furnace},
    SceneEntry{"lit_floor", "black square light over a floor: irradiance by Lambert's formula", true,
               lit_floor},
};

/// Builds a scene of kScenes, or reads one from a file (import_scene.h), which may have notes to give its user. Throws
/// std::runtime_error with one line, naming the known scenes if the name is neither.
Scene make_scene(std::string_view name, std::vector<std::string>* notes = nullptr);

}  // namespace icbench
