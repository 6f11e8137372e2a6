// What a biased picture lacks: an unbiased estimate of (true minus cached) radiance from sparse paths at the very hits
// that the picture was made at.
//
// Each pixel that reflects is drawn with probability q, by random numbers of its own. A drawn pixel gets kPaths
// independent path samples X_1, X_2 of what it reflects; with C the value that the pass gave it, d_j = X_j - C,
//     Y  = (d_1 + d_2) / (2 q)            is unbiased for b = E[X] - C, with what is not drawn counting 0,
//     V  = Y^2 - d_1 d_2 / q      >= 0    is unbiased for the variance of Y,
//     d_1 d_2 / q                         is unbiased for b^2.
// (The Horvitz-Thompson estimator of a total by Poisson sampling, Sarndal et al. 1992, chapter 3, in two stages.) Two
// paths instead of one are what makes V exact wherever bias differs from pixel to pixel, and b^2 known at all.
//
// So the mean of Y over the picture is what it lacks, minus its bias, with an error bar; and Y added to the picture, as
// a signed layer, makes it unbiased. Everything is conditional on the picture: V is the variance of the paths, not of
// the records that the picture happened to get.
//
// Costs: the paths, and a list of the pixels drawn in one sample (28 bytes each, twice while it is put in order); with
// the layer kept, 16 bytes for every pixel drawn so far. Results are the same bit for bit for any number of threads.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/sync.h"
#include "image/image.h"
#include "render/path.h"
#include "render/primary.h"
#include "render/ray_tracer.h"
#include "render/sampling.h"
#include "render/tiles.h"

namespace icbench {

/// A mean with its standard error, W/(m^2 sr) or the square of that.
struct MeanWithError {
  double mean = 0.0, error = 0.0;
};

/// True minus cached reflected radiance. Means are over all pixels and samples; pixels that reflect nothing count 0.
struct ResidualFigures {
  std::uint64_t samples = 0;           ///< path samples taken: kPaths for each pixel drawn
  std::array<double, 3> cached_rgb{};  ///< mean of what the pass gave, by channel
  double cached = 0.0;                 ///< over channels, too
  std::array<MeanWithError, 3> rgb;    ///< of the residual, by channel
  MeanWithError all;                   ///< over channels, too
  MeanWithError square;                ///< of its square, at a pixel's hits in one sample; below 0 at times
  int edge = 0;                        ///< of the blocks, pixels; cut off at the right and the bottom
  int columns = 0, rows = 0;           ///< of blocks
  std::vector<MeanWithError> blocks;   ///< row by row from the top; the residual over a block and channels
  std::vector<std::uint64_t> block_samples;  ///< path samples taken in each; of none nothing is known
};

class ResidualEstimator {
 public:
  static constexpr unsigned kPaths = 2;
  static constexpr int kBlocks = 8;  ///< along the longer side, at most

  /// `share` in (0, 1] is the probability q that a pixel is drawn in a sample, rounded to a multiple of 2^-24 above 0.
  ResidualEstimator(int width, int height, float share, unsigned threads, bool keeps_layer);

  /// Memory that it takes in expectation, bytes; none for a share of 0.
  static std::uint64_t bytes(std::uint64_t pixels, std::uint32_t spp, float share, bool keeps_layer) noexcept;

  /// Draws among the pixels of a tile, to which a pass with this light() has given `made` at the hits `primary`. By one
  /// thread, after the pass has ended its sample. A pass that brings nothing is held to all indirect light. Out of
  /// memory ends the program.
  void tile(unsigned thread, Tracer& tracer, Light light_of_pass, const PrimaryHits& primary,
            const SampleKey& key, const Tile& tile, const Image& made) noexcept;

  /// Quiescent, after all tiles of a sample.
  void end_sample(const Image& made);

  /// Of all samples that have ended, at least one.
  ResidualFigures figures() const;

  /// Adds the layer, the mean of Y over the samples that have ended; it has negative values. It must have been kept.
  void add_to(Image& picture) const;

 private:
  struct Drawn {
    std::uint32_t pixel;
    std::array<glm::vec3, kPaths> d;
  };
  struct LayerPixel {
    std::uint32_t pixel;
    glm::vec3 sum;  // of Y over samples
  };
  struct Sums {
    double y = 0.0, variance = 0.0;
    std::uint64_t drawn = 0;

    void add(double d0, double d1, double q) noexcept;
    MeanWithError over(double n) const noexcept;
  };
  struct alignas(kNoSharing) Worker {
    std::vector<Drawn> drawn;
  };

  void add(const Drawn& drawn) noexcept;
  void add_to_layer(const std::vector<Drawn>& drawn);

  int width_, height_, edge_, columns_;
  std::uint32_t chance_;  // of 2^24
  double q_;
  bool keeps_layer_;
  std::vector<Worker> workers_;

  // Of the samples that have ended.
  std::uint32_t samples_ = 0;
  std::uint64_t drawn_ = 0;
  glm::dvec3 cached_{0.0};
  std::array<Sums, 3> rgb_;
  Sums all_;
  double square_ = 0.0, square_squared_ = 0.0;
  std::vector<Sums> blocks_;
  std::vector<LayerPixel> layer_;  // by rising pixel
};

}  // namespace icbench
