// Passes through the simplest cache there is, at every level of interpolation.
#pragma once

#include <gtest/gtest.h>

#include <cstddef>
#include <limits>
#include <optional>
#include <ostream>
#include <string>
#include <vector>

#include "core/interpolation.h"
#include "core/random.h"
#include "render/extrapolation.h"
#include "render/gather.h"
#include "render/integrators.h"
#include "render/irradiance_cache.h"
#include "render_support.h"

namespace icbench {

inline void PrintTo(const InterpolationEntry& entry, std::ostream* out) { *out << entry.name; }

/// Names a parameter of a test.
inline std::string level_name(const ::testing::TestParamInfo<InterpolationEntry>& info) {
  return std::string(info.param.name);
}

/// Makes records whose radii have nothing to do with each other; E tells what R was made.
class UnevenSource final : public RecordSource {
 public:
  UnevenSource(Interpolation level, float a, const Bounds& bounds)
      : shapes_{RecordShaper(level, a, bounds, {0.1f, 10.0f}, 10), RecordDetails(1, 1)} {}

  RecordsThen begin_frame(const SceneChange&, Crew&) override { return RecordsThen::go; }
  Record evaluate(unsigned, Tracer&, const Visible& x, const SampleKey&) noexcept override {
    const float R = 0.2f + 2.0f * Pcg32(hash_keys(x.pixel, 1)).uniform();
    return {x.hit.p, x.hit.n, R, Irradiance(R), RecordDetails::kNone};
  }
  RecordShapes* shapes() noexcept override { return &shapes_; }

 private:
  RecordShapes shapes_;
};

// A list of records, for one thread.
class ListSession {
 public:
  template <class F>
  void visit(const SurfacePoint& x, F&& f) noexcept {
    for (const Record& r : records)
      if (const float w = split_sphere_weight(x, r, a); w > 0.0f) f(r, w);
  }
  std::optional<Irradiance> query(const SurfacePoint& x) noexcept {
    Interpolator sum;
    visit(x, sum);
    return sum.result();
  }
  InsertResult insert(const Record& r) noexcept {
    if (!is_storable(r, bounds)) return InsertResult::rejected;
    if (records.size() == capacity) return InsertResult::full;
    records.push_back(r);
    return InsertResult::inserted;
  }

  Bounds bounds;
  float a = 0.3f;
  std::size_t capacity = std::numeric_limits<std::size_t>::max();
  std::vector<Record> records{};
};

// Records of one integrator at one level of interpolation.
struct RecordKind {
  std::string name;
  Interpolation level;
  MakeSource make;

  bool by_vpls() const { return make != make_irradiance_cache; }
  /// Of the accuracy, with which a cache is asked for these records.
  float reach() const { return search_reach(level, by_vpls()); }
};

inline void PrintTo(const RecordKind& kind, std::ostream* out) { *out << kind.name; }

/// Names a parameter of a test.
inline std::string kind_name(const ::testing::TestParamInfo<RecordKind>& info) { return info.param.name; }

/// All that there are.
inline std::vector<RecordKind> record_kinds() {
  std::vector<RecordKind> kinds;
  for (const IntegratorEntry& integrator : kIntegrators)
    for (const InterpolationEntry& entry : kInterpolations)
      if (integrator.needs_cache() && (!integrator.uses_vpls || is_for_vpls(entry.level)))
        kinds.push_back(
            {std::string(integrator.name) + "_" + std::string(entry.name), entry.level, integrator.source});
  return kinds;
}

inline std::vector<RecordKind> record_kinds_by_vpls() {
  std::vector<RecordKind> kinds = record_kinds();
  std::erase_if(kinds, [](const RecordKind& kind) { return !kind.by_vpls(); });
  return kinds;
}

struct Level {
  Interpolation level = Interpolation::split_sphere;
  std::uint32_t gather_rays = 64;
  float a = 0.2f;
  bool leak_guard = false;
  std::uint32_t vpls = 64;
  std::uint64_t seed = 0;  ///< of gathers and of virtual lights
};

struct LevelRun {
  Image indirect;
  CacheUse use;
  std::vector<Record> records;
};

/// The indirect pass of a picture by one thread; `make`: make_irradiance_cache or one of those by virtual point lights.
inline LevelRun run_level(const RayTracer& rays, const PrimaryHits& primary, const Level& level,
                          MakeSource make = make_irradiance_cache) {
  ThreadCrew crew(rays, 1);
  PassSetup setup{rays, crew, primary.width, primary.height};
  setup.gather_rays = level.gather_rays;
  setup.vpls = level.vpls;
  setup.seed = level.seed;
  setup.a = level.a;
  setup.interpolation = level.level;
  setup.leak_guard = level.leak_guard;
  const auto source = make(setup);
  source->begin_frame({}, crew);
  ListSession session{.bounds = rays.scene().bounds,
                      .a = search_reach(level.level, make != make_irradiance_cache) * level.a};
  LevelRun out{blank(primary.width, primary.height), {}, {}};
  Tracer tracer(rays);
  for (const Tile& tile : make_tiles(primary.width, primary.height, 8, TileOrder::morton))
    irradiance_cache_tile(session, *source, 0, tracer, primary, {.seed = level.seed}, tile, out.indirect,
                          out.use);
  out.records = std::move(session.records);
  return out;
}

/// Indirect light at these hits without a cache: by the virtual lights that the records of run_level() have, or by a
/// gather of so many rays in every pixel, of other random numbers for each `key`.
inline Image without_cache(const RayTracer& rays, const PrimaryHits& primary, const Level& level,
                           bool by_vpls, std::uint64_t key = 0) {
  Image out = blank(primary.width, primary.height);
  Tracer tracer(rays);
  if (by_vpls) {
    ThreadCrew crew(rays, 1);
    PassSetup setup{rays, crew, primary.width, primary.height};
    setup.vpls = level.vpls;
    const auto pass = make_instant_gi(setup);
    pass->begin_frame({});
    for (const Tile& tile : make_tiles(primary.width, primary.height, 8, TileOrder::morton))
      pass->tile(0, tracer, primary, {}, tile, out);
    return out;
  }
  for (std::size_t i = 0; i < out.pixels.size(); ++i) {
    const Hit& hit = primary.hits[i];
    out.pixels[i] =
        reflects(rays, hit)
            ? reflected_radiance(
                  rays, hit, gather(tracer, hit, Strata::for_rays(level.gather_rays), hash_keys(key, i)).E)
            : glm::vec3(0.0f);
  }
  return out;
}

/// The mean of `n` of them.
inline double mean_without_cache(const RayTracer& rays, const PrimaryHits& primary, const Level& level,
                                 bool by_vpls, unsigned n) {
  double sum = 0.0;
  for (unsigned key = 0; key < n; ++key)
    for (const glm::vec3& L : without_cache(rays, primary, level, by_vpls, key).pixels) sum += L.y;
  return sum / static_cast<double>(n * primary.hits.size());
}

}  // namespace icbench
