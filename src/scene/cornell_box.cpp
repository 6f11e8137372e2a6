// The Cornell box with a statue in its middle, round which the Stanford bunny runs, as in the Cornell Box animation of
// Dubla 2012, section 6.3.2.
#include "scene/cornell.h"
#include "scene/registry.h"

namespace icbench {

Scene cornell_box() {
  Scene s = cornell::room();
  cornell::add_ceiling_lamp(s);
  cornell::add_statue(s);
  cornell::add_circling_bunny(s, 1.5f, cornell::kMiddle, 1.76f);
  return s;
}

}  // namespace icbench
