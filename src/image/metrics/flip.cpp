#include "image/metrics/flip.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/glm.hpp>
#include <numbers>

#include "image/metrics/colours.h"

namespace icbench {
namespace {

// Fit of the ACES tone curve, (k0 x^2 + k1 x + k2) / (k3 x^2 + k4 x + k5), with the exposure of 0.6 that it
// presumes inside.
constexpr double kPreExposure = 0.6;
constexpr double kAces0 = 2.51 * kPreExposure * kPreExposure, kAces1 = 0.03 * kPreExposure, kAces2 = 0.0;
constexpr double kAces3 = 2.43 * kPreExposure * kPreExposure, kAces4 = 0.59 * kPreExposure, kAces5 = 0.14;

/// The tone-mapped value that the exposures bring maximum and median to.
constexpr double kExposureTarget = 0.85;

double tone_mapped(double x) noexcept {
  x = std::clamp(x, 0.0, 1e6);  // from there on the curve is flat; keeps the squares finite
  return std::min((kAces0 * x * x + kAces1 * x + kAces2) / (kAces3 * x * x + kAces4 * x + kAces5), 1.0);
}

/// The x whose tone-mapped value is kExposureTarget.
double exposure_root() noexcept {
  const double a = kAces0 - kExposureTarget * kAces3;
  const double b = kAces1 - kExposureTarget * kAces4;
  const double c = kAces2 - kExposureTarget * kAces5;
  return (-b + std::sqrt(b * b - 4.0 * a * c)) / (2.0 * a);
}

// sRGB primaries (IEC 61966-2-1), exact in the chromaticities; the white is their sum.
constexpr std::array<std::array<double, 3>, 3> kXyzFromRgb = {
    {{10135552.0 / 24577794.0, 8788810.0 / 24577794.0, 4435075.0 / 24577794.0},
     {2613072.0 / 12288897.0, 8788810.0 / 12288897.0, 887015.0 / 12288897.0},
     {1425312.0 / 73733382.0, 8788810.0 / 73733382.0, 70074185.0 / 73733382.0}}};

/// XYZ relative to white, so that white is (1, 1, 1).
const glm::mat3& relative_xyz_from_rgb() {
  static const glm::mat3 matrix = [] {
    glm::mat3 m;
    for (int row = 0; row < 3; ++row) {
      const auto& r = kXyzFromRgb[static_cast<std::size_t>(row)];
      for (int column = 0; column < 3; ++column) {
        m[column][row] = static_cast<float>(r[static_cast<std::size_t>(column)] / (r[0] + r[1] + r[2]));
      }
    }
    return m;
  }();
  return matrix;
}

/// The opponent space in which the eye's contrast sensitivity is applied: CIELab without its root.
glm::vec3 ycxcz_from_rgb(const glm::vec3& rgb) {
  const glm::vec3 xyz = relative_xyz_from_rgb() * rgb;
  return {116.0f * xyz.y - 16.0f, 500.0f * (xyz.x - xyz.y), 200.0f * (xyz.y - xyz.z)};
}

glm::vec3 rgb_from_ycxcz(const glm::vec3& colour) {
  static const glm::mat3 rgb_from_xyz = glm::inverse(relative_xyz_from_rgb());
  const float y = (colour.x + 16.0f) / 116.0f;
  return rgb_from_xyz * glm::vec3(y + colour.y / 500.0f, y, y - colour.z / 200.0f);
}

/// CIELab with a and b scaled by lightness, after Hunt: dark colours look less colourful.
glm::vec3 hunt_lab_from_rgb(const glm::vec3& rgb) {
  const glm::vec3 xyz = relative_xyz_from_rgb() * rgb;
  constexpr float kDelta = 6.0f / 29.0f;
  const auto f = [](float t) {
    return t > kDelta * kDelta * kDelta ? std::cbrt(t) : t / (3.0f * kDelta * kDelta) + 4.0f / 29.0f;
  };
  const float fx = f(xyz.x), fy = f(xyz.y), fz = f(xyz.z);
  const float lightness = 116.0f * fy - 16.0f;
  return {lightness, 0.01f * lightness * 500.0f * (fx - fy), 0.01f * lightness * 200.0f * (fy - fz)};
}

constexpr float kColourExponent = 0.7f;
constexpr float kFeatureExponent = 0.5f;

/// Distance of two colours: city-block between lightness and chroma, Euclidean within chroma (HyAB).
float colour_distance(const glm::vec3& a, const glm::vec3& b) {
  const glm::vec3 d = a - b;
  return std::pow(std::abs(d.x) + std::sqrt(d.y * d.y + d.z * d.z), kColourExponent);
}

/// Maps [0, largest] to [0, 1]: the lower 40 % of the range get 95 % of it, since larger distances all look
/// large.
float redistributed(float distance) {
  static const float largest =
      colour_distance(hunt_lab_from_rgb({0.0f, 1.0f, 0.0f}), hunt_lab_from_rgb({0.0f, 0.0f, 1.0f}));
  constexpr float kKnee = 0.4f, kKneeValue = 0.95f;
  const float knee = kKnee * largest;
  return distance < knee ? kKneeValue * distance / knee
                         : kKneeValue + (1.0f - kKneeValue) * (distance - knee) / (largest - knee);
}

/// Taps of a filter along one axis, middle in the middle.
using Kernel = std::vector<float>;

template <class F>
std::vector<double> sampled(int radius, const F& f) {
  std::vector<double> taps;
  for (int i = -radius; i <= radius; ++i) taps.push_back(f(static_cast<double>(i)));
  return taps;
}

/// Scales the positive taps to the sum 1 and the negative ones to -1.
Kernel normalised(const std::vector<double>& taps) {
  double positive = 0.0, negative = 0.0;
  for (const double tap : taps) (tap > 0.0 ? positive : negative) += tap;
  Kernel kernel;
  for (const double tap : taps) {
    kernel.push_back(static_cast<float>(tap > 0.0 ? tap / positive : tap < 0.0 ? -tap / negative : 0.0));
  }
  return kernel;
}

/// The filters of one viewing distance, all separable.
struct Kernels {
  Kernel achromatic, red_green;       // contrast sensitivity: one Gaussian each
  std::array<Kernel, 2> blue_yellow;  // two Gaussians of different width, of weights
  std::array<float, 2> blue_yellow_weight;
  Kernel blur, edge, point;  // feature detectors: Gaussian, its first and its second derivative
};

Kernels make_kernels(double pixels_per_degree) {
  // Width and weight of the Gaussians a sqrt(pi / b) exp(-pi^2 x^2 / b), x in degrees (2020, table 1).
  constexpr double kAchromatic = 0.0047, kRedGreen = 0.0053;
  constexpr std::array<double, 2> kBlueYellow = {0.04, 0.025}, kBlueYellowWeight = {34.1, 13.5};
  constexpr double pi = std::numbers::pi;
  const int radius =
      static_cast<int>(std::ceil(3.0 * std::sqrt(kBlueYellow[0] / (2.0 * pi * pi)) * pixels_per_degree));
  const auto gaussian = [&](double b) {
    return sampled(radius, [&](double i) {
      const double x = i / pixels_per_degree;
      return std::exp(-pi * pi * x * x / b);
    });
  };
  Kernels kernels;
  kernels.achromatic = normalised(gaussian(kAchromatic));
  kernels.red_green = normalised(gaussian(kRedGreen));
  std::array<double, 2> weight{};
  for (std::size_t i = 0; i < 2; ++i) {
    const std::vector<double> taps = gaussian(kBlueYellow[i]);
    double sum = 0.0;
    for (const double tap : taps) sum += tap;
    weight[i] = kBlueYellowWeight[i] * std::sqrt(pi / kBlueYellow[i]) * sum * sum;  // over both axes
    kernels.blue_yellow[i] = normalised(taps);
  }
  for (std::size_t i = 0; i < 2; ++i) {
    kernels.blue_yellow_weight[i] = static_cast<float>(weight[i] / (weight[0] + weight[1]));
  }

  constexpr double kFeatureWidth = 0.082;  // degrees
  const double sigma = 0.5 * kFeatureWidth * pixels_per_degree;
  const int feature_radius = static_cast<int>(std::ceil(3.0 * sigma));
  const auto g = [&](double x) { return std::exp(-x * x / (2.0 * sigma * sigma)); };
  kernels.blur = normalised(sampled(feature_radius, g));
  kernels.edge = normalised(sampled(feature_radius, [&](double x) { return -x * g(x); }));
  kernels.point =
      normalised(sampled(feature_radius, [&](double x) { return (x * x / (sigma * sigma) - 1.0) * g(x); }));
  return kernels;
}

/// A channel of an image.
struct Plane {
  int width = 0, height = 0;
  std::vector<float> values;

