// Records that carry more than irradiance: how it changes around them, and how far that can be trusted.
//
// A cache stores records as they are and answers with those whose split-sphere region holds the point
// (core/interpolation.h). Beyond the first two levels below, that is where the search ends and this file begins: beside
// the cache there is a RecordDetail for each record, found by the record's id, and a record counts with the irradiance
// that its gradients extrapolate to the point, negative channels as 0, and with a weight that falls to 0 at the border
// of the region where it is valid, so that nothing jumps there.
//
//   level               region of a record                                        irradiance, weight
//   split_sphere        R = harmonic mean distance (Ward et al. 1988), within      as is, 1 / error
//                       wide limits
//   bounded             the same, within kLeastPixels and kMostPixels as           as is, 1 / error
//                       projected to the screen (Tabellion & Lamorlette 2004);
//                       the former outweighs every other limit
//   gradients           the same; R <= E / |gradient of E|, where E is known       extrapolated (Ward & Heckbert 1992),
//                                                                                  1 / error - 1 / a
//   neighbour_clamping  the same; R <= R_j + |p - p_j| for the records j around    the same
//                       (Krivanek et al. 2006)
//   geometric_hessian   ellipse from the eigenvalues of a Hessian by geometry      extrapolated, below
//   occlusion_hessian   ellipse from the eigenvalues of the Hessian with           extrapolated, below
//                       occlusion (Schwarzhaupt, Jensen, Jarosz 2012)
//
// Ellipses. The error of extrapolating E linearly grows with the second derivative: along an eigenvector of eigenvalue
// lambda a record is valid to the distance r = a D s (E / (|lambda| D^2))^q, where D is the scene's diagonal. By
// geometry q is 1/4, which spreads the error evenly over regions (Schwarzhaupt et al. 2012). With occlusion it is 1/6:
// near corners and on small things lambda grows without bound, and the fourth root put seven records of eight where a
// tenth of the squared error was (two bunnies upon two). Limits: r is at most a fifth of D and at least a hundredth of
// a D, with occlusion 0.005; by geometry alone at most a E / |gradient|, and the smaller axis is at least half the
// larger; with occlusion at most kMostPixels as projected to the screen.
//
// With occlusion the ellipse lies along what is near. Slats, edges and shelves go on along themselves, and so does the
// light between them, but a Hessian that is half noise does not tell: across is the direction of the tangent plane that
// the surfaces seen face most, each for as much as it is near; there the larger eigenvalue decides, and r is at most
// 3 a times a mean distance, the geometric mean of the harmonic mean of all distances and of that by radiance. Along
// the other axis r is kStretch times as long, or more by how much less the surfaces face it, up to kMostStretchAlong,
// and at most what the Hessian allows there. Along neither r is longer than the gradient takes to promise kMostSlope of
// the mean irradiance of the picture, or of the record where that is brighter.
//
// With occlusion errors are absolute: the E of that formula is the mean irradiance of the picture, as far as that is
// within kMostContrast times the record's own; and where a record is brighter than that mean, its limit by the mean
// distances is smaller by the cube of how much, down to a tenth. A picture's squared error is in its bright places:
// beside the windows of a nave 5 % of the pixels, the brightest, hold two fifths of it (bench/TRIED.md). Where
// nothing has told the mean, E is the record's own. Of light that comes straight from lamps by way of mirrors and glass
// the Hessian knows nothing; particles tell where it is and how far a record may count beside it (render/caustics.h).
//
// Where the rays tell irradiance to more than kMostErrorOfLight (render/hemisphere.h) they know no derivatives of it:
// a record has no gradients, so that none bounds it, and with occlusion its ellipse is a circle by the mean distance.
// Else records that found no light would reach farthest, and lucky ones least. The Hessian by geometry stays; lambda /
// E is that of one radiance everywhere, whatever the rays found.
//
// Of Radiance's rules one is not kept: its largest radius is at most 64 times its least. Here that may be 100 times
// (split sphere), or a fifth of D over 0.005 a D.
//
// The normal may turn as far as the split-sphere error allows, with occlusion that of 2.8 a. A point off the record's
// surface, as far as that curves from one normal to the other (on a sphere the chord is at right angles to the sum of
// the normals), counts as kOffSurface times as far away: slats and books have neighbours that face the same way.
//
// The error e of a record is 1 at the border of its ellipse. A point in no ellipse needs a new record; in all others
// every record counts that has e < kOverlap, with weight (1 - e / kOverlap) / (e^4 + kNoise): the square of what
// extrapolation misses grows as the fourth power of the distance, the square of a record's noise does not. But the
// search finds those alone at which normals turn a third as far as kOverlap would let them, and 1 - b takes the place
// of 1 - e / kOverlap where it is less, b being 1 where the search ends: else light would jump there on curved
// surfaces. Were a record to count within its ellipse alone, most points would have one or two, on the side where the
// first ray happened to arrive, and corners, extrapolated from the open, would be too bright. R is that of the last
// point where a record counts, if it faces the same way. A pixel that has had its answer when a record of its tile is
// made that counts there asks again, unless it has a record of its own (render/irradiance_cache.h); what other tiles'
// records would bring later, it does without.
//
// Gradients are trusted as far as they do not promise too much. By geometry alone, as without ellipses, they are cut
// down once and for all, so that E changes by a share search_reach a at most on the whole way to where the record ends
// (restrain). With occlusion each change is judged where it is asked for: what comes of the place, g, counts as
// g / (1 + |g| / kMostMoved mean), small ones in full; and a record covers no point at which the two changes, by place
// and by normal, come to more than kMostForeseen a times the mean, or times the record where that is brighter. What it
// foresees there is better looked at.
//
// Records of virtual point lights, where they are extrapolated, let the normal turn kTurnOfVpls times as far as the
// split-sphere error does: the rotational gradient is a sum over the same lights as irradiance, without noise, so that
// the error that is left grows with the square of the turn. That took 29 % of the records of four bunnies' room away,
// and no more of them was seen in one picture (bench/TRIED.md). Since |d| / R + turn / k < a is
// |d| / (R / k) + turn < k a, such records are stored with R / k and asked for with k a.
//
// Where normals may turn so far that those of the two sides of a sheet would do (the errors of VPLs' records from a =
// 0.47 on, as those with occlusion), a record counts on its own side alone: up to right angles.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <limits>
#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "core/interpolation.h"
#include "core/sync.h"
#include "core/types.h"
#include "render/hemisphere.h"
#include "render/leak_guard.h"
#include "scene/scene.h"

