#include "rows/cached_pictures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "image/metrics/block_rmse.h"
#include "image/metrics/mean_ratio.h"
#include "image/metrics/relmse.h"
#include "image/metrics/rmse.h"
#include "rows/animations.h"
#include "scene/registry.h"
#include "workload/frame_renderer.h"
#include "workload/pareto.h"
#include "workload/ray_traced_plan.h"

namespace icbench {
namespace {

constexpr int kJudgedWidth = 192, kJudgedHeight = 144;  // of pictures that are compared with path tracing
constexpr std::uint32_t kReferenceSpp = 1024;

// A scene at its first frame, and the threads that render it.
class Stage {
 public:
  Stage(const Machine& machine, std::string_view scene)
      : rays_(make_scene(scene)), team_(machine.topology, Placement::compact, machine.units()) {}

  const RayTracer& rays() const noexcept { return rays_; }

  /// What an integrator is asked for, by default: records extrapolated by gradients at the scene's own accuracy.
  FrameRequest request(const IntegratorEntry& integrator, std::uint64_t seed, int width, int height) {
    return {.rays = rays_,
            .team = team_,
            .integrator = integrator,
            .cache = find_cache("packed_wait_free"),
            .width = width,
            .height = height,
            .interpolation = Interpolation::gradients,
            .seed = seed};
  }

 private:
  RayTracer rays_;
  ThreadTeam team_;
};

float own_accuracy(std::string_view scene) { return accuracy_of(Setting{scene, 0}); }

const IntegratorEntry& irradiance_cache() { return find_integrator("irradiance_cache"); }

class DeterministicOverFree : public Experiment {
 public:
  DeterministicOverFree(const Machine& machine, std::string_view scene, const DeterministicFrame& which)
      : stage_(machine, scene), scene_(scene), which_(which), seed_(machine.seed) {}

  Sample sample() override {
    const auto [deterministic, free] = in_turns(
        count_++, [&] { return seconds_of(true); }, [&] { return seconds_of(false); });
    return {deterministic / free};
  }

 private:
  double seconds_of(bool deterministic) {
    FrameRequest r =
        stage_.request(find_integrator(which_.integrator), seed_, which_.width(), which_.height());
    r.interpolation = find_interpolation(which_.interpolation).level;
    r.spp = which_.spp;
    r.a = own_accuracy(scene_);
    r.vpls = DeterministicFrame::kVpls;
    r.deterministic = deterministic;
    return FrameRenderer(r).render(0).seconds_indirect;
  }

  Stage stage_;
  std::string_view scene_;
  DeterministicFrame which_;
  std::uint64_t seed_, count_ = 0;
};

bool is_along_axis(const glm::vec3& n) noexcept {
  constexpr float kAlmost = 0.9999f;  // within 0.8 degrees
  return std::max({std::fabs(n.x), std::fabs(n.y), std::fabs(n.z)}) > kAlmost;
}

// Pictures of a scene's first frame against path tracing at the same hits.
class Judged : public Experiment {
 public:
  Judged(const Machine& machine, std::string_view scene)
      : stage_(machine, scene),
        seed_(machine.seed),
        primary_(centre_hits(stage_.rays(), kJudgedWidth, kJudgedHeight)),
        reference_(make_reference(stage_.rays(), primary_, kReferenceSpp, hash_keys(machine.seed, 1))) {}

 protected:
  struct Picture {
    double seconds;
    std::uint64_t records, records_along_axes;
    Image indirect;
  };

  std::uint64_t next_seed() noexcept { return hash_keys(seed_, 2, count_++); }

  FrameRequest request(const IntegratorEntry& integrator, std::uint64_t seed) {
    return stage_.request(integrator, seed, kJudgedWidth, kJudgedHeight);
  }

  Picture render(const FrameRequest& r) {
    FrameRenderer renderer(r);
    const FrameCost cost = renderer.render(0);
    std::uint64_t along_axes = 0;
    renderer.for_each_record([&](const Record& record) { along_axes += is_along_axis(record.n); });
    return {cost.seconds_indirect, cost.pass.records, along_axes, renderer.indirect()};
  }

  /// Without the reference's own error, which is independent of the picture's; 0 where that is all there is.
  double relmse_of(const Picture& p) const {
    return std::max(0.0, scaled_relmse(reference_.indirect, p.indirect) - reference_.scaled_relmse);
  }

