#include "render/hemisphere.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <limits>
#include <numbers>

namespace icbench {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;

glm::vec2 at_azimuth(float phi) noexcept { return {std::cos(phi), std::sin(phi)}; }
glm::vec2 quarter_turn(const glm::vec2& v) noexcept { return {-v.y, v.x}; }
glm::vec3 along(const Basis& basis, const glm::vec2& v) noexcept { return v.x * basis.s + v.y * basis.t; }

// Adds a vector in the tangent plane, times each channel of `of`.
void add(std::array<glm::vec2, 3>& sum, const glm::vec2& v, const glm::vec3& of) noexcept {
  for (int c = 0; c < 3; ++c) sum[static_cast<std::size_t>(c)] += of[c] * v;
}

// Points on the segment between two points as seen from the origin: evenly spread over the angle between them rather
// than over the length, so that a segment which goes from near to far is met where it matters.
struct SeenSegment {
  static constexpr int kPoints = 3;  // of Gauss and Legendre: exact for segments that point at the origin
  glm::vec3 at[kPoints];
  float weight[kPoints];  // of ds, s from 0 to 1 along the segment

  SeenSegment(const glm::vec3& a, const glm::vec3& b) noexcept {
    constexpr float u[kPoints] = {0.1127016654f, 0.5f, 0.8872983346f};
    constexpr float w[kPoints] = {5.0f / 18.0f, 8.0f / 18.0f, 5.0f / 18.0f};
    const float nearness_a = 1.0f / glm::length(a), nearness_b = 1.0f / glm::length(b);
    for (int i = 0; i < kPoints; ++i) {
      const float of_a = (1.0f - u[i]) * nearness_a, of_b = u[i] * nearness_b;
      const float total = of_a + of_b;
      at[i] = (of_a * a + of_b * b) / total;
      weight[i] = w[i] * nearness_a * nearness_b / (total * total);
    }
  }
};

// Second derivatives, in the plane z = 0, of the z-component of an edge's term in Lambert's formula:
// c I, c = (a x b).z, I = integral of 1 / |r(s)|^2.
glm::mat2 edge_hessian(const glm::vec3& a, const glm::vec3& b) noexcept {
  const SeenSegment segment(a, b);
  glm::vec2 dI(0.0f);
  glm::mat2 ddI(0.0f);
  for (int i = 0; i < SeenSegment::kPoints; ++i) {
    const glm::vec3& r = segment.at[i];
    const glm::vec2 flat(r.x, r.y);
    const float inverse = 1.0f / glm::dot(r, r);
    const float w = segment.weight[i] * inverse * inverse;
    dI += 2.0f * w * flat;
    ddI += w * (8.0f * inverse * glm::outerProduct(flat, flat) - glm::mat2(2.0f));
  }
  const float c = a.x * b.y - a.y * b.x;
  const glm::vec2 dc(a.y - b.y, b.x - a.x);
  return glm::outerProduct(dc, dI) + glm::outerProduct(dI, dc) + c * ddI;
}

// Hit points as seen from the point, in its basis, with the radiance that they send. What is not seen at all lies
// a thousand times as far away as the nearest surface.
class SeenPoints {
 public:
  SeenPoints(const Hemisphere& seen, float near) noexcept : strata_(seen.strata) {
    float nearest = std::numeric_limits<float>::infinity();
    for (const HemisphereSample& s : seen.samples) nearest = std::min(nearest, s.t);
    const float far = 1e3f * (std::isfinite(nearest) ? std::max(nearest, near) : near);
    corners_.reserve(seen.samples.size());
    for (const HemisphereSample& s : seen.samples) {
      const float t = std::clamp(s.t, near, std::max(far, near));
      const glm::vec3 d(glm::dot(s.d, seen.basis.s), glm::dot(s.d, seen.basis.t),
                        glm::dot(s.d, seen.basis.n));
      corners_.push_back({t * d, t, luminance(s.L)});
    }
  }

  const glm::vec3& at(std::uint32_t m, std::uint32_t n) const noexcept { return corner(m, n).p; }

