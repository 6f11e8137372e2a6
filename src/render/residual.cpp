#include "render/residual.h"

#include <algorithm>
#include <cmath>

#include "render/irradiance_cache.h"

namespace icbench {
namespace {

constexpr std::uint32_t kChances = 1u << 24;  // as many as floats hold exactly

double mean_of(const glm::vec3& v) { return (double{v.x} + v.y + v.z) / 3.0; }

}  // namespace

void ResidualEstimator::Sums::add(double d0, double d1, double q) noexcept {
  const double Y = (d0 + d1) / (2.0 * q);
  y += Y;
  variance += Y * Y - d0 * d1 / q;
  ++drawn;
}

MeanWithError ResidualEstimator::Sums::over(double n) const noexcept {
  return {y / n, std::sqrt(std::max(0.0, variance)) / n};  // below 0 by rounding alone
}

ResidualEstimator::ResidualEstimator(int width, int height, float share, unsigned threads, bool keeps_layer)
    : width_(width),
      height_(height),
      edge_((std::max(width, height) + kBlocks - 1) / kBlocks),
      columns_((width + edge_ - 1) / edge_),
      chance_(std::clamp(static_cast<std::uint32_t>(std::lround(share * kChances)), 1u, kChances)),
      q_(static_cast<double>(chance_) / kChances),
      keeps_layer_(keeps_layer),
      workers_(threads),
      blocks_(static_cast<std::size_t>(columns_) * static_cast<std::size_t>((height + edge_ - 1) / edge_)) {}

std::uint64_t ResidualEstimator::bytes(std::uint64_t pixels, std::uint32_t spp, float share,
                                       bool keeps_layer) noexcept {
  const double in_layer = keeps_layer ? 1.0 - std::pow(1.0 - share, spp) : 0.0;  // drawn once or more
  // Each list is there twice while it is put in order.
  return static_cast<std::uint64_t>(2.0 * static_cast<double>(pixels) *
                                    (share * sizeof(Drawn) + in_layer * sizeof(LayerPixel)));
}

void ResidualEstimator::tile(unsigned thread, Tracer& tracer, Light light_of_pass, const PrimaryHits& primary,
                             const SampleKey& key, const Tile& tile, const Image& made) noexcept {
  const Light light = light_of_pass == Light::all ? Light::all : Light::indirect;
  std::vector<Drawn>& drawn = workers_[thread].drawn;
  bool is_drawn = false;
  for_each_visible(tile, primary, [&](const Visible& x) {
    if (x.layer == 0) {
      Pcg32 random(x.key(key, Purpose::residual_draw));
      is_drawn = random.below(kChances) < chance_;
    }
    if (!is_drawn || !reflects(tracer.shared(), x.hit)) return;
    if (drawn.empty() || drawn.back().pixel != x.pixel) {
      Drawn& begun = drawn.emplace_back();
      begun.pixel = x.pixel;
      begun.d.fill(-made.pixels[x.pixel]);
    }
    Pcg32 random(x.key(key, Purpose::residual));
    for (glm::vec3& d : drawn.back().d) {
      d += x.weight *
           reflected_radiance(tracer.shared(), x.hit, sample_irradiance(tracer, x.hit, light, random));
    }
  });
}

void ResidualEstimator::end_sample(const Image& made) {
  // Sums of floating-point numbers depend on their order, and which thread had which tile is chance.
  std::vector<Drawn> drawn;
  for (Worker& w : workers_) {
    drawn.insert(drawn.end(), w.drawn.begin(), w.drawn.end());
    w.drawn.clear();
  }
  std::sort(drawn.begin(), drawn.end(), [](const Drawn& a, const Drawn& b) { return a.pixel < b.pixel; });
  for (const Drawn& one : drawn) add(one);
  for (const glm::vec3& L : made.pixels) cached_ += L;
  drawn_ += drawn.size();
  ++samples_;
  if (keeps_layer_) add_to_layer(drawn);
}

void ResidualEstimator::add(const Drawn& drawn) noexcept {
  const auto& [d0, d1] = drawn.d;
  double square = 0.0;
  for (int c = 0; c < 3; ++c) {
    rgb_[static_cast<std::size_t>(c)].add(d0[c], d1[c], q_);
    square += double{d0[c]} * d1[c] / (3.0 * q_);
  }
  square_ += square;
  square_squared_ += square * square;
  all_.add(mean_of(d0), mean_of(d1), q_);
  const auto width = static_cast<std::uint32_t>(width_), edge = static_cast<std::uint32_t>(edge_);
  const std::uint32_t column = drawn.pixel % width / edge, row = drawn.pixel / width / edge;
  blocks_[row * static_cast<std::uint32_t>(columns_) + column].add(mean_of(d0), mean_of(d1), q_);
}

void ResidualEstimator::add_to_layer(const std::vector<Drawn>& drawn) {
  std::vector<LayerPixel> sum;
  sum.reserve(layer_.size() + drawn.size());
  auto old = layer_.begin();
  const auto weight = static_cast<float>(0.5 / q_);
  for (const Drawn& one : drawn) {
    while (old != layer_.end() && old->pixel < one.pixel) sum.push_back(*old++);
    sum.push_back({one.pixel, weight * (one.d[0] + one.d[1])});
    if (old != layer_.end() && old->pixel == one.pixel) sum.back().sum += (old++)->sum;
  }
  sum.insert(sum.end(), old, layer_.end());
  sum.shrink_to_fit();
  layer_ = std::move(sum);
}

ResidualFigures ResidualEstimator::figures() const {
  ResidualFigures out;
  const double n = static_cast<double>(samples_) * width_ * height_;
  out.samples = kPaths * drawn_;
  for (std::size_t c = 0; c < 3; ++c) {
    out.cached_rgb[c] = cached_[static_cast<int>(c)] / n;
    out.rgb[c] = rgb_[c].over(n);
  }
  out.cached = (out.cached_rgb[0] + out.cached_rgb[1] + out.cached_rgb[2]) / 3.0;
  out.all = all_.over(n);
  out.square = {square_ / n, std::sqrt(square_squared_) / n};
  out.edge = edge_;
  out.columns = columns_;
  out.rows = static_cast<int>(blocks_.size()) / columns_;
  for (int row = 0; row < out.rows; ++row)
    for (int column = 0; column < columns_; ++column) {
      const int wide = std::min(edge_, width_ - column * edge_),
                high = std::min(edge_, height_ - row * edge_);
      const Sums& block = blocks_[out.blocks.size()];
      out.blocks.push_back(block.over(static_cast<double>(samples_) * wide * high));
      out.block_samples.push_back(kPaths * block.drawn);
    }
  return out;
}

void ResidualEstimator::add_to(Image& picture) const {
  const float share = 1.0f / static_cast<float>(samples_);
  for (const LayerPixel& p : layer_) picture.pixels[p.pixel] += share * p.sum;
}

}  // namespace icbench
