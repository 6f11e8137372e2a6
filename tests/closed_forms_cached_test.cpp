// Interpolation at every level, and pictures of the methods that share light between pixels, against closed forms.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <ostream>
#include <string>
#include <string_view>
#include <vector>

#include "any_cache.h"
#include "cached_runs.h"
#include "judged_estimates.h"
#include "render/irradiance_cache.h"
#include "scene/directions.h"
#include "scene/registry.h"

namespace icbench {
namespace {

// Of a point above the plate, by finite differences of the closed form; as its normal turns: none.
IrradianceGradients exact_gradients(const Hit& at) {
  constexpr float kStep = 1e-3f;
  const Basis basis(at.n);
  IrradianceGradients out;
  for (const glm::vec3& axis : {basis.s, basis.t}) {
    const double change = above_plate(at.p + kStep * axis, at.n).E - above_plate(at.p - kStep * axis, at.n).E;
    for (glm::vec3& channel : out.translational)
      channel += static_cast<float>(change / (2.0 * static_cast<double>(kStep))) * axis;
  }
  return out;
}

// Points that all face the plate.
std::vector<Known> grid_above_plate() {
  constexpr int kSide = 20;
  std::vector<Known> points;
  for (int i = 0; i < kSide * kSide; ++i) {
    const int k = i * 87 % (kSide * kSide);  // all over the place, not row by row
    points.push_back(above_plate(
        {0.1f * static_cast<float>(k % kSide) - 0.95f, 0.6f, 0.1f * static_cast<float>(k / kSide) - 0.95f},
        {0, -1, 0}));
  }
  return points;
}

std::optional<Irradiance> ask(AnyCache::Session& session, const RecordShapes* shapes, Tracer& tracer,
                              const SurfacePoint& x, LeakTests& leaks) {
  if (shapes == nullptr) return session.query(x);
  return shapes->details.are_guarded() ? query_guarded(session, *shapes, tracer, x, leaks)
                                       : query_extrapolating(session, *shapes, x);
}

struct Errors {
  Judged records{1.0};  // of the irradiance of inserted records
  Estimate interpolation, whole;
  double interpolation_square = 0.0, noise_square = 0.0, asked = 0.0;
  LeakTests leaks;

  double of_interpolation() const { return std::sqrt(interpolation_square / asked); }
};

struct Way {
  Interpolation level;
  bool leak_guard;
  MakeSource make = make_irradiance_cache;

