// Temporal instant caching: after every frame, whatever changed, each record in the cache equals one made anew with the
// same virtual lights, bit for bit; and so do the lights. Variants of the change that hide something from the source
// show that the comparison would notice.
#include "render/temporal.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "scene/registry.h"
#include "temporal_film.h"
#include "temporal_scenes.h"

namespace icbench {
namespace {

TEST(Temporal, EveryRecordIsAsIfMadeAnewWhateverChanges) {
  for (const auto& [level, leak_guard] : {std::pair{Interpolation::split_sphere, false},
                                          {Interpolation::gradients, false},
                                          {Interpolation::split_sphere, true},
                                          {Interpolation::gradients, true}})
    for (const NamedScene& s : animated_rooms()) {
      SCOPED_TRACE(s.name);
      Film film(s.scene, "wait_free", 2, kWidth, kHeight, 0.3f, kVpls, level, leak_guard);
      std::uint64_t made = 0, updated = 0, dropped = 0, leaks = 0;
      for (std::uint32_t frame = 0; frame < s.scene.frames + 4; ++frame) {
        film.begin(frame);
        ASSERT_EQ(film.difference(), "") << "frame " << frame << ", begun";
        film.render(frame);
        ASSERT_EQ(film.difference(), "") << "frame " << frame << ", rendered";
        ASSERT_GT(film.records, 20u);
        const PassFigures f = film.pass->figures();
        made += f.use.inserts;
        updated += f.records_updated;
        dropped += f.records_dropped;
        leaks += f.use.leaks.rays;
      }
      if (s.name == "camera") {
        EXPECT_EQ(updated, 0u);
      } else {
        EXPECT_GT(updated, 0u);
      }
      // What the camera leaves behind is dropped as well, in time. Where all rests, records go that others make
      // superfluous, which threads made at once: few.
      EXPECT_EQ(4 * dropped > made, s.name != "light" && s.name != "material") << dropped << " of " << made;
      EXPECT_EQ(film.sloped > 0, extrapolates(level));
      EXPECT_EQ(leaks > 0, leak_guard);
      EXPECT_LE(1e4 * static_cast<double>(film.otherwise), static_cast<double>(film.asked))
          << film.otherwise << " of " << film.asked;
    }
}

/// A number of frames that the environment asks for.
std::optional<std::uint32_t> frames_asked_for(const char* variable) {
  const char* const text = std::getenv(variable);
  if (text == nullptr) return std::nullopt;
  return static_cast<std::uint32_t>(std::strtoul(text, nullptr, 10));
}

/// Which frames of an animation are rendered, how large, and with how many virtual lights.
struct Footage {
  int width, height;
  std::uint32_t vpls;
  std::vector<std::uint32_t> frames;
};

/// As many frames as ICBENCH_TEMPORAL_FRAMES says (all 100 in the full form of tests/run); where it is not set, five
/// smaller ones from the start, then five from the middle: some things begin to move late.
Footage footage_of(const Scene& scene) {
  const auto asked = frames_asked_for("ICBENCH_TEMPORAL_FRAMES");
  Footage out{24, 18, 128, {}};
  if (asked) out = {32, 24, 256, {}};
  const std::uint32_t stretch = asked ? std::min(*asked, scene.frames) : 5;
  for (std::uint32_t frame = 0; frame < stretch; ++frame) out.frames.push_back(frame);
  if (!asked)
    for (std::uint32_t frame = 0; frame < stretch; ++frame) out.frames.push_back(scene.frames / 2 + frame);
  return out;
}

class TemporalScene : public ::testing::TestWithParam<std::tuple<std::string, Interpolation>> {};

TEST_P(TemporalScene, EveryRecordIsAsIfMadeAnewInEveryFrame) {
  const auto& [name, level] = GetParam();
  const Scene scene = make_scene(name);
  if (!scene.is_animated()) GTEST_SKIP() << "nothing changes";
  const Footage footage = footage_of(scene);
  ASSERT_FALSE(footage.frames.empty());
  Film film(scene, "wait_free", 2, footage.width, footage.height, 0.3f, footage.vpls, level);
  for (const std::uint32_t frame : footage.frames) {
    film.begin(frame);
    ASSERT_EQ(film.difference(), "") << "frame " << frame << ", begun";
    film.render(frame);
    ASSERT_EQ(film.difference(), "") << "frame " << frame << ", rendered";
    ASSERT_GT(film.records, 0u);
  }
}

std::vector<std::string> scene_names() {
  std::vector<std::string> out;
  for (const SceneEntry& scene : kScenes) out.emplace_back(scene.name);
  return out;
}

INSTANTIATE_TEST_SUITE_P(Suite, TemporalScene,
                         ::testing::Combine(::testing::ValuesIn(scene_names()),
                                            ::testing::Values(Interpolation::split_sphere,
                                                              Interpolation::gradients)),
                         [](const auto& test) {
                           const bool has_gradients = std::get<1>(test.param) == Interpolation::gradients;
                           return std::get<0>(test.param) + (has_gradients ? "_gradients" : "");
                         });

TEST(Temporal, ItDoesSoWithEveryCacheAndNumberOfThreads) {
  const Scene scene = animated_room({true, true, true, true, true}, 6);
  for (const CacheEntry& cache : all_caches()) {
    for (const unsigned threads : {1u, 5u}) {
      if (cache.traits.single_thread && threads > 1) continue;
      SCOPED_TRACE(::testing::Message() << cache.traits.name << ", " << threads << " threads");
      Film film(scene, cache.traits.name, threads);
      for (std::uint32_t frame = 0; frame < 5; ++frame) {
        film.begin(frame);
        ASSERT_EQ(film.difference(), "") << "frame " << frame << ", begun";
        film.render(frame);
        ASSERT_EQ(film.difference(), "") << "frame " << frame << ", rendered";
        if (cache.traits.consistency != Consistency::none) {
          ASSERT_GT(film.records, 20u);
        }
      }
    }
  }
}

// Frames until the comparison notices; nothing if it never does.
std::optional<std::uint32_t> noticed(const Scene& scene, const Falsify& falsify) {
  Film film(scene, "sequential", 1);
  for (std::uint32_t frame = 0; frame < 16; ++frame) {
    film.begin(frame, falsify);
    if (!film.difference().empty()) return frame;
    film.render(frame);
  }
  return std::nullopt;
}
std::optional<std::uint32_t> noticed(const Animations& a, const Falsify& falsify) {
  return noticed(animated_room(a), falsify);
}

TEST(Temporal, WhatIsHiddenFromItIsNoticed) {
  EXPECT_FALSE(noticed({.rigid = true}, [](SceneChange&) {}));
  EXPECT_TRUE(noticed({.rigid = true}, [](SceneChange& c) { c.moved.clear(); }));
  EXPECT_TRUE(noticed({.deforming = true}, [](SceneChange& c) { c.moved.clear(); }));
  EXPECT_TRUE(noticed({.light = true}, [](SceneChange& c) { c.lights = c.materials = false; }));
  EXPECT_TRUE(noticed({.material = true}, [](SceneChange& c) { c.materials = false; }));
  EXPECT_TRUE(noticed({.rigid = true}, [](SceneChange& c) {
    for (MovedMesh& m : c.moved) m.before = m.after;
  })) << "the old position is ignored";
  EXPECT_TRUE(noticed({.rigid = true}, [](SceneChange& c) {
    for (MovedMesh& m : c.moved) m.after = m.before;
  })) << "the new position is ignored";
  EXPECT_TRUE(noticed({.rigid = true}, [](SceneChange& c) {
    for (MovedMesh& m : c.moved)
      for (PosedBox* box : {&m.before, &m.after}) {
        const glm::vec3 margin = 0.15f * (box->box.upper - box->box.lower);
        box->box = {box->box.lower + margin, box->box.upper - margin};
      }
  })) << "the boxes are too small";
}

// 2,000 frames; as many as ICBENCH_DRIFT_FRAMES says where it is set (10,000 in the full form of tests/run).
TEST(Temporal, NothingDriftsOverManyFrames) {
  const std::uint32_t frames = frames_asked_for("ICBENCH_DRIFT_FRAMES").value_or(2'000);
  ASSERT_GT(frames, 200u);
  Film film(animated_room({.rigid = true, .deforming = true, .camera = true}, 7), "wait_free", 1, 8, 6, 0.5f,
            64);
  std::uint64_t most = 0;
  std::size_t bytes = 0;
  for (std::uint32_t frame = 0; frame < frames; ++frame) {
    film.begin(frame);
    film.render(frame);
    ASSERT_EQ(film.difference(), "") << "frame " << frame;
    most = std::max(most, film.pass->figures().records);
    if (frame == 200) bytes = film.pass->figures().bytes_beside_cache;
  }
  EXPECT_LT(most, 1000u);
  EXPECT_EQ(film.pass->figures().bytes_beside_cache, bytes) << "ids of dropped records are not used again";
}

// Guards against: rays of compensation that are not traced again where what they meet was black.
TEST(Temporal, WhatWasBlackReflectsOnceItIsNot) {
  Scene scene = animated_room({}, 4);
  scene.change_light = [red = scene.meshes[2].material](float frame, std::span<Material> materials,
                                                        std::span<PointLight>) {
    materials[red].albedo = glm::vec3(frame == 1.0f ? 0.0f : 0.6f);
  };
  ASSERT_EQ(scene.meshes[2].name, "block");
  EXPECT_EQ(noticed(scene, [](SceneChange&) {}), std::nullopt);
  EXPECT_TRUE(noticed(scene, [](SceneChange& c) { c.materials = false; }));
}

// Guards against: paths of point lights that are kept though those moved, where no material says that light changed.
TEST(Temporal, WhatPointLightsLitIsLitAnewAsTheyMove) {
  Scene scene = animated_room({}, 4);
  scene.point_lights.push_back({.p = {0.2f, 1.0f, 0.2f}, .intensity = glm::vec3(1.0f)});
  scene.change_light = [](float frame, std::span<Material>, std::span<PointLight> lights) {
    lights[0].p.x = 0.1f * frame;
  };
  EXPECT_EQ(noticed(scene, [](SceneChange&) {}), std::nullopt);
  EXPECT_TRUE(noticed(scene, [](SceneChange& c) { c.lights = false; }));
}

// Guards against: light that left an open scene, and nothing that notes where it went.
TEST(Temporal, WhatMovesIntoTheWayOfLightThatLeftTheSceneIsLit) {
  Scene scene;
  scene.name = "yard";
  scene.frames = 16;
  const auto grey = scene.add_material({.albedo = glm::vec3(0.7f)});
  const auto lamp = scene.add_material({.emission = glm::vec3(20.0f)});
  scene.meshes.push_back(quad("ground", {-1, 0, -1}, {0, 0, 2}, {2, 0, 0}, grey));
  scene.meshes.push_back(quad("lamp", {-0.1f, 0.5f, -0.1f}, {0.2f, 0, 0}, {0, 0, 0.2f}, lamp));
  scene.meshes.push_back(box("cloud", {{-0.5f, -0.1f, -0.5f}, {0.5f, 0.1f, 0.5f}}, grey));
  scene.meshes.back().pose = [](float frame) {
    return Pose{glm::mat3(1.0f), {3.0f - 0.4f * frame, 3.0f, 0.0f}};
  };
  scene.camera = {.eye = {0, 1.5f, 6}, .target = {0, 1.5f, 0}, .up = {0, 1, 0}, .fov_y = 0.7f};
  Film film(scene, "sequential", 1);
  std::uint64_t retraced = 0, paths = 0;
  for (std::uint32_t frame = 0; frame < 16; ++frame) {
    film.begin(frame);
    ASSERT_EQ(film.difference(), "") << frame;
    film.render(frame);
    const PassFigures f = film.pass->figures();
    if (frame == 0) continue;
    retraced += f.light_paths_retraced;
    paths += f.light_paths;
  }
  EXPECT_GT(retraced, 0u);
  EXPECT_LT(4 * retraced, paths);
}

TEST(Temporal, ItsPicturesAreThoseOfStaticInstantCaching) {
  const Scene scene = animated_room({true, true, false, false, false});
  Film film(scene, "sequential", 1, 64, 48, 0.15f);
  const IntegratorEntry& still = find_integrator("instant_caching");
  double kept = 0.0, fresh = 0.0;
  ThreadCrew crew(film.rays, 1);
  PassSetup setup{film.rays, crew, 64, 48};
  setup.vpls = kVpls;
  CachedPassSetup cached;
  cached.cache.bounds = film.rays.scene().bounds;
  cached.cache.a = cached.cache.a_max = 0.15f;
  cached.cache.capacity = capacity_for(64 * 48, 1);
  const auto pass = find_cache("sequential").pass(cached, still.source(setup), crew);
  Image image = blank(64, 48);
  for (std::uint32_t frame = 0; frame < 16; ++frame) {
    film.begin(frame);
    film.render(frame);
    pass->begin_frame({});
    pass->begin_sample(film.primary, {});
    crew.run([&](unsigned t, Tracer& tracer) {
      for (const Tile& tile : make_tiles(64, 48, 8, TileOrder::morton))
        pass->tile(t, tracer, film.primary, {}, tile, image);
    });
    pass->end_sample(film.primary, image);
    for (std::size_t i = 0; i < image.pixels.size(); ++i) {
      kept += film.indirect.pixels[i].x + film.indirect.pixels[i].y + film.indirect.pixels[i].z;
      fresh += image.pixels[i].x + image.pixels[i].y + image.pixels[i].z;
    }
  }
  EXPECT_NEAR(kept / fresh, 1.0, 0.01);
}

}  // namespace
}  // namespace icbench