  // Radiance of the patch between elevations m, m + 1 and azimuths n, n + 1: that of its farthest corner, since the
  // nearer ones hide it.
  float patch(std::uint32_t m, std::uint32_t n) const noexcept {
    const Corner* farthest = &corner(m, n);
    for (const Corner* other : {&corner(m, n + 1), &corner(m + 1, n), &corner(m + 1, n + 1)})
      if (other->t > farthest->t) farthest = other;
    return farthest->L;
  }
  // That of the cap inside the first ring.
  float cap() const noexcept {
    const Corner* farthest = &corner(0, 0);
    for (std::uint32_t n = 1; n < strata_.azimuths; ++n)
      if (corner(0, n).t > farthest->t) farthest = &corner(0, n);
    return farthest->L;
  }

 private:
  struct Corner {
    glm::vec3 p;
    float t, L;
  };
  const Corner& corner(std::uint32_t m, std::uint32_t n) const noexcept {
    return corners_[static_cast<std::size_t>(m) * strata_.azimuths + n % strata_.azimuths];
  }

  Strata strata_;
  std::vector<Corner> corners_;
};

}  // namespace

Strata Strata::for_rays(std::uint32_t rays) noexcept {
  const double wanted = std::max(rays, 1u);
  const double ideal = std::sqrt(wanted / std::numbers::pi);
  const auto lowest = static_cast<std::uint32_t>(std::max(1.0, std::ceil(0.7 * ideal)));
  const auto highest = static_cast<std::uint32_t>(std::max(1.0, std::floor(1.3 * ideal)));
  Strata best{1, std::max(rays, 1u)};
  double best_miss = std::numeric_limits<double>::infinity();
  for (std::uint32_t m = lowest; m <= highest; ++m) {
    const auto n = static_cast<std::uint32_t>(std::max(1.0, std::round(wanted / m)));
    // First the count, then the shape.
    const double miss = std::abs(wanted - static_cast<double>(m) * n) + 0.01 * std::abs(m - ideal) / ideal;
    if (miss < best_miss) {
      best = {m, n};
      best_miss = miss;
    }
  }
  return best;
}

bool is_light_known(const Hemisphere& seen) noexcept {
  double sum = 0.0, squares = 0.0;
  for (const HemisphereSample& s : seen.samples) {
    const double L = luminance(s.L);
    sum += L;
    squares += L * L;
  }
  if (!(sum > 0.0)) return false;
  // The square of the mean's relative standard error.
  const double error2 = squares / (sum * sum) - 1.0 / static_cast<double>(seen.samples.size());
  return error2 < kMostErrorOfLight * kMostErrorOfLight;
}

IrradianceGradients gradients_of(const Hemisphere& seen, float near) noexcept {
  const auto [M, N] = seen.strata;
  std::array<glm::vec2, 3> translational{}, rotational{};
  const float width = 2.0f * kPi / static_cast<float>(N);
  const auto border = [near](const HemisphereSample& a, const HemisphereSample& b) {
    return 1.0f / std::max(std::min(a.t, b.t), near);  // 0 where neither meets anything
  };
  for (std::uint32_t m = 0; m < M; ++m) {
    const float low = std::sqrt(static_cast<float>(m) / static_cast<float>(M));  // sines
    const float high = std::sqrt(static_cast<float>(m + 1) / static_cast<float>(M));
    const float cos2 = 1.0f - low * low;
    // Mean tangent of the cell's elevations: a sample's own is unbounded.
    const auto primitive = [](float sine) {
      return std::asin(sine) - sine * std::sqrt(std::max(0.0f, 1.0f - sine * sine));
    };
    const float tangent = static_cast<float>(M) * (primitive(high) - primitive(low));
    for (std::uint32_t n = 0; n < N; ++n) {
      const HemisphereSample& s = seen.at(m, n);
      const glm::vec2 u = at_azimuth((static_cast<float>(n) + 0.5f) * width);
      if (m > 0) {
        const HemisphereSample& above = seen.at(m - 1, n);
        add(translational, u, width * low * cos2 * border(s, above) * (s.L - above.L));
      }
      const HemisphereSample& before = seen.at(m, n == 0 ? N - 1 : n - 1);
      const glm::vec2 v = quarter_turn(at_azimuth(static_cast<float>(n) * width));
      add(translational, v, (high - low) * border(s, before) * (s.L - before.L));
      add(rotational, quarter_turn(u), kPi / static_cast<float>(M * N) * tangent * s.L);
    }
  }
  IrradianceGradients out;
  for (std::size_t c = 0; c < 3; ++c) {
    out.translational[c] = along(seen.basis, translational[c]);
    out.rotational[c] = along(seen.basis, rotational[c]);
  }
  return out;
}

