// The cached integrators' tile: for every stored primary hit, those seen in mirrors and through glass included, ask the
// cache, on a miss have a record made and insert it; and the classic source of records, hemisphere gathers.
//
// Templated on the cache's session so that dispatch happens once per tile, never per operation; all else is compiled
// once. Random numbers of a gather depend on seed, frame, sample and pixel; which pixels gather depends on what the
// cache holds when they ask, hence on the schedule. Hits ask one by one, never in a batch: a miss inserts a record that
// answers the hits around it, and those asked together with it would each have one of their own made.
//
// Where records overlap (render/extrapolation.h) a hit is given by all records around it, but those on one side of it
// may not have been made yet when it asks. So what the later records of its tile bring something to asks once more when
// all of them are there. A hit that a record was made at keeps the record's irradiance.
#pragma once

#include <cstdint>
#include <optional>
#include <type_traits>
#include <vector>

#include "core/interpolation.h"
#include "core/types.h"
#include "image/image.h"
#include "render/caustics.h"
#include "render/gather.h"
#include "render/guarded_sum.h"
#include "render/indirect_pass.h"
#include "render/needed_record.h"
#include "render/place_hash.h"
#include "render/primary.h"
#include "render/radiance_smoother.h"
#include "render/ray_tracer.h"
#include "render/record_source.h"
#include "render/sampling.h"
#include "render/tiles.h"

namespace icbench {

/// Radius limits of new records as shares of the scene's diagonal (Ward et al. 1988 leave them to the
/// implementation).
inline constexpr float kMinRadiusOfDiagonal = 0.003f;
inline constexpr float kMaxRadiusOfDiagonal = 0.3f;

inline RadiusLimits radius_limits(const Bounds& bounds) noexcept {
  return RadiusLimits::for_scene(bounds, kMinRadiusOfDiagonal, kMaxRadiusOfDiagonal);
}

/// Ids of records that are named after the hit they were made at: pixel + pixels of the image * (layer + sample * L),
/// where L is 1 in scenes without specular surfaces, else kMaxVisible. Modulo 2^32; unique within a frame below that.
class RecordNames {
 public:
  RecordNames(const Scene& scene, int width, int height) noexcept
      : pixels_(static_cast<std::uint32_t>(width) * static_cast<std::uint32_t>(height)),
        layers_(scene.has_specular() ? kMaxVisible : 1) {}

  std::uint32_t operator()(const Visible& x, const SampleKey& key) const noexcept {
    return x.pixel + pixels_ * (x.layer + key.sample * layers_);
  }

 private:
  std::uint32_t pixels_, layers_;
};

/// Records by hemisphere gathers. As a frame begins, they stay if nothing but the camera has changed and there is room for
/// new ones, else all go.
class HemisphereSource final : public RecordSource {
 public:
  HemisphereSource(const Strata& strata, const RadiusLimits& limits, const RecordNames& names) noexcept
      : strata_(strata), limits_(limits), names_(names) {}

  RecordsThen begin_frame(const SceneChange& change, Crew& crew) override;
  void found_no_room() noexcept override { is_full_ = true; }
  Record evaluate(unsigned thread, Tracer& tracer, const Visible& x, const SampleKey& key) noexcept override;

 private:
  Strata strata_;
  RadiusLimits limits_;
  RecordNames names_;
  bool is_full_ = false;
};

/// For the records of a pass at its level of interpolation.
RecordShapes make_shapes(const PassSetup& setup);
/// For those of virtual point lights, as their cache is asked for them: with an accuracy times search_reach, and radii
/// over that.
RecordShapes make_shapes_of_vpls(const PassSetup& setup);

/// Mean luminance of indirect irradiance, W/m^2, in a picture of width times height pixels from the scene's camera, by
/// 16 rays from each of 256 pixels on a grid; 0 where none of them reflects light. Its standard deviation is 3 to 9 %
/// in four scenes (tests/render_cached_test.cpp). The same for any number of threads.
float mean_irradiance(const RayTracer& rays, Crew& crew, int width, int height, std::uint64_t seed);

/// Records by hemisphere gathers at the other levels of interpolation: with gradients, and radii as the level says; at
/// all of them with a guard against leaks, if asked for. Ids are those of RecordDetails where records are extrapolated
/// or guarded, else of RecordNames.
class ShapedHemisphereSource final : public RecordSource {
 public:
  explicit ShapedHemisphereSource(const PassSetup& setup);

