#include "render/gather.h"

#include <algorithm>
#include <cstddef>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <limits>
#include <numbers>
#include <span>
#include <type_traits>
#include <utility>

#include "core/random.h"
#include "render/sampling.h"
#include "render/specular.h"
#include "render/transport.h"

namespace icbench {
namespace {

constexpr std::uint32_t kWave =
    128;  // paths that advance together: full packets, and their state still fits a 32 KiB L1 cache
constexpr float kInfinity = std::numeric_limits<float>::infinity();

// Room for N values that are written before they are read, without the cost of initialising those not used: a
// gather may be of four rays only. The element types are trivially copyable, so that storage brings them to
// life.
template <class T, std::size_t N>
class Room {
 public:
  static_assert(std::is_trivially_copyable_v<T>, "values come to life by assignment");
  T& operator[](std::size_t i) noexcept { return reinterpret_cast<T*>(bytes_)[i]; }
  std::span<T> first(std::size_t n) noexcept { return {reinterpret_cast<T*>(bytes_), n}; }

 private:
  alignas(T) std::byte bytes_[N * sizeof(T)];
};

// A path on its way along a ray.
struct Path {
  Pcg32 random;
  glm::vec3 weight;  // of the irradiance where the ray left a diffuse surface, in the irradiance asked for
  float q;           // probability with which it was traced there
  float p_b;         // density of its direction; 0 until it has left another diffuse surface
  std::uint32_t specular;  // mirrors and dielectrics met since that diffuse surface
  std::uint32_t cell;      // of the hemisphere that it began in
};

// Where a gather's light goes: into a sum; or into that and, cell by cell, into what was seen.
struct Summed {
  glm::vec3 E{0.0f};

  void add(std::uint32_t, const glm::vec3& light) noexcept { E += light; }
  void add_focused(std::uint32_t, const glm::vec3& light) noexcept { E += light; }
  void add_of_caustic(std::uint32_t, const glm::vec3& light) noexcept { E += light; }
  void meet(std::uint32_t, const Hit&) noexcept {}
};
struct SummedAndSeen : Summed {
  std::vector<HemisphereSample>& samples;
  FocusedLight where;
  glm::vec3 apart{0.0f};

  SummedAndSeen(std::vector<HemisphereSample>& s, FocusedLight f) noexcept : samples(s), where(f) {}
  void add(std::uint32_t cell, const glm::vec3& light) noexcept {
    E += light;
    samples[cell].L += std::numbers::inv_pi_v<float> * light;
  }
  void add_focused(std::uint32_t cell, const glm::vec3& light) noexcept {
    if (where == FocusedLight::seen) return add(cell, light);
    E += light;
    apart += light;
  }
  // What surfaces reflect of light that was focused on them. Rays find it by chance alone, too, but no particle that
  // lands at the record tells it.
  void add_of_caustic(std::uint32_t cell, const glm::vec3& light) noexcept {
    if (where == FocusedLight::seen) return add(cell, light);
    E += light;
  }
  void meet(std::uint32_t cell, const Hit& hit) noexcept {
    samples[cell].t = hit.t;
    samples[cell].ng = hit.ng;
  }
};

// Up to kWave paths, one bounce at a time. Arrays are compacted in place: the paths that go on move to the
// front.
template <class T, class Sink>
class Wave {
 public:
  Wave(T& tracer, Sink& sink) noexcept : tracer_(tracer), sink_(sink), shared_(tracer.shared()) {}

  // Returns the direction of the path that starts in this cell.
  glm::vec3 start(const Hit& x, const glm::vec3& from, const Basis& basis, std::uint32_t index,
                  const glm::vec2& low, const glm::vec2& cell, std::uint64_t key) noexcept {
    Pcg32 random(key);
    const float u_elevation = low.x + cell.x * random.uniform();
    const float u_azimuth = low.y + cell.y * random.uniform();
    // Rounding may lift the last of the last stratum to 1 and over.
    const glm::vec3 d = cosine_direction(basis, std::min(u_elevation, kBelowOne), u_azimuth);
    if (glm::dot(d, x.ng) > 0.0f) {  // else into the surface, past a tilted shading normal: nothing arrives
      paths_[active_] = {random, glm::vec3(1.0f), 1.0f, 0.0f, 0, index};
      rays_[active_++] = {from, kInfinity, d};
    }
    return d;
  }

  bool is_full() const noexcept { return active_ == kWave; }

  void finish() noexcept {
    if (active_ == 0) return;
    trace();
    for (std::uint32_t i = 0; i < active_; ++i) {
      inverse_distances += 1.0 / static_cast<double>(hits_[i].t);
      if (!hits_[i].missed()) sink_.meet(paths_[i].cell, hits_[i]);
    }
    seen += active_;
    shade(false);
    while (active_ > 0) {
      trace();
      shade(true);
    }
  }

  double inverse_distances = 0.0;  // sum over first rays
  std::uint32_t seen = 0;          // first rays

 private:
  void trace() noexcept { tracer_.intersect(rays_.first(active_), hits_.first(active_)); }

