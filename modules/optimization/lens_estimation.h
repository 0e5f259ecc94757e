// What the images say of a mono camera's lens: how wrong its focal lengths are, and how distorted its images.
#pragma once

#include <array>
#include <optional>

#include "optimization/bundle_adjustment.h"

namespace tessera {

struct FocalEstimate {
  double error = 0.0;  // the best focal lengths are 1 + error times those given, fx and fy alike
  double sigma = 0.0;  // its standard deviation
};

// How wrong a calibration is.
struct LensError {
  double focal = 0.0;   // the focal lengths are 1 + focal times those given, fx and fy alike
  double radial = 0.0;  // CameraCalibration::radial, which calibrations take to be 0
};

// Estimates of one camera differ by twice what the curvature of their costs says: the variance grows by this.
inline constexpr double kImagesVariance = 4.0;
// For a least cost that all observations take part in, whichever camera they would agree with.
BundleOptions LeastCostOptions();

// What one problem says of its lens. Costs that both estimates need are computed once.
class LensEstimator {
 public:
  // `problem` must outlive it.
  explicit LensEstimator(const BundleProblem& problem) : problem_(problem) {}

  // With C(e) the least robust cost of the problem (AdjustBundle) when its focal lengths are 1 + e times those given,
  // the parabola through C(-h), C(0), C(h), h = 1 %:
  //
  //   error = -C' / C'',   sigma = 1 / sqrt(C'')            C: half a sum of squares of standard deviation 1
  //
  // A camera that only goes straight shows the same images with another focal length and another depth: C'' is small
  // then. One that turns does not. nullopt: the problem can't be solved, or shows nothing of the focal length.
  std::optional<FocalEstimate> Focal();

  // By how much more than `known` the calibration is wrong; problem.calibration and the observations have `known`
  // already.
  //
  // A turn shows one number: a shorter focal length and edges that are drawn inward explain it equally well, and only
  // together are they well known. So the estimate weighs what images say (the paraboloid through six least costs) and
  // what calibrations are wrong by: one percent of the focal length, 0.4 % of radial, as standard deviations:
  //
  //   min over x = (focal, radial):   (C' x + x' C'' x / 2) / 4 + |(x + known) / sigma|^2 / 2
  //
  // 4: estimates of one camera differ by twice what their curvature says. nullopt: the problem can't be solved.
  std::optional<LensError> Lens(const LensError& known);

 private:
  double LeastCost(int focal_steps, int radial_steps);  // steps: -1, 0 or 1; NaN: can't be solved

  const BundleProblem& problem_;
  std::array<std::optional<double>, 9> least_costs_;
};

// The problem with this much more of both, in its calibration and its observations, whose standard deviations grow with
// the image around them.
BundleProblem WithLensError(BundleProblem problem, const LensError& error);

// The calibration's correction with this much more of both.
LensCorrection CorrectedBy(const LensError& error, const CameraCalibration& calibration);

}  // namespace tessera