  bool by_vpls() const { return make != make_irradiance_cache; }
  // How far a record of radius R is valid, that gradients must not promise too much on the way.
  float restrained_within(float R, const RayTracer& rays) const {
    if (by_vpls()) return kTurnOfVpls * R;
    return level == Interpolation::occlusion_hessian ? rays.epsilon() : R;
  }
};

// Records are made and asked for as a renderer does, in the light of the plate. Beside the cache goes a twin whose
// records lie at the same places, have the same regions and hold the closed form and its gradients, so that its error
// is interpolation's alone.
void add_run(const AnyCache::Maker& maker, const RayTracer& rays, Way way, float a,
             const std::vector<Known>& points, std::uint64_t seed, Errors& errors) {
  ThreadCrew crew(rays, 1);
  PassSetup setup{rays, crew, 100, 100};
  setup.gather_rays = 256;
  setup.a = a;
  setup.interpolation = way.level;
  setup.leak_guard = way.leak_guard;
  if (way.by_vpls()) {
    setup.vpls = 1024;
    setup.seed = seed;
  }
  const auto source = way.make(setup);
  source->begin_frame({}, crew);
  const float accuracy = search_reach(way.level, way.by_vpls()) * a;
  const CacheConfig config{
      .bounds = {{-2, -1, -2}, {2, 1, 2}}, .a_max = accuracy, .a = accuracy, .capacity = 1024};
  AnyCache cache(maker, config), twin(maker, config);
  AnyCache::Session session = cache.open_session(0), exact = twin.open_session(0);
  RecordShapes* const shapes = source->shapes();
  RecordShapes exact_shapes = way.by_vpls() ? make_shapes_of_vpls(setup) : make_shapes(setup);
  if (shapes != nullptr) exact_shapes.shaper = shapes->shaper;
  Tracer tracer(rays);
  std::uint32_t pixel = 0;
  Estimate of_run;
  for (const Known& known : points) {
    const SurfacePoint x{known.at.p, known.at.n};
    if (ask(session, shapes, tracer, x, errors.leaks)) continue;
    Record r = source->evaluate(0, tracer, {known.at, glm::vec3(1.0f), pixel++, 0}, {.seed = seed});
    if (shapes != nullptr && shapes->clamps_to_neighbours()) r.R = clamped_to_neighbours(session, r);
    of_run.add(r.E.y / known.E);
    if (!way.by_vpls()) errors.records.add(r.E.y / known.E);
    const InsertResult result = session.insert(r);
    ASSERT_EQ(result, InsertResult::inserted);
    source->settle(0, r, result);
    r.E = Irradiance(static_cast<float>(known.E));
    if (shapes != nullptr) {
      exact_shapes.details.make_room(r.id);
      RecordDetail& detail = exact_shapes.details[r.id] = shapes->details[r.id];
      if (extrapolates(way.level)) {
        detail.gradients = exact_gradients(known.at);
        restrain(detail.gradients, r.E, way.restrained_within(r.R, rays));
      }
    }
    ASSERT_EQ(exact.insert(r), InsertResult::inserted);
  }
  if (way.by_vpls()) errors.records.add(of_run.mean());  // which share their virtual lights
  for (const Known& known : points) {
    const SurfacePoint x{known.at.p, known.at.n};
    const double E = ask(session, shapes, tracer, x, errors.leaks).value().y / known.E;
    const double of_twin =
        ask(exact, shapes != nullptr ? &exact_shapes : nullptr, tracer, x, errors.leaks).value().y / known.E;
    errors.interpolation.add(of_twin - 1.0);
    errors.whole.add(E - 1.0);
    errors.interpolation_square += (of_twin - 1.0) * (of_twin - 1.0);
    errors.noise_square += (E - of_twin) * (E - of_twin);
    ++errors.asked;
  }
}

class ClosedFormsAtLevels : public ::testing::TestWithParam<InterpolationEntry> {
 protected:
  static constexpr std::uint64_t kRuns = 24;
  const RayTracer rays_{lit_plate()};
  const std::vector<Known> points_ = grid_above_plate();

  Errors run(const AnyCache::Maker& maker, Way way, float a) const {
    Errors errors;
    for (std::uint64_t seed = 0; seed < kRuns; ++seed) add_run(maker, rays_, way, a, points_, seed, errors);
    return errors;
  }

