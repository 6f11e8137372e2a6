#include "render/inner_spheres.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/ext/vector_double3.hpp>
#include <glm/ext/vector_int3.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>
#include <queue>
#include <utility>

#include "core/random.h"
#include "scene/shapes.h"

namespace icbench {
namespace {

constexpr std::size_t kFewTriangles = 256;  // a BVH of these is as fast
constexpr std::size_t kMost = 32;           // spheres
constexpr int kSteps = 24;                  // of the grid of centres, along the mesh's longest side
constexpr float kMargin = 1e-3f;            // of the longest side: far more than any rounding
constexpr std::size_t kWorth = 4;           // points of the grid that a sphere must hold and no other does
constexpr int kMostWindings = 64;           // of parts of the grid that hang together

// A number for each directed edge, drawn from where its ends are: vertices in one place are one.
std::uint64_t edge_key(const glm::vec3& from, const glm::vec3& to) noexcept {
  std::uint64_t key = 0;
  for (const glm::vec3& p : {from, to})
    for (int axis = 0; axis < 3; ++axis)
      key = hash_keys(key, std::bit_cast<std::uint32_t>(p[axis] + 0.0f));  // -0 as 0
  return key;
}

// Whether every directed edge has its opposite: the sum over all edges of numbers drawn for them is that over their
// opposites. That two such sums agree by chance happens once in 2^64 meshes.
bool is_closed(const Mesh& mesh) noexcept {
  std::uint64_t difference = 0;
  for (const glm::uvec3& t : mesh.triangles)
    for (int i = 0; i < 3; ++i) {
      const glm::vec3 &a = mesh.positions[t[i]], &b = mesh.positions[t[(i + 1) % 3]];
      difference += edge_key(a, b) - edge_key(b, a);
    }
  return difference == 0;
}

// Winding number of a closed mesh around a point: the solid angles of its triangles (van Oosterom, Strackee 1983) over
// 4 pi.
double winding(const Mesh& mesh, const glm::vec3& at) {
  double sum = 0.0;
  for (const glm::uvec3& t : mesh.triangles) {
    const glm::dvec3 a(mesh.positions[t.x] - at), b(mesh.positions[t.y] - at), c(mesh.positions[t.z] - at);
    const double A = glm::length(a), B = glm::length(b), C = glm::length(c);
    sum += 2.0 * std::atan2(glm::dot(a, glm::cross(b, c)),
                            A * B * C + glm::dot(a, b) * C + glm::dot(b, c) * A + glm::dot(c, a) * B);
  }
  return sum / (4.0 * std::numbers::pi);
}

double distance_to_segment(const glm::dvec3& p, const glm::dvec3& a, const glm::dvec3& b) noexcept {
  const glm::dvec3 along = b - a;
  const double length2 = std::max(glm::dot(along, along), std::numeric_limits<double>::min());
  return glm::length(p - a - glm::clamp(glm::dot(p - a, along) / length2, 0.0, 1.0) * along);
}

// In double precision: squares of areas would vanish among floats. Of a needle too thin to know its plane it may be too
// large, by less than the needle's width.
double distance_to_triangle(const glm::dvec3& p, const glm::dvec3& a, const glm::dvec3& b,
                            const glm::dvec3& c) noexcept {
  const double to_edge =
      std::min({distance_to_segment(p, a, b), distance_to_segment(p, b, c), distance_to_segment(p, c, a)});
  const glm::dvec3 n = glm::cross(b - a, c - a);
  const double n2 = glm::dot(n, n);
  // Of the foot on the triangle's plane, times n2.
  const double at_b = glm::dot(glm::cross(p - a, c - a), n), at_c = glm::dot(glm::cross(b - a, p - a), n);
  if (!(n2 > 0.0 && at_b >= 0.0 && at_c >= 0.0 && at_b + at_c <= n2)) return to_edge;
  return std::min(to_edge, std::abs(glm::dot(p - a, n)) / std::sqrt(n2));
}

float distance_to_surface(RTCScene shape, const Mesh& mesh, const glm::vec3& p) {
  RTCPointQuery query{};
  query.x = p.x;
  query.y = p.y;
  query.z = p.z;
  query.radius = std::numeric_limits<float>::infinity();
  RTCPointQueryContext context;
  rtcInitPointQueryContext(&context);
  const auto visit = [](RTCPointQueryFunctionArguments* args) {
    const Mesh& of = *static_cast<const Mesh*>(args->userPtr);
    const glm::uvec3& t = of.triangles[args->primID];
    const glm::dvec3 at(args->query->x, args->query->y, args->query->z);
    const auto d =
        static_cast<float>(distance_to_triangle(at, of.positions[t.x], of.positions[t.y], of.positions[t.z]));
    if (!(d < args->query->radius)) return false;
    args->query->radius = d;
    return true;
  };
  const LibraryCall call;
  rtcPointQuery(shape, &query, &context, visit, const_cast<Mesh*>(&mesh));
  return query.radius;
}

// Spheres around the points of a grid in the mesh's box, each as large as the surface allows.
class Grid {
 public:
  Grid(RTCScene shape, const Mesh& mesh, const Bounds& box) : mesh_(mesh) {
    const glm::vec3 extent = box.upper - box.lower;
    const float longest = std::max({extent.x, extent.y, extent.z});
    step_ = longest / float(kSteps);
    size_ = glm::ivec3(glm::ceil(extent / step_));
    const glm::vec3 first = 0.5f * (box.lower + box.upper) - 0.5f * step_ * glm::vec3(size_ - 1);
    spheres_.resize(static_cast<std::size_t>(size_.x) * static_cast<std::size_t>(size_.y) *
                    static_cast<std::size_t>(size_.z));
    tbb::parallel_for(std::size_t{0}, spheres_.size(), [&](std::size_t i) {
      const glm::vec3 centre = first + step_ * glm::vec3(place(static_cast<int>(i)));
      spheres_[i] = {centre, distance_to_surface(shape, mesh, centre) - kMargin * longest};
    });
  }

