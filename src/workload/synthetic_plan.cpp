#include "workload/synthetic_plan.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "caches/registry.h"
#include "core/random.h"

namespace icbench {
namespace {

constexpr std::uint32_t kQueryPoints = 1u << 17, kLeastQueryPoints = 1u << 12;
constexpr int kImage = 512;       // pixels a side of the image that coherent points are seen through
constexpr double kOverlap = 6.0;  // records valid at a point of a filled cache, on average

/// Operations of a trial, all threads together.
std::uint32_t operations_of(const WorkloadSpec& spec) noexcept {
  return spec.kind == WorkloadKind::insert_only ? spec.records : spec.operations;
}

/// Points that queries are drawn from: so many that few of them are drawn twice, or as many as a large scene shows.
std::uint32_t query_points(const WorkloadSpec& spec) noexcept {
  return static_cast<std::uint32_t>(
      std::clamp<std::uint64_t>(4 * std::uint64_t{operations_of(spec)}, kLeastQueryPoints, kQueryPoints));
}

}  // namespace

Irradiance smooth_irradiance(const glm::vec3& p) noexcept {
  return {2.0f + std::sin(3.0f * p.x), 2.0f + std::sin(3.0f * p.y + 1.0f),
          2.0f + std::sin(3.0f * p.z + 2.0f)};
}

PlanPoints plan_points(const WorkloadSpec& spec, const RayTracer& rays, std::uint64_t seed) {
  PlanPoints out;
  // Where records come about by misses, any query may leave one.
  const auto radii = spec.kind == WorkloadKind::miss_driven ? WithRadii::yes : WithRadii::no;
  out.queries = spec.order == PointOrder::coherent
                    ? image_points(rays, kImage, kImage, seed, radii, out.tile_ends)
                    : scattered_points(rays, query_points(spec), seed, radii);
  if (const std::uint32_t n = spec.prefilled() + spec.inserts(); n != 0) {
    out.sites = scattered_points(rays, n, hash_keys(seed, 1), WithRadii::yes);
  }
  return out;
}

SyntheticPlan::SyntheticPlan(const WorkloadSpec& spec, PlanPoints given, std::uint64_t seed)
    : spec_(spec),
      points_(std::move(given.queries)),
      tile_ends_(std::move(given.tile_ends)),
      prefilled_(spec.prefilled()) {
  if (spec.order == PointOrder::hot_spot) add_hot_spot(seed);
  if (spec.kind == WorkloadKind::miss_driven) return;
  const SurfacePoints& sites = given.sites;
  for (std::uint32_t i = 0; i < sites.points.size(); ++i) {
    const SurfacePoint& x = sites.points[i];
    records_.push_back({x.p, x.n, sites.radii[i], smooth_irradiance(x.p), i});
  }
  scale_radii();
  Sequential<> oracle(config(1));
  auto session = oracle.open_session(0);
  for (std::uint32_t i = 0; i < prefilled_; ++i) session.insert(records_[i]);
  for (const SurfacePoint& x : points()) {
    const auto E = session.query(x);
    answers_.push_back(E ? E->x : -1.0f);
  }
}

SyntheticPlan::Answers SyntheticPlan::expected_answers(const Streams& streams) const {
  Answers out;
  for (const std::uint32_t operation : streams.operations) {
    if ((operation & Streams::kInsert) != 0 || answers_[operation] < 0.0f) continue;
    ++out.hits;
    out.sum += answers_[operation];
  }
  return out;
}

void SyntheticPlan::add_hot_spot(std::uint64_t seed) {
  const std::vector<SurfacePoint>& points = points_.points;
  const glm::vec3 centre =
      points[Pcg32(hash_keys(seed, 2)).below(static_cast<std::uint32_t>(points.size()))].p;
  hot_.resize(points.size());
  std::iota(hot_.begin(), hot_.end(), 0u);
  const std::size_t keep = std::max<std::size_t>(1, points.size() / 100);
  const auto distance = [&](std::uint32_t i) { return glm::dot(points[i].p - centre, points[i].p - centre); };
  std::nth_element(hot_.begin(), hot_.begin() + static_cast<std::ptrdiff_t>(keep - 1), hot_.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return distance(a) < distance(b); });
  hot_.resize(keep);
}

