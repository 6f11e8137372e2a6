// Temporal instant caching: which records go, and when: those that no pixel uses, those that others make superfluous,
// and all of them where that costs less than updates.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <string_view>
#include <vector>

#include "render/needed_record.h"
#include "temporal_film.h"
#include "temporal_scenes.h"

namespace icbench {
namespace {

// Guards against: records that the guard against leaks asks for, and that are then taken for unused.
TEST(TemporalRecords, RecordsThatAreInUseStayWhereLeaksAreGuardedAgainst) {
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

TEST(TemporalRecords, RecordsThatNoPixelUsesGoInTime) {
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

TEST(TemporalRecords, RecordsThatNoPixelUsesGoThoughNoneIsNew) {
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
    pass->begin_frame(rays.go_to(static_cast<float>(frame)));
    const CameraView view(rays.scene().camera, width, height);
    render_sample(*pass, crew, view, Lens::centre, {1, frame, 0}, tiles, primary, direct, indirect);
    out.push_back(pass->figures().records);
  }
  return out;
}

// Guards against: keeping every record that some pixel uses, though others would do, of which there are more with each
// frame in which something moves.
TEST(TemporalRecords, RecordsDoNotBecomeManyMoreThanWouldBeMadeAnew) {
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

// Guards against: updates of records that the camera left behind, beside which those of the new view are made.
TEST(TemporalRecords, WhatTheCameraLeavesBehindGoesBeforeTheNextUpdate) {
  constexpr std::uint32_t kFrames = 12;
  Scene scene = animated_room({.rigid = true}, 64);
  scene.camera_path = [wide = scene.camera](float frame) {
    Camera camera = wide;
    camera.fov_y *= 0.3f;
    const glm::vec3 ahead = wide.target - wide.eye, right = glm::normalize(glm::cross(ahead, wide.up));
    const float angle = 0.5f * frame;  // more than the width of a picture
    camera.target = wide.eye + std::cos(angle) * ahead + std::sin(angle) * glm::length(ahead) * right;
    return camera;
  };
  const std::vector<std::uint64_t> anew = records_made_anew(scene, 64, 48, 0.06f, kFrames);
  Film film(scene, "sequential", 1, 64, 48, 0.06f, 16, Interpolation::gradients);
  std::uint64_t all = 0, all_anew = 0;
  for (std::uint32_t frame = 0; frame < kFrames; ++frame) {
    film.begin(frame);
    film.render(frame);
    all += film.pass->figures().records;
    all_anew += anew[frame];
    ASSERT_EQ(film.difference(), "") << frame;
  }
  EXPECT_LT(all,
            1.2 * static_cast<double>(all_anew));  // 3.3 times, if all that are left are brought up to date
}

// Guards against: updating records at a greater cost than making them anew; kept ones of one kind of frame in the
// other; and dropping those that nothing has touched, because unused ones go.
TEST(TemporalRecords, WhereMostChangesAllIsMadeAnew) {
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

// Guards against: naming a record that is kept nowhere, by which those that are kept seem superfluous.
TEST(TemporalRecords, OneWithoutAnIdIsNeededByNobody) {
  struct Told final : RecordSource {
    RecordsThen begin_frame(const SceneChange&, Crew&) override { return RecordsThen::stay; }
    Record evaluate(unsigned, Tracer&, const Visible&, const SampleKey&) noexcept override { return {}; }
    void used(const Record& r) noexcept override { ids.push_back(r.id); }
    std::vector<std::uint32_t> ids;
  };
  Told told;
  const auto offer_and_tell = [&](std::vector<std::uint32_t> ids) {
    NeededRecord needed;
    for (std::uint64_t order = 0; order < ids.size(); ++order)
      needed.offer({{}, {}, 0.0f, {}, ids[order]}, order);
    needed.tell(told);
  };
  offer_and_tell({RecordTable::kNone, 7, 8});
  offer_and_tell({RecordTable::kNone});
  offer_and_tell({});
  EXPECT_EQ(told.ids, std::vector<std::uint32_t>{7});
}

// Guards against: taking what can move but rests for a reason to make all anew.
TEST(TemporalRecords, StayWhereWhatHidesMuchRests) {
  Scene scene = animated_room({.rigid = true}, 97);
  scene.meshes.back().pose = [](float) { return Pose{glm::mat3(4.0f), {0.0f, 0.9f, -0.3f}}; };
  Mesh mote =
      box("mote", {{-0.005f, -0.005f, -0.005f}, {0.005f, 0.005f, 0.005f}}, scene.meshes.back().material);
  mote.pose = [](float frame) { return Pose{glm::mat3(1.0f), {0.9f, 0.02f + 0.002f * frame, 0.9f}}; };
  scene.meshes.push_back(mote);
  Film film(scene, "wait_free", 2, 64, 48, 0.05f);
  std::uint32_t tried = 0;
  for (std::uint32_t frame = 0; frame < 12; ++frame) {
    SCOPED_TRACE(frame);
    film.begin(frame);
    ASSERT_EQ(film.difference(), "");
    film.render(frame);
    const PassFigures f = film.pass->figures();
    if (frame == 0 || f.light_paths_retraced != 0) continue;
    ++tried;
    EXPECT_LT(2 * f.records_dropped, f.records) << "of " << f.records;
  }
  EXPECT_GT(tried, 6u);
}

// Guards against: dropping what others make superfluous, and changing the picture, where nothing changes.
TEST(TemporalRecords, AllThatAreUsedStayWhereAllRests) {
  Film film(animated_room({}, 12), "sequential", 1, 64, 48, 0.05f, 16);
  std::uint64_t dropped = 0;
  for (std::uint32_t frame = 0; frame < 12; ++frame) {
    film.begin(frame);
    film.render(frame);
    dropped += film.pass->figures().records_dropped;
    EXPECT_EQ(film.pass->figures().use.inserts > 0, frame == 0);
  }
  EXPECT_EQ(dropped, 0u);
  EXPECT_GT(film.pass->figures().records, 300u);
}

// Guards against: keeping, or counting wrongly, records for which there was no room beside the cache.
TEST(TemporalRecords, ThoseWithoutRoomBesideTheCacheLastForOneFrame) {
  // Through a pane before the camera a pixel sees more hits than there are ids for.
  Scene scene = animated_room({.rigid = true}, 64);
  const auto glass = scene.add_material({.albedo = glm::vec3(1.0f), .surface = Surface::dielectric});
  scene.meshes.push_back(box("pane", {{-0.9f, 0.1f, 0.8f}, {0.9f, 1.9f, 0.85f}}, glass));
  for (const Interpolation level : {Interpolation::split_sphere, Interpolation::gradients}) {
    Film film(scene, "sequential", 1, 16, 12, 0.003f, 16, level);
    std::uint64_t before = 0, homeless = 0;
    for (std::uint32_t frame = 0; frame < 4; ++frame) {
      SCOPED_TRACE(frame);
      film.begin(frame);
      ASSERT_EQ(film.difference(), "") << "begun";
      film.pass->for_each_record([](const Record& r) { EXPECT_NE(r.id, RecordTable::kNone); });
      film.render(frame);
      ASSERT_EQ(film.difference(), "") << "rendered";
      film.pass->for_each_record([&](const Record& r) { homeless += r.id == RecordTable::kNone; });
      const PassFigures f = film.pass->figures();
      EXPECT_EQ(f.records_kept + f.records_updated + f.records_dropped, before);
      EXPECT_EQ(f.records, before - f.records_dropped + f.use.inserts);
      before = f.records;
    }
    EXPECT_GT(homeless, 20u) << "all had room";
  }
}

// Guards against: counting records that are gone, and never using their ids again.
TEST(TemporalRecords, ThoseThatTheCacheDoesNotTakeAgainAreDropped) {
  RayTracer rays(animated_room({.rigid = true}, 16));
  ThreadCrew crew(rays, 1);
  PassSetup setup{rays, crew, kWidth, kHeight};
  setup.vpls = 16;
  TemporalSource source(setup);
  const PrimaryHits primary = primary_hits(rays, kWidth, kHeight);
  Tracer tracer(rays);
  source.begin_frame({}, crew);
  std::vector<Record> records;
  for (std::uint32_t pixel = 0; pixel < primary.hits.size(); ++pixel) {
    const Visible x = primary.at(pixel, 0);
    if (!reflects(rays, x.hit)) continue;
    records.push_back(source.evaluate(0, tracer, x, {}));
    source.settle(0, records.back(), InsertResult::inserted);
  }
  std::uint64_t refused = 0;
  const auto figures = [&source] {
    PassFigures f;
    source.report(f);
    return f;
  };
  for (const float frame : {1.0f, 2.0f, 3.0f}) {
    const std::uint64_t before = records.size();
    ASSERT_EQ(source.begin_frame(rays.go_to(frame), crew), RecordsThen::update);
    std::erase_if(records, [&](Record& r) { return source.update(r) == UpdateResult::drop; });
    source.updated();
    for (const Record& r : source.to_insert()) source.refused(r);
    refused += source.to_insert().size();
    EXPECT_EQ(figures().records_kept + figures().records_updated, records.size());
    EXPECT_EQ(figures().records_dropped, before - records.size());
    for (int still = 0; still < 2; ++still) {
      for (const Record& r : records) source.used(r);
      ASSERT_EQ(source.begin_frame({}, crew), RecordsThen::stay);
      EXPECT_EQ(figures().records_kept, records.size());
    }
  }
  EXPECT_GT(refused, 5u);
}

// A source and what it made, with which a test does as a cache would.
class TemporalSweeps : public ::testing::Test {
 protected:
  static constexpr int kSize = 16;

  static PassSetup setup_of(const RayTracer& rays, Crew& crew) {
    PassSetup setup{rays, crew, kSize, kSize};
    setup.vpls = 16;
    return setup;
  }

  // At a hit on the mesh of this name, `result` being what the cache said of it; its id.
  std::uint32_t make(std::string_view mesh, InsertResult result = InsertResult::inserted) {
    for (std::uint32_t pixel = 0; pixel < primary_.hits.size(); ++pixel) {
      const Visible x = primary_.at(pixel, 0);
      if (!reflects(rays_, x.hit) || rays_.scene().meshes[x.hit.mesh].name != mesh) continue;
      const Record r = source_.evaluate(0, tracer_, x, {});
      source_.settle(0, r, result);
      if (result == InsertResult::inserted) records_.push_back(r);
      return r.id;
    }
    ADD_FAILURE() << mesh << " is not seen";
    return RecordTable::kNone;
  }

  // The next frame; whether its queries tell which records they need or use.
  bool begins_to_sweep(const SceneChange& change = {}) {
    const RecordsThen then = source_.begin_frame(change, crew_);
    if (then == RecordsThen::go) records_.clear();
    if (then == RecordsThen::update) {
      std::erase_if(records_, [&](Record& r) { return source_.update(r) == UpdateResult::drop; });
      source_.updated();
      for (const Record& r : source_.to_insert()) records_.push_back(r);
    }
    return source_.tells() != UseToTell::nothing;
  }

  // Frames in which nothing changes, until what there is has been swept; queries use all but the first `unused`.
  void sweep(std::size_t unused = 0) {
    for (int frame = 0; frame < 3; ++frame)
      if (begins_to_sweep())
        for (std::size_t i = unused; i < records_.size(); ++i) source_.used(records_[i]);
    ASSERT_EQ(source_.tells(), UseToTell::nothing);
  }

  RayTracer rays_{animated_room({.rigid = true}, 16)};
  ThreadCrew crew_{rays_, 1};
  TemporalSource source_{setup_of(rays_, crew_)};
  PrimaryHits primary_ = primary_hits(rays_, kSize, kSize);
  Tracer tracer_{rays_};
  std::vector<Record> records_;
};

// Guards against: a cache, or a table of records beside it, that is full for ever of what nobody uses.
TEST_F(TemporalSweeps, AreMadeWhenANewRecordFindsNoRoom) {
  begins_to_sweep();
  for (int i = 0; i < 30; ++i) make("room");
  ASSERT_FALSE(begins_to_sweep()) << "for so few";
  make("room", InsertResult::rejected);
  ASSERT_FALSE(begins_to_sweep()) << "room is no matter";
  make("room", InsertResult::full);
  sweep(10);
  EXPECT_EQ(records_.size(), 20u) << "what nobody used stays";
  EXPECT_FALSE(begins_to_sweep()) << "once is enough";

  while (make("room") != RecordTable::kNone) ASSERT_LT(records_.size(), 1u << 16) << "there is always room";
  sweep();
  const std::size_t full = records_.size();
  ASSERT_EQ(make("room"), RecordTable::kNone);
  sweep(1);
  EXPECT_EQ(records_.size(), full - 1) << "the one without an id, and the one that nobody used";
  EXPECT_NE(make("room"), RecordTable::kNone);
}

// Guards against: many unused records for each that there is, once most are gone.
TEST_F(TemporalSweeps, AreMadeForWhatCameSinceThereWereFewest) {
  begins_to_sweep();
  for (int i = 0; i < 200; ++i) make("moving");
  sweep();
  ASSERT_EQ(records_.size(), 200u);
  ASSERT_FALSE(begins_to_sweep(rays_.go_to(1.0f)));
  ASSERT_EQ(records_.size(), 0u) << "of what moved";
  for (int i = 0; i < 64; ++i) make("room");
  ASSERT_FALSE(begins_to_sweep());
  make("room");
  EXPECT_TRUE(begins_to_sweep());
}

// Guards against: queries that tell of their records in every frame once they have begun to.
TEST_F(TemporalSweeps, AreMadeWithEveryEighthUpdate) {
  begins_to_sweep();
  for (int i = 0; i < 30; ++i) make("room");
  for (int frame = 1; frame <= 40; ++frame) {
    const bool begins = begins_to_sweep(rays_.go_to(0.1f * static_cast<float>(frame % 2)));
    ASSERT_EQ(begins, frame % 8 == 0) << frame;
    if (begins)
      for (const Record& r : records_) source_.used(r);
    ASSERT_EQ(records_.size(), 30u);
  }
}

TEST_F(TemporalSweeps, AreMadeAsTheCameraMovesAmidMotion) {
  begins_to_sweep();
  for (int i = 0; i < 30; ++i) make("room");
  auto moving_on = [&, frame = 0.0f](bool camera) mutable {
    SceneChange change = rays_.go_to(frame += 1.0f);
    change.camera = camera;
    return begins_to_sweep(change);
  };
  EXPECT_FALSE(moving_on(false));
  SceneChange camera_alone;
  camera_alone.camera = true;
  EXPECT_FALSE(begins_to_sweep(camera_alone));
  EXPECT_TRUE(moving_on(true));
  ASSERT_GT(records_.size(), 0u);
  EXPECT_FALSE(begins_to_sweep());
  EXPECT_EQ(records_.size(), 0u) << "what the queries of that frame did not use";
}

}  // namespace
}  // namespace icbench
