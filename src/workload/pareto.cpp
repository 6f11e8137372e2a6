#include "workload/pareto.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <limits>
#include <numeric>
#include <stdexcept>

#include "core/random.h"
#include "image/metrics/flip.h"
#include "image/metrics/hdrvdp.h"
#include "image/metrics/mean_ratio.h"
#include "image/metrics/relmse.h"
#include "image/metrics/rmse.h"

namespace icbench {
namespace {

// Path tracing at stored hits, indirect light alone: what all methods here estimate.
class PathIndirectPass final : public IndirectPass {
 public:
  explicit PathIndirectPass(std::uint32_t paths) : paths_(paths) {}
  void begin_frame(const SceneChange&) override {}
  void tile(unsigned, Tracer& tracer, const PrimaryHits& primary, const SampleKey& key, const Tile& tile,
            Image& out) noexcept override {
    path_indirect_tile(tracer, primary, paths_, key, tile, out);
  }

 private:
  std::uint32_t paths_;
};

constexpr IntegratorEntry kPathIndirect{"path", "indirect light by path tracing",
                                        [](const PassSetup& s) -> std::unique_ptr<IndirectPass> {
                                          return std::make_unique<PathIndirectPass>(s.paths);
                                        },
                                        nullptr, false};

constexpr bool kWarm = true;

std::uint32_t whole(double value) { return static_cast<std::uint32_t>(value); }

ParetoAxis spp(std::vector<double> values) {
  return {"spp", [](FrameRequest& r, double v) { r.paths = whole(v); }, std::move(values)};
}
ParetoAxis vpls(std::vector<double> values) {
  return {"vpls", [](FrameRequest& r, double v) { r.vpls = whole(v); }, std::move(values)};
}
ParetoAxis accuracy(std::vector<double> values) {
  return {"accuracy", [](FrameRequest& r, double v) { r.a = static_cast<float>(v); }, std::move(values)};
}
ParetoAxis rays_per_record(std::vector<double> values) {
  return {"rays_per_record", [](FrameRequest& r, double v) { r.gather = whole(v); }, std::move(values)};
}
ParetoAxis cell_size(std::vector<double> values) {
  return {"cell_size", [](FrameRequest& r, double v) { r.cell_size = static_cast<float>(v); },
          std::move(values)};
}

/// For methods that interpolate at a level of their own.
template <Interpolation kLevel>
void interpolate(FrameRequest& r) {
  r.interpolation = kLevel;
}

void interpolate_after_overture(FrameRequest& r) {
  r.interpolation = Interpolation::occlusion_hessian;
  r.overture = true;
}

Image mean_of(const Image& a, const Image& b) {
  Image out = a;
  for (std::size_t i = 0; i < out.pixels.size(); ++i) out.pixels[i] = 0.5f * (a.pixels[i] + b.pixels[i]);
  return out;
}

/// Seed of a repetition: the same for all points, so that none is lucky in it.
std::uint64_t seed_of(const ParetoRequest& request, unsigned repetition) {
  return hash_keys(request.seed, repetition, 10);
}

}  // namespace

const IntegratorEntry& path_indirect() { return kPathIndirect; }

const std::vector<ParetoMethod>& pareto_methods() {
  static const std::vector<ParetoAxis> kGathered{accuracy({0.4, 0.2, 0.1, 0.05}),
                                                 rays_per_record({16, 64, 256, 1024})};
  static const std::vector<ParetoAxis> kInstant{accuracy({0.4, 0.2, 0.1}), vpls({64, 256, 1024, 4096})};
  static const IntegratorEntry& cache = find_integrator("irradiance_cache");
  static const IntegratorEntry& ic = find_integrator("instant_caching");
  static const IntegratorEntry& tic = find_integrator("temporal_instant_caching");
  static const std::vector<ParetoMethod> methods{
      {"path", kPathIndirect, {spp({1, 2, 4, 8, 16, 32, 64, 128, 256})}},
      {"instant_gi", find_integrator("instant_gi"), {vpls({64, 128, 256, 512, 1024, 2048})}},
      {"instant_gi_interleaved",
       find_integrator("instant_gi_interleaved"),
       {vpls({64, 128, 256, 512, 1024, 2048, 4096})}},
      {"irradiance_cache", cache, kGathered},
      {"irradiance_cache_bounded", cache, kGathered, interpolate<Interpolation::bounded>},
      {"irradiance_cache_gradients", cache, kGathered, interpolate<Interpolation::gradients>},
      {"irradiance_cache_neighbours", cache, kGathered, interpolate<Interpolation::neighbour_clamping>},
      {"irradiance_cache_geometric", cache, kGathered, interpolate<Interpolation::geometric_hessian>},
      {"irradiance_cache_occlusion", cache, kGathered, interpolate<Interpolation::occlusion_hessian>},
      {"irradiance_cache_overture", cache, kGathered, interpolate_after_overture},
      {"instant_caching", ic, kInstant},
      {"instant_caching_gradients", ic, kInstant, interpolate<Interpolation::gradients>},
      {"temporal_instant_caching", tic, kInstant, nullptr, kWarm},
      {"temporal_instant_caching_gradients", tic, kInstant, interpolate<Interpolation::gradients>, kWarm},
      {"hash_cells", find_integrator("hash_cells"), {cell_size({2, 4, 8, 16, 32}), spp({1, 4, 16, 64})}},
  };
  return methods;
}

std::vector<ParetoPoint> pareto_points(const std::vector<const ParetoMethod*>& methods, bool is_coarse) {
  std::vector<ParetoPoint> out;
  for (const ParetoMethod* method : methods) {
    std::vector<ParetoPoint> made{{method, {}}};
    for (const ParetoAxis& axis : method->axes) {
      std::vector<ParetoPoint> longer;
      for (const ParetoPoint& point : made)
        for (std::size_t i = 0; i < axis.values.size(); i += is_coarse ? 2 : 1) {
          longer.push_back(point);
          longer.back().values.push_back(axis.values[i]);
        }
      made = std::move(longer);
    }
    out.insert(out.end(), made.begin(), made.end());
  }
  return out;
}

std::string setting_of(const ParetoPoint& point) {
  std::string out;
  for (std::size_t i = 0; i < point.values.size(); ++i)
    out += fmt::format("{}{}:{}", i == 0 ? "" : "/", point.method->axes[i].name, point.values[i]);
  return out;
}

std::vector<bool> pareto_front(std::span<const double> seconds, std::span<const double> error) {
  std::vector<std::size_t> order(seconds.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return seconds[a] < seconds[b]; });
  std::vector<bool> front(seconds.size());
  double least = std::numeric_limits<double>::infinity();  // error of what is faster
  for (std::size_t i = 0; i < order.size();) {
    std::size_t end = i;  // of those that take as long
    double least_here = least;
    for (; end < order.size() && seconds[order[end]] == seconds[order[i]]; ++end) {
      front[order[end]] = !(least < error[order[end]]);
      least_here = std::min(least_here, error[order[end]]);
    }
    least = least_here;
    i = end;
  }
  return front;
}

