#include "workload/repeatability.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <limits>

#include "core/random.h"
#include "image/metrics/rmse.h"
#include "workload/names.h"

namespace icbench {
namespace {

double rms_difference(const Image& a, const Image& b) { return first_of(rmse(a, b, nullptr)); }

/// `value`, and what share it is of the picture's mean and of its error; null where there is no such share.
void put(nlohmann::ordered_json& counters, const std::string& name, double value, double mean, double error) {
  const auto share_of = [&](double of) {
    return of > 0.0 ? value / of : std::numeric_limits<double>::quiet_NaN();
  };
  counters[name] = value;
  counters[name + "_share_of_mean"] = share_of(mean);
  counters[name + "_share_of_error"] = share_of(error);
}

}  // namespace

std::vector<RepeatabilityPoint> repeatability_points(std::span<const CacheEntry* const> caches,
                                                     std::vector<unsigned> threads) {
  std::sort(threads.begin(), threads.end());
  std::vector<RepeatabilityPoint> out;
  for (const CacheEntry* cache : caches) {
    if (cache->traits.single_thread) {
      out.push_back({cache, 1, 0});
      continue;
    }
    unsigned fewer = 0;
    for (const unsigned n : threads) {
      out.push_back({cache, n, fewer});
      fewer = n;
    }
  }
  return out;
}

std::uint64_t repeatability_bytes(const RepeatabilityRequest& r, std::size_t points) {
  const auto pixels = static_cast<std::uint64_t>(r.frame.width) * static_cast<std::uint64_t>(r.frame.height);
  constexpr std::uint64_t kImages = 4;  // references, and pictures at a time
  // Of each point its last picture; of its cache that of one thread.
  return pixels * (kImages + 2 * points) * sizeof(glm::vec3);
}

double RepeatabilityStudy::reference_work(const RepeatabilityRequest& r) { return r.reference_spp; }

RepeatabilityStudy::RepeatabilityStudy(const RepeatabilityRequest& request, const Topology& topology,
                                       const std::function<void(double)>& progress)
    : request_(request), topology_(topology) {
  const FrameRequest& f = request_.frame;
  f.rays.go_to(static_cast<float>(request_.number));
  const PrimaryHits primary = centre_hits(f.rays, f.width, f.height);
  // Of no picture.
  reference_ = make_reference(f.rays, primary, request_.reference_spp, hash_keys(f.seed, 0, 9));
  progress(reference_work(request_));
}

std::string RepeatabilityStudy::name_of(const RepeatabilityPoint& point) const {
  return fmt::format("repeatability/{}/{}{}/{}/threads:{}", request_.scene, request_.frame.integrator.name,
                     request_.frame.deterministic ? "/deterministic" : "", point.cache->traits.name,
                     point.threads);
}

FrameRequest RepeatabilityStudy::request_of(const RepeatabilityPoint& point) {
  const FrameRequest& f = request_.frame;
  auto& team = teams_[point.threads];
  if (!team) team = std::make_unique<ThreadTeam>(topology_, request_.placement, point.threads);
  FrameRequest r{f.rays, *team, f.integrator, *point.cache, f.width, f.height};
  r.gather = f.gather;
  r.vpls = f.vpls;
  r.a = f.a;
  r.interpolation = f.interpolation;
  r.tiles = f.tiles;
  r.seed = f.seed;
  r.deterministic = f.deterministic;
  r.overture = f.overture;
  r.leak_guard = f.leak_guard;
  return r;
}

RepeatabilityStudy::Rendered RepeatabilityStudy::render(const RepeatabilityPoint& point,
                                                        unsigned repetition) {
  FrameRenderer renderer(request_of(point));
  Rendered out{repetition, {}, 0.0, {}};
  const std::clock_t cpu = std::clock();
  out.cost = renderer.render(request_.number);
  out.cpu_seconds = static_cast<double>(std::clock() - cpu) / CLOCKS_PER_SEC;
  out.indirect = renderer.indirect();
  return out;
}

const RepeatabilityStudy::Rendered& RepeatabilityStudy::single(const CacheEntry& cache) {
  const auto known = single_.find(&cache);
  return known != single_.end() ? known->second
                                : single_.emplace(&cache, render({&cache, 1, 0}, 0)).first->second;
}

const RepeatabilityStudy::Rendered& RepeatabilityStudy::last(const RepeatabilityPoint& point,
                                                             unsigned repetition) {
  const auto known = last_.find(name_of(point));
  if (known != last_.end() && known->second.repetition == repetition) return known->second;
  return last_.insert_or_assign(name_of(point), render(point, repetition)).first->second;
}

Entry RepeatabilityStudy::run(const RepeatabilityPoint& point, unsigned repetition) {
  Rendered made = render(point, repetition);
  if (point.threads == 1) single_.try_emplace(point.cache, made);
  const Rendered& one = single(*point.cache);
  const FrameRequest& f = request_.frame;
  const IntegratorEntry& integrator = f.integrator;

  Entry entry;
  entry.name = name_of(point);
  entry.repetitions = request_.repetitions;
  entry.repetition_index = repetition;
  entry.threads = point.threads;
  entry.real_time = 1e3 * made.cost.seconds;
  entry.cpu_time = 1e3 * made.cpu_seconds;

  auto& c = entry.counters;
  c["scene"] = request_.scene;
  c["integrator"] = integrator.name;
  c["deterministic"] = f.deterministic;
  c["cache"] = point.cache->traits.name;
  c["mechanism"] = point.cache->traits.mechanism;
  c["single_thread"] = point.cache->traits.single_thread;
  c["oversubscribed"] = point.threads > topology_.units().size();
  c["interpolation"] = icbench::name_of(f.interpolation);
  c["leak_guard"] = guards_against_leaks(f);
  c["accuracy"] = shortest_decimal(f.a);
  c[integrator.uses_vpls ? "vpls" : "rays_per_record"] = integrator.uses_vpls ? f.vpls : f.gather;
  c["width"] = f.width;
  c["height"] = f.height;
  c["frame"] = request_.number;
  c["seed"] = f.seed;
  c["seconds"] = made.cost.seconds;
  c["seconds_indirect"] = made.cost.seconds_indirect;
  c["records"] = made.cost.pass.records;
  c["records_made"] = made.records_made();
  c["redundant_records"] =
      static_cast<std::int64_t>(made.records_made()) - static_cast<std::int64_t>(one.records_made());

  const double mean = channel_mean(made.indirect);
  const double rms = rms_difference(reference_.indirect, made.indirect);
  // The reference errs independently of all pictures.
  const double error = std::sqrt(std::max(0.0, rms * rms - reference_.rmse * reference_.rmse));
  c["mean"] = mean;
  c["rmse"] = rms;
  c["reference_rmse"] = reference_.rmse;
  c["reference_spp"] = reference_.spp;
  c["error"] = error;
  put(c, "rms_to_single", rms_difference(one.indirect, made.indirect), mean, error);
  if (repetition > 0)
    put(c, "rms_to_last_run", rms_difference(last(point, repetition - 1).indirect, made.indirect), mean,
        error);
  if (point.fewer != 0) {
    const RepeatabilityPoint fewer{point.cache, point.fewer, 0};
    c["fewer_threads"] = point.fewer;
    put(c, "rms_to_fewer_threads", rms_difference(last(fewer, repetition).indirect, made.indirect), mean,
        error);
  }
  last_.insert_or_assign(entry.name, std::move(made));
  return entry;
}

}  // namespace icbench
