#include "image/metrics/fourier.h"

#include <mutex>

namespace icbench {
namespace {

std::mutex& planner() {
  static std::mutex mutex;
  return mutex;
}

fftw_complex* as_fftw(std::complex<double>* p) noexcept { return reinterpret_cast<fftw_complex*>(p); }

}  // namespace

int fast_transform_size(int size) noexcept {
  for (int candidate = size + size % 2;; candidate += 2) {
    int rest = candidate;
    for (const int factor : {2, 3, 5, 7}) {
      while (rest % factor == 0) rest /= factor;
    }
    if (rest == 1) return candidate;
  }
}

Fourier::Fourier(int width, int height) : width_(width), height_(height) {
  RealPlane real(real_size());
  Spectrum spectrum(spectrum_size());
  const std::lock_guard guard(planner());
  forward_ = fftw_plan_dft_r2c_2d(height, width, real.data(), as_fftw(spectrum.data()),
                                  FFTW_ESTIMATE | FFTW_PRESERVE_INPUT);
  inverse_ = fftw_plan_dft_c2r_2d(height, width, as_fftw(spectrum.data()), real.data(), FFTW_ESTIMATE);
  if (!forward_ || !inverse_) {
    fftw_destroy_plan(forward_);
    fftw_destroy_plan(inverse_);
    throw std::bad_alloc();
  }
}

Fourier::~Fourier() {
  const std::lock_guard guard(planner());
  fftw_destroy_plan(forward_);
  fftw_destroy_plan(inverse_);
}

std::size_t Fourier::real_size() const noexcept {
  return static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_);
}

std::size_t Fourier::spectrum_size() const noexcept {
  return static_cast<std::size_t>(spectrum_width()) * static_cast<std::size_t>(height_);
}

void Fourier::forward(const RealPlane& in, Spectrum& out) const noexcept {
  // FFTW takes no const, but the plan preserves its input.
  fftw_execute_dft_r2c(forward_, const_cast<double*>(in.data()), as_fftw(out.data()));
}

void Fourier::inverse(Spectrum& in, RealPlane& out) const noexcept {
  fftw_execute_dft_c2r(inverse_, as_fftw(in.data()), out.data());
  const double scale = 1.0 / static_cast<double>(real_size());
  for (std::size_t i = 0; i < out.size(); ++i) out[i] *= scale;
}

}  // namespace icbench
