#include "image/metrics/hdrvdp.h"

#include <algorithm>
#include <cmath>
#include <glm/glm.hpp>

#include "image/metrics/fourier.h"
#include "image/metrics/hdrvdp_model.h"

namespace icbench {
namespace {

/// Pixels by which an image is continued on each side, at least.
constexpr int kMargin = 32;

/// Adaptation luminances of the contrast sensitivity filters: 10^-3 to 10^2 cd/m^2.
constexpr int kFirstDecade = -3, kDecades = 6;

/// Luminances that differ by less are the same, cd/m^2: the filters spread differences to pixels that have
/// none.
constexpr double kSameLuminance = 1e-4;

/// Pixels of all channels in work at once: bounds the memory, and does not depend on threads.
constexpr std::size_t kPixelsAtOnce = std::size_t{1} << 24;

double luminance(const glm::vec3& rgb) noexcept {
  return 0.2126 * double{rgb.r} + 0.7152 * double{rgb.g} + 0.0722 * double{rgb.b};
}

template <class F>
void for_each_index(std::size_t count, const F& f) {
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, 4096),
                    [&](const tbb::blocked_range<std::size_t>& range) {
                      for (std::size_t i = range.begin(); i != range.end(); ++i) f(i);
                    });
}

template <class T>
struct Pair {
  T a, b;
  explicit Pair(std::size_t size) : a(size), b(size) {}
};

/// An image of one size looked at under one Viewing: the grid and what does not depend on the pixels.
class Observer {
 public:
  Observer(int width, int height, const Viewing& viewing)
      : width_(width),
        height_(height),
        viewing_(viewing),
        per_degree_(pixels_per_degree(viewing)),
        fourier_(fast_transform_size(width + 2 * kMargin), fast_transform_size(height + 2 * kMargin)),
        frequency_(fourier_.spectrum_size()),
        angle_(fourier_.spectrum_size()) {
    for_each_index(frequency_.size(), [&](std::size_t i) {
      frequency_[i] = std::hypot(x_of(i), y_of(i));
      angle_[i] = std::atan2(y_of(i), x_of(i));
    });
  }

  /// Probability exponents (hdrvdp_model.h), a value for each pixel of the image.
  std::vector<double> compare(const std::vector<double>& a, const std::vector<double>& b) const;

 private:
  void extend(const std::vector<double>& in, RealPlane& out) const;
  void see(Pair<RealPlane>& luminances, double pupil) const;
  Pair<Spectrum> respond(const Pair<RealPlane>& luminances, double pupil) const;
  void detect(const Pair<Spectrum>& response, int channel, std::vector<double>& exponents) const;

  std::size_t row_of(std::size_t i) const noexcept {
    return i / static_cast<std::size_t>(fourier_.spectrum_width());
  }
  double x_of(std::size_t i) const noexcept {
    return fourier_.frequency_x(static_cast<int>(i % static_cast<std::size_t>(fourier_.spectrum_width())));
  }
  double y_of(std::size_t i) const noexcept { return fourier_.frequency_y(static_cast<int>(row_of(i))); }
  /// Cycles per degree.
  double frequency_of(std::size_t i) const noexcept {
    return std::hypot(x_of(i) * per_degree_.x, y_of(i) * per_degree_.y);
  }

  int width_, height_;
  Viewing viewing_;
  PixelsPerDegree per_degree_;
  Fourier fourier_;
  std::vector<double> frequency_, angle_;  // of the spectrum's bins, in the pixels' grid: cycles per pixel
};

/// Continues the image by mirroring, half of the excess on each side.
void Observer::extend(const std::vector<double>& in, RealPlane& out) const {
  const auto source = [](int i, int excess, int size) {
    const int period = 2 * size;
    const int place = ((i - excess / 2) % period + period) % period;
    return place < size ? place : period - 1 - place;
  };
  const int out_width = fourier_.width();
  tbb::parallel_for(0, fourier_.height(), [&](int y) {
    const double* const row =
        in.data() + static_cast<std::size_t>(source(y, fourier_.height() - height_, height_)) *
                        static_cast<std::size_t>(width_);
    double* const target = out.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(out_width);
    for (int x = 0; x < out_width; ++x) target[x] = row[source(x, out_width - width_, width_)];
  });
}

/// The optics: luminances of the scene to those of the retina.
void Observer::see(Pair<RealPlane>& luminances, double pupil) const {
  std::vector<double> transfer(fourier_.spectrum_size());
  for_each_index(transfer.size(),
                 [&](std::size_t i) { transfer[i] = optical_transfer(frequency_of(i), pupil); });
  Spectrum spectrum(fourier_.spectrum_size());
  for (RealPlane* plane : {&luminances.a, &luminances.b}) {
    fourier_.forward(*plane, spectrum);
    for (std::size_t i = 0; i < spectrum.size(); ++i) spectrum[i] *= transfer[i];
    fourier_.inverse(spectrum, *plane);
    for (std::size_t i = 0; i < plane->size(); ++i) {
      (*plane)[i] = std::clamp((*plane)[i], kMinLuminance, kMaxLuminance);
    }
  }
}

