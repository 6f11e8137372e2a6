// Temporal instant caching: after every frame, whatever changed, each record in the cache equals one made anew with the
// same virtual lights, bit for bit; and so do the lights. Variants of the change that hide something from the source
// show that the comparison would notice.
#include "render/temporal.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "render_support.h"
#include "scene/registry.h"
#include "temporal_scenes.h"
#include "workload/cached_pass.h"
#include "workload/dispatch.h"

namespace icbench {
namespace {

constexpr std::uint32_t kVpls = 128;
constexpr int kWidth = 32, kHeight = 24;

using Falsify = std::function<void(SceneChange&)>;

/// Passes everything on, and remembers which hit every record was made at.
class Witness final : public RecordSource {
 public:
  explicit Witness(const PassSetup& setup) : source(setup) {}

  RecordsThen begin_frame(const SceneChange& change, Crew& crew) override {
    return source.begin_frame(change, crew);
  }
  Record evaluate(unsigned thread, Tracer& tracer, const Visible& x, const SampleKey& key) noexcept override {
    const Record r = source.evaluate(thread, tracer, x, key);
    const std::lock_guard lock(mutex_);
    hits.insert_or_assign({r.p.x, r.p.y, r.p.z}, x.hit);
    return r;
  }
  void settle(unsigned thread, const Record& r, InsertResult result) noexcept override {
    source.settle(thread, r, result);
  }
  UpdateResult update(Record& r) noexcept override { return source.update(r); }
  void updated() noexcept override { source.updated(); }
  std::span<const Record> to_insert() const noexcept override { return source.to_insert(); }
  void refused(const Record& r) override { source.refused(r); }
  RecordShapes* shapes() noexcept override { return source.shapes(); }
  UseToTell tells() const noexcept override { return source.tells(); }
  void used(const Record& r) noexcept override { source.used(r); }
  void report(PassFigures& figures) const noexcept override { source.report(figures); }

  TemporalSource source;
  std::map<std::array<float, 3>, Hit> hits;  // by place

 private:
  std::mutex mutex_;
};

/// An animation by temporal instant caching through one cache.
class Film {
 public:
  Film(const Scene& scene, std::string_view cache, unsigned threads, int width = kWidth, int height = kHeight,
       float a = 0.3f, std::uint32_t vpls = kVpls, Interpolation interpolation = Interpolation::split_sphere,
       bool leak_guard = false)
      : rays(scene),
        crew_(rays, threads),
        primary(rays.scene(), width, height),
        direct(blank(width, height)),
        indirect(blank(width, height)),
        tiles_(make_tiles(width, height, 8, TileOrder::morton)) {
    PassSetup setup{rays, crew_, width, height};
    setup.vpls = vpls;
    setup.a = a;
    setup.interpolation = interpolation;
    setup.leak_guard = leak_guard;
    auto made = std::make_unique<Witness>(setup);
    witness = made.get();
    CachedPassSetup cached;
    cached.cache.bounds = rays.scene().bounds;
    cached.cache.a = cached.cache.a_max = search_reach(interpolation, true) * a;
    cached.cache.max_sessions = threads;
    cached.cache.capacity = capacity_for(4ull * primary.hits.size(), threads);
    pass = find_cache(cache).pass(cached, std::move(made), crew_);
  }

  void begin(
      std::uint32_t frame, const Falsify& falsify = [](SceneChange&) {}) {
    SceneChange change = rays.go_to(static_cast<float>(frame));
    moved.assign(rays.scene().meshes.size(), false);
    begun = true;
    for (const MovedMesh& m : change.moved) moved[m.mesh] = true;
    falsify(change);
    pass->begin_frame(change);
  }

