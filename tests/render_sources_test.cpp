// What the sources of records that no frame is to inherit make of a change between frames.
#include <gtest/gtest.h>

#include <utility>

#include "render/instant_caching.h"
#include "render/irradiance_cache.h"
#include "render_support.h"
#include "temporal_scenes.h"

namespace icbench {
namespace {

constexpr int kWidth = 16, kHeight = 12;

PassSetup setup_of(const RayTracer& rays, Crew& crew, Interpolation level) {
  PassSetup setup{rays, crew, kWidth, kHeight};
  setup.gather_rays = 16;
  setup.vpls = 16;
  setup.interpolation = level;
  return setup;
}

// Guards against: gathered records that outlive the light they were made in, and those that go for nothing.
TEST(HemisphereSources, KeepRecordsUnlessLightChangesOrThereIsNoRoom) {
  for (const Interpolation level :
       {Interpolation::split_sphere, Interpolation::gradients, Interpolation::occlusion_hessian}) {
    const RayTracer rays(animated_room({}));
    ThreadCrew crew(rays, 1);
    const auto source = make_irradiance_cache(setup_of(rays, crew, level));
    const auto begin = [&](const SceneChange& change) { return source->begin_frame(change, crew); };
    begin({});
    EXPECT_EQ(begin({}), RecordsThen::stay);
    EXPECT_EQ(begin({.moved = {}, .camera = true}), RecordsThen::stay);
    EXPECT_EQ(begin({.moved = {}, .materials = true}), RecordsThen::go);
    EXPECT_EQ(begin({.moved = {}, .lights = true}), RecordsThen::go);
    SceneChange moved;
    moved.moved.emplace_back();
    EXPECT_EQ(begin(moved), RecordsThen::go);
    source->found_no_room();
    EXPECT_EQ(begin({}), RecordsThen::go);
    EXPECT_EQ(begin({}), RecordsThen::stay) << "there is room again";
  }
}

// Guards against: limits on the screen of a camera that has gone on, and a mean of light that has changed.
TEST(HemisphereSources, FollowTheCameraAndTheLight) {
  Scene scene = animated_room({.camera = true});
  scene.change_light = [](float frame, std::span<Material> materials, std::span<PointLight>) {
    for (Material& m : materials)
      if (m.emits()) m.emission = glm::vec3(frame < 8.0f ? 20.0f : 80.0f);
  };
  RayTracer rays(std::move(scene));
  ThreadCrew crew(rays, 1);
  const auto source = make_irradiance_cache(setup_of(rays, crew, Interpolation::occlusion_hessian));
  const auto radius = [&] { return source->shapes()->shaper.radius({-0.9f, 1.0f, 0.9f}, 1e-6f); };
  const auto mean = [&] { return source->shapes()->shaper.brightness_for(glm::vec3(0.0f)); };
  source->begin_frame(rays.go_to(0.0f), crew);
  const float R = radius(), E = mean();
  ASSERT_GT(E, 0.0f);
  source->begin_frame(rays.go_to(4.0f), crew);
  EXPECT_NE(radius(), R);
  EXPECT_EQ(mean(), E) << "only the camera moved";
  source->begin_frame(rays.go_to(12.0f), crew);
  EXPECT_GT(mean(), 2.0f * E);
}

// Guards against: details that are never free again, until records are extrapolated no more.
TEST(InstantCaching, UsesTheRoomForDetailsAnewInEveryFrame) {
  RayTracer rays(animated_room({.rigid = true}));
  ThreadCrew crew(rays, 1);
  InstantCachingSource source(setup_of(rays, crew, Interpolation::gradients));
  const PrimaryHits primary = primary_hits(rays, kWidth, kHeight);
  Tracer tracer(rays);
  std::uint64_t bytes = 0;
  for (std::uint32_t frame = 0; frame < 4; ++frame) {
    EXPECT_EQ(source.begin_frame(rays.go_to(static_cast<float>(frame)), crew), RecordsThen::go);
    for (std::uint32_t pixel = 0; pixel < primary.hits.size(); ++pixel) {
      const Visible x = primary.at(pixel, 0);
      if (!reflects(rays, x.hit)) continue;
      const Record r = source.evaluate(0, tracer, x, {});
      ASSERT_NE(r.id, RecordDetails::kNone);
      source.settle(0, r, InsertResult::inserted);
    }
    PassFigures figures;
    source.report(figures);
    if (frame == 0) bytes = figures.bytes_of_details;
    EXPECT_EQ(figures.bytes_of_details, bytes);
  }
  EXPECT_GT(bytes, 0u);
}

}  // namespace
}  // namespace icbench