/// Photoreceptors and contrast sensitivity: spectra of contrast in units of its threshold.
Pair<Spectrum> Observer::respond(const Pair<RealPlane>& luminances, double pupil) const {
  const std::size_t pixels = fourier_.real_size(), bins = fourier_.spectrum_size();
  static const JndScale jnd;
  Pair<RealPlane> plane(pixels), sum(pixels);
  RealPlane adaptation(pixels);  // in decades from kFirstDecade
  for_each_index(pixels, [&](std::size_t i) {
    plane.a[i] = jnd(luminances.a[i]);
    plane.b[i] = jnd(luminances.b[i]);
    sum.a[i] = sum.b[i] = 0.0;
    const double decade = 0.5 * (std::log10(luminances.a[i]) + std::log10(luminances.b[i]));
    adaptation[i] = std::clamp(decade - kFirstDecade, 0.0, double{kDecades - 1});
  });
  const auto [low, high] = std::minmax_element(adaptation.data(), adaptation.data() + pixels);
  const int first = static_cast<int>(std::floor(*low)), last = static_cast<int>(std::ceil(*high));

  Pair<Spectrum> response(bins);
  fourier_.forward(plane.a, response.a);
  fourier_.forward(plane.b, response.b);
  Pair<Spectrum> scaled(bins);
  for (int level = first; level <= last; ++level) {
    const SensitivityConditions at{std::pow(10.0, kFirstDecade + level),
                                   width_ / per_degree_.x * (height_ / per_degree_.y), viewing_.distance};
    const double peak = peak_sensitivity(at);
    for_each_index(bins, [&](std::size_t i) {
      // Without the optics, which the luminances have passed. What nobody sees is left out before it can
      // overflow.
      const double frequency = frequency_of(i);
      const double angle = std::atan2(y_of(i) * per_degree_.y, x_of(i) * per_degree_.x);
      const double sensitivity = contrast_sensitivity(frequency, angle, at) / peak;
      const double neural = sensitivity < 1e-6 ? 0.0 : sensitivity / optical_transfer(frequency, pupil);
      scaled.a[i] = neural * response.a[i];
      scaled.b[i] = neural * response.b[i];
    });
    fourier_.inverse(scaled.a, plane.a);
    fourier_.inverse(scaled.b, plane.b);
    for_each_index(pixels, [&](std::size_t i) {
      const double weight = std::max(0.0, 1.0 - std::abs(adaptation[i] - level));
      sum.a[i] += weight * plane.a[i];
      sum.b[i] += weight * plane.b[i];
    });
  }
  fourier_.forward(sum.a, response.a);
  fourier_.forward(sum.b, response.b);
  return response;
}

/// One channel of the cortex: its contribution to the exponents, a value for each pixel of the image.
void Observer::detect(const Pair<Spectrum>& response, int channel, std::vector<double>& exponents) const {
  const int band = channel / kOrientations;
  const int orientation = channel % kOrientations;
  const bool is_base = band == kBands;
  const std::size_t pixels = fourier_.real_size(), bins = fourier_.spectrum_size();

  Spectrum spectrum(bins);
  std::vector<double> gain(bins);
  const auto filter = [&](const Spectrum& in, RealPlane& out) {
    for (std::size_t i = 0; i < bins; ++i) spectrum[i] = gain[i] * in[i];
    fourier_.inverse(spectrum, out);
  };
  for (std::size_t i = 0; i < bins; ++i) {
    const double pass = is_base ? base_filter(frequency_[i]) : dom(band, frequency_[i]);
    gain[i] = is_base || pass == 0.0 ? pass : pass * fan(orientation, angle_[i]);
  }
  Pair<RealPlane> contrast(pixels), elevation(pixels);
  filter(response.a, contrast.a);
  filter(response.b, contrast.b);

  // Masking does not depend on the mask's phase: its peaks and zeros are smoothed away.
  if (!is_base) {
    for (std::size_t i = 0; i < bins; ++i) gain[i] = mesa(band, frequency_[i]);
  }
  const auto elevate = [&](const RealPlane& mask, RealPlane& out) {
    for (std::size_t i = 0; i < pixels; ++i) out[i] = threshold_elevation(std::abs(mask[i]));
    if (band == 0) return;  // which lets everything through
    fourier_.forward(out, spectrum);
    filter(spectrum, out);
  };
  elevate(contrast.a, elevation.a);
  elevate(contrast.b, elevation.b);

  const auto left = static_cast<std::size_t>((fourier_.width() - width_) / 2);
  const auto top = static_cast<std::size_t>((fourier_.height() - height_) / 2);
  const auto stride = static_cast<std::size_t>(fourier_.width());
  const auto width = static_cast<std::size_t>(width_);
  for (std::size_t i = 0; i < exponents.size(); ++i) {
    const std::size_t place = (top + i / width) * stride + left + i % width;
    const double threshold = std::max(1.0, std::min(elevation.a[place], elevation.b[place]));
    exponents[i] = detection_exponent(std::abs(contrast.a[place] - contrast.b[place]) / threshold);
  }
}