  RecordsThen begin_frame(const SceneChange& change, Crew& crew) override;
  void found_no_room() noexcept override { is_full_ = true; }
  Record evaluate(unsigned thread, Tracer& tracer, const Visible& x, const SampleKey& key) noexcept override;
  void settle(unsigned thread, const Record& record, InsertResult result) noexcept override;
  RecordShapes* shapes() noexcept override { return has_details() ? &shapes_ : nullptr; }
  void report(PassFigures& figures) const noexcept override;

 private:
  struct alignas(kNoSharing) Worker {
    Hemisphere seen;
    RadianceSmoother smooth;
  };

  bool has_details() const noexcept {
    return extrapolates(shapes_.shaper.level()) || shapes_.details.are_guarded();
  }

  const RayTracer& rays_;
  int width_, height_;
  std::uint64_t seed_;
  Strata strata_;
  RecordNames names_;
  RecordShapes shapes_;
  Caustics caustics_;         // occlusion Hessian only
  bool knows_light_ = false;  // mean and caustics of the light that there is
  bool is_full_ = false;
  std::vector<Worker> workers_;
};

/// Radiance, W/(m^2 sr), that a hit reflects of irradiance E.
glm::vec3 reflected_radiance(const RayTracer& rays, const Hit& hit, const Irradiance& E) noexcept;

/// Asks the cache, and tells `source` which records answered or, if `telling` says so, which is needed for that. Sum is
/// an Interpolator, an Extrapolator or a GuardedSum.
template <class Session, class Sum>
std::optional<Irradiance> query_telling(Session& session, RecordSource& source, UseToTell telling,
                                        const SurfacePoint& x, Sum&& sum) noexcept {
  NeededRecord needed;
  session.visit(x, [&](const Record& r, float weight) noexcept {
    sum(r, weight);
    if (telling == UseToTell::answering) {
      source.used(r);
    } else if constexpr (std::is_same_v<std::remove_cvref_t<Sum>, Extrapolator>) {
      const Contribution c = sum.of(r, weight);
      if (c.w > 0.0f && c.covers) needed.offer(r, hash_of(r.p));
    } else {
      needed.offer(r, hash_of(r.p));
    }
  });
  needed.tell(source);
  return sum.result();
}

/// Asks the cache, and extrapolates from the records that answered.
template <class Session>
std::optional<Irradiance> query_extrapolating(Session& session, const RecordShapes& shapes,
                                              const SurfacePoint& x) noexcept {
  Extrapolator sum(shapes, x);
  session.visit(x, [&](const Record& r, float weight) noexcept { sum(r, weight); });
  return sum.result();
}

/// Asks the cache, and leaves out the records that the guard against leaks stops. Counts rays in `tracer`.
template <class Session>
std::optional<Irradiance> query_guarded(Session& session, const RecordShapes& shapes, Tracer& tracer,
                                        const SurfacePoint& x, LeakTests& tests) noexcept {
  GuardedSum sum(shapes, tracer, x, tests);
  session.visit(x, [&](const Record& r, float weight) noexcept { sum(r, weight); });
  return sum.result();
}

/// R that a neighbour allows a new record at p (Krivanek et al. 2006): R_j + |p - p_j|.
inline float allowed_by_neighbour(const Record& other, const glm::vec3& p) noexcept {
  return other.R + glm::distance(p, other.p);
}

/// R of a record as every record that the cache finds there allows it.
template <class Session>
float clamped_to_neighbours(Session& session, const Record& record) noexcept {
  float R = record.R;
  session.visit({record.p, record.n}, [&](const Record& other, float) noexcept {
    R = std::min(R, allowed_by_neighbour(other, record.p));
  });
  return R;
}

/// A session that is told of each point which was asked for, and whether the records there gave an answer: one that
/// captures a trace (workload/trace_capture.h).
template <class Session>
concept ToldOfQueries = requires(Session s, const SurfacePoint& x) {
  s.asked(x, true);
};

/// Whether a record with an ellipse counts at a point, be it behind what the guard against leaks finds between them.
inline bool counts_at(const RecordShapes& shapes, const Record& r, const SurfacePoint& at) noexcept {
  const float accuracy = search_reach(shapes.shaper.level()) * shapes.shaper.a();
  const float weight = split_sphere_weight(at, r, accuracy);
  return weight > 0.0f && Extrapolator(shapes, at).of(r, weight).w > 0.0f;
}

/// Hits of a tile where records overlap: their irradiance until all records of the tile are made.
class OverlappedHits {
 public:
  OverlappedHits(const RecordShapes& shapes, const Tile& tile) : shapes_(shapes) {
    hits_.reserve(static_cast<std::size_t>(tile.x1 - tile.x0) * static_cast<std::size_t>(tile.y1 - tile.y0));
  }