  Stage stage_;
  std::uint64_t seed_, count_ = 0;
  PrimaryHits primary_;
  Reference reference_;
};

// y at x on the line through two points in logarithms.
double between(double x, double x0, double y0, double x1, double y1) {
  const double t = std::log(x / x0) / std::log(x1 / x0);
  return y0 * std::pow(y1 / y0, t);
}

// At so many rays a record that both are judged by where their records lie: with 1,024 rays the noise of the records is
// up to twice the error of interpolation, the same in both, and hides what is asked for. In irradiance, which is what
// is interpolated: radiance would count it by how white the surface is.
class RecordsAtEqualError : public Judged {
 public:
  RecordsAtEqualError(const Machine& machine, std::string_view scene, Hits which)
      : Judged(machine, scene), which_(which), truth_(irradiance(reference_.indirect)) {
    // Of two independent pictures of n and n / 4 samples the mean square of the difference is five times that of the
    // first one's error.
    const Reference other =
        make_reference(stage_.rays(), primary_, kReferenceSpp / 4, hash_keys(machine.seed, 3));
    own_square_ = square_of_difference(irradiance(other.indirect)) / 5.0;
  }

  Sample sample() override {
    const std::uint64_t seed = next_seed();
    const Made split = cached(seed, Interpolation::split_sphere, 0.2f);
    // Accuracies on both sides of the wanted error; the last sample's are tried first.
    std::map<std::size_t, Made> made;
    const auto at = [&](std::size_t i) -> const Made& {
      auto found = made.find(i);
      if (found == made.end())
        found = made.emplace(i, cached(seed, Interpolation::occlusion_hessian, kAccuracies[i])).first;
      return found->second;
    };
    while (fine_ + 1 < kAccuracies.size() && at(fine_).error > split.error) ++fine_;
    while (fine_ > 0 && at(fine_ - 1).error <= split.error) --fine_;
    double records = at(fine_).records;
    // Where the coarsest is good enough, fewer might have been; where the finest is not, more would have been needed.
    if (fine_ > 0 && at(fine_).error <= split.error) {
      const Made &coarse = at(fine_ - 1), &fine = at(fine_);
      records = between(split.error, coarse.error, coarse.records, fine.error, fine.records);
    }
    return {records / split.records};
  }
  bool starts_warm() const override { return true; }

 protected:
  // So close together that between two of them records go with a power of the error.
  static constexpr std::array kAccuracies{1.0f,  0.84f, 0.7f,  0.59f, 0.5f,  0.42f, 0.35f, 0.3f,
                                          0.25f, 0.21f, 0.18f, 0.15f, 0.13f, 0.11f, 0.09f};

  struct Made {
    double records, error;
    Image irradiance;
  };

  Made cached(std::uint64_t seed, Interpolation level, float a) {
    FrameRequest r = request(irradiance_cache(), seed);
    r.gather = 4096;
    r.interpolation = level;
    r.a = a;
    const Picture p = render(r);
    Image E = irradiance(p.indirect);
    const double square = square_of_difference(E) - own_square_;
    const std::uint64_t records = which_ == Hits::all ? p.records : p.records_along_axes;
    return {static_cast<double>(records), std::sqrt(std::max(0.0, square)), std::move(E)};
  }

  const Image& truth() const noexcept { return truth_; }
  double own_square() const noexcept { return own_square_; }

 private:
  // 0 at hits that do not count.
  Image irradiance(const Image& reflected) const {
    Image out = irradiance_of(stage_.rays(), primary_, reflected);
    for (std::size_t i = 0; which_ == Hits::along_axes && i < out.pixels.size(); ++i) {
      if (!is_along_axis(primary_.hits[i].n)) out.pixels[i] = glm::vec3(0.0f);
    }
    return out;
  }
  double square_of_difference(const Image& image) const {
    const double error = first_of(rmse(truth_, image, nullptr));
    return error * error;
  }

  Hits which_;
  Image truth_;
  double own_square_ = 0.0;  // mean square of its own error
  // The coarsest accuracy that was good enough in the last sample.
  std::size_t fine_ = kAccuracies.size() / 2 - 1;
};

// What adding records to those that the occlusion Hessian makes would gain, pixel by pixel.
class RecordsMended : public RecordsAtEqualError {
 public:
  RecordsMended(const Machine& machine, std::string_view scene)
      : RecordsAtEqualError(machine, scene, Hits::all) {}