  Plane(int w, int h)
      : width(w), height(h), values(static_cast<std::size_t>(w) * static_cast<std::size_t>(h)) {}
  float* row(int y) { return values.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(width); }
  const float* row(int y) const { return const_cast<Plane*>(this)->row(y); }
};

/// Correlates along rows; the edge pixels go on outside.
Plane along_rows(const Plane& in, const Kernel& kernel) {
  Plane out(in.width, in.height);
  const int radius = static_cast<int>(kernel.size() / 2);
  tbb::parallel_for(tbb::blocked_range<int>(0, in.height, 8), [&](const tbb::blocked_range<int>& range) {
    std::vector<float> extended(static_cast<std::size_t>(in.width + 2 * radius));
    for (int y = range.begin(); y != range.end(); ++y) {
      const float* const source = in.row(y);
      for (int x = -radius; x < in.width + radius; ++x) {
        extended[static_cast<std::size_t>(x + radius)] = source[std::clamp(x, 0, in.width - 1)];
      }
      float* const target = out.row(y);
      for (std::size_t k = 0; k < kernel.size(); ++k) {
        const float weight = kernel[k];
        const float* const shifted = extended.data() + k;
        for (int x = 0; x < in.width; ++x) target[x] += weight * shifted[x];
      }
    }
  });
  return out;
}

/// Adds the correlation along columns, `scale` times, to `out`.
void along_columns(const Plane& in, const Kernel& kernel, float scale, Plane& out) {
  const int radius = static_cast<int>(kernel.size() / 2);
  tbb::parallel_for(tbb::blocked_range<int>(0, in.height, 8), [&](const tbb::blocked_range<int>& range) {
    for (int y = range.begin(); y != range.end(); ++y) {
      float* const target = out.row(y);
      for (int k = -radius; k <= radius; ++k) {
        const float weight = scale * kernel[static_cast<std::size_t>(k + radius)];
        const float* const source = in.row(std::clamp(y + k, 0, in.height - 1));
        for (int x = 0; x < in.width; ++x) target[x] += weight * source[x];
      }
    }
  });
}

Plane filtered(const Plane& in, const Kernel& rows, const Kernel& columns) {
  Plane out(in.width, in.height);
  along_columns(along_rows(in, rows), columns, 1.0f, out);
  return out;
}

/// What one image contributes to the comparison.
struct Percept {
  std::vector<glm::vec3> colour;   // Hunt-adjusted Lab of what the eye resolves
  std::vector<float> edge, point;  // magnitudes
};

std::vector<float> magnitudes(const Plane& x, const Plane& y) {
  std::vector<float> out(x.values.size());
  for (std::size_t i = 0; i < out.size(); ++i) {
    out[i] = std::sqrt(x.values[i] * x.values[i] + y.values[i] * y.values[i]);  // at most 1: no overflow
  }
  return out;
}

template <class Pixel>
Percept perceive(const Image& image, const Kernels& kernels, const Pixel& pixel) {
  Plane y(image.width, image.height), cx = y, cz = y, luminance = y;
  const std::size_t count = image.pixels.size();
  tbb::parallel_for(std::size_t{0}, count, [&](std::size_t i) {
    const glm::vec3 colour = ycxcz_from_rgb(glm::clamp(pixel(image.pixels[i]), 0.0f, 1.0f));
    y.values[i] = colour.x;
    cx.values[i] = colour.y;
    cz.values[i] = colour.z;
    luminance.values[i] = (colour.x + 16.0f) / 116.0f;
  });

  Percept percept;
  percept.edge = magnitudes(filtered(luminance, kernels.edge, kernels.blur),
                            filtered(luminance, kernels.blur, kernels.edge));
  percept.point = magnitudes(filtered(luminance, kernels.point, kernels.blur),
                             filtered(luminance, kernels.blur, kernels.point));

  y = filtered(y, kernels.achromatic, kernels.achromatic);
  cx = filtered(cx, kernels.red_green, kernels.red_green);
  Plane sum(image.width, image.height);
  for (std::size_t i = 0; i < 2; ++i) {
    along_columns(along_rows(cz, kernels.blue_yellow[i]), kernels.blue_yellow[i],
                  kernels.blue_yellow_weight[i], sum);
  }
  percept.colour.resize(count);
  tbb::parallel_for(std::size_t{0}, count, [&](std::size_t i) {
    const glm::vec3 rgb = rgb_from_ycxcz({y.values[i], cx.values[i], sum.values[i]});
    percept.colour[i] = hunt_lab_from_rgb(glm::clamp(rgb, 0.0f, 1.0f));
  });
  return percept;
}

/// Raises `errors` to the LDR-FLIP of the images whose pixels are taken through `pixel`.
template <class Pixel>
void accumulate(const Image& reference, const Image& image, const Kernels& kernels, const Pixel& pixel,
                std::vector<float>& errors) {
  const Percept a = perceive(reference, kernels, pixel);
  const Percept b = perceive(image, kernels, pixel);
  tbb::parallel_for(std::size_t{0}, errors.size(), [&](std::size_t i) {
    const float colour = redistributed(colour_distance(a.colour[i], b.colour[i]));
    const float change = std::max(std::abs(a.edge[i] - b.edge[i]), std::abs(a.point[i] - b.point[i]));
    const float feature =
        std::min(std::pow(change * static_cast<float>(std::numbers::sqrt2 / 2.0), kFeatureExponent), 1.0f);
    errors[i] = std::max(errors[i], std::min(std::pow(colour, 1.0f - feature), 1.0f));
  });
}

double luminance(const glm::vec3& rgb) {
  const auto& weights = kXyzFromRgb[1];
  double sum = 0.0;
  for (int c = 0; c < 3; ++c) sum += weights[static_cast<std::size_t>(c)] * std::max(double{rgb[c]}, 0.0);
  return sum;
}

}  // namespace

FlipExposures flip_exposures(const Image& reference) {
  std::vector<double> values;
  values.reserve(reference.pixels.size());
  for (const glm::vec3& pixel : reference.pixels) values.push_back(luminance(pixel));
  const auto median = [](std::vector<double>& v) {
    const auto middle = v.begin() + static_cast<std::ptrdiff_t>((v.size() - 1) / 2);
    std::nth_element(v.begin(), middle, v.end());
    return *middle;
  };
  const double largest = *std::max_element(values.begin(), values.end());
  if (largest == 0.0) return {0.0, 0.0, 1};
  double middle = median(values);
  if (middle == 0.0) {
    std::erase(values, 0.0);
    middle = median(values);
  }
  const double root = exposure_root();
  const double start = std::log2(root / largest);
  const double stop = std::log2(root / middle);
  if (start == stop) return {start, stop, 1};
  return {start, stop, std::max(2, static_cast<int>(std::ceil(stop - start)))};
}

std::vector<float> ldr_flip(const Image& reference, const Image& image, double pixels_per_degree) {
  std::vector<float> errors(reference.pixels.size(), 0.0f);
  accumulate(
      reference, image, make_kernels(pixels_per_degree), [](const glm::vec3& p) { return p; }, errors);
  return errors;
}

std::vector<MetricValue> flip(const Image& reference, const Image& image, Image* map,
                              const Viewing& viewing) {
  check_viewing(viewing);
  check_comparable(reference, image);
  const Kernels kernels = make_kernels(viewing.flip_pixels_per_degree);
  const FlipExposures exposures = flip_exposures(reference);
  std::vector<float> errors(reference.pixels.size(), 0.0f);
  for (int e = 0; e < exposures.count; ++e) {
    const double factor = std::exp2(exposures.at(e));
    const auto expose = [&](const glm::vec3& p) {
      glm::vec3 out;
      for (int c = 0; c < 3; ++c) out[c] = static_cast<float>(tone_mapped(factor * double{p[c]}));
      return out;
    };
    accumulate(reference, image, kernels, expose, errors);
  }
  if (map) {
    *map = make_image(reference.width, reference.height);
    for (std::size_t i = 0; i < errors.size(); ++i) map->pixels[i] = glm::vec3(errors[i]);
  }
  const double sum = parallel_sum(errors.size(), [&](std::size_t i) { return double{errors[i]}; });
  return {{"", sum / static_cast<double>(errors.size())}};
}

Image paint_flip(const Image& map, const Image&) {
  Image out = make_image(map.width, map.height);
  for (std::size_t i = 0; i < out.pixels.size(); ++i) out.pixels[i] = magma(map.pixels[i].x);
  return out;
}

}  // namespace icbench
