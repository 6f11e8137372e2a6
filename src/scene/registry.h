// The built-in scenes: one file each, one entry each in kScenes.
#pragma once

#include <array>
#include <string_view>

#include "scene/scene.h"

namespace icbench {

Scene cornell_box();
Scene white_furnace();
Scene lit_floor();
Scene conference();
Scene sibenik();
Scene office();

struct SceneEntry {
  std::string_view name;
  std::string_view description;
  bool analytic;  ///< its irradiance is known in closed form
  Scene (*make)();
};

inline constexpr std::array kScenes{
    SceneEntry{"cornell_box", "Cornell box with the Stanford bunny and a Venus statue", false, cornell_box},
    SceneEntry{"conference", "conference room of 32 chairs; a green bunny crosses the table", false, conference},
    SceneEntry{"sibenik", "nave, aisles and apse lit by small windows; a yellow box moves through", false, sibenik},
    SceneEntry{"office", "desk, swivel chair, bookcase and a window behind venetian blinds", false, office},
    SceneEntry{"white_furnace", "closed room whose surfaces emit 1 - albedo: radiance 1 everywhere", true,
               white_furnace},
    SceneEntry{"lit_floor", "black square light over a floor: irradiance by Lambert's formula", true,
               lit_floor},
};

/// Builds a scene of kScenes. Throws std::runtime_error naming the known scenes if there is none of that
/// name.
Scene make_scene(std::string_view name);

}  // namespace icbench
