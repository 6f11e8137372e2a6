// The parts of the eye that HDR-VDP is made of, each a function of its own so that it can be held against
// published values.
//
// Sources. Deeley: Deeley, Drasdo, Charman, "A simple parametric model of the human ocular modulation
// transfer function" (1991). Moon and Spencer: "On the Stiles-Crawford effect" (1944), in cd/m^2. Daly: "The
// Visible Differences Predictor" (1993). Watson: "The cortex transform" (1987), with Daly's filters.
#pragma once

#include <vector>

namespace icbench {

/// Luminance, cd/m^2, that is told apart: below, nothing is seen; above, the eye is blinded.
inline constexpr double kMinLuminance = 1e-6, kMaxLuminance = 1e10;

/// Smallest visible contrast at the best frequency and luminance (calibrated by Mantiuk et al. 2005).
inline constexpr double kPeakContrast = 0.006;

/// Diameter of the pupil, mm, at an adaptation luminance in cd/m^2 (Moon and Spencer).
double pupil_diameter(double luminance) noexcept;

/// Share of the contrast at `frequency`, cycles per degree, that a pupil of that diameter in mm lets through
/// to the retina (Deeley): exp(-(f / (20.9 - 2.1 d))^(1.3 - 0.07 d)).
double optical_transfer(double frequency, double pupil) noexcept;

/// What contrast sensitivity depends on besides the frequency (Daly 1993, section 2.2).
struct SensitivityConditions {
  double luminance;  ///< adaptation, cd/m^2
  double area;       ///< image, square degrees
  double distance;   ///< metres
};

/// Daly's contrast sensitivity for a frequency in cycles per degree at an angle in radians; 0 at frequency
/// 0. For a large image at 0.5 m and 100 cd/m^2 it peaks with 237 at 3.2 cycles per degree.
double contrast_sensitivity(double frequency, double angle, const SensitivityConditions& at) noexcept;

/// Largest contrast sensitivity over all frequencies, at angle 0.
double peak_sensitivity(const SensitivityConditions& at) noexcept;

/// Smallest visible contrast at an adaptation luminance: kPeakContrast in bright light and, below, in inverse
/// proportion to the peak of Daly's sensitivity for large images, which has the closed form
/// kPeakContrast (1 + 0.7/L)^0.2 (1 + 100/L)^0.15. L times this is the threshold versus intensity curve.
double threshold_contrast(double luminance) noexcept;

/// Response of the photoreceptors in just noticeable differences: the integral of dL / (L
/// threshold_contrast(L)) from kMinLuminance, clamped to [kMinLuminance, kMaxLuminance].
class JndScale {
 public:
  JndScale();
  double operator()(double luminance) const noexcept;

 private:
  std::vector<double> table_;  // at even distances in log luminance
};

/// Cortex transform: bands 0 (finest) to kBands - 1 of kOrientations each, then the base band.
inline constexpr int kBands = 5, kOrientations = 6;

/// Low-pass filter with half of its amplitude at 2^-k cycles per pixel and a transition two thirds as wide;
/// mesa(0) lets everything through.
double mesa(int k, double frequency) noexcept;

/// The base band's low-pass filter, a truncated Gaussian.
double base_filter(double frequency) noexcept;

/// Band-pass filter of a band: mesa(band) - mesa(band + 1), for the coarsest band minus the base filter. All
/// bands and the base add up to 1.
double dom(int band, double frequency) noexcept;

/// Share of an orientation at `angle` radians; all orientations add up to 1.
double fan(int orientation, double angle) noexcept;

/// How much a mask of contrast `mask`, in units of its threshold, raises the threshold (Daly, equation of
/// section 2.3.3, with W = 6, Q = 0.7, b = 4 and slope 1): (1 + (6 mask)^4)^(1/4).
double threshold_elevation(double mask) noexcept;

/// Slope of the psychometric function 1 - exp(-c^slope) of contrast c in units of its threshold.
inline constexpr double kPsychometricSlope = 3.5;

/// c^kPsychometricSlope for c >= 0. The probabilities of independent channels add up by it: the probability
/// that none detects is exp of minus the sum.
double detection_exponent(double c) noexcept;

}  // namespace icbench
