#include "render/radiance_smoother.h"

#include <algorithm>
#include <cstddef>

namespace icbench {

void RadianceSmoother::operator()(Hemisphere& seen) noexcept {
  const auto [M, N] = seen.strata;
  // A row does not meet itself on its way round.
  const std::uint32_t reach = std::min(kRadius, (N - 1) / 2);
  const std::size_t width = N + 2 * std::size_t{reach};
  for (std::vector<float>* v :
       {&rows_.t, &rows_.nx, &rows_.ny, &rows_.nz, &rows_.red, &rows_.green, &rows_.blue})
    v->resize(M * width);
  for (std::uint32_t m = 0; m < M; ++m)
    for (std::size_t i = 0; i < width; ++i) {
      const HemisphereSample& s = seen.at(m, static_cast<std::uint32_t>((i + N - reach) % N));
      const std::size_t to = m * width + i;
      rows_.t[to] = s.t;
      rows_.nx[to] = s.ng.x;
      rows_.ny[to] = s.ng.y;
      rows_.nz[to] = s.ng.z;
      rows_.red[to] = s.L.x;
      rows_.green[to] = s.L.y;
      rows_.blue[to] = s.L.z;
    }
  for (std::uint32_t m = 0; m < M; ++m) {
    const std::size_t own = m * width + reach;
    for (std::vector<float>* v : {&sums_.red, &sums_.green, &sums_.blue, &sums_.cells}) v->assign(N, 0.0f);
    const std::uint32_t first = m < kRadius ? 0 : m - kRadius, last = std::min(m + kRadius, M - 1);
    for (std::uint32_t row = first; row <= last; ++row)
      for (std::size_t shift = 0; shift <= 2 * std::size_t{reach}; ++shift) {
        const std::size_t other = row * width + shift;
        for (std::uint32_t n = 0; n < N; ++n) {
          const std::size_t a = own + n, b = other + n;
          const float nearer = std::min(rows_.t[a], rows_.t[b]), farther = std::max(rows_.t[a], rows_.t[b]);
          const float cosine =
              rows_.nx[a] * rows_.nx[b] + rows_.ny[a] * rows_.ny[b] + rows_.nz[a] * rows_.nz[b];
          const bool alike = (farther <= (1.0f + kLikeDistance) * nearer) & (cosine >= kLikeNormals);
          // A choice of values, not a product: 0 times an overflow would not be 0.
          sums_.red[n] += alike ? rows_.red[b] : 0.0f;
          sums_.green[n] += alike ? rows_.green[b] : 0.0f;
          sums_.blue[n] += alike ? rows_.blue[b] : 0.0f;
          sums_.cells[n] += alike ? 1.0f : 0.0f;
        }
      }
    for (std::uint32_t n = 0; n < N; ++n) {
      const float cells = sums_.cells[n];  // 0 only where its own normal is not one
      if (cells > 1.0f)
        seen.samples[std::size_t{m} * N + n].L =
            glm::vec3(sums_.red[n] / cells, sums_.green[n] / cells, sums_.blue[n] / cells);
    }
  }
}

}  // namespace icbench
