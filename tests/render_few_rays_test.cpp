// Means of pictures where few rays of a gather find the light: no level of interpolation may lose it.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <cstdio>

#include "cached_runs.h"
#include "render_support.h"
#include "scene/shapes.h"

namespace icbench {
namespace {

// A grey room, 4 x 3 x 4 m, and a spot in its ceiling that lights a patch of the floor 0.4 m wide, which is all that
// there is for rays to find.
Scene lit_by_a_patch() {
  Scene s;
  s.name = "patch";
  const auto grey = s.add_material({.albedo = glm::vec3(0.3f)});
  s.meshes.push_back(box("walls", {{-2, 0, -2}, {2, 3, 2}}, grey, true));
  constexpr float kHeight = 2.9f, kRadius = 0.2f;
  const float edge = kHeight / std::hypot(kHeight, kRadius);  // cosine
  s.point_lights.push_back({{0, kHeight, 0}, glm::vec3(1000.0f), {0, -1, 0}, edge, edge});
  s.camera = {.eye = {-1.9f, 1.5f, -1.9f}, .target = {0, 1.2f, 0}, .up = {0, 1, 0}, .fov_y = 1.0f};
  return s;
}

class FewRays : public ::testing::TestWithParam<InterpolationEntry> {};
INSTANTIATE_TEST_SUITE_P(Levels, FewRays, ::testing::ValuesIn(kInterpolations), level_name);

// Guards against: records that found nothing, and so no derivative that would bound them, reaching farthest. When
// derivatives are taken of whatever light was found, gradients lose 35 % of it, neighbour clamping 31, the geometric
// Hessian 6 and the occlusion Hessian 63.
TEST_P(FewRays, FindAllTheLightInTheMean) {
  constexpr int kSeeds = 48;
  const RayTracer rays(lit_by_a_patch());
  const PrimaryHits primary = primary_hits(rays, 48, 36);
  const double truth = mean_of(without_cache(rays, primary, {.gather_rays = 1024}, false));
  Estimate mean;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const Level level{.level = GetParam().level, .gather_rays = 64, .seed = seed};
    mean.add(mean_of(run_level(rays, primary, level).indirect) / truth);
  }
  std::printf("%s: %.3f +- %.3f of the light\n", std::string(GetParam().name).c_str(), mean.mean(),
              mean.error());
  EXPECT_NEAR(mean.mean(), 1.0, 3.0 * mean.error());
}

}  // namespace
}  // namespace icbench