  // From coarse to fine, until fewer pixels to mend are no longer worth the records that it takes.
  Sample sample() override {
    const std::uint64_t seed = next_seed();
    const Made split = cached(seed, Interpolation::split_sphere, 0.2f);
    double least = std::numeric_limits<double>::infinity();
    for (const float a : kAccuracies) {
      const Made made = cached(seed, Interpolation::occlusion_hessian, a);
      const double records = made.records + static_cast<double>(mended(made.irradiance, split.error));
      if (records > kNoLongerWorth * least) break;
      least = std::min(least, records);
    }
    return {least / split.records};
  }

 private:
  static constexpr double kNoLongerWorth = 1.1;

  // How many pixels, the worst first, have to be as the reference has them for that root-mean-square error.
  std::size_t mended(const Image& irradiance, double wanted) const {
    const std::size_t pixels = irradiance.pixels.size();
    std::vector<double> squares(pixels);
    for (std::size_t i = 0; i < pixels; ++i) {
      const glm::dvec3 difference(irradiance.pixels[i] - truth().pixels[i]);
      squares[i] = glm::dot(difference, difference) / 3.0;
    }
    std::sort(squares.begin(), squares.end(), std::greater<>());
    const double most = wanted * wanted * static_cast<double>(pixels);
    double left = std::accumulate(squares.begin(), squares.end(), 0.0);
    std::size_t count = 0;
    while (count < pixels && left - own_square() * static_cast<double>(pixels - count) > most)
      left -= squares[count++];
    return count;
  }
};

// The first sample tries every setting; later ones only those that were best in it.
class ErrorAtEqualTime : public Judged {
 public:
  ErrorAtEqualTime(const Machine& machine, std::string_view scene, std::uint32_t spp)
      : Judged(machine, scene), spp_(spp) {
    for (const Interpolation level : {Interpolation::gradients, Interpolation::occlusion_hessian}) {
      for (const float a : {0.6f, 0.4f, 0.2f})
        tunings_.push_back({"irradiance_cache", level, a, {64, 256, 1024, 4096}});
    }
    for (const float a : {0.4f, 0.2f})
      tunings_.push_back({"instant_caching", Interpolation::gradients, a, {256, 1024, 4096, 16384}});
  }

  Sample sample() override {
    const std::uint64_t seed = next_seed();
    FrameRequest traced = request(path_indirect(), seed);
    traced.paths = spp_;
    const Picture path = render(traced);
    const double limit = path.seconds, error = relmse_of(path);
    double best = std::numeric_limits<double>::infinity();
    std::vector<Tried> tried;
    for (const Tuning& tuning : tunings_) {
      for (const std::uint32_t count : tuning.counts) {
        FrameRequest r = request(find_integrator(tuning.integrator), seed);
        r.gather = r.vpls = count;
        r.a = tuning.a;
        r.interpolation = tuning.level;
        const Picture p = render(r);
        if (p.seconds <= limit) best = std::min(best, relmse_of(p));
        if (p.seconds <= kNearlyInTime * limit) tried.push_back({&tuning, count, relmse_of(p)});
        // The next has four times the rays or lights.
        if (p.seconds > 2.0 * limit) break;
      }
    }
    if (!std::isfinite(best)) return {0.0, "no cached picture was as fast"};
    keep_the_best_of(std::move(tried));
    return {best / error};
  }

 private:
  struct Tuning {
    std::string_view integrator;
    Interpolation level;
    float a;
    std::vector<std::uint32_t> counts;  // of rays a record, or of virtual lights
  };
  struct Tried {
    const Tuning* tuning;
    std::uint32_t count;
    double error;
  };

  // What may be in time in another sample; and so many that one of them is.
  static constexpr double kNearlyInTime = 1.2;
  static constexpr std::size_t kKept = 6;

  void keep_the_best_of(std::vector<Tried> tried) {
    if (std::exchange(chosen_, true)) return;
    std::sort(tried.begin(), tried.end(), [](const Tried& a, const Tried& b) { return a.error < b.error; });
    tried.resize(std::min(tried.size(), kKept));
    std::vector<Tuning> kept;
    for (const Tried& t : tried) {
      kept.push_back(*t.tuning);
      kept.back().counts = {t.count};
    }
    tunings_ = std::move(kept);
  }