  void judge(std::string_view cache, bool leak_guard) const {
    const auto all = registered_caches();
    const AnyCache::Maker& maker =
        *std::find_if(all.begin(), all.end(), [&](const auto& m) { return m.traits.name == cache; });
    const Interpolation level = GetParam().level;
    double of_interpolation[2];
    for (const bool fine : {false, true}) {
      const float a = fine ? 0.2f : 0.6f;
      const Errors errors = run(maker, {level, leak_guard}, a);
      const std::string at =
          std::string(cache) + (leak_guard ? ", guarded" : "") + (fine ? ", a = 0.2" : ", a = 0.6");
      errors.records.print(at + ", inserted records");
      of_interpolation[fine] = errors.of_interpolation();
      std::printf(
          "%-44s interpolation: bias %.3f %%, RMS %.3f %%; records' noise left: RMS %.3f %%; whole bias %.3f "
          "%%\n",
          at.c_str(), 100.0 * errors.interpolation.mean(), 100.0 * of_interpolation[fine],
          100.0 * std::sqrt(errors.noise_square / errors.asked), 100.0 * errors.whole.mean());
      EXPECT_TRUE(errors.records.agrees()) << at;
      EXPECT_LE(errors.records.error(), 0.0025) << at;
      // A quarter of the accuracy is what split spheres come to.
      EXPECT_LT(of_interpolation[fine], static_cast<double>(a) / 3.0) << at;
      EXPECT_GT(of_interpolation[fine], 1e-5) << at << ": nothing was interpolated";
      EXPECT_EQ(errors.leaks.stopped, 0u) << at << ": nothing stands there";
      // Regions of other levels end before the plate.
      if (!fine && is_elliptic(level)) {
        EXPECT_EQ(errors.leaks.rays > 0, leak_guard) << at;
      }
    }
    EXPECT_LT(of_interpolation[1], 0.5 * of_interpolation[0]) << "a finer accuracy does not help";
    if (extrapolates(level)) {
      const Errors plain = run(maker, {Interpolation::split_sphere, leak_guard}, 0.2f);
      EXPECT_LT(of_interpolation[1], 0.6 * plain.of_interpolation()) << "gradients do not help";
    }
  }
};
INSTANTIATE_TEST_SUITE_P(Levels, ClosedFormsAtLevels, ::testing::ValuesIn(kInterpolations), level_name);

TEST_P(ClosedFormsAtLevels, RecordsAreUnbiasedAndInterpolationErrsByAThirdOfTheAccuracyAtMost) {
  judge("wait_free", false);
  if (GetParam().level == Interpolation::split_sphere) judge("packed_wait_free", false);
}

// Guards against: a guard against leaks that costs light, or interpolation, where nothing stands.
TEST_P(ClosedFormsAtLevels, TheGuardAgainstLeaksDoesNotChangeThat) { judge("wait_free", true); }

class ClosedFormsByVpls : public ::testing::TestWithParam<RecordKind> {};
INSTANTIATE_TEST_SUITE_P(Kinds, ClosedFormsByVpls, ::testing::ValuesIn(record_kinds_by_vpls()), kind_name);

// Likewise for records by virtual point lights.
TEST_P(ClosedFormsByVpls, RecordsAreUnbiasedAndInterpolationErrsByAThirdOfTheAccuracyAtMost) {
  constexpr std::uint64_t kRuns = 64;
  const RayTracer rays(lit_plate());
  const std::vector<Known> points = grid_above_plate();
  const auto all = registered_caches();
  const AnyCache::Maker& maker =
      *std::find_if(all.begin(), all.end(), [](const auto& m) { return m.traits.name == "wait_free"; });
  const auto run = [&](Interpolation level, float a) {
    Errors errors;
    for (std::uint64_t seed = 0; seed < kRuns; ++seed)
      add_run(maker, rays, {level, false, GetParam().make}, a, points, seed, errors);
    return errors;
  };
  double of_interpolation[2];
  for (const bool fine : {false, true}) {
    const float a = fine ? 0.2f : 0.6f;
    const Errors errors = run(GetParam().level, a);
    const std::string at = GetParam().name + (fine ? ", a = 0.2" : ", a = 0.6");
    errors.records.print(at + ", inserted records");
    of_interpolation[fine] = errors.of_interpolation();
    std::printf("%-44s interpolation: bias %.3f %%, RMS %.3f %%; whole bias %.3f %%\n", at.c_str(),
                100.0 * errors.interpolation.mean(), 100.0 * of_interpolation[fine],
                100.0 * errors.whole.mean());
    EXPECT_TRUE(errors.records.agrees()) << at;
    EXPECT_LE(errors.records.error(), 0.0025) << at;
    EXPECT_LT(of_interpolation[fine], static_cast<double>(a) / 3.0) << at;
    EXPECT_GT(of_interpolation[fine], 1e-5) << at << ": nothing was interpolated";
  }
  EXPECT_LT(of_interpolation[1], 0.5 * of_interpolation[0]) << "a finer accuracy does not help";
  if (extrapolates(GetParam().level)) {
    EXPECT_LT(of_interpolation[1], 0.6 * run(Interpolation::split_sphere, 0.2f).of_interpolation())
        << "gradients do not help";
  }
}

// Mean radiance of the indirect light in a picture.
double mean_of_picture(const RayTracer& rays, const PrimaryHits& primary, const IntegratorEntry& integrator,
                       std::uint64_t seed) {
  constexpr std::uint32_t kVpls = 256;
  Image out = make_image(primary.width, primary.height);
  if (integrator.needs_cache()) {
    out = run_level(rays, primary, {.a = 0.1f, .vpls = kVpls, .seed = seed}, integrator.source).indirect;
  } else {
    ThreadCrew crew(rays, 1);
    PassSetup setup{rays, crew, primary.width, primary.height};
    setup.vpls = kVpls;
    setup.paths = 8;
    setup.seed = seed;
    const auto pass = integrator.pass(setup);
    const SampleKey key{.seed = seed};
    pass->begin_frame({});
    pass->begin_sample(primary, key);
    Tracer tracer(rays);
    for (const Tile& tile : make_tiles(primary.width, primary.height, 8, TileOrder::morton))
      pass->tile(0, tracer, primary, key, tile, out);
    pass->end_sample(primary, out);
  }
  return mean_of(out);
}

// A method, and what its mean may be off by where light falls off towards the picture's edges: interpolation between
// records, which lie inside, makes the brightest edge too dark. In a furnace no method may be off.
struct SharedLight {
  std::string_view integrator;
  double bias_on_wall;
};

void PrintTo(const SharedLight& method, std::ostream* out) { *out << method.integrator; }

class ClosedFormsOfPictures : public ::testing::TestWithParam<SharedLight> {
 protected:
  static void judge_mean(const std::string& scene, const RayTracer& rays, const PrimaryHits& primary,
                         double exact, double bias) {
    constexpr std::uint64_t kRuns = 400;
    Judged mean(exact);
    Estimate ratio;
    const IntegratorEntry& integrator = find_integrator(GetParam().integrator);
    for (std::uint64_t seed = 0; seed < kRuns; ++seed) {
      const double L = mean_of_picture(rays, primary, integrator, seed);
      mean.add(L);
      ratio.add(L / exact);
    }
    mean.print(scene + ", " + std::string(integrator.name));
    EXPECT_LE(std::abs(ratio.mean() - 1.0), bias + 4.0 * ratio.error());
    EXPECT_LE(ratio.error(), 0.007) << "too few samples to say anything";
  }
};
INSTANTIATE_TEST_SUITE_P(Methods, ClosedFormsOfPictures,
                         ::testing::Values(SharedLight{"hash_cells", 0.0},
                                           SharedLight{"instant_gi_interleaved", 0.0},
                                           SharedLight{"irradiance_cache", 0.01},
                                           SharedLight{"instant_caching", 0.01},
                                           SharedLight{"temporal_instant_caching", 0.01}),
                         [](const auto& method) { return std::string(method.param.integrator); });

TEST_P(ClosedFormsOfPictures, KeepTheLightOfAFurnace) {
  const RayTracer rays(make_scene("white_furnace"));
  judge_mean("white_furnace", rays, primary_hits(rays, 6, 6), double{kRho * kRho}, 0.0);
}

TEST_P(ClosedFormsOfPictures, KeepTheLightThatAPlateSendsToAWall) {
  const RayTracer rays(plate_and_wall());
  const PrimaryHits primary = primary_hits(rays, 16, 16);
  judge_mean("plate and wall", rays, primary, radiance_of_wall(primary), GetParam().bias_on_wall);
}

}  // namespace
}  // namespace icbench