  // Those inside that are larger than a step. All that reach one another by steps within a sphere are inside, or none.
  std::vector<Sphere> inside() const {
    std::vector<bool> seen(spheres_.size());
    std::vector<Sphere> out;
    std::vector<int> part;
    for (int seed = 0, windings = 0; seed < static_cast<int>(spheres_.size()); ++seed) {
      if (seen[seed] || !large(seed)) continue;
      if (++windings > kMostWindings) break;
      seen[seed] = true;
      part.assign(1, seed);
      for (std::size_t i = 0; i < part.size(); ++i)
        for (int axis = 0; axis < 3; ++axis)
          for (const int by : {-1, 1}) {
            glm::ivec3 next = place(part[i]);
            next[axis] += by;
            if (next[axis] < 0 || next[axis] >= size_[axis]) continue;
            const int at = (next.z * size_.y + next.y) * size_.x + next.x;
            if (seen[at] || !large(at)) continue;
            seen[at] = true;
            part.push_back(at);
          }
      if (std::abs(winding(mesh_, spheres_[seed].centre)) < 0.5) continue;
      for (const int i : part) out.push_back(spheres_[i]);
    }
    return out;
  }

 private:
  glm::ivec3 place(int i) const { return {i % size_.x, i / size_.x % size_.y, i / size_.x / size_.y}; }
  bool large(int i) const { return spheres_[i].radius > step_; }

  const Mesh& mesh_;
  float step_;
  glm::ivec3 size_;
  std::vector<Sphere> spheres_;
};

// A few that together hold most of the centres, each the one that adds the most: what a sphere would add only falls as
// others are taken, so one whose gain still tops the others' old ones is the best.
std::vector<Sphere> choose(const std::vector<Sphere>& from) {
  std::vector<bool> held(from.size());
  const auto in = [&](const Sphere& s, std::size_t i) {
    const glm::vec3 d = from[i].centre - s.centre;
    return glm::dot(d, d) < s.radius * s.radius;
  };
  const auto gain = [&](const Sphere& s) {
    std::size_t out = 0;
    for (std::size_t i = 0; i < from.size(); ++i) out += !held[i] && in(s, i) ? 1 : 0;
    return out;
  };
  std::priority_queue<std::pair<std::size_t, std::size_t>> best;  // gain, sphere
  for (std::size_t s = 0; s < from.size(); ++s) best.emplace(gain(from[s]), s);
  std::vector<Sphere> out;
  while (out.size() < kMost && !best.empty() && best.top().first >= kWorth) {
    const std::size_t s = best.top().second;
    best.pop();
    const std::size_t now = gain(from[s]);
    if (now < kWorth) continue;
    if (!best.empty() && now < best.top().first) {
      best.emplace(now, s);
      continue;
    }
    out.push_back(from[s]);
    for (std::size_t i = 0; i < from.size(); ++i) held[i] = held[i] || in(from[s], i);
  }
  return out;
}

}  // namespace

std::vector<Sphere> inner_spheres(RTCScene shape, const Mesh& mesh) {
  if (mesh.triangles.size() < kFewTriangles || !is_closed(mesh)) return {};
  const Bounds box = bounds_of(mesh);
  const glm::vec3 extent = box.upper - box.lower, far = glm::max(glm::abs(box.lower), glm::abs(box.upper));
  for (int axis = 0; axis < 3; ++axis)  // flat, or so far off that points are hardly told apart
    if (!(extent[axis] > 1e-2f * std::max({far.x, far.y, far.z}))) return {};
  return choose(Grid(shape, mesh, box).inside());
}

}  // namespace icbench