std::uint64_t pareto_bytes(const ParetoRequest& r, std::size_t points) {
  const auto pixels = static_cast<std::uint64_t>(r.frame.width) * static_cast<std::uint64_t>(r.frame.height);
  constexpr std::uint64_t kImages = 11;     // references and pictures at a time
  constexpr std::uint64_t kObserver = 300;  // HDR-VDP
  return pixels * (kObserver + kImages * sizeof(glm::vec3) + 2 * points * sizeof(glm::dvec3) + sizeof(Hit));
}

void RunErrors::add(const Image& reference, const Image& image) {
  if (runs_++ == 0) {
    width_ = image.width;
    height_ = image.height;
    sums_.assign(image.pixels.size(), glm::dvec3(0.0));
    squares_ = sums_;
  }
  for (std::size_t i = 0; i < sums_.size(); ++i) {
    const glm::dvec3 difference = glm::dvec3(image.pixels[i]) - glm::dvec3(reference.pixels[i]);
    sums_[i] += difference;
    squares_[i] += difference * difference;
  }
}

RunErrors::Bias RunErrors::bias(const Reference& reference) const {
  const double n = runs_;
  const int side = std::clamp(std::min(width_, height_) / 16, 1, 8);
  const auto blocks_x = static_cast<std::size_t>((width_ + side - 1) / side);
  std::vector<double> blocks(blocks_x * static_cast<std::size_t>((height_ + side - 1) / side));
  for (int y = 0; y < height_; ++y)
    for (int x = 0; x < width_; ++x) {
      const auto i =
          static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x);
      const glm::dvec3 own(reference.half_difference.pixels[i]);
      const glm::dvec3 squared = (sums_[i] * sums_[i] - squares_[i]) / (n * (n - 1.0)) - own * own;
      blocks[static_cast<std::size_t>(y / side) * blocks_x + static_cast<std::size_t>(x / side)] +=
          squared.x + squared.y + squared.z;
    }
  const double values = 3.0 * static_cast<double>(sums_.size());
  double all = 0.0, squares = 0.0;
  for (const double block : blocks) {
    all += block;
    squares += block * block;
  }
  return {all / values, std::sqrt(squares) / values};
}