std::vector<double> Observer::compare(const std::vector<double>& a, const std::vector<double>& b) const {
  const double mean = parallel_sum(a.size(), [&](std::size_t i) { return 0.5 * (a[i] + b[i]); }) /
                      static_cast<double>(a.size());
  const double pupil = pupil_diameter(std::max(mean, kMinLuminance));
  Pair<RealPlane> luminances(fourier_.real_size());
  extend(a, luminances.a);
  extend(b, luminances.b);
  see(luminances, pupil);
  const Pair<Spectrum> response = respond(luminances, pupil);

  constexpr int kChannels = kBands * kOrientations + 1;
  const int at_once =
      static_cast<int>(std::clamp<std::size_t>(kPixelsAtOnce / fourier_.real_size(), 1, kChannels));
  std::vector<std::vector<double>> parts(static_cast<std::size_t>(at_once), std::vector<double>(a.size()));
  std::vector<double> exponents(a.size(), 0.0);
  for (int first = 0; first < kChannels; first += at_once) {
    const int count = std::min(at_once, kChannels - first);
    tbb::parallel_for(0, count,
                      [&](int c) { detect(response, first + c, parts[static_cast<std::size_t>(c)]); });
    for_each_index(exponents.size(), [&](std::size_t i) {
      for (int c = 0; c < count; ++c) exponents[i] += parts[static_cast<std::size_t>(c)][i];
    });
  }
  return exponents;
}

}  // namespace

std::vector<MetricValue> hdrvdp(const Image& reference, const Image& image, Image* map,
                                const Viewing& viewing) {
  check_viewing(viewing);
  check_comparable(reference, image);
  const std::size_t pixels = reference.pixels.size();
  const auto luminances_of = [&](const Image& of) {
    std::vector<double> out(pixels);
    for_each_index(pixels, [&](std::size_t i) {
      out[i] = std::clamp(viewing.luminance_scale * luminance(of.pixels[i]), 0.0, kMaxLuminance);
    });
    return out;
  };
  const std::vector<double> a = luminances_of(reference), b = luminances_of(image);
  const Observer observer(reference.width, reference.height, viewing);
  std::vector<double> probability = observer.compare(a, b);
  for_each_index(pixels, [&](std::size_t i) {
    probability[i] = std::abs(a[i] - b[i]) <= kSameLuminance ? 0.0 : -std::expm1(-probability[i]);
  });
  if (map) {
    *map = make_image(reference.width, reference.height);
    for (std::size_t i = 0; i < pixels; ++i) map->pixels[i] = glm::vec3(static_cast<float>(probability[i]));
  }
  const auto percent_above = [&](double level) {
    const auto above =
        std::count_if(probability.begin(), probability.end(), [&](double p) { return p > level; });
    return 100.0 * static_cast<double>(above) / static_cast<double>(pixels);
  };
  return {{"p75", percent_above(0.75)}, {"p95", percent_above(0.95)}};
}

Image paint_hdrvdp(const Image& map, const Image& reference) {
  const std::size_t pixels = reference.pixels.size();
  // The geometric mean of what is lit becomes a quarter of white, with a soft shoulder above.
  const auto is_lit = [&](std::size_t i) { return luminance(reference.pixels[i]) > 0.0; };
  const double lit = parallel_sum(pixels, [&](std::size_t i) { return is_lit(i) ? 1.0 : 0.0; });
  const double logs = parallel_sum(
      pixels, [&](std::size_t i) { return is_lit(i) ? std::log(luminance(reference.pixels[i])) : 0.0; });
  const double key = lit > 0.0 ? std::exp(logs / lit) : 1.0;
  Image out = make_image(map.width, map.height);
  for_each_index(pixels, [&](std::size_t i) {
    const double light = std::max(luminance(reference.pixels[i]), 0.0);
    const auto grey = static_cast<float>(light / (light + 3.0 * key));
    // Colours keep some light where the image is dark, so that they can be told from grey.
    const float shade = 0.15f + 0.85f * grey;
    const float p = map.pixels[i].x;
    const float coloured = std::clamp((p - 0.5f) / 0.25f, 0.0f, 1.0f);
    const float red = std::clamp((p - 0.75f) / 0.2f, 0.0f, 1.0f);
    out.pixels[i] = glm::mix(glm::vec3(grey), shade * glm::vec3(red, 1.0f - red, 0.0f), coloured);
  });
  return out;
}

}  // namespace icbench
