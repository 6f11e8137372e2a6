// Animations by temporal instant caching for its tests: what is in the cache after every step, beside what would be
// made anew.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "render/temporal.h"
#include "render_support.h"
#include "workload/cached_pass.h"
#include "workload/dispatch.h"

namespace icbench {

inline constexpr std::uint32_t kVpls = 128;
inline constexpr int kWidth = 32, kHeight = 24;

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
    hits.insert_or_assign(place_of(r), x.hit);
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

  static std::array<float, 6> place_of(const Record& r) noexcept {
    return {r.p.x, r.p.y, r.p.z, r.n.x, r.n.y, r.n.z};
  }

  TemporalSource source;
  std::map<std::array<float, 6>, Hit> hits;  // by place and normal: faces may lie in one plane

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
    render_sample(*pass, crew_, view, Lens::centre, {1, frame, 0}, tiles_, primary, direct, indirect);
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
      const Hit& hit = witness->hits.at(Witness::place_of(r));
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
      if (r.id == RecordTable::kNone) {
        expected.R = r.R;  // nothing is known of it but what the cache has
      } else if (shapes != nullptr && extrapolates(shapes->shaper.level())) {
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
  // Of these, seen by rays in full packets and hidden by rays alone, or the reverse.
  std::uint64_t otherwise = 0;

 private:
  std::vector<Tile> tiles_;
};

}  // namespace icbench
