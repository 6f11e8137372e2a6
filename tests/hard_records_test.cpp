// Records of every integrator that makes some, at each level of interpolation, in scenes that are hard on them; each
// with the failure it guards against.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <glm/geometric.hpp>
#include <string>
#include <utility>
#include <vector>

#include "cached_runs.h"
#include "hard_scenes.h"
#include "scene/registry.h"
#include "trap_invalid.h"

namespace icbench {
namespace {

// Records of every integrator that makes some, at each level of interpolation.
class HardRecords : public ::testing::TestWithParam<RecordKind> {
 protected:
  static Level level(bool leak_guard = false) {
    return {.level = GetParam().level, .leak_guard = leak_guard};
  }
  static LevelRun run(const RayTracer& rays, const PrimaryHits& primary, const Level& level) {
    return run_level(rays, primary, level, GetParam().make);
  }
};
INSTANTIATE_TEST_SUITE_P(Kinds, HardRecords, ::testing::ValuesIn(record_kinds()), kind_name);

// Guards against: any NaN, infinity or negative value in a cached picture, and light that gets lost or comes about,
// with the guard against leaks, too; in each scene, besides, against what kHardScenes names.
TEST_P(HardRecords, CachedPicturesAreImagesOfTheRightBrightness) {
  constexpr int kSize = 14;
  const bool by_vpls = GetParam().by_vpls();
  for (const HardScene& hard : kHardScenes) {
    const RayTracer rays(hard.make());
    const PrimaryHits primary = primary_hits(rays, kSize, kSize);
    const std::string what = std::string(hard.name) + ", guards against: " + hard.guards_against;
    Level fine = level();
    fine.gather_rays = 256;
    const unsigned runs = by_vpls ? 1 : hard.runs;
    double made = 0.0, first = 0.0;
    for (; fine.seed < runs; ++fine.seed) {
      const LevelRun one = run(rays, primary, fine);
      expect_an_image(one.indirect, what);
      EXPECT_EQ(one.use.rejected, 0u) << what;
      if (fine.seed == 0) first = mean_of(one.indirect);
      made += mean_of(one.indirect) / runs;
    }
    if (hard.is_bright()) {
      const double anew = mean_without_cache(rays, primary, fine, by_vpls, hard.gathers());
      ASSERT_GT(anew, 0.0) << what;
      std::printf("%s: %.4f\n", hard.name, made / anew);
      EXPECT_NEAR(made / anew, 1.0, by_vpls ? hard.tolerance_by_vpls : hard.tolerance) << what;
    } else {
      EXPECT_LE(made, hard.most) << what;
    }
    // A record that is stopped without need costs another one, no light.
    fine.seed = 0;
    fine.leak_guard = true;
    const LevelRun guarded = run(rays, primary, fine);
    expect_an_image(guarded.indirect, what);
    EXPECT_EQ(guarded.use.rejected, 0u) << what;
    EXPECT_NEAR(mean_of(guarded.indirect), first, 0.02 * first) << what;
  }
}

// Guards against: radii and gradients whose unit is not that of the scene.
TEST_P(HardRecords, AScaledSceneGivesTheSamePicture) {
  constexpr int kSize = 20;
  const RayTracer rays(scaled_room(1.0f));
  const LevelRun one = run(rays, primary_hits(rays, kSize, kSize), level());
  for (const float scale : {1e-4f, 1e4f}) {
    const RayTracer scaled(scaled_room(scale));
    const LevelRun other = run(scaled, primary_hits(scaled, kSize, kSize), level());
    expect_alike(one.indirect, other.indirect, "scaled by " + std::to_string(scale));
  }
}

// Guards against: coordinates of a file that lose their places as they become floats.
TEST_P(HardRecords, AFileAMillionMetresAwayGivesTheSamePicture) {
  constexpr int kSize = 20;
  const RayTracer near(import_room(0.0)), far(import_room(1e6));
  const LevelRun one = run(near, primary_hits(near, kSize, kSize), level());
  const LevelRun other = run(far, primary_hits(far, kSize, kSize), level());
  expect_alike(one.indirect, other.indirect, "moved by 1e6 m");
}

// Guards against: offsets as wide as a gap, which carry rays through what lies above it.
TEST_P(HardRecords, UnderARugAMillimetreAboveTheFloorOfAHallItIsDark) {
  const RayTracer rays(hall());
  Tracer tracer(rays);
  double brightness[2];
  for (const bool beside : {false, true}) {
    PrimaryHits primary = primary_hits(rays, 6, 6);
    for (std::size_t i = 0; i < primary.hits.size(); ++i) {
      // From 1 m before the rug, half a millimetre high, to the floor: some metres under it, or before it.
      const float z = beside ? 39.5f : 45.0f + static_cast<float>(i) / 10.0f;
      const glm::vec3 from(45.0f + static_cast<float>(i) / 10.0f, 5e-4f, 39);
      const Hit hit = tracer.intersect(Ray{from, kInfinity, {0, -5e-4f / (z - 39.0f), 1}});
      ASSERT_FALSE(hit.missed());
      ASSERT_NEAR(hit.p.z, z, 0.1f);
      primary.hits[i] = hit;
    }
    const Image made = run(rays, primary, level()).indirect;
    expect_an_image(made, "rug");
    brightness[beside] = mean_of(made);
    if (!beside) continue;
    Level fine = level();
    fine.gather_rays = 1024;
    const Image anew = without_cache(rays, primary, fine, GetParam().by_vpls());
    EXPECT_NEAR(brightness[true] / mean_of(anew), 1.0, 0.1);
  }
  EXPECT_LT(brightness[false], 1e-4 * brightness[true]);
}

// Guards against: records that are not valid where they were made, or whose answer there is not their own irradiance;
// weights that jump where normals are equal, equal but for rounding, or opposite; sheets of paper with a lit side that
// shines through, at whatever accuracy.
TEST_P(HardRecords, ARecordAnswersAtItsOwnPointWhateverRoundingDoesToTheNormal) {
  const RayTracer rays(scaled_room(1.0f));
  ThreadCrew crew(rays, 1);
  const PrimaryHits primary = primary_hits(rays, 10, 10);
  for (const float a : {0.05f, 0.2f, 1.0f})
    for (const bool guard : {false, true}) {
      PassSetup setup{rays, crew, 10, 10};
      setup.gather_rays = setup.vpls = 64;
      setup.interpolation = GetParam().level;
      setup.leak_guard = guard;
      setup.a = a;
      const auto source = GetParam().make(setup);
      source->begin_frame({}, crew);
      Tracer tracer(rays);
      for_each_visible({0, 0, 10, 10}, primary, [&](const Visible& x) {
        if (!reflects(rays, x.hit)) return;
        ListSession session{.bounds = rays.scene().bounds, .a = GetParam().reach() * a};
        const Record r = source->evaluate(0, tracer, x, {});
        ASSERT_EQ(session.insert(r), InsertResult::inserted);
        source->settle(0, r, InsertResult::inserted);
        LeakTests tests;
        const auto ask = [&](const SurfacePoint& at) {
          const RecordShapes* shapes = source->shapes();
          return !shapes ? session.query(at)
                 : guard ? query_guarded(session, *shapes, tracer, at, tests)
                         : query_extrapolating(session, *shapes, at);
        };
        glm::vec3 rounded = r.n;
        for (int axis = 0; axis < 3; ++axis) rounded[axis] = std::nextafter(rounded[axis], 2.0f);
        for (const glm::vec3& n : {r.n, rounded, glm::normalize(rounded)}) {
          const auto E = ask({r.p, n});
          ASSERT_TRUE(E.has_value());
          for (int c = 0; c < 3; ++c) ASSERT_NEAR((*E)[c], r.E[c], 1e-4f * r.E[c]);
        }
        ASSERT_FALSE(ask({r.p, -r.n}).has_value()) << "accuracy " << a;
        EXPECT_EQ(tests.rays, 0u);
      });
    }
}

// Guards against: radii, gradients and marks that explode as the distance to the next surface goes to 0. In the furnace
// what a point there should say is known.
TEST_P(HardRecords, EdgesAndCornersOfTheFurnaceAreAsBrightAsTheRest) {
  const RayTracer rays(make_scene("white_furnace"));
  const Bounds& bounds = rays.scene().bounds;
  const glm::vec3 centre = rays.scene().camera.eye;
  Tracer tracer(rays);
  PrimaryHits primary = primary_hits(rays, 8, 6);
  // Towards a corner, an edge and the middle of an edge, nearer and nearer; then the very same.
  for (std::size_t i = 0; i < primary.hits.size(); ++i) {
    const float share = i % 8 == 7 ? 0.0f : std::pow(0.1f, static_cast<float>(i % 8));
    glm::vec3 target = bounds.upper;
    target.y += share * (centre.y - bounds.upper.y);
    if (i / 8 % 2 == 1) target.x = centre.x;
    if (i / 8 >= 4) target.z += share * (centre.z - bounds.upper.z);
    const Hit hit = tracer.intersect(Ray{centre, kInfinity, target - centre});
    if (!hit.missed()) primary.hits[i] = hit;
  }
  // Records by virtual lights all err alike, by the same lights: they are told apart by seeds.
  const bool by_vpls = GetParam().by_vpls();
  for (const bool guard : {false, true}) {
    Level fine = level(guard);
    fine.gather_rays = 1024;
    fine.vpls = 256;
    Estimate of_records, of_pictures;
    for (fine.seed = 0; fine.seed < (by_vpls ? 128u : 1u); ++fine.seed) {
      const LevelRun made = run(rays, primary, fine);
      expect_an_image(made.indirect, "edges");
      of_pictures.add(mean_of(made.indirect) / (kRho * kRho));
      for (const Record& r : made.records) {
        EXPECT_TRUE(is_storable(r, bounds));
        of_records.add(r.E.x / (kPi * kRho));
        if (!by_vpls) {
          EXPECT_NEAR(r.E.x / (kPi * kRho), 1.0, 0.2);
        }
      }
    }
    const double error = by_vpls ? of_pictures.error() : of_records.error();
    std::printf("corner of the furnace: %.4f, standard error %.4f\n", of_pictures.mean(), error);
    EXPECT_NEAR(of_pictures.mean(), 1.0, (by_vpls ? 4.0 : 5.0) * error);
    EXPECT_LT(error, 0.02);
  }
}

// Guards against: floats whose range ends where two rooms differ by 40 orders of magnitude.
TEST_P(HardRecords, RoomsOfRadiance1em20And1e20KeepTheirLight) {
  Scene s;
  s.name = "dim_and_bright_rooms";
  for (const float L : {1e-20f, 1e20f}) {
    const float x = L < 1.0f ? -2.0f : 2.0f;
    const auto wall = s.add_material({.albedo = glm::vec3(0.5f), .emission = glm::vec3(0.5f * L)});
    s.meshes.push_back(box("room", {{x - 1, 0, -1}, {x + 1, 2, 1}}, wall, true));
  }
  s.camera = {.eye = {-2, 1, 0.9f}, .target = {-2, 0.5f, 0}, .up = {0, 1, 0}, .fov_y = 1.0f};
  const RayTracer rays(std::move(s));
  PrimaryHits primary = primary_hits(rays, 12, 12);
  for (std::size_t i = 0; i < primary.hits.size(); i += 2) {  // every other pixel looks into the bright room
    primary.hits[i].p.x += 4.0f;
    primary.hits[i].material = 1;
  }
  Level fine = level();
  fine.gather_rays = fine.vpls = 1024;
  const LevelRun made = run(rays, primary, fine);
  expect_an_image(made.indirect, "rooms");
  Estimate ratio[2];
  for (std::size_t i = 0; i < primary.hits.size(); ++i)
    ratio[i % 2].add(made.indirect.pixels[i].y / (0.5 * 0.5 * (i % 2 == 1 ? 1e-20 : 1e20)));
  EXPECT_NEAR(ratio[0].mean(), 1.0, 0.05);
  std::printf("rooms of 1e20 and 1e-20: %.4f and %.4f\n", ratio[0].mean(), ratio[1].mean());
  if (GetParam().by_vpls()) {
    // Virtual lights go by power, and the dim room has none: only compensation brings light there, from what is near.
    EXPECT_GT(ratio[1].mean(), 1e-3);
    EXPECT_LT(ratio[1].mean(), 0.02);
  } else {
    EXPECT_NEAR(ratio[1].mean(), 1.0, 0.05);
  }
}

// Guards against: weighted sums of many that overflow, stagnate or, where rays of the guard wait for each other, lose
// some.
TEST_P(HardRecords, AMillionOnOneSpotAnswerAsOneDoes) {
  if (GetParam().make == make_temporal_instant_caching)
    GTEST_SKIP() << "these are summed as those of instant_caching";
  const RayTracer rays(scaled_room(1.0f));
  ThreadCrew crew(rays, 1);
  Tracer tracer(rays);
  const Hit hit = facing({0, 0, 0}, {0, 1, 0});
  for (const bool guard : {false, true}) {
    PassSetup setup{rays, crew, 1000, 1000};
    setup.leak_guard = guard;
    setup.interpolation = GetParam().level;
    const bool extrapolated = extrapolates(GetParam().level);
    RecordShapes shapes = GetParam().by_vpls() ? make_shapes_of_vpls(setup) : make_shapes(setup);
    // Of the guard 10^4: it adds a ray for each, and then sums as the others do.
    for (const auto& [E, records] :
         {std::pair{kMaxIrradiance, guard ? 10'000u : 1'000'000u}, std::pair{1e-30f, 10'000u}}) {
      // What core/interpolation.h promises of so many, and of one.
      const double bound = 2.0 * (9 * 0x1p-24 + records * 0x1p-53) + 2.0 * (9 * 0x1p-24);
      ASSERT_LT(bound, 3e-6);
      constexpr float kR = 1.0f;
      ListSession many{.bounds = rays.scene().bounds, .a = GetParam().reach() * setup.a};
      ListSession one = many;
      shapes.details.clear();
      many.records.reserve(records);
      for (std::uint32_t i = 0; i < records; ++i) {
        std::uint32_t id = i;
        if (extrapolated || guard) {
          id = shapes.details.draft(0);
          ASSERT_NE(id, RecordDetails::kNone);
          RecordDetail& detail = shapes.details[id];
          detail = {.gradients = {},
                    .major = {1, 0, 0},
                    .inverse_major = 4.0f / kR,
                    .inverse_minor = 5.0f / kR,
                    .marks = guard ? kMarkedEverywhere : LeakMarks{}};
          for (glm::vec3& g : detail.gradients.translational) g = {-0.5f * E / kR, 0, 0};
          for (glm::vec3& g : detail.gradients.rotational) g = {0, 0, 0.5f * E};
          shapes.details.keep(0);
        }
        const Record r{hit.p, hit.n, kR, Irradiance(E), id};
        ASSERT_EQ(many.insert(r), InsertResult::inserted);
        if (i == 0) {
          ASSERT_EQ(one.insert(r), InsertResult::inserted);
        }
      }
      LeakTests tests;
      const auto ask = [&](ListSession& session, const SurfacePoint& x) {
        return guard          ? query_guarded(session, shapes, tracer, x, tests)
               : extrapolated ? query_extrapolating(session, shapes, x)
                              : session.query(x);
      };
      for (const SurfacePoint& x :
           {SurfacePoint{hit.p, hit.n}, SurfacePoint{{0.1f * kR, 0, 0}, hit.n},
            SurfacePoint{{-0.1f * kR, 0, 0.02f * kR}, glm::normalize(glm::vec3(0.02f, 1, 0.01f))}}) {
        const auto whole = ask(many, x), alone = ask(one, x);
        ASSERT_TRUE(whole.has_value() && alone.has_value());
        ASSERT_TRUE(is_irradiance(*whole));
        const double known = !extrapolated || x.p.x == 0.0f ? static_cast<double>(E) : (*alone)[0];
        for (int c = 0; c < 3; ++c) EXPECT_NEAR((*whole)[c] / known, 1.0, bound) << E << " at " << x.p.x;
      }
      // When 1 / kLeakWorth alike count, another is worth a ray just still, and a packet is judged at once.
      constexpr std::uint32_t kAsked = std::uint32_t(1.0 / kLeakWorth) + kLeakPacket;
      EXPECT_EQ(tests.rays, guard ? 2 * (std::min(records, kAsked) + 1) : 0u);
      EXPECT_EQ(tests.stopped, 0u);
    }
  }
}

}  // namespace
}  // namespace icbench
