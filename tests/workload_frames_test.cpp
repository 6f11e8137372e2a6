// Pictures of many samples and of many frames.
#include <gtest/gtest.h>

#include <atomic>
#include <numeric>
#include <vector>

#include "harness/thread_team.h"
#include "scene/room.h"
#include "scene/shapes.h"
#include "workload/frame_renderer.h"

namespace icbench {
namespace {

FrameRequest request_of(RayTracer& rays, ThreadTeam& team, std::string_view integrator) {
  FrameRequest request{rays, team, find_integrator(integrator), find_cache("packed_wait_free")};
  request.gather = 16;
  request.a = 0.2f;
  return request;
}

// Guards against: sums of millions of floats, each of which loses what is below the last digit of all before.
TEST(Frames, TheMeanOfManyEqualSamplesIsTheirs) {
  Scene s;
  const glm::vec3 emission(0.7f, 0.6f, 0.55f);
  s.add_material({.emission = emission});
  s.meshes.push_back(quad("lamp", {-9, -9, 0}, {18, 0, 0}, {0, 18, 0}, 0));
  RayTracer rays(std::move(s));
  ThreadTeam team(Topology::of_this_process(), Placement::none, 1);
  FrameRequest request = request_of(rays, team, "whitted");
  request.width = request.height = 1;
  request.spp = 1 << 16;
  FrameRenderer renderer(request);
  renderer.render(0);
  const glm::vec3 mean = renderer.picture().pixels.at(0);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(mean[c] / emission[c], 1.0f, 1e-6f);
}

// Guards against: progress that is told of indirect light alone, so that the time left is reckoned from a tile although
// all of them have been seen, and a picture of seconds seems to take hours.
TEST(Frames, ProgressIsToldAsTilesAreSeen) {
  Scene s;
  const auto lamp = s.add_material({.emission = glm::vec3(1)});
  s.meshes.push_back(quad("lamp", {-9, -9, 0}, {18, 0, 0}, {0, 18, 0}, lamp));
  RayTracer rays(std::move(s));
  ThreadTeam team(Topology::of_this_process(), Placement::none, 1);
  FrameRequest request = request_of(rays, team, "whitted");
  request.width = request.height = 40;
  request.spp = 2;
  std::vector<double> told;
  request.progress = [&](double work) { told.push_back(work); };
  const double tiles = frame_work(request);
  FrameRenderer(request).render(0);
  EXPECT_EQ(told.size(), 2 * tiles) << "once as a tile is seen, once as it is lit";
  EXPECT_EQ(std::accumulate(told.begin(), told.end(), 0.0), tiles);
}

// Guards against: records that are made before or after the tiles, in waves or for an overture, of which nothing is
// told, or the tiles' work once more.
TEST(Frames, ProgressIsToldOfAllWorkOnce) {
  Scene s;
  const auto white = s.add_material({.albedo = glm::vec3(0.7f)});
  add_room(s, {{-1, 0, -1}, {1, 2, 1}}, {white, white, white, white, white, white});
  s.camera = {{0, 1, 0}, {0, 1, -1}, {0, 1, 0}, 1.0f};
  RayTracer rays(std::move(s));
  ThreadTeam team(Topology::of_this_process(), Placement::none, 2);
  for (const bool deterministic : {false, true}) {
    for (const bool overture : {false, true}) {
      FrameRequest request = request_of(rays, team, "irradiance_cache");
      request.width = 50;
      request.height = 40;
      request.spp = 2;
      request.deterministic = deterministic;
      request.overture = overture;
      std::atomic<double> told = 0.0, most = 0.0;
      request.progress = [&](double work) {
        told += work;
        for (double seen = most; work > seen && !most.compare_exchange_weak(seen, work);) continue;
      };
      const double tiles = frame_work(request);
      FrameRenderer(request).render(0);
      EXPECT_NEAR(told, tiles, 1e-9 * tiles) << deterministic << overture;
      EXPECT_LT(most, 0.8 * tiles) << deterministic << overture;
    }
  }
}

/// A corridor with lamps, through which the camera moves `step` metres a frame: little of what a frame sees was near
/// enough before for its records to do.
Scene corridor(std::uint32_t frames, float step) {
  Scene s;
  const auto white = s.add_material({.albedo = glm::vec3(0.7f)});
  const auto lamp = s.add_material({.emission = glm::vec3(4)});
  const float length = step * static_cast<float>(frames);
  add_room(s, {{-1, 0, -2}, {1, 2, length + 8.0f}}, {white, white, white, white, white, white});
  for (float z = 0.0f; z < length + 8.0f; z += 4.0f)
    s.meshes.push_back(quad("lamp", {-0.2f, 1.99f, z}, {0.4f, 0, 0}, {0, 0, 0.4f}, lamp));
  s.frames = frames;
  s.camera_path = [step](float frame) {
    return Camera{{0, 1, step * frame}, {0, 0.8f, step * frame + 1.0f}, {0, 1, 0}, 1.0f};
  };
  return s;
}

// Guards against: a cache that is full for ever once a long way has filled it, so that every pixel gathers for itself.
TEST(Frames, ACacheThatIsFullIsNotFullForEver) {
  for (const Interpolation level : {Interpolation::split_sphere, Interpolation::gradients}) {
    constexpr std::uint32_t kFrames = 150;
    RayTracer rays(corridor(kFrames, 5.0f));
    ThreadTeam team(Topology::of_this_process(), Placement::none, 2);
    FrameRequest request = request_of(rays, team, "irradiance_cache");
    request.interpolation = level;
    request.a = 0.03f;
    request.width = 24;
    request.height = 18;
    FrameRenderer renderer(request);
    std::uint32_t full = 0, row = 0;
    for (std::uint32_t frame = 0; frame < kFrames; ++frame) {
      const CacheUse use = renderer.render(frame).pass.use;
      row = use.full > use.queries / 16 ? row + 1 : 0;
      full += use.full > 0;
      ASSERT_LE(row, 1u) << "frame " << frame << ": " << use.full << " of " << use.queries
                         << " found no room";
    }
    EXPECT_GT(full, 0u) << "the way is too short to fill the cache";
  }
}

// A lamp over a floor that shines away from it in the first quarter of the animation.
Scene turning_lamp() {
  Scene s;
  const auto white = s.add_material({.albedo = glm::vec3(0.7f)});
  const auto lamp = s.add_material({.emission = glm::vec3(4)});
  s.meshes.push_back(quad("floor", {-9, 0, -9}, {0, 0, 18}, {18, 0, 0}, white));
  s.meshes.push_back(quad("lamp", {-0.5f, 0, -0.5f}, {1, 0, 0}, {0, 0, 1}, lamp));
  s.meshes.back().pose = [](float frame) {
    glm::mat3 linear(1.0f);
    if (frame < 25.0f) linear[1][1] = linear[2][2] = -1.0f;
    return Pose{linear, {0, 1, 0}};
  };
  s.frames = 100;
  s.camera = {.eye = {0, 2, 6}, .target = {0, 0, 0}, .up = {0, 1, 0}, .fov_y = 1.0f};
  return s;
}

// Guards against: a hundred times the virtual lights that were asked for, where an animation's first frame is dark.
TEST(Frames, VirtualLightsAreAsManyAsWereAskedForThoughTheFirstFrameHasNone) {
  for (const char* method : {"instant_gi", "instant_caching", "temporal_instant_caching"}) {
    RayTracer rays(turning_lamp());
    ThreadTeam team(Topology::of_this_process(), Placement::none, 1);
    FrameRequest request = request_of(rays, team, method);
    request.width = request.height = 8;
    request.vpls = 256;
    FrameRenderer renderer(request);
    EXPECT_LT(renderer.render(0).pass.vpls_in_use, 26u) << method;
    const auto lit = renderer.render(60).pass.vpls_in_use;
    EXPECT_GT(lit, 192u) << method;
    EXPECT_LT(lit, 320u) << method;
  }
}

}  // namespace
}  // namespace icbench
