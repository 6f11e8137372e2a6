// FLIP: how much two images differ for an observer who flips between them at one place.
//
// After Andersson, Nilsson, Akenine-Moller, Oskarsson, Astrom, Fairchild, "FLIP: A Difference Evaluator for
// Alternating Images" (2020) and Andersson, Nilsson, Shirley, Akenine-Moller, "Visualizing Errors in Rendered
// High Dynamic Range Images" (2021). The error of a pixel lies in [0, 1] and grows from 0 for equal images to
// 1 for patches of pure green and pure blue (black against white: 0.967).
//
// Costs: linear in pixels and exposures, about 0.4 s an exposure for 2 million pixels on one core; 100 bytes
// a pixel. There are as many exposures as stops between the median and the maximum of the reference, some ten
// for a room with a lamp. Results do not depend on the number of threads.
#pragma once

#include "image/metrics/metric.h"

namespace icbench {

/// Exposures, as powers of two, under which HDR images are compared.
struct FlipExposures {
  double start, stop;
  int count;  ///< evenly from start to stop

  double at(int i) const noexcept { return count == 1 ? start : start + (stop - start) * i / (count - 1); }
};

/// From the one that maps the reference's largest luminance to 85 % of white to the one that maps its median
/// there, as many as there are stops between them, rounded up, two at least, so that a step is two stops at most
/// (2021, section 4). Where more than half of the reference is black
/// the median of the rest is taken; a black reference gets exposure 0 alone.
FlipExposures flip_exposures(const Image& reference);

/// LDR-FLIP, pixel by pixel, of linear RGB in [0, 1] (clamped to it). The images must be of one size.
std::vector<float> ldr_flip(const Image& reference, const Image& image, double pixels_per_degree);

/// Mean over the pixels of HDR-FLIP: the largest LDR-FLIP over all exposures, tone-mapped by the ACES fit of
/// the paper. Map: the pixels' errors, the same in all channels. Negative radiance counts as 0.
std::vector<MetricValue> flip(const Image& reference, const Image& image, Image* map, const Viewing& viewing);

/// The map in the magma colours of the papers, for PNG.
Image paint_flip(const Image& map, const Image& reference);

}  // namespace icbench