  void render(std::uint32_t frame) {
    begun = false;
    const CameraView view(rays.scene().camera, primary.width, primary.height);
    const SampleKey key{1, frame, 0};
    const auto for_all = [&](const auto& f) {
      crew_.for_each(tiles_.size(), 1,
                     [&](unsigned t, Tracer& tracer, std::size_t i) { f(t, tracer, tiles_[i]); });
    };
    for_all([&](unsigned, Tracer& tracer, const Tile& tile) {
      visible_tile(tracer, pass->light(), view, Lens::centre, key, 1, tile, primary, direct);
    });
    pass->begin_sample(primary, key);
    for_all([&](unsigned t, Tracer& tracer, const Tile& tile) {
      pass->tile(t, tracer, primary, key, tile, indirect);
    });
    pass->end_sample(primary, indirect);
  }

  /// The first thing in which what is kept differs from what would be made anew; empty if nothing does.
  std::string difference() {
    Tracer tracer(rays);
    const VplSet& vpls = witness->source.vpls();
    VplSet anew = vpls;
    if (trace_all(anew, tracer).any()) return "virtual lights";
    const Bounds& bounds = rays.scene().bounds;
    const RadiusRays radius(bounds, radius_limits(bounds));
    RecordShapes* shapes = witness->shapes();
    const MovingShadows moving(rays, vpls.vpls());
    std::vector<std::uint64_t> open(vpls.vpls().words()), all(vpls.vpls().words()), suspects, scratch;
    const float clamp = vpl_clamp(bounds);
    std::string first;
    records = 0;
    pass->for_each_record([&](const Record& r) {
      ++records;
      if (!first.empty()) return;
      const Hit& hit = witness->hits.at({r.p.x, r.p.y, r.p.z});
      if (begun && moved[hit.mesh]) first = "a record on a mesh that moved";
      const Hit point = record_point(hit);
      DistanceCodes codes;
      radius.trace(tracer, point, RadiusRays::kAll, codes);
      const Packing packing = witness->source.packing(hit.mesh);
      trace_visibility(tracer, point, vpls.vpls(), all, packing);
      std::span<const std::uint64_t> seen = all;
      if (packing == Packing::exact) {
        trace_visibility(tracer, point, vpls.vpls(), open, packing, Shapes::still);
        seen = moving.unhidden(tracer, point, vpls.vpls(), open, suspects, scratch);
        for (std::size_t w = 0; w < all.size(); ++w) {
          otherwise += static_cast<std::uint64_t>(std::popcount(seen[w] ^ all[w]));
          if (w < suspects.size()) asked += static_cast<std::uint64_t>(std::popcount(suspects[w]));
        }
      }
      const Irradiance E = irradiance_from(seen, point, vpls.vpls(), clamp) +
                           compensate_record(tracer, point, vpls, clamp, packing).E;
      Record expected{point.p, point.n, radius.radius(codes), E, r.id};
      if (shapes != nullptr && extrapolates(shapes->shaper.level())) {
        RecordDetail detail;
        IrradianceGradients gradients;
        irradiance_from(seen, point, vpls.vpls(), clamp, gradients);
        expected.R = shapes->shaper.shape_of_vpls(expected.R, E, gradients, detail);
        const IrradianceGradients& kept = shapes->details[r.id].gradients;
        if (std::memcmp(&kept, &detail.gradients, sizeof kept) != 0) first = "gradients";
        sloped += detail.gradients.translational[1] != glm::vec3(0.0f) ? 1 : 0;
      }
      if (r.R != expected.R) first = "radius";
      if (std::memcmp(&r.E, &E, sizeof E) != 0) first = "irradiance";
      if (std::memcmp(&r, &expected, sizeof r) != 0 && first.empty()) first = "place";
    });
    return first;
  }

  RayTracer rays;

 private:
  ThreadCrew crew_;

 public:
  PrimaryHits primary;
  Image direct, indirect;
  Witness* witness = nullptr;
  std::unique_ptr<IndirectPass> pass;
  std::vector<bool> moved;    // by mesh
  bool begun = false;         // a frame, of which nothing has been rendered yet
  std::uint64_t records = 0;  // seen by difference()
  std::uint64_t sloped = 0;   // of them all, those with a gradient
  std::uint64_t asked = 0;  // VPLs that something that moves may hide, of records that see them but for that
  std::uint64_t otherwise =
      0;  // of these, seen by rays in full packets and hidden by rays alone, or the reverse