glm::mat2 occlusion_hessian(const Hemisphere& seen, float near) noexcept {
  const auto [M, N] = seen.strata;
  const SeenPoints points(seen, near);
  glm::mat2 sum(0.0f);
  for (std::uint32_t m = 0; m + 1 < M; ++m)
    for (std::uint32_t n = 0; n < N; ++n) {
      const float inside = points.patch(m, n);
      // Along the ring, towards growing azimuth: the patch above is on the left.
      const float above = m == 0 ? points.cap() : points.patch(m - 1, n);
      if (above != inside)
        sum += 0.5f * (above - inside) * edge_hessian(points.at(m, n), points.at(m, n + 1));
      // From the pole outwards: the patch of greater azimuth is on the left.
      const float before = points.patch(m, n == 0 ? N - 1 : n - 1);
      if (before != inside)
        sum += 0.5f * (inside - before) * edge_hessian(points.at(m, n), points.at(m + 1, n));
    }
  return sum;
}

glm::mat2 geometric_hessian(const Hemisphere& seen, float near) noexcept {
  float mean = 0.0f;
  for (const HemisphereSample& s : seen.samples) mean += luminance(s.L);
  return kPi * mean / static_cast<float>(seen.samples.size()) * relative_geometric_hessian(seen, near);
}

glm::mat2 relative_geometric_hessian(const Hemisphere& seen, float near) noexcept {
  constexpr float kLeastCosine = 0.2f;  // surfaces seen at a slant are not what one sample makes of them
  glm::mat2 sum(0.0f);
  for (const HemisphereSample& s : seen.samples) {
    if (!std::isfinite(s.t)) continue;
    const glm::vec2 d(glm::dot(s.d, seen.basis.s), glm::dot(s.d, seen.basis.t));
    const glm::vec2 n(glm::dot(s.ng, seen.basis.s), glm::dot(s.ng, seen.basis.t));
    const float cosine = std::min(glm::dot(s.d, s.ng), -kLeastCosine);
    // Of -(r . n) / |r|^4 over its own value, at |r| = 1.
    const glm::mat2 term = 24.0f * glm::outerProduct(d, d) - glm::mat2(4.0f) -
                           4.0f / cosine * (glm::outerProduct(n, d) + glm::outerProduct(d, n));
    const Eigen2 e = magnitudes_of(term);
    const glm::vec2 other = quarter_turn(e.axis);
    const float t = std::max(s.t, near);
    sum +=
        (e.large * glm::outerProduct(e.axis, e.axis) + e.small * glm::outerProduct(other, other)) / (t * t);
  }
  return sum / static_cast<float>(seen.samples.size());
}

NearSurfaces near_surfaces(const Hemisphere& seen, float near) noexcept {
  NearSurfaces out;
  float light = 0.0f, nearness_of_light = 0.0f;
  for (const HemisphereSample& s : seen.samples) {
    if (!std::isfinite(s.t)) continue;
    const float nearness = 1.0f / std::max(s.t, near), L = luminance(s.L);
    const glm::vec2 n(glm::dot(s.ng, seen.basis.s), glm::dot(s.ng, seen.basis.t));
    out.facing += nearness * glm::outerProduct(n, n);
    light += L;
    nearness_of_light += L * nearness;
  }
  out.distance_of_light =
      nearness_of_light > 0.0f ? light / nearness_of_light : std::numeric_limits<float>::infinity();
  return out;
}

Eigen2 magnitudes_of(const glm::mat2& symmetric) noexcept {
  const float a = symmetric[0][0], b = 0.5f * (symmetric[0][1] + symmetric[1][0]), d = symmetric[1][1];
  const float centre = 0.5f * (a + d), half = 0.5f * (a - d);
  const float spread = std::sqrt(half * half + b * b);
  // The axis of centre + spread is at half the angle of (half, b).
  const float angle = 0.5f * std::atan2(b, half);
  const glm::vec2 upper = at_azimuth(angle);
  const float first = std::abs(centre + spread), second = std::abs(centre - spread);
  if (first >= second) return {first, second, upper};
  return {second, first, quarter_turn(upper)};
}

}  // namespace icbench
