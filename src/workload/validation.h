// Whether a trial may count: what the cache holds afterwards is compared with what it was given.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <vector>

#include "core/interpolation.h"
#include "core/random.h"
#include "core/types.h"

namespace icbench {

inline bool same_bits(const Record& a, const Record& b) noexcept {
  return std::memcmp(&a, &b, sizeof a) == 0;
}

/// What a visit calls, whoever asks: one type, so that a cache's traversal is compiled once for all of them.
struct RecordCallback {
  void (*call)(void* context, const Record&, float weight) noexcept;
  void* context;
  void operator()(const Record& r, float weight) const noexcept { call(context, r, weight); }
};

/// Checks that queries at sample points see exactly those of the `stored` records that are valid there. Empty if all is
/// well, else one line. `session` must be one of the cache's, which is quiescent.
template <class Cache, class Session>
std::string validate_queries(const Cache& cache, Session& session, std::span<const Record> stored,
                             std::span<const SurfacePoint> samples) {
  for (const SurfacePoint& x : samples) {
    std::vector<std::uint32_t> seen, valid;
    session.visit(x, RecordCallback{[](void* ids, const Record& r, float) noexcept {
                                      static_cast<std::vector<std::uint32_t>*>(ids)->push_back(r.id);
                                    },
                                    &seen});
    for (const Record& r : stored) {
      if (split_sphere_weight(x, r, cache.config().a) > 0.0f) valid.push_back(r.id);
    }
    std::sort(seen.begin(), seen.end());
    std::sort(valid.begin(), valid.end());
    if (seen != valid)
      return fmt::format("a query sees {} records where {} are valid", seen.size(), valid.size());
  }
  return {};
}

/// Checks a quiescent cache (after end_frame): every record there is bit for bit the one that was given, none
/// is there twice, and there are exactly as many as were accepted; and queries at sample points see exactly
/// the valid ones.
///
/// `expected(id)` returns the record that was given under an id, or nullptr if none was. Empty if all is
/// well, else one line. `session` must be one of the cache's.
template <class Cache, class Session, class Expected>
std::string validate_records(const Cache& cache, Session& session, std::uint64_t accepted,
                             std::span<const SurfacePoint> samples, Expected&& expected) {
  std::vector<Record> stored;
  stored.reserve(accepted);
  cache.for_each_record([&](const Record& r) { stored.push_back(r); });
  for (const Record& r : stored) {
    const Record* given = expected(r.id);
    if (given == nullptr) return fmt::format("invented record {}", r.id);
    if (!same_bits(r, *given)) return fmt::format("torn record {}", r.id);
  }
  std::sort(stored.begin(), stored.end(), [](const Record& a, const Record& b) { return a.id < b.id; });
  const auto twice = std::adjacent_find(stored.begin(), stored.end(),
                                        [](const Record& a, const Record& b) { return a.id == b.id; });
  if (twice != stored.end()) return fmt::format("duplicated record {}", twice->id);
  if (stored.size() != accepted)
    return fmt::format("{} records accepted but {} stored", accepted, stored.size());
  return validate_queries(cache, session, stored, samples);
}

/// At most `n` of the points, chosen at random but always the same.
inline std::vector<SurfacePoint> sample_points(std::span<const SurfacePoint> points, std::size_t n) {
  std::vector<SurfacePoint> out;
  Pcg32 random(5);
  for (std::size_t i = 0; i < n && !points.empty(); ++i) {
    out.push_back(points[random.below(static_cast<std::uint32_t>(points.size()))]);
  }
  return out;
}

}  // namespace icbench
