// The Hessian by geometry alone against closed forms and finite differences of its definition (render/hemisphere.h).
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat2x2.hpp>
#include <glm/matrix.hpp>
#include <limits>

#include "render/hemisphere.h"
#include "render_support.h"
#include "scene/directions.h"

namespace icbench {
namespace {

using Vec = glm::dvec3;
constexpr float kInfinity = std::numeric_limits<float>::infinity();

// Of all directions evenly: a sample for the middle of each cell.
template <class SampleOf>
Hemisphere seen_evenly(Strata strata, SampleOf&& sample_of) {
  Hemisphere out;
  out.strata = strata;
  for (std::uint32_t m = 0; m < strata.elevations; ++m)
    for (std::uint32_t n = 0; n < strata.azimuths; ++n)
      out.samples.push_back(sample_of(
          cosine_direction(out.basis, (static_cast<float>(m) + 0.5f) / static_cast<float>(strata.elevations),
                           (static_cast<float>(n) + 0.5f) / static_cast<float>(strata.azimuths))));
  return out;
}

// By geometry alone a surface element sends L cos cos / r^2; of its second derivatives the magnitudes of eigenvalues
// are summed. With u the squared sine of the angle to the normal, even in [0, 1]:
//   plane at the height h    (24 u - 4, -4) (1 - u) / h^2    -> pi L / h^2 * 125/54 in all directions
//   centre of a sphere, r    (16 u - 4, -4) / r^2            -> pi L / r^2 * 9/2
TEST(GeometricHessian, IsKnownUnderAPlaneAndInASphere) {
  constexpr float kL = 3.0f, kSize = 1.5f;
  const Strata fine{200, 16};
  const auto expect_round = [](const Hemisphere& seen, double share) {
    const glm::mat2 H = geometric_hessian(seen, 1e-4f);
    const double exact = share * kPi * kL / (kSize * kSize);
    EXPECT_NEAR(H[0][0] / exact, 1.0, 1e-3);
    EXPECT_NEAR(H[1][1] / exact, 1.0, 1e-3);
    EXPECT_NEAR(H[0][1] / exact, 0.0, 1e-5);
    EXPECT_NEAR(H[1][0] / exact, 0.0, 1e-5);
  };
  expect_round(seen_evenly(fine,
                           [&](const glm::vec3& d) -> HemisphereSample {
                             return {d, kSize / d.z, glm::vec3(kL), {0, 0, -1}};
                           }),
               125.0 / 54.0);
  expect_round(seen_evenly(fine,
                           [&](const glm::vec3& d) -> HemisphereSample {
                             return {d, kSize, glm::vec3(kL), -d};
                           }),
               4.5);
}

// Of walls at any slant: each sample's by finite differences of what its surface element sends.
TEST(GeometricHessian, IsThatOfSurfaceElementsByFiniteDifferences) {
  // Two walls that lean over the point, of different brightness: which is whose does not matter.
  const Vec normals[] = {glm::normalize(Vec(-1, 0.5, -1)), glm::normalize(Vec(0.6, -0.2, -1))};
  const auto wall = [&](const glm::vec3& d) -> HemisphereSample {
    const auto t = [&](const Vec& n) {
      const double c = -glm::dot(Vec(d), n);
      return c > 0.25 ? 1.2 / c : 1e3;  // not at a slant
    };
    const double first = t(normals[0]), second = t(normals[1]);
    const Vec& n = first < second ? normals[0] : normals[1];
    if (std::min(first, second) > 100.0) return {d, kInfinity, glm::vec3(0.0f), {0, 0, 1}};
    return {d, static_cast<float>(std::min(first, second)), glm::vec3(first < second ? 1.0f : 5.0f), n};
  };
  const Hemisphere seen = seen_evenly({16, 50}, wall);
  double mean = 0.0;
  for (const HemisphereSample& s : seen.samples)
    mean += luminance(s.L) / static_cast<double>(seen.samples.size());
  glm::dmat2 exact(0.0);
  for (const HemisphereSample& s : seen.samples) {
    if (!std::isfinite(s.t)) continue;
    const auto sent = [&](double x, double y) {  // to a point moved in the tangent plane
      const Vec r = double{s.t} * Vec(s.d) - Vec(x, y, 0);
      return -r.z * glm::dot(r, Vec(s.ng)) / (glm::dot(r, r) * glm::dot(r, r));
    };
    const double h = 1e-3 * double{s.t}, at = sent(0, 0);
    const double xx = sent(h, 0) + sent(-h, 0) - 2 * at, yy = sent(0, h) + sent(0, -h) - 2 * at;
    const double xy = (sent(h, h) + sent(-h, -h) - sent(h, -h) - sent(-h, h)) / 4;
    const glm::dmat2 H = glm::dmat2(xx, xy, xy, yy) / (at * h * h);
    // Magnitudes of the eigenvalues: the root of H^2, by Cayley and Hamilton.
    const glm::dmat2 square = H * H;
    const double det = std::abs(glm::determinant(H));
    exact += (square + glm::dmat2(det)) / std::sqrt(square[0][0] + square[1][1] + 2 * det);
  }
  exact *= kPi * mean / static_cast<double>(seen.samples.size());
  const double size = std::hypot(exact[0][0], exact[1][1], exact[0][1]);
  const glm::mat2 found = geometric_hessian(seen, 1e-4f);
  for (int i = 0; i < 4; ++i) EXPECT_NEAR(found[i / 2][i % 2], exact[i / 2][i % 2], 1e-3 * size) << i;
  EXPECT_GT(std::abs(exact[0][1]), 0.01 * size) << "nothing says which way axes turn";
}

// Guards against: one sample on a wall seen edge-on deciding the whole.
TEST(GeometricHessian, CountsSurfacesAtASlantAsIfTheirCosineWereAFifth) {
  const Hemisphere edge_on{.strata = {1, 1}, .samples = {{{1, 0, 0}, 1.0f, glm::vec3(1.0f), {0, -1, 0}}}};
  const Eigen2 e = magnitudes_of(geometric_hessian(edge_on, 1e-4f));  // of (20, -20; -20, -4)
  EXPECT_NEAR(e.large / kPi, 8.0 + std::sqrt(544.0), 1e-4);
  EXPECT_NEAR(e.small / kPi, std::sqrt(544.0) - 8.0, 1e-4);
}

}  // namespace
}  // namespace icbench
