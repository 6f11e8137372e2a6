// Colours of error maps.
#pragma once

#include <glm/vec3.hpp>

namespace icbench {

/// The magma colour map (van der Walt and Smith, matplotlib, public domain): black for 0, pale yellow for 1,
/// lightness even between. `value` is clamped to [0, 1]; the result is linear RGB.
glm::vec3 magma(float value);

}  // namespace icbench