double RunErrors::variance() const noexcept {
  const double n = runs_;
  double all = 0.0;
  for (std::size_t i = 0; i < sums_.size(); ++i) {
    const glm::dvec3 own = (squares_[i] - sums_[i] * sums_[i] / n) / (n - 1.0);
    all += own.x + own.y + own.z;
  }
  return all / (3.0 * static_cast<double>(sums_.size()));
}

double ParetoStudy::reference_work(const ParetoRequest& r) {
  // Indirect light, direct light, all light: rays go about as 4 to 1 to 5.
  return 10.0 * static_cast<double>(r.reference_spp);
}

ParetoStudy::ParetoStudy(const ParetoRequest& request, const std::function<void(double)>& progress)
    : request_(request) {
  const FrameRequest& f = request_.frame;
  const std::uint64_t seed = hash_keys(request.seed, 0, 9);  // of no repetition
  f.rays.go_to(static_cast<float>(request.number));
  primary_ = centre_hits(f.rays, f.width, f.height);
  reference_ = make_reference(f.rays, primary_, request.reference_spp, seed);
  irradiance_ = irradiance_of(f.rays, primary_, reference_.indirect);
  progress(4.0 * request.reference_spp);
  direct_ = make_image(f.width, f.height);
  TeamCrew crew(f.team, f.rays);
  const std::vector<Tile> tiles = make_tiles(f.width, f.height, kFrameTile, TileOrder::morton);
  crew.for_each(tiles.size(), 1, [&](unsigned, Tracer& tracer, std::size_t i) {
    direct_tile(tracer, primary_, request.reference_spp, SampleKey{seed, request.number, 0}, tiles[i],
                direct_);
  });
  progress(1.0 * request.reference_spp);

  FrameRequest all{f.rays, f.team, find_integrator("path"), f.cache, f.width, f.height};
  all.spp = std::max(2u, request.reference_spp / 2);  // two at least: samples are spread over the pixel
  all.light_samples = 1;
  const double step = 5.0 * request.reference_spp / (2.0 * frame_work(all));
  all.progress = [&](double tile_samples) { progress(step * tile_samples); };
  Image halves[2];
  for (std::uint64_t h = 0; h < 2; ++h) {
    FrameRequest half = all;
    half.seed = hash_keys(seed, h + 1);
    FrameRenderer renderer(half);
    renderer.render(request.number);
    halves[h] = renderer.picture();
  }
  full_ = mean_of(halves[0], halves[1]);
  // As far as a half lies from the mean of both, the mean lies from the truth, in expectation.
  full_relmse_ = 0.5 * (scaled_relmse(full_, halves[0]) + scaled_relmse(full_, halves[1]));
}

std::string ParetoStudy::name_of(const ParetoPoint& point) const {
  return fmt::format("pareto/{}/{}/{}", request_.scene, point.method->name, setting_of(point));
}

Image ParetoStudy::under_direct_light(const Image& indirect) const {
  Image out = indirect;
  for (std::size_t i = 0; i < out.pixels.size(); ++i) out.pixels[i] += direct_.pixels[i];
  return out;
}

FrameRequest ParetoStudy::request_of(const ParetoPoint& point, unsigned repetition) const {
  const FrameRequest& f = request_.frame;
  FrameRequest r{f.rays, f.team, point.method->integrator, f.cache, f.width, f.height};
  r.light_samples = f.light_samples;
  r.tiles = f.tiles;
  r.seed = seed_of(request_, repetition);
  if (point.method->also != nullptr) point.method->also(r);
  for (std::size_t i = 0; i < point.values.size(); ++i) point.method->axes[i].set(r, point.values[i]);
  return r;
}

ParetoStudy::Rendered ParetoStudy::render(const ParetoPoint& point, unsigned repetition) {
  const FrameRequest& f = request_.frame;
  FrameRequest r = request_of(point, repetition);
  const std::uint32_t frames = f.rays.scene().frames;
  if (point.method->is_warm) f.rays.go_to(static_cast<float>((request_.number + frames - 1) % frames));
  FrameRenderer renderer(r);
  if (point.method->is_warm) renderer.render((request_.number + frames - 1) % frames);
  Rendered out;
  const std::clock_t cpu = std::clock();
  out.cost = renderer.render(request_.number);
  out.cpu_seconds = static_cast<double>(std::clock() - cpu) / CLOCKS_PER_SEC;
  out.indirect = renderer.indirect();
  out.picture = renderer.picture();
  return out;
}