  // `count_straight`: whether lamps that are met straight from a diffuse surface count.
  void shade(bool count_straight) noexcept {
    std::uint32_t lit = 0, onward = 0;
    for (std::uint32_t i = 0; i < active_; ++i) {
      const Hit& hit = hits_[i];
      if (hit.missed()) continue;
      Path path = paths_[i];
      const Material& material = shared_.material(hit);
      if (material.is_specular()) {
        Ray on;
        if (!scatter_specular(shared_, hit, rays_[i].d, path.specular++, path.random, path.weight, on))
          continue;
        paths_[onward] = path;
        rays_[onward++] = on;
        continue;
      }
      if (hit.front && material.emits()) {
        const auto arrives = [&](float w) {
          return std::numbers::pi_v<float> * w / path.q * path.weight * material.emission;
        };
        if (path.specular > 0 && path.p_b == 0.0f)
          sink_.add_focused(path.cell, arrives(1.0f));
        else if (path.specular > 0)
          sink_.add_of_caustic(path.cell, arrives(1.0f));
        else if (count_straight)
          sink_.add(path.cell, arrives(emitter_weight(shared_, hit, rays_[i].d, path.p_b, path.q)));
      }
      path.weight *= shared_.albedo(hit) / path.q;
      path.q = survival(path.weight);
      if (!(path.q > 0.0f)) continue;
      LightProposal proposal;
      if (propose_light(shared_, hit, path.q, path.random, proposal)) {
        shadows_[lit] = proposal.shadow;
        lit_cell_[lit] = path.cell;
        light_[lit++] = path.weight * proposal.E;
      }
      if (!(path.random.uniform() < path.q)) continue;
      const float u_elevation = path.random.uniform(), u_azimuth = path.random.uniform();
      const glm::vec3 d = cosine_direction(Basis(hit.n), u_elevation, u_azimuth);
      if (!(glm::dot(d, hit.ng) > 0.0f)) continue;
      path.p_b = glm::dot(d, hit.n) * std::numbers::inv_pi_v<float>;
      path.specular = 0;
      paths_[onward] = path;
      rays_[onward++] = {shared_.leave(hit.p, hit.ng), kInfinity, d};
    }
    tracer_.occluded(shadows_.first(lit), dark_.first(lit));
    for (std::uint32_t i = 0; i < lit; ++i)
      if (!dark_[i]) sink_.add(lit_cell_[i], light_[i]);
    active_ = onward;
  }

  T& tracer_;
  Sink& sink_;
  const RayTracer& shared_;
  std::uint32_t active_ = 0;
  Room<Path, kWave> paths_;
  Room<Ray, kWave> rays_;
  Room<Hit, kWave> hits_;
  Room<Ray, kWave> shadows_;
  Room<glm::vec3, kWave> light_;
  Room<std::uint32_t, kWave> lit_cell_;
  Room<bool, kWave> dark_;
};

// Calls on_start(cell, direction) for each.
template <class T, class Sink, class OnStart>
GatherResult gather_into(T& tracer, Sink& sink, const Hit& x, const Basis& basis, const Strata& strata,
                         std::uint64_t key, OnStart&& on_start) noexcept {
  const std::uint64_t rays_before = tracer.counts.total();
  const glm::vec3 from = tracer.shared().leave(x.p, x.ng);
  const glm::vec2 cell(1.0f / static_cast<float>(strata.elevations),
                       1.0f / static_cast<float>(strata.azimuths));
  Wave<T, Sink> wave(tracer, sink);
  for (std::uint32_t m = 0; m < strata.elevations; ++m)
    for (std::uint32_t n = 0; n < strata.azimuths; ++n) {
      const std::uint32_t index = m * strata.azimuths + n;
      on_start(index, wave.start(x, from, basis, index, cell * glm::vec2(m, n), cell, hash_keys(key, m, n)));
      if (wave.is_full()) wave.finish();
    }
  wave.finish();
  const double R = wave.inverse_distances > 0.0 ? wave.seen / wave.inverse_distances : kInfinity;
  return {sink.E / static_cast<float>(strata.count()), static_cast<float>(R),
          tracer.counts.total() - rays_before};
}

}  // namespace

template <class T>
GatherResult gather(T& tracer, const Hit& x, const Strata& strata, std::uint64_t key) noexcept {
  Summed sum;
  return gather_into(tracer, sum, x, Basis(x.n), strata, key, [](std::uint32_t, const glm::vec3&) {});
}

GatherResult gather(Tracer& tracer, const Hit& x, const Strata& strata, std::uint64_t key, Hemisphere& seen,
                    FocusedLight focused) noexcept {
  seen.strata = strata;
  seen.basis = Basis(x.n);
  seen.samples.assign(strata.count(), {glm::vec3(0.0f), kInfinity, glm::vec3(0.0f), x.ng});
  SummedAndSeen sum(seen.samples, focused);
  const GatherResult out =
      gather_into(tracer, sum, x, seen.basis, strata, key,
                  [&](std::uint32_t cell, const glm::vec3& d) { seen.samples[cell].d = d; });
  seen.apart = sum.apart / static_cast<float>(strata.count());
  return out;
}

template GatherResult gather(Tracer&, const Hit&, const Strata&, std::uint64_t) noexcept;
template GatherResult gather(RecordingTracer&, const Hit&, const Strata&, std::uint64_t) noexcept;

std::vector<TracedRay> record_gather_rays(const RayTracer& rays, std::span<const Hit> points,
                                          const Strata& strata, std::uint64_t key) {
  RecordingTracer tracer(rays);
  for (std::size_t i = 0; i < points.size(); ++i) gather(tracer, points[i], strata, hash_keys(key, i));
  return std::move(tracer.log);
}

std::uint64_t gather_all(Tracer& tracer, std::span<const Hit> points, const Strata& strata,
                         std::uint64_t key) noexcept {
  std::uint64_t rays = 0;
  for (std::size_t i = 0; i < points.size(); ++i)
    rays += gather(tracer, points[i], strata, hash_keys(key, i)).rays;
  return rays;
}

}  // namespace icbench