namespace icbench {

enum class Interpolation : std::uint8_t {
  split_sphere,
  bounded,
  gradients,
  neighbour_clamping,
  geometric_hessian,
  occlusion_hessian
};

struct InterpolationEntry {
  std::string_view name;
  std::string_view description;
  Interpolation level;
};

inline constexpr std::array kInterpolations{
    InterpolationEntry{"split_sphere", "radius: harmonic mean distance", Interpolation::split_sphere},
    InterpolationEntry{"bounded", "radius within limits on the screen", Interpolation::bounded},
    InterpolationEntry{"gradients", "irradiance extrapolated by its gradients, which bound the radius",
                       Interpolation::gradients},
    InterpolationEntry{"neighbour_clamping", "the same, and radii no larger than those nearby allow",
                       Interpolation::neighbour_clamping},
    InterpolationEntry{"geometric_hessian", "extrapolated; elliptic regions by geometry",
                       Interpolation::geometric_hessian},
    InterpolationEntry{"occlusion_hessian", "extrapolated; elliptic regions by the Hessian with occlusion",
                       Interpolation::occlusion_hessian},
};

/// Throws std::runtime_error naming the known levels if there is none of that name.
const InterpolationEntry& find_interpolation(std::string_view name);

constexpr std::string_view name_of(Interpolation level) noexcept {
  for (const InterpolationEntry& entry : kInterpolations)
    if (entry.level == level) return entry.name;
  return {};
}

constexpr bool extrapolates(Interpolation level) noexcept { return level >= Interpolation::gradients; }
/// Whether records gathered from virtual point lights can be had at this level: one point's shadow rays tell nothing of
/// Hessians, and limits on the screen or by neighbours would tie records that live on to where the camera was.
constexpr bool is_for_vpls(Interpolation level) noexcept {
  return level == Interpolation::split_sphere || level == Interpolation::gradients;
}
constexpr bool is_elliptic(Interpolation level) noexcept { return level >= Interpolation::geometric_hessian; }

/// Scales gradients down where they promise more than a record within its region can hold: with |d| <= a R a channel
/// may change by a share a, as its normal turns by kMostTurn of itself a radian. A few paths that found much light make
/// such gradients, and the least radius would let them show.
void restrain(IrradianceGradients& gradients, const Irradiance& E, float R) noexcept;

/// How many times as far as by the split-sphere error normals may turn: records of virtual point lights that are
/// extrapolated.
inline constexpr float kTurnOfVpls = 3.0f;

/// By how much the accuracy with which a cache is asked is coarser than a: so that a new record finds its neighbours,
/// or that normals may turn farther than a alone allows. `of_vpls`: of a cache whose records these give.
constexpr float search_reach(Interpolation level, bool of_vpls = false) noexcept {
  if (of_vpls && extrapolates(level)) return kTurnOfVpls;
  if (level == Interpolation::occlusion_hessian) return 2.8f;
  return level == Interpolation::neighbour_clamping ? 2.0f : 1.0f;
}

/// To how many times the size of its ellipse a record counts where another one covers the point.
inline constexpr float kOverlap = 3.0f;

/// What a record carries beside the cache.
struct RecordDetail {
  IrradianceGradients gradients;
  glm::vec3 major{0.0f};                             ///< unit, in the tangent plane: elliptic regions only
  float R = 0.0f;                                    ///< metres: records of virtual point lights only
  float inverse_major = 0.0f, inverse_minor = 0.0f;  ///< of the distances to which it is valid, 1/m
  LeakMarks marks;                                   ///< where those that are marked are suspects
};

/// Details by record id. Threads draw ids of their own, in blocks; what a thread writes there before it inserts the
/// record is read by others after they found the record in the cache: the cache's own publication orders the two.
class RecordDetails {
 public:
  static constexpr std::uint32_t kBlock = 16;
  static constexpr std::uint32_t kNone = ~0u;  ///< no id: a record of that id is not extrapolated

