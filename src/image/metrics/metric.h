// What all image metrics share: their signature, the check of their input, and sums that do not depend on
// threads.
#pragma once

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <cstddef>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <vector>

#include "image/image.h"
#include "image/metrics/viewing.h"

namespace icbench {

/// One figure of a metric. A metric with a single figure leaves the name empty.
struct MetricValue {
  std::string_view name;
  std::optional<double> value;  ///< none where the reference has no light that it could be a share of
};

/// The first figure. Throws std::runtime_error with one line if there is none.
inline double first_of(const std::vector<MetricValue>& values) {
  if (const auto& value = values.at(0).value) return *value;
  throw std::runtime_error("the mean of the reference is not positive, so there is no share of it");
}

/// Compares `image` to `reference`. If `map` is given it becomes an image of the error, which every metric
/// describes. Throws std::runtime_error with one line if the images cannot be compared.
using MetricFunction = std::vector<MetricValue> (*)(const Image& reference, const Image& image, Image* map);

/// The figure of a metric that has a single one.
inline double figure_of(MetricFunction metric, const Image& reference, const Image& image) {
  return first_of(metric(reference, image, nullptr));
}

/// The same for a metric that models an observer, who looks at the images as `viewing` says.
using ViewedMetricFunction = std::vector<MetricValue> (*)(const Image& reference, const Image& image,
                                                          Image* map, const Viewing& viewing);

/// A metric without an observer as one with.
template <MetricFunction kMetric>
std::vector<MetricValue> unviewed(const Image& reference, const Image& image, Image* map, const Viewing&) {
  return kMetric(reference, image, map);
}

/// A map in colours for looking at, linear RGB in [0, 1].
using PaintFunction = Image (*)(const Image& map, const Image& reference);

struct Metric {
  std::string_view name;
  ViewedMetricFunction compute;
  int bytes;                ///< that the images and the work on them take at least, a pixel
  bool has_map;             ///< whether `map` is filled
  PaintFunction paint;      ///< or nullptr: the map has no colours of its own
  std::string_view closer;  ///< what a value says, and which value says "equal"
  std::string_view source;  ///< publication, or "this project"
};

/// Throws unless the images are of one valid size, of one place in the whole picture, and finite.
inline void check_comparable(const Image& reference, const Image& image) {
  for (const Image* each : {&reference, &image}) {
    const char* which = each == &reference ? "the reference" : "the image";
    if (const std::string error = size_error(*each); !error.empty()) {
      throw std::runtime_error(fmt::format("cannot compare: {}: {}", which, error));
    }
    if (const std::string error = value_error(*each, true); !error.empty()) {
      throw std::runtime_error(fmt::format("cannot compare: {}: {}", which, error));
    }
  }
  if (reference.width != image.width || reference.height != image.height) {
    throw std::runtime_error(fmt::format("cannot compare images of {} x {} and {} x {} pixels",
                                         reference.width, reference.height, image.width, image.height));
  }
  if (reference.left != image.left || reference.top != image.top) {
    throw std::runtime_error(
        fmt::format("cannot compare parts of pictures that begin at pixel ({}, {}) and at ({}, {})",
                    reference.left, reference.top, image.left, image.top));
  }
}

/// Sum of f(i) for 0 <= i < count, in double, in parallel. The tree of partial sums depends on `count` alone,
/// so the result does not depend on the number of threads; the relative error for terms of one sign is below
/// 1e-13 (pairwise above 512 terms).
template <class F>
double parallel_sum(std::size_t count, const F& f) {
  constexpr std::size_t kGrain = 512;
  return tbb::parallel_deterministic_reduce(
      tbb::blocked_range<std::size_t>(0, count, kGrain), 0.0,
      [&](const tbb::blocked_range<std::size_t>& range, double sum) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) sum += f(i);
        return sum;
      },
      [](double a, double b) { return a + b; });
}

/// Mean of f(a, b) over all channels of all pixel pairs.
template <class F>
double channel_mean(const Image& reference, const Image& image, const F& f) {
  const std::size_t count = reference.pixels.size();
  const double sum = parallel_sum(count, [&](std::size_t i) {
    const glm::vec3& a = reference.pixels[i];
    const glm::vec3& b = image.pixels[i];
    return f(double{a.x}, double{b.x}) + f(double{a.y}, double{b.y}) + f(double{a.z}, double{b.z});
  });
  return sum / (3.0 * static_cast<double>(count));
}

/// Mean of all channels of all pixels.
inline double channel_mean(const Image& image) {
  return channel_mean(image, image, [](double a, double) { return a; });
}

/// A double >= 0 as a float, the largest finite one at most, so that maps can be written.
inline float map_value(double value) noexcept {
  return static_cast<float>(std::min(value, double{std::numeric_limits<float>::max()}));
}

/// Fills `map` with f(a, b) >= 0 of every channel, if there is a map.
template <class F>
void fill_map(const Image& reference, const Image& image, Image* map, const F& f) {
  if (!map) return;
  *map = make_image(reference.width, reference.height);
  tbb::parallel_for(std::size_t{0}, map->pixels.size(), [&](std::size_t i) {
    for (int c = 0; c < 3; ++c) {
      map->pixels[i][c] = map_value(f(double{reference.pixels[i][c]}, double{image.pixels[i][c]}));
    }
  });
}

}  // namespace icbench