// A renderer's records come about by misses and hardly overlap more than a few times, however many there are.
// Records strewn at random get there by scaling their radii; the ratios between radii stay those of the
// scene.
void SyntheticPlan::scale_radii() {
  constexpr int kRounds = 6;
  constexpr std::uint32_t kProbes = 1000;
  for (int round = 0; round < kRounds; ++round) {
    CacheConfig config = this->config(1);
    Sequential<WithCounters> cache(config);
    auto session = cache.open_session(0);
    for (const Record& r : records_) session.insert(r);
    Pcg32 random(hash_keys(3, static_cast<std::uint64_t>(round)));
    for (std::uint32_t i = 0; i < kProbes; ++i) {
      session.query(points()[random.below(static_cast<std::uint32_t>(points().size()))]);
    }
    const double overlap = std::max(0.1, static_cast<double>(cache.counters().records_valid) / kProbes);
    const auto scale = static_cast<float>(std::sqrt(kOverlap / overlap));
    if (std::abs(scale - 1.0f) < 0.03f) return;
    for (Record& r : records_) r.R *= scale;
  }
}

Record SyntheticPlan::record_at(const Streams& streams, std::uint32_t operation) const noexcept {
  const std::uint32_t i = streams.operations[operation];
  const SurfacePoint& x = points_.points[i];
  return {x.p, x.n, points_.radii[i], smooth_irradiance(x.p), operation};
}

Streams SyntheticPlan::streams(unsigned threads, std::uint64_t seed) const {
  const std::uint32_t n = operations_of(spec_);
  const std::uint32_t inserts = spec_.inserts();
  const auto points = static_cast<std::uint32_t>(points_.points.size());
  Streams out;
  out.operations.reserve(n);
  out.begin.push_back(0);
  std::uint32_t next_insert = prefilled_;
  Pcg32 random(hash_keys(seed, 4));  // one for all: the operations do not depend on how they are dealt
  for (unsigned t = 0; t < threads; ++t) {
    const auto end = static_cast<std::uint32_t>(std::uint64_t{n} * (t + 1) / threads);
    // Where a coherent thread stands: tiles are dealt round, point by point within a tile.
    std::uint32_t tile = t, at = 0, tile_end = 0;
    for (std::uint32_t i = out.begin.back(); i < end; ++i) {
      // Inserts are spread evenly over the operations, so that every thread gets its share and each is made
      // once.
      if (std::uint64_t{i + 1} * inserts / n > std::uint64_t{i} * inserts / n) {
        out.operations.push_back(Streams::kInsert | next_insert++);
        continue;
      }
      std::uint32_t point = 0;
      switch (spec_.order) {
        case PointOrder::uniform:
          point = random.below(points);
          break;
        case PointOrder::hot_spot:
          point = random.below(10) != 0 ? hot_[random.below(static_cast<std::uint32_t>(hot_.size()))]
                                        : random.below(points);
          break;
        case PointOrder::coherent:
          if (at == tile_end) {
            const auto which = static_cast<std::uint32_t>(tile % tile_ends_.size());
            at = which == 0 ? 0 : tile_ends_[which - 1];
            tile_end = tile_ends_[which];
            tile += threads;
          }
          point = at++;
          break;
      }
      out.operations.push_back(point);
    }
    out.begin.push_back(end);
  }
  return out;
}

CacheConfig SyntheticPlan::config(const WorkloadSpec& spec, unsigned threads) {
  const std::uint64_t records = std::uint64_t{spec.prefilled()} + spec.inserts();
  CacheConfig config;
  config.a_max = spec.a;
  config.a = spec.a;
  config.max_sessions = threads;
  const bool is_miss_driven = spec.kind == WorkloadKind::miss_driven || records == 0;
  config.capacity = capacity_for(is_miss_driven ? spec.operations : records, threads);
  return config;
}

CacheConfig SyntheticPlan::config(unsigned threads) const {
  CacheConfig config = SyntheticPlan::config(spec_, threads);
  config.bounds = points_.bounds;
  return config;
}

std::uint64_t SyntheticPlan::records_of_one_thread(unsigned number, std::uint64_t seed) const {
  if (spec_.kind != WorkloadKind::miss_driven) return 0;
  const Streams all = streams(number, seed);
  Sequential<> cache(config(1));
  auto session = cache.open_session(0);
  std::uint64_t records = 0;
  std::size_t left = all.operations.size();
  for (std::uint32_t turn = 0; left != 0; ++turn) {
    for (unsigned t = 0; t < number; ++t) {
      const std::uint32_t i = all.begin[t] + turn;
      if (i >= all.begin[t + 1]) continue;
      --left;
      if (session.query(points()[all.operations[i]])) continue;
      records += session.insert(record_at(all, i)) == InsertResult::inserted;
    }
  }
  return records;
}

}  // namespace icbench