  /// For `capacity` records at least, drawn by `threads` threads; `suspects`: of the guard against leaks.
  RecordDetails(std::uint32_t capacity, unsigned threads, LeakSuspects suspects = LeakSuspects::none)
      : blocks_(blocks_for(capacity, threads)), suspects_(suspects), purses_(threads) {}

  /// Blocks for so many ids, though every thread may leave one of ids without bits and one of ids with bits unused
  /// (RecordTable, whose ids may be those of details).
  static std::size_t blocks_for(std::uint32_t capacity, unsigned threads) noexcept {
    return capacity / kBlock + 2 * std::size_t{threads} + 1;
  }

  /// The id of the record that this thread makes next; the same until keep().
  std::uint32_t draft(unsigned thread);
  void keep(unsigned thread) noexcept { ++purses_[thread].next; }

  RecordDetail& operator[](std::uint32_t id) noexcept { return blocks_[id / kBlock][id % kBlock]; }
  const RecordDetail& operator[](std::uint32_t id) const noexcept {
    return blocks_[id / kBlock][id % kBlock];
  }

  LeakSuspects suspects() const noexcept { return suspects_; }
  bool are_guarded() const noexcept { return suspects_ != LeakSuspects::none; }
  /// Of any record, also without a detail, where leaks are guarded against.
  const LeakMarks& marks(std::uint32_t id) const noexcept {
    return suspects_ == LeakSuspects::all || id == kNone ? kMarkedEverywhere : (*this)[id].marks;
  }

  /// Makes room for the details of an id that another table gave to this thread, in blocks of kBlock as here.
  void make_room(std::uint32_t id) {
    std::unique_ptr<RecordDetail[]>& block = blocks_[id / kBlock];
    if (!block) block = std::make_unique<RecordDetail[]>(kBlock);
  }

  /// All ids are free again. Quiescent.
  void clear() noexcept;

  /// Bytes taken so far.
  std::size_t bytes() const noexcept;