 private:
  std::vector<Tile> tiles_;
};

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

// Guards against: records that the guard against leaks asks for, and that are then taken for unused.
TEST(Temporal, RecordsThatAreInUseStayWhereLeaksAreGuardedAgainst) {
  const Scene scene = animated_room({.rigid = true});
  for (const bool leak_guard : {false, true}) {
    Film film(scene, "wait_free", 1, kWidth, kHeight, 0.3f, kVpls, Interpolation::gradients, leak_guard);
    std::uint64_t made = 0, first = 0;
    for (std::uint32_t frame = 0; frame < 40; ++frame) {
      film.begin(frame);
      film.render(frame);
      (frame == 0 ? first : made) += film.pass->figures().use.inserts;
    }
    EXPECT_LT(made, 40 * first / 4) << leak_guard;
  }
}

// Frames until the comparison notices; nothing if it never does.
std::optional<std::uint32_t> noticed(const Animations& a, const Falsify& falsify) {
  Film film(animated_room(a), "sequential", 1);
  for (std::uint32_t frame = 0; frame < 16; ++frame) {
    film.begin(frame, falsify);
    if (!film.difference().empty()) return frame;
    film.render(frame);
  }
  return std::nullopt;
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

TEST(Temporal, RecordsThatNoPixelUsesGoInTime) {
  // Every frame looks elsewhere and leaves many records behind.
  Film film(animated_room({.camera = true}, 97), "wait_free", 1, 64, 48, 0.03f, 16);
  std::uint64_t made = 0, dropped = 0, most = 0;
  for (std::uint32_t frame = 0; frame < 30; ++frame) {
    film.begin(frame);
    film.render(frame);
    const PassFigures f = film.pass->figures();
    made += f.use.inserts;
    dropped += f.records_dropped;
    most = std::max(most, f.records);
    ASSERT_EQ(f.records, made - dropped);
  }
  EXPECT_GT(made, 15'000u) << "the test asks for too few records";
  EXPECT_GT(dropped, made / 3);
  // In use, what they may grow by, and what is made until the rest goes.
  EXPECT_LT(most, 64 * 48 + 64 * 48 / 16 + 64 + 64 * 48);
  ASSERT_EQ(film.difference(), "");
}

TEST(Temporal, RecordsThatNoPixelUsesGoThoughNoneIsNew) {
  // The camera closes in on what it sees already, while something goes on moving.
  Scene scene = animated_room({.rigid = true}, 97);
  scene.camera_path = [wide = scene.camera](float frame) {
    Camera camera = wide;
    if (frame > 2.0f) camera.fov_y *= 0.25f;
    return camera;
  };
  Film film(scene, "wait_free", 1, 64, 48, 0.05f, 16);
  std::uint64_t first = 0, last = 0;
  for (std::uint32_t frame = 0; frame < 40; ++frame) {
    film.begin(frame);
    film.render(frame);
    last = film.pass->figures().records;
    if (frame == 2) first = last;
  }
  EXPECT_LT(last, first / 2);
}

// Records of an animation's frames by instant caching.
std::vector<std::uint64_t> records_made_anew(const Scene& scene, int width, int height, float a,
                                             std::uint32_t frames) {
  RayTracer rays(scene);
  ThreadCrew crew(rays, 1);
  PassSetup setup{rays, crew, width, height};
  setup.vpls = 16;
  setup.interpolation = Interpolation::gradients;
  CachedPassSetup cached;
  cached.cache.bounds = rays.scene().bounds;
  cached.cache.a = cached.cache.a_max = search_reach(setup.interpolation, true) * a;
  cached.cache.capacity = capacity_for(4ull * static_cast<std::uint64_t>(width * height), 1);
  const auto pass =
      find_cache("sequential").pass(cached, find_integrator("instant_caching").source(setup), crew);
  PrimaryHits primary(rays.scene(), width, height);
  Image direct = blank(width, height), indirect = direct;
  const std::vector<Tile> tiles = make_tiles(width, height, 8, TileOrder::morton);
  std::vector<std::uint64_t> out;
  for (std::uint32_t frame = 0; frame < frames; ++frame) {
    const SceneChange change = rays.go_to(static_cast<float>(frame));
    const CameraView view(rays.scene().camera, width, height);
    const SampleKey key{1, frame, 0};
    pass->begin_frame(change);
    crew.run([&](unsigned, Tracer& tracer) {
      for (const Tile& tile : tiles)
        visible_tile(tracer, pass->light(), view, Lens::centre, key, 1, tile, primary, direct);
    });
    pass->begin_sample(primary, key);
    crew.run([&](unsigned t, Tracer& tracer) {
      for (const Tile& tile : tiles) pass->tile(t, tracer, primary, key, tile, indirect);
    });
    pass->end_sample(primary, indirect);
    out.push_back(pass->figures().records);
  }
  return out;
}

// Guards against: keeping every record that some pixel uses, though others would do, of which there are more with each
// frame in which something moves.
TEST(Temporal, RecordsDoNotBecomeManyMoreThanWouldBeMadeAnew) {
  constexpr std::uint32_t kFrames = 48;
  const Scene scene = animated_room({.rigid = true}, 64);
  const std::vector<std::uint64_t> anew = records_made_anew(scene, 64, 48, 0.06f, kFrames);
  Film film(scene, "sequential", 1, 64, 48, 0.06f, 16, Interpolation::gradients);
  double most = 0.0, late = 0.0;
  for (std::uint32_t frame = 0; frame < kFrames; ++frame) {
    film.begin(frame);
    film.render(frame);
    const double ratio = static_cast<double>(film.pass->figures().records) / static_cast<double>(anew[frame]);
    most = std::max(most, ratio);
    if (frame >= kFrames / 2) late += ratio / (kFrames / 2);
  }
  EXPECT_LT(most, 1.25) << "unused records stay until others are swept away";
  EXPECT_LT(late, 1.04);  // 1.06 where all that are used stay
  EXPECT_GT(anew.front(), 500u) << "too few for the slack that there always is";
}

// Guards against: updating records at a greater cost than making them anew; kept ones of one kind of frame in the
// other; and dropping those that nothing has touched, because unused ones go.
TEST(Temporal, WhereMostChangesAllIsMadeAnew) {
  Scene scene = animated_room({.rigid = true}, 97);
  // In frames 4 to 11 the moving box fills much of the room, and from 7 on it rests there.
  const auto is_large = [](float frame) { return frame > 3.5f && frame < 11.5f; };
  scene.meshes.back().pose = [is_large](float frame) {
    if (!is_large(frame)) return Pose{glm::mat3(1.0f), {0.01f * frame, 0.6f, 0.0f}};
    return Pose{glm::mat3(4.0f), {0.01f * std::min(frame, 7.0f), 0.9f, -0.3f}};
  };
  Film film(scene, "wait_free", 2, 64, 48, 0.05f);
  std::uint64_t before = 0;
  for (std::uint32_t frame = 0; frame < 16; ++frame) {
    SCOPED_TRACE(frame);
    film.begin(frame);
    ASSERT_EQ(film.difference(), "") << "begun";
    film.render(frame);
    ASSERT_EQ(film.difference(), "") << "rendered";
    const PassFigures f = film.pass->figures();
    // The large box hides what it left and comes to: nothing made before, while it moves, or as it goes is kept.
    const bool all_anew = frame == 0 || (frame >= 4 && frame <= 7) || frame == 12 || frame == 13;
    EXPECT_EQ(f.records_kept + f.records_updated == 0, all_anew);
    EXPECT_EQ(f.records_dropped == before, all_anew);
    if (frame >= 8 && frame <= 11) {
      EXPECT_EQ(f.records_updated, 0u);
      EXPECT_EQ(f.records_dropped, 0u);
    }
    EXPECT_EQ(f.records, before - f.records_dropped + f.use.inserts);
    before = f.records;
  }
  EXPECT_GT(before, 300u) << "too few for a sweep";
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
