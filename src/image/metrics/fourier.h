// Two-dimensional Fourier transforms of real arrays of any size, on FFTW.
//
// Transforms of one size share two plans, which any number of threads may use at once; FFTW's planner itself
// is not safe for threads and is guarded here. Plans are estimated, never measured: results depend on the
// input alone.
#pragma once

#include <fftw3.h>

#include <complex>
#include <cstddef>
#include <memory>
#include <new>

namespace icbench {

/// An array with the alignment that the plans expect, uninitialised.
template <class T>
class AlignedArray {
 public:
  explicit AlignedArray(std::size_t size)
      : data_(static_cast<T*>(fftw_malloc(size * sizeof(T)))), size_(size) {
    if (!data_) throw std::bad_alloc();
  }
  T* data() noexcept { return data_.get(); }
  const T* data() const noexcept { return data_.get(); }
  std::size_t size() const noexcept { return size_; }
  T& operator[](std::size_t i) noexcept { return data_.get()[i]; }
  const T& operator[](std::size_t i) const noexcept { return data_.get()[i]; }

 private:
  struct Free {
    void operator()(T* p) const noexcept { fftw_free(p); }
  };
  std::unique_ptr<T, Free> data_;
  std::size_t size_;
};

using RealPlane = AlignedArray<double>;
using Spectrum = AlignedArray<std::complex<double>>;

/// Smallest even number >= `size` without prime factors above 7: a size that is transformed fast.
int fast_transform_size(int size) noexcept;

/// The transforms of one size.
class Fourier {
 public:
  /// Rows of `width`, `height` of them; both positive. Throws std::bad_alloc.
  Fourier(int width, int height);
  Fourier(const Fourier&) = delete;
  Fourier& operator=(const Fourier&) = delete;
  ~Fourier();

  int width() const noexcept { return width_; }
  int height() const noexcept { return height_; }
  std::size_t real_size() const noexcept;
  /// Rows of width / 2 + 1: the other half is the complex conjugate.
  int spectrum_width() const noexcept { return width_ / 2 + 1; }
  std::size_t spectrum_size() const noexcept;

  /// Frequency of a column or row of the spectrum, cycles per sample, in [0, 0.5] and [-0.5, 0.5].
  double frequency_x(int column) const noexcept { return static_cast<double>(column) / width_; }
  double frequency_y(int row) const noexcept {
    return static_cast<double>(2 * row <= height_ ? row : row - height_) / height_;
  }

  void forward(const RealPlane& in, Spectrum& out) const noexcept;
  /// Scaled so that it undoes `forward`. Destroys `in`.
  void inverse(Spectrum& in, RealPlane& out) const noexcept;

 private:
  int width_, height_;
  fftw_plan forward_ = nullptr, inverse_ = nullptr;
};

}  // namespace icbench
