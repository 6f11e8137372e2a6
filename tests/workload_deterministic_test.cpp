// Deterministic pictures: the same bits for any number of threads, any schedule and any cache; and pictures that wait
// until all records are made.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <optional>
#include <ostream>
#include <string>
#include <tuple>
#include <vector>

#include "harness/topology.h"
#include "render_support.h"
#include "scene/registry.h"
#include "workload/frame_renderer.h"

namespace icbench {
namespace {

// What a frame shows and what the cache holds: but for ids, which may name a slot of a table.
struct Made {
  std::vector<glm::vec3> pixels;
  std::vector<Record> records;
  CacheUse use;
};

struct Wish {
  std::string integrator = "irradiance_cache", cache = "wait_free";
  Interpolation interpolation = Interpolation::split_sphere;
  unsigned threads = 1;
  int width = 32, height = 24;
  std::uint32_t frames = 1, spp = 1;
  bool deterministic = true, overture = false;
  std::optional<bool> leak_guard{};
  TileOrder tiles = TileOrder::morton;
};

std::vector<Made> render(RayTracer& rays, const Wish& wish) {
  ThreadTeam team(Topology::of_this_process(), Placement::none, wish.threads);
  FrameRequest request{rays, team, find_integrator(wish.integrator), find_cache(wish.cache)};
  request.width = wish.width;
  request.height = wish.height;
  request.gather = 16;
  request.vpls = 32;
  request.a = 0.3f;
  request.interpolation = wish.interpolation;
  request.spp = wish.spp;
  request.deterministic = wish.deterministic;
  request.overture = wish.overture;
  request.leak_guard = wish.leak_guard;
  request.tiles = wish.tiles;
  rays.go_to(0.0f);  // the number of light paths follows from the frame that the renderer is set up in
  FrameRenderer renderer(request);
  std::vector<Made> out;
  for (std::uint32_t frame = 0; frame < wish.frames; ++frame) {
    const FrameCost cost = renderer.render(frame);
    Made made{renderer.indirect().pixels, {}, cost.pass.use};
    renderer.for_each_record([&](const Record& r) { made.records.push_back(r); });
    std::sort(made.records.begin(), made.records.end(), [](const Record& a, const Record& b) {
      const auto key = [](const Record& r) { return std::tie(r.p.x, r.p.y, r.p.z, r.R, r.E.x); };
      return key(a) < key(b);
    });
    for (Record& r : made.records) r.id = 0;
    out.push_back(std::move(made));
  }
  return out;
}

template <class T>
bool same_bits(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0;
}

::testing::AssertionResult same(const std::vector<Made>& a, const std::vector<Made>& b) {
  for (std::size_t frame = 0; frame < a.size(); ++frame) {
    if (!same_bits(a[frame].pixels, b[frame].pixels))
      return ::testing::AssertionFailure() << "the pictures of frame " << frame << " differ";
    if (!same_bits(a[frame].records, b[frame].records))
      return ::testing::AssertionFailure() << "the records of frame " << frame << " differ";
  }
  return ::testing::AssertionSuccess() << a.front().records.size() << " records";
}

class DeterministicScene : public ::testing::TestWithParam<const char*> {};

TEST_P(DeterministicScene, IsTheSameForAnyNumberOfThreads) {
  RayTracer rays(make_scene(GetParam()));
  const std::uint32_t frames = std::min(rays.scene().frames, 3u);
  for (const char* integrator : {"irradiance_cache", "instant_caching", "temporal_instant_caching"}) {
    const Interpolation level = std::string(integrator) == "irradiance_cache"
                                    ? Interpolation::occlusion_hessian
                                    : Interpolation::gradients;
    Wish wish{integrator, "packed_wait_free", level};
    wish.frames = std::string(integrator) == "temporal_instant_caching" ? frames : 1;
    wish.spp = level == Interpolation::occlusion_hessian ? 3 : 1;
    const std::vector<Made> one = render(rays, wish);
    ASSERT_GT(one.front().records.size(), 0u) << integrator;
    for (const unsigned threads : {2u, 3u, 8u, 64u}) {
      wish.threads = threads;
      ASSERT_TRUE(same(one, render(rays, wish))) << integrator << " by " << threads << " threads";
    }
  }
}

std::vector<const char*> scene_names() {
  std::vector<const char*> names;
  for (const SceneEntry& scene : kScenes) names.push_back(scene.name.data());
  return names;
}

INSTANTIATE_TEST_SUITE_P(Suite, DeterministicScene, ::testing::ValuesIn(scene_names()),
                         [](const auto& scene) { return std::string(scene.param); });

// Mirrors and glass among it: several hits in a pixel.
RayTracer& cornell_specular_room() {
  static RayTracer rays(make_scene("cornell_specular"));
  return rays;
}

TEST(Deterministic, IsTheSameForAnyCache) {
  RayTracer& rays = cornell_specular_room();
  for (const auto& [integrator, level] :
       {std::pair{"irradiance_cache", Interpolation::split_sphere},
        std::pair{"irradiance_cache", Interpolation::occlusion_hessian},
        std::pair{"temporal_instant_caching", Interpolation::split_sphere}}) {
    Wish wish{integrator, "wait_free", level};
    wish.frames = 2;
    const std::vector<Made> first = render(rays, wish);
    for (const CacheEntry& cache : all_caches()) {
      if (cache.traits.consistency == Consistency::none) continue;
      wish.cache = cache.traits.name;
      wish.threads = cache.traits.single_thread ? 1 : 5;
      EXPECT_TRUE(same(first, render(rays, wish))) << integrator << ", " << wish.cache;
    }
  }
}

TEST(Deterministic, IsTheSameAtEveryLevelOfInterpolation) {
  RayTracer& rays = cornell_specular_room();
  for (const IntegratorEntry& integrator : kIntegrators)
    for (const InterpolationEntry& level : kInterpolations)
      for (const bool guard : {false, true}) {
        if (!integrator.needs_cache() || (integrator.uses_vpls && !is_for_vpls(level.level))) continue;
        SCOPED_TRACE(::testing::Message()
                     << integrator.name << ' ' << level.name << (guard ? ", guarded" : ""));
        Wish wish{std::string(integrator.name), "wait_free", level.level};
        wish.frames = 2;
        wish.leak_guard = guard;
        const std::vector<Made> one = render(rays, wish);
        EXPECT_EQ(one.front().use.leaks.rays > 0, guard);
        wish.threads = 4;
        wish.cache = "packed_local_write";
        wish.tiles = TileOrder::random;
        EXPECT_TRUE(same(one, render(rays, wish)));
      }
}

// The comparison can fail: left to itself, a cache that shows other threads' records only in the next frame gives them
// other pictures than a single thread gets.
TEST(Deterministic, IsNotSoByItself) {
  Wish wish{"irradiance_cache", "local_write"};
  wish.deterministic = false;
  const std::vector<Made> one = render(cornell_specular_room(), wish);
  wish.width = 64;
  wish.height = 48;
  const std::vector<Made> larger = render(cornell_specular_room(), wish);
  EXPECT_FALSE(same(one, larger));
  wish.threads = 8;
  // On a busy machine one thread may have made a whole picture before the others began.
  constexpr int kPictures = 50;
  int alike = 0;
  while (alike < kPictures && same(larger, render(cornell_specular_room(), wish))) ++alike;
  EXPECT_LT(alike, kPictures);
}

double mean_of(const Made& made) {
  double sum = 0.0;
  for (const glm::vec3& L : made.pixels) sum += L.x + L.y + L.z;
  return sum / (3.0 * static_cast<double>(made.pixels.size()));
}

// Records in another order make another picture, but not a brighter one; and few of them are made in vain.
TEST(Deterministic, IsThePictureThatAFreeThreadMakes) {
  Wish wish{"instant_caching"};  // whose records carry no noise of their own
  wish.width = 128;
  wish.height = 96;
  const Made waves = render(cornell_specular_room(), wish).front();
  wish.deterministic = false;
  const Made free = render(cornell_specular_room(), wish).front();
  EXPECT_NEAR(mean_of(waves) / mean_of(free), 1.0, 0.01);
  EXPECT_LT(static_cast<double>(waves.records.size()), 1.15 * static_cast<double>(free.records.size()));
  EXPECT_EQ(waves.use.queries, free.use.queries);
  EXPECT_EQ(waves.use.queries - waves.use.hits, waves.use.inserts);
}

// After an overture every pixel is made of all records that are valid there, be it late or early in the frame.
TEST(Overture, EveryPixelSeesEveryRecord) {
  RayTracer rays(make_scene("cornell_box"));
  for (const bool deterministic : {false, true}) {
    Wish wish;
    wish.overture = true;
    wish.deterministic = deterministic;
    wish.threads = deterministic ? 3 : 1;
    const Made made = render(rays, wish).front();
    PrimaryHits primary(rays.scene(), wish.width, wish.height);
    const CameraView view(rays.scene().camera, wish.width, wish.height);
    Tracer tracer(rays);
    primary_tile(tracer, view, Lens::centre, {}, {0, 0, wish.width, wish.height}, primary);
    int differing = 0;
    for (std::uint32_t pixel = 0; pixel < made.pixels.size(); ++pixel) {
      const Hit& hit = primary.hits[pixel];
      if (!reflects(rays, hit)) continue;
      Interpolator sum;
      for (const Record& r : made.records) {
        const float weight = split_sphere_weight({hit.p, hit.n}, r, 0.3f);
        if (weight > 0.0f) sum(r, weight);
      }
      ASSERT_TRUE(sum.result()) << pixel;
      const glm::vec3 L = rays.albedo(hit) / static_cast<float>(M_PI) * *sum.result();
      differing += glm::length(L - made.pixels[pixel]) > 1e-5f * glm::length(L) ? 1 : 0;
    }
    EXPECT_EQ(differing, 0);
  }
}

// In a picture of one tile, so that its records are all that there are: by what an overture shows.
TEST(Overlap, LaterRecordsOfTheTileCountAtAllHitsButThoseOfRecords) {
  for (const char* scene : {"cornell_box", "cornell_specular"}) {
    RayTracer rays(make_scene(scene));
    for (const Interpolation level : {Interpolation::geometric_hessian, Interpolation::occlusion_hessian})
      for (const auto& [deterministic, guard] :
           {std::pair{false, false}, std::pair{false, true}, std::pair{true, false}, std::pair{true, true}}) {
        Wish wish;
        wish.interpolation = level;
        wish.deterministic = deterministic;
        wish.leak_guard = guard;
        wish.threads = deterministic ? 3 : 1;
        wish.width = wish.height = kFrameTile;
        const Made made = render(rays, wish).front();
        wish.overture = true;
        const Made every_record = render(rays, wish).front();
        ASSERT_TRUE(same_bits(made.records, every_record.records));
        PrimaryHits primary(rays.scene(), wish.width, wish.height);
        Tracer tracer(rays);
        primary_tile(tracer, CameraView(rays.scene().camera, wish.width, wish.height), Lens::centre, {},
                     {0, 0, wish.width, wish.height}, primary);
        std::size_t differing = 0;
        for (std::uint32_t pixel = 0; pixel < made.pixels.size(); ++pixel) {
          bool has_record = false;
          for (std::uint32_t layer = 0; layer < primary.layers_of(pixel); ++layer)
            for (const Record& r : made.records) has_record |= r.p == primary.at(pixel, layer).hit.p;
          if (same_bits<glm::vec3>({made.pixels[pixel]}, {every_record.pixels[pixel]})) continue;
          EXPECT_TRUE(has_record) << scene << ", pixel " << pixel;
          ++differing;
        }
        EXPECT_GT(differing, 0u) << "what a record is made for does not keep its irradiance";
        EXPECT_GT(made.pixels.size(), 2 * made.records.size()) << "hardly anything was interpolated";
      }
  }
}

}  // namespace
}  // namespace icbench