  std::uint32_t spp_;
  std::vector<Tuning> tunings_;
  bool chosen_ = false;
};

class MeanOff : public Judged {
 public:
  MeanOff(const Machine& machine, std::string_view scene, Interpolation level)
      : Judged(machine, scene), scene_(scene), level_(level) {}

  // Over several seeds: what the noise of records adds to one and takes from another is not amiss.
  Sample sample() override {
    constexpr int kPictures = 4;
    double off = 0.0;
    for (int i = 0; i < kPictures; ++i) {
      FrameRequest r = request(irradiance_cache(), next_seed());
      r.gather = 1024;
      r.interpolation = level_;
      r.a = own_accuracy(scene_);
      const Picture p = render(r);
      off += (first_of(mean_ratio(reference_.indirect, p.indirect, nullptr)) - 1.0) / kPictures;
    }
    return {std::fabs(off)};
  }
  bool starts_warm() const override { return true; }

 private:
  std::string_view scene_;
  Interpolation level_;
};

class BlockError : public Judged {
 public:
  explicit BlockError(const Machine& machine) : Judged(machine, "cornell_box") {}

  Sample sample() override {
    FrameRequest r = request(irradiance_cache(), next_seed());
    r.gather = 256;
    r.a = kBlockAccuracy;
    r.light_samples = 64;
    FrameRenderer renderer(r);
    renderer.render(0);
    // The same direct light in both, so that only the cached part is judged, as a share of the whole picture's mean.
    const Image& picture = renderer.picture();
    Image truth = picture;
    for (std::size_t i = 0; i < truth.pixels.size(); ++i)
      truth.pixels[i] += reference_.indirect.pixels[i] - renderer.indirect().pixels[i];
    return {first_of(block_rmse(truth, picture, nullptr))};
  }
  bool starts_warm() const override { return true; }
};

class FurnaceMean : public Experiment {
 public:
  explicit FurnaceMean(const Machine& machine) : stage_(machine, "white_furnace"), seed_(machine.seed) {}

  Sample sample() override {
    constexpr double kTruth = 0.25;  // albedo^2
    FrameRequest r =
        stage_.request(irradiance_cache(), hash_keys(seed_, count_++), kJudgedWidth, kJudgedHeight);
    r.gather = 16384;  // so that a few pictures tell a tenth of a per cent
    FrameRenderer renderer(r);
    renderer.render(0);
    double sum = 0.0;
    for (const glm::vec3& L : renderer.indirect().pixels) sum += L.x + L.y + L.z;
    const double mean = sum / (3.0 * static_cast<double>(renderer.indirect().pixels.size()));
    return {mean / kTruth};
  }
  bool starts_warm() const override { return true; }

 private:
  Stage stage_;
  std::uint64_t seed_, count_ = 0;
};

}  // namespace

std::unique_ptr<Experiment> deterministic_over_free(const Machine& machine, std::string_view scene,
                                                    const DeterministicFrame& which) {
  return std::make_unique<DeterministicOverFree>(machine, scene, which);
}

std::unique_ptr<Experiment> records_at_equal_error(const Machine& machine, std::string_view scene,
                                                   Hits which) {
  return std::make_unique<RecordsAtEqualError>(machine, scene, which);
}

std::unique_ptr<Experiment> records_mended(const Machine& machine, std::string_view scene) {
  return std::make_unique<RecordsMended>(machine, scene);
}

std::unique_ptr<Experiment> error_at_equal_time(const Machine& machine, std::string_view scene,
                                                std::uint32_t spp) {
  return std::make_unique<ErrorAtEqualTime>(machine, scene, spp);
}

std::unique_ptr<Experiment> mean_off(const Machine& machine, std::string_view scene, Interpolation level) {
  return std::make_unique<MeanOff>(machine, scene, level);
}

std::unique_ptr<Experiment> furnace_mean(const Machine& machine) {
  return std::make_unique<FurnaceMean>(machine);
}

std::unique_ptr<Experiment> block_error(const Machine& machine) {
  return std::make_unique<BlockError>(machine);
}

}  // namespace icbench