Image ParetoStudy::view(const ParetoPoint& point) { return under_direct_light(render(point, 0).indirect); }

Entry ParetoStudy::run(const ParetoPoint& point, unsigned repetition) {
  const std::string name = name_of(point);
  RunErrors& errors = errors_[name];
  while (errors.runs() < repetition) {
    const unsigned earlier = errors.runs();
    errors.add(reference_.indirect, render(point, earlier).indirect);
  }
  const Rendered made = render(point, repetition);
  const FrameCost& cost = made.cost;
  errors.add(reference_.indirect, made.indirect);

  const FrameRequest& f = request_.frame;
  const IntegratorEntry& integrator = point.method->integrator;
  Entry entry;
  entry.name = name;
  entry.repetitions = request_.repetitions;
  entry.repetition_index = repetition;
  entry.threads = cost.threads;
  entry.real_time = 1e3 * cost.seconds;
  entry.cpu_time = 1e3 * made.cpu_seconds;

  auto& c = entry.counters;
  c["scene"] = request_.scene;
  c["method"] = point.method->name;
  c["integrator"] = integrator.name;
  c["cache"] = integrator.needs_cache() ? f.cache.traits.name : "none";
  if (integrator.needs_cache())
    c["interpolation"] = icbench::name_of(request_of(point, repetition).interpolation);
  for (std::size_t i = 0; i < point.values.size(); ++i) {
    const double value = point.values[i];
    auto& field = c[std::string(point.method->axes[i].name)];
    if (value == std::floor(value)) {
      field = static_cast<std::int64_t>(value);
    } else {
      field = value;
    }
  }
  c["width"] = f.width;
  c["height"] = f.height;
  c["frame"] = request_.number;
  c["seed"] = seed_of(request_, repetition);
  c["seconds"] = cost.seconds;
  c["seconds_indirect"] = cost.seconds_indirect;
  c["rays"] = cost.rays.total();
  if (integrator.needs_cache() || integrator.uses_cells) c["records"] = cost.pass.records;

  c["rmse"] = figure_of(rmse, reference_.indirect, made.indirect);
  const double error = scaled_relmse(reference_.indirect, made.indirect);
  c["relmse"] = error;
  c["relmse_scale"] = relmse_scale(reference_.indirect);
  const Image E = irradiance_of(f.rays, primary_, made.indirect);
  c["rmse_irradiance"] = figure_of(rmse, irradiance_, E);
  c["relmse_irradiance"] = scaled_relmse(irradiance_, E);
  c["mean_ratio"] = figure_of(mean_ratio, reference_.indirect, made.indirect);
  const Image seen = under_direct_light(made.indirect), truth = reference_view();
  c["flip"] = first_of(flip(truth, seen, nullptr, {}));
  for (const MetricValue& part : hdrvdp(truth, seen, nullptr, {})) {
    c[fmt::format("hdrvdp_{}", part.name)] = part.value.value();
  }
  c["full_rmse"] = figure_of(rmse, full_, made.picture);
  c["full_relmse"] = scaled_relmse(full_, made.picture);
  c["full_relmse_scale"] = relmse_scale(full_);
  c["full_mean_ratio"] = figure_of(mean_ratio, full_, made.picture);
  c["full_flip"] = first_of(flip(full_, made.picture, nullptr, {}));
  c["reference_spp"] = reference_.spp;
  c["reference_rmse"] = reference_.rmse;
  c["reference_relmse"] = reference_.scaled_relmse;
  c["reference_rmse_irradiance"] = reference_.rmse_irradiance;
  c["reference_relmse_irradiance"] = reference_.scaled_relmse_irradiance;
  c["full_reference_relmse"] = full_relmse_;
  c["below_reference"] = error - reference_.scaled_relmse < reference_.scaled_relmse;
  if (errors.runs() >= 2) {
    const RunErrors::Bias bias = errors.bias(reference_);
    c["bias"] = std::sqrt(std::max(0.0, bias.squared));
    c["bias_squared"] = bias.squared;
    c["bias_squared_error"] = bias.error;
    c["deviation"] = std::sqrt(std::max(0.0, errors.variance()));
    c["bias_runs"] = errors.runs();
  }
  return entry;
}

}  // namespace icbench
