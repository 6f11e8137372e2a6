// An RGB image in float: row-major, top row first.
#pragma once

#include <glm/vec3.hpp>
#include <vector>

namespace icbench {

struct Image {
  int width = 0, height = 0;
  std::vector<glm::vec3> pixels;
};

}  // namespace icbench
