// The built-in scenes: one file each, one entry each in kScenes.
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "scene/scene.h"

namespace icbench {

Scene cornell_box();
Scene wobble();
Scene desk();
Scene bunnies_1();
Scene bunnies_2();
Scene bunnies_4();
Scene bunnies_9();
Scene cornell_specular();
Scene cornell_indirect();
Scene cornell_camera();
Scene cornell_lamp();
Scene cornell_paint();
Scene conference();
Scene sibenik();
Scene office();
Scene white_furnace();
Scene lit_floor();
Scene sphere_light();
Scene integrating_sphere();

struct SceneEntry {
  std::string_view name;
  std::string_view description;
  bool analytic;  ///< its irradiance is known in closed form
  Scene (*make)();
  /// Of a cache whose records are extrapolated by gradients (render/extrapolation.h): one so coarse that its picture
  /// by virtual point lights hardly differs from one without a cache: in 512 x 384 pixels HDR-VDP (P > 75 %) told fewer
  /// than 0.33 % apart, by 8,192 of them (bench/MEASURED.md). 0.1 where it was not tried.
  float accuracy = 0.1f;
};

inline constexpr std::array kScenes{
    SceneEntry{"cornell_box", "Cornell box: the Stanford bunny runs round a Venus statue", false, cornell_box,
               0.15f},
    SceneEntry{"wobble", "room with a column that a sine wave runs up: a deforming mesh", false, wobble,
               0.12f},
    SceneEntry{"desk", "study with a desk; a swivel chair rolls about", false, desk, 0.13f},
    SceneEntry{"bunnies_1", "room with a bouncing bunny", false, bunnies_1, 0.11f},
    SceneEntry{"bunnies_2", "the same room with 2 bouncing bunnies", false, bunnies_2, 0.11f},
    SceneEntry{"bunnies_4", "the same room with 4 bouncing bunnies", false, bunnies_4, 0.11f},
    SceneEntry{"bunnies_9", "the same room with 9 bouncing bunnies", false, bunnies_9, 0.11f},
    SceneEntry{"cornell_specular", "Cornell box with a mirror, a glass ball and a running bunny", false,
               cornell_specular, 0.15f},
    SceneEntry{"cornell_indirect", "Cornell box whose lamp shines at the ceiling", false, cornell_indirect,
               0.05f},
    SceneEntry{"cornell_camera", "Cornell box that the camera flies about", false, cornell_camera},
    SceneEntry{"cornell_lamp", "Cornell box whose lamp dims and changes colour; a spot light sweeps", false,
               cornell_lamp},
    SceneEntry{"cornell_paint", "Cornell box with a wall that changes its paint", false, cornell_paint},
    SceneEntry{"conference", "conference room of 32 chairs; a green bunny crosses the table", false,
               conference, 0.15f},
    SceneEntry{"sibenik", "nave, aisles and apse lit by small windows; a yellow box moves through", false,
               sibenik, 0.05f},
    SceneEntry{"office", "desk, swivel chair, bookcase and a window behind venetian blinds", false, office,
               0.07f},
    SceneEntry{"white_furnace", "closed room whose surfaces emit 1 - albedo: radiance 1 everywhere", true,
               white_furnace},
    SceneEntry{"lit_floor", "black square light over a floor: irradiance by Lambert's formula", true,
               lit_floor},
    SceneEntry{"sphere_light", "black glowing sphere over a floor: as bright as a point in its centre", true,
               sphere_light},
    SceneEntry{"integrating_sphere", "lamp in a hollow sphere: indirect light is even, direct light is not",
               true, integrating_sphere},
};

/// Builds a scene of kScenes, or reads one from a file (import_scene.h), which may have notes to give its
/// user. Throws std::runtime_error with one line, naming the known scenes if the name is neither.
Scene make_scene(std::string_view name, std::vector<std::string>* notes = nullptr);

}  // namespace icbench