  /// Given by the records that there were.
  void add_answered(const Visible& x, const Irradiance& E) { hits_.push_back({x, E, State::answered}); }
  /// Given by a record made there.
  void add_own(const Visible& x, const Irradiance& E) { hits_.push_back({x, E, State::own}); }

  /// A new record is in the cache.
  void note(const Record& r) noexcept {
    for (OverlappedHit& hit : hits_) {
      if (hit.state == State::answered && counts_at(shapes_, r, {hit.x.hit.p, hit.x.hit.n}))
        hit.state = State::outdated;
    }
  }

  /// Calls show(visible, irradiance) for every hit in the order in which they were added; those that new records count
  /// at have irradiance_at(visible) instead of what they were added with.
  template <class IrradianceAt, class Show>
  void show_all(IrradianceAt&& irradiance_at, Show&& show) const {
    for (const OverlappedHit& hit : hits_)
      show(hit.x, hit.state == State::outdated ? irradiance_at(hit.x) : hit.E);
  }

 private:
  enum class State : std::uint8_t { answered, outdated, own };
  struct OverlappedHit {
    Visible x;
    Irradiance E;
    State state;
  };

  const RecordShapes& shapes_;
  std::vector<OverlappedHit> hits_;
};

/// Whether hits of a tile ask once more when records that count there came later: not if all were made before.
enum class AskAgain : std::uint8_t { where_outdated, never };

/// Indirect radiance at the stored hits of a tile, through the cache. Pixels that reflect nothing are 0 and ask
/// nothing. `thread` is the caller's, for the source; rays are counted in `tracer`. Out of memory ends the program.
template <class Session>
void irradiance_cache_tile(Session& session, RecordSource& source, unsigned thread, Tracer& tracer,
                           const PrimaryHits& primary, const SampleKey& key, const Tile& tile,
                           Image& indirect, CacheUse& use,
                           AskAgain ask_again = AskAgain::where_outdated) noexcept {
  const UseToTell told = source.tells();
  const bool telling = told != UseToTell::nothing;
  const RecordShapes* shapes = source.shapes();
  std::optional<OverlappedHits> overlapped;
  if (ask_again == AskAgain::where_outdated && shapes != nullptr && is_elliptic(shapes->shaper.level()))
    overlapped.emplace(*shapes, tile);
  const auto answer = [&](const SurfacePoint& at) noexcept {
    if (shapes == nullptr)
      return telling ? query_telling(session, source, told, at, Interpolator{}) : session.query(at);
    if (shapes->details.are_guarded())
      return telling ? query_telling(session, source, told, at, GuardedSum(*shapes, tracer, at, use.leaks))
                     : query_guarded(session, *shapes, tracer, at, use.leaks);
    return telling ? query_telling(session, source, told, at, Extrapolator(*shapes, at))
                   : query_extrapolating(session, *shapes, at);
  };
  const auto ask = [&](const Visible& x) noexcept {
    const SurfacePoint at{x.hit.p, x.hit.n};
    ++use.queries;
    const std::optional<Irradiance> E = answer(at);
    if constexpr (ToldOfQueries<Session>) session.asked(at, E.has_value());
    if (E) ++use.hits;
    return E;
  };
  const auto make_record = [&](const Visible& x) noexcept {
    Record record = source.evaluate(thread, tracer, x, key);
    if (shapes != nullptr && shapes->clamps_to_neighbours())
      record.R = clamped_to_neighbours(session, record);
    const InsertResult result = session.insert(record);
    use.count(result);
    if (overlapped && result == InsertResult::inserted) overlapped->note(record);
    source.settle(thread, record, result);
    return record.E;
  };
  const auto show = [&](const Visible& x, const Irradiance& E) noexcept {
    x.show(indirect, reflected_radiance(tracer.shared(), x.hit, E));
  };
  for_each_visible_coarse_to_fine(tile, primary, [&](const Visible& x) {
    if (!reflects(tracer.shared(), x.hit)) {
      x.show(indirect, glm::vec3(0.0f));
      return;
    }
    const std::optional<Irradiance> answered = ask(x);
    const Irradiance E = answered ? *answered : make_record(x);
    if (!overlapped)
      show(x, E);
    else if (answered)
      overlapped->add_answered(x, E);
    else
      overlapped->add_own(x, E);
  });
  if (!overlapped) return;
  // Such a record may be worth so much that the guard against leaks no longer asks for the only one that covered the
  // hit, which then makes another; those that were shown by then do without it.
  const auto irradiance_at = [&](const Visible& x) noexcept {
    const std::optional<Irradiance> E = ask(x);
    return E ? *E : make_record(x);
  };
  overlapped->show_all(irradiance_at, show);
}

}  // namespace icbench