 private:
  struct alignas(kNoSharing) Purse {
    std::uint32_t next = 0, end = 0;
  };

  std::vector<std::unique_ptr<RecordDetail[]>> blocks_;  // each written by the thread that drew it
  LeakSuspects suspects_;
  std::vector<Purse> purses_;
  alignas(kNoSharing) std::atomic<std::uint32_t> next_block_{0};
};

/// Radii of new records.
class RecordShaper {
 public:
  /// For an image `height` pixels high; `limits`: of the split sphere.
  RecordShaper(Interpolation level, float a, const Bounds& bounds, const RadiusLimits& limits,
               int height) noexcept;

  Interpolation level() const noexcept { return level_; }
  float a() const noexcept { return a_; }
  /// How far a record of that R is valid at all, metres.
  float reach(float R) const noexcept { return (is_elliptic(level_) ? search_reach(level_) : 1.0f) * a_ * R; }

  /// The camera of this frame, from which screen limits are measured.
  void look_from(const Camera& camera) noexcept;

  /// The luminance of irradiance, W/m^2, by which changes are judged where a record of irradiance E counts.
  float brightness_for(const Irradiance& E) const noexcept {
    return mean_irradiance_ > 0.0f ? mean_irradiance_ : luminance(E);
  }

  /// Mean luminance of the irradiance in the pictures to come, W/m^2, by which errors are judged; 0: it is not known.
  void expect(float mean_irradiance) noexcept { mean_irradiance_ = mean_irradiance; }

  /// Sets the detail of a record that virtual point lights gave, of split-sphere radius `R`, and returns its own R,
  /// metres, to be asked for with accuracy kTurnOfVpls a: no limits on the screen.
  float shape_of_vpls(float R, const Irradiance& E, const IrradianceGradients& gradients,
                      RecordDetail& detail) const noexcept;

  /// R of a record at p with harmonic mean distance `mean` (may be infinite), metres; levels without ellipses.
  float radius(const glm::vec3& p, float mean) const noexcept;
  /// The same, of a record that is extrapolated by `gradients`.
  float radius(const glm::vec3& p, float mean, const Irradiance& E,
               const IrradianceGradients& gradients) const noexcept;

  /// Sets the ellipse of a record at p and returns R of the sphere around it, metres; elliptic levels. `mean`: harmonic
  /// mean distance, which decides where there are too few cells; `farthest`: no valid distance exceeds it, or the least
  /// that there is, metres.
  float ellipse(const glm::vec3& p, const Hemisphere& seen, float mean, const Irradiance& E,
                RecordDetail& detail, float farthest = std::numeric_limits<float>::infinity()) const noexcept;

 private:
  Interpolation level_;
  float a_, diagonal_;
  RadiusLimits limits_;
  float pixel_of_unit_distance_ = 0.0f;
  float height_;
  float mean_irradiance_ = 0.0f;
  glm::vec3 eye_{0.0f};
};

/// What the records of one cache carry, and how new ones are shaped.
struct RecordShapes {
  RecordShaper shaper;
  RecordDetails details;

  bool clamps_to_neighbours() const noexcept { return shaper.level() == Interpolation::neighbour_clamping; }
};

/// What a record brings to a point.
struct Contribution {
  Irradiance E;
  float w;      ///< weight; the record counts if it is above 0
  bool covers;  ///< whether its region holds the point, so that no new record is needed
};

/// Mean of what counts at a point.
class CoveredMean {
 public:
  void add(const Contribution& c) noexcept {
    sum_.add(c.E, c.w);
    covered_ |= c.covers;
  }
  /// Of all that counted together; 0 as long as no record covered the point.
  double weight() const noexcept { return covered_ ? sum_.weight() : 0.0; }

  /// nullopt exactly when no record covered the point.
  std::optional<Irradiance> result() const noexcept { return covered_ ? sum_.result() : std::nullopt; }

 private:
  MeanIrradiance sum_;
  bool covered_ = false;
};

/// Sums what records extrapolate to one point.
class Extrapolator {
 public:
  Extrapolator(const RecordShapes& shapes, const SurfacePoint& x) noexcept
      : shaper_(shapes.shaper),
        details_(shapes.details),
        x_(x),
        inverse_a_(1.0f / shapes.shaper.a()),
        inverse_turn_(inverse_a_ / search_reach(shapes.shaper.level())),
        elliptic_(is_elliptic(shapes.shaper.level())),
        softens_(shapes.shaper.level() == Interpolation::occlusion_hessian) {}

