// Speed against error: every method over its parameters, on one frame of one scene, against path tracing.
//
// A picture is one sample through the centre of each pixel, for all methods and for the reference they are judged by:
// path-traced indirect light at the very same hits. So neither edges nor direct light count as error of a method.
// Beside that stands the error of the whole picture against path tracing with samples all over the pixel.
//
// relMSE is of pictures scaled by 1 / mean luminance of the reference: its epsilon presumes pictures about as bright as
// white, and would else judge scenes of little light by their squared error.
//
// Every reference carries its own error, from two independent halves. Runs of a setting are independent of each other;
// what they have in common is bias, what sets them apart is variance.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "harness/results.h"
#include "workload/frame_renderer.h"
#include "workload/ray_traced_plan.h"

namespace icbench {

/// Indirect light alone by path tracing at the pixels' centres, FrameRequest::paths of them: what all methods estimate.
const IntegratorEntry& path_indirect();

/// A parameter of a method and the values it takes; its name is the field's in the results.
struct ParetoAxis {
  std::string_view name;
  void (*set)(FrameRequest&, double);
  std::vector<double> values;  ///< rising in cost
};

/// A method: an integrator, all combinations of the values of its parameters, and what else it asks for.
struct ParetoMethod {
  std::string_view name;
  const IntegratorEntry& integrator;
  std::vector<ParetoAxis> axes;
  void (*also)(FrameRequest&) = nullptr;
  bool is_warm = false;  ///< keeps state over frames: measured after the frame before
};

/// All of them. Adding one is an entry in pareto.cpp.
const std::vector<ParetoMethod>& pareto_methods();

/// A method with its parameters set.
struct ParetoPoint {
  const ParetoMethod* method;
  std::vector<double> values;  ///< one for each axis
};

/// The points of methods, in their order. A coarse grid takes every other value of each parameter.
std::vector<ParetoPoint> pareto_points(const std::vector<const ParetoMethod*>& methods, bool is_coarse);

/// The parameters of a point, "accuracy:0.2/rays_per_record:64".
std::string setting_of(const ParetoPoint& point);

/// Marks each point unless another is both faster and better: less of both.
std::vector<bool> pareto_front(std::span<const double> seconds, std::span<const double> error);

struct ParetoRequest {
  FrameRequest frame;        ///< scene, team, cache and size; what a point sets is overwritten
  std::string scene;         ///< name in the results
  std::uint32_t number = 0;  ///< of the frame
  unsigned repetitions = 5;
  std::uint32_t reference_spp = 1024;  ///< at least 2
  std::uint64_t seed = 1;
};

/// Bytes that a study of so many points takes beside the pictures of one frame.
std::uint64_t pareto_bytes(const ParetoRequest& request, std::size_t points);

/// Mean squared differences of independent runs from a reference, and what of them is bias.
class RunErrors {
 public:
  void add(const Image& reference, const Image& image);

  unsigned runs() const noexcept { return runs_; }

  /// Of two runs and more, W^2/(m^4 sr^2).
  struct Bias {
    /// Mean over channels and pixels of the square of the expected picture's difference from the truth: mean squared
    /// error less variance, and less what the reference itself errs by. Unbiased, and so below 0 at times.
    double squared;
    /// Its standard error were there none. Pixels may err alike: blocks of them, 8 x 8 or in small pictures fewer, so
    /// that there are some hundreds, are taken for independent of one another.
    double error;
  };
  Bias bias(const Reference& reference) const;
  double variance() const noexcept;  ///< of one run, mean over channels and pixels; of two runs and more

 private:
  unsigned runs_ = 0;
  int width_ = 0, height_ = 0;
  // Of the differences, a value a pixel. Doubles: the variance is a small difference of them where pictures are biased.
  std::vector<glm::dvec3> sums_, squares_;
};

class ParetoStudy {
 public:
  /// Path traces the references. `progress` is told how much of reference_work was done.
  ParetoStudy(const ParetoRequest& request, const std::function<void(double)>& progress);

  static double reference_work(const ParetoRequest& request);

  /// Name in the results, "pareto/SCENE/METHOD/PARAMETER:VALUE/...".
  std::string name_of(const ParetoPoint& point) const;

  /// Measures a point. Repetitions come in rising order; those that a run before this one has measured are rendered
  /// again without being measured, for the bias.
  Entry run(const ParetoPoint& point, unsigned repetition);

  /// What a viewer sees: a point's indirect light, as in its first repetition, under the reference's direct light.
  Image view(const ParetoPoint& point);
  Image reference_view() const { return under_direct_light(reference_.indirect); }

 private:
  struct Rendered {
    FrameCost cost;
    double cpu_seconds;
    Image indirect, picture;
  };

  FrameRequest request_of(const ParetoPoint& point, unsigned repetition) const;
  Rendered render(const ParetoPoint& point, unsigned repetition);
  Image under_direct_light(const Image& indirect) const;

  ParetoRequest request_;
  PrimaryHits primary_;                      // at the pixels' centres
  Reference reference_;                      // indirect light there
  Image direct_;                             // likewise, with what is emitted
  Image irradiance_;                         // behind the reference
  Image full_;                               // all light, samples all over the pixel
  double full_relmse_ = 0.0;                 // expected of full_ itself
  std::map<std::string, RunErrors> errors_;  // by name
};

}  // namespace icbench
