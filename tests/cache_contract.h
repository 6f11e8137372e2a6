// What the tests of all caches share: records that betray faults, the oracle, and the fixture over the registry.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "any_cache.h"
#include "core/random.h"
#include "sanitized.h"

namespace icbench {

/// A record whose irradiance is a function of its id, so that a torn or invented one is recognised.
inline Record make_record(std::uint32_t id, glm::vec3 p, glm::vec3 n, float R) {
  const std::uint64_t h = mix64(id + 1);
  return {p, n, R,
          glm::vec3(static_cast<float>(h & 0xffff), static_cast<float>((h >> 16) & 0xffff),
                    static_cast<float>((h >> 32) & 0xffff)),
          id};
}

inline bool is_intact(const Record& r) { return r.E == make_record(r.id, r.p, r.n, r.R).E; }

/// Points on the walls of the unit box, normals inwards: what a renderer asks for.
inline SurfacePoint random_surface_point(Pcg32& rng) {
  const unsigned face = rng.below(6);
  SurfacePoint x{{rng.uniform(), rng.uniform(), rng.uniform()}, {0, 0, 0}};
  const int axis = static_cast<int>(face % 3);
  x.p[axis] = face < 3 ? 0.0f : 1.0f;
  x.n[axis] = face < 3 ? 1.0f : -1.0f;
  return x;
}

inline std::vector<Record> random_records(std::uint32_t n, std::uint64_t seed, std::uint32_t first_id = 0) {
  Pcg32 rng(seed);
  std::vector<Record> records;
  for (std::uint32_t i = 0; i < n; ++i) {
    const SurfacePoint x = random_surface_point(rng);
    records.push_back(make_record(first_id + i, x.p, x.n, 0.02f * std::exp2(5.0f * rng.uniform())));
  }
  return records;
}

inline std::vector<std::uint32_t> oracle(const std::vector<Record>& records, const SurfacePoint& x, float a) {
  std::vector<std::uint32_t> ids;
  for (const Record& r : records) {
    if (split_sphere_weight(x, r, a) > 0.0f) ids.push_back(r.id);
  }
  std::sort(ids.begin(), ids.end());
  return ids;
}

template <class Session>
std::vector<std::uint32_t> seen(Session& session, const SurfacePoint& x) {
  std::vector<std::uint32_t> ids;
  session.visit(x, [&](const Record& r, float) { ids.push_back(r.id); });
  std::sort(ids.begin(), ids.end());
  return ids;
}

template <class Cache>
std::vector<std::uint32_t> stored(const Cache& cache) {
  std::vector<std::uint32_t> ids;
  cache.for_each_record([&](const Record& r) { ids.push_back(r.id); });
  std::sort(ids.begin(), ids.end());
  return ids;
}

/// A test of the cache that is its parameter.
class Contract : public ::testing::TestWithParam<AnyCache::Maker> {
 protected:
  static bool keeps() { return GetParam().traits.consistency != Consistency::none; }
  static std::uint32_t threads() { return GetParam().traits.single_thread ? 1 : 8; }

  static CacheConfig config(std::uint32_t capacity = 20000) {
    CacheConfig c;
    c.a_max = 0.4f;
    c.a = 0.3f;
    c.capacity = capacity;
    c.max_sessions = threads();
    return c;
  }
};

}  // namespace icbench
