// HDR-VDP: which pixels a human would tell apart, after Mantiuk, Daly, Myszkowski, Seidel, "Predicting
// Visible Differences in High Dynamic Range Images: Model and its Calibration" (2005).
//
// Luminance passes the eye's optics, the photoreceptors (just noticeable differences), contrast sensitivity
// for the local adaptation, and Watson's cortex transform (5 bands of 6 orientations, and a base band); in
// each channel a difference counts in units of a threshold that the images' own contrast raises (mutual
// masking with phase uncertainty); the channels' probabilities are summed. Constants are those of the
// publication and calibration; hdrvdp_model.h has each of them.
//
// What it does not see: colour, and a change that is the same all over the image (sensitivity at frequency 0
// is 0), such as a factor on everything in bright light: mean_ratio tells that. Where the publication leaves
// a choice: the optics are taken out of the contrast sensitivity, so that they count once; the pupil follows
// the mean luminance, local adaptation the geometric mean, of both images, so that the figures do not depend
// on which one is the reference; images are continued by mirroring for 32 pixels or more, so that opposite
// edges do not meet.
//
// Sides of 48 pixels and more are sensible; of smaller images, down to 1 x 1, the coarse bands see the mirror
// images. Costs: about 190 Fourier transforms, a second for 512 x 512 pixels on one core; 300 bytes a pixel
// on two threads, to which more threads add 0.8 GB at most. Results do not depend on the number of threads.
#pragma once

#include "image/metrics/metric.h"

namespace icbench {

/// Percentages of pixels whose difference is detected with a probability above 75 % (`p75`) and above 95 %
/// (`p95`). Map: the probability of detection, the same in all channels. Pixels whose luminances differ by at
/// most 1e-4 cd/m^2 count as equal; luminance is clamped to [1e-6, 1e10] cd/m^2.
std::vector<MetricValue> hdrvdp(const Image& reference, const Image& image, Image* map,
                                const Viewing& viewing);

/// The map over the reference in grey, for PNG: grey where differences are not visible (below 50 %), turning
/// to green at 75 % and to red at 95 %.
Image paint_hdrvdp(const Image& map, const Image& reference);

}  // namespace icbench