  /// `weight`: of the split sphere, for an accuracy no finer than a.
  void operator()(const Record& r, float weight) noexcept {
    if (const Contribution c = of(r, weight); c.w > 0.0f) sum_.add(c);
  }

  /// nullopt exactly when no record covered the point.
  std::optional<Irradiance> result() const noexcept { return sum_.result(); }

  /// Error of a record with an ellipse, 1 at its border.
  float error_of(const Record& r) const noexcept {
    const RecordDetail& detail = details_[r.id];
    const glm::vec3 d = x_.p - r.p;
    const float along = glm::dot(d, detail.major);
    const float across2 = std::max(glm::dot(d, d) - along * along, 0.0f);
    const float off_surface = 0.5f * std::fabs(glm::dot(d, r.n + x_.n));
    return std::sqrt(square(along * detail.inverse_major) + across2 * square(detail.inverse_minor)) +
           kOffSurface * off_surface * detail.inverse_minor +
           inverse_turn_ * std::sqrt(1.0f - std::min(glm::dot(x_.n, r.n), 1.0f));
  }

  /// What one record brings.
  Contribution of(const Record& r, float weight) const noexcept {
    if (!(glm::dot(x_.n, r.n) > 0.0f)) return {r.E, 0.0f, false};
    // Without details, for which there was no room, it is valid as the split sphere says.
    const bool has_details = r.id != RecordDetails::kNone, by_ellipse = elliptic_ && has_details;
    const float error = by_ellipse ? error_of(r) : inverse_a_ / weight;
    if (!(error < (by_ellipse ? kOverlap : 1.0f))) return {r.E, 0.0f, false};
    // To 0 where e ends, or where the search does that led here, which lets normals turn less far.
    const float last = by_ellipse ? std::min(1.0f - error / kOverlap, 1.0f - inverse_turn_ / weight)
                                  : 1.0f - error / kOverlap;
    if (by_ellipse && !(last > 0.0f)) return {r.E, 0.0f, false};
    const float w = elliptic_ ? last / (square(square(error)) + kNoise) : weight - inverse_a_;
    bool covers = error < 1.0f;
    if (!has_details) return {r.E, w, covers};
    const RecordDetail& detail = details_[r.id];
    const glm::vec3 d = x_.p - r.p;
    const glm::vec3 turn = glm::cross(r.n, x_.n);
    glm::vec3 moved, turned;  // what changes with place and normal
    for (int c = 0; c < 3; ++c) {
      const auto channel = static_cast<std::size_t>(c);
      moved[c] = glm::dot(detail.gradients.translational[channel], d);
      turned[c] = glm::dot(detail.gradients.rotational[channel], turn);
    }
    if (softens_) {
      const float unit = shaper_.brightness_for(r.E), by_place = std::fabs(luminance(moved));
      const float foreseen = by_place + std::fabs(luminance(turned));
      covers = covers && foreseen * inverse_a_ <= kMostForeseen * std::max(unit, luminance(r.E));
      const float limit = kMostMoved * unit;
      if (by_place > 0.0f) moved *= limit / (limit + by_place);
    }
    glm::vec3 E = r.E;
    for (int c = 0; c < 3; ++c) E[c] = std::clamp(E[c] + moved[c] + turned[c], 0.0f, kMaxIrradiance);
    return {E, w, covers};
  }

 private:
  static constexpr float kOffSurface = 2.0f;
  static constexpr float kNoise = 0.5f;
  // Of a, as a share of what is brighter, the record or the picture's mean; and of that mean.
  static constexpr float kMostForeseen = 1.1f, kMostMoved = 0.25f;

  static float square(float x) noexcept { return x * x; }

  const RecordShaper& shaper_;
  const RecordDetails& details_;
  SurfacePoint x_;
  float inverse_a_, inverse_turn_;
  bool elliptic_, softens_;
  CoveredMean sum_;
};

}  // namespace icbench
