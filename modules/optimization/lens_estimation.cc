#include "optimization/lens_estimation.h"

#include <Eigen/LU>
#include <cmath>
#include <utility>

namespace tessera {
namespace {

constexpr double kFocalStep = 0.01, kRadialStep = 0.004;    // of the parabolas
constexpr double kFocalSigma = 0.01, kRadialSigma = 0.004;  // of calibrations
constexpr double kImagesVariance = 4.0;

// All observations take part, whichever focal length they would agree with.
BundleOptions OneRound() {
  BundleOptions options = GlobalBundleOptions();
  options.num_rounds = 1;
  options.function_tolerance = 1e-6;
  return options;
}

// Of the area around a pixel that MovedByLens moves, as a length: how much longer it is thereafter.
double Magnification(const CameraCalibration& calibration, double radial, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d from_center = pixel - Eigen::Vector2d(calibration.cx_px, calibration.cy_px);
  const double half_width_px = 0.5 * calibration.width_px;
  const double moved_by = radial * from_center.squaredNorm() / (half_width_px * half_width_px);
  return std::sqrt((1.0 + moved_by) * (1.0 + 3.0 * moved_by));
}

// NaN: can't be solved.
double LeastCost(const BundleProblem& problem, const LensError& error) {
  const std::optional<BundleResult> result = AdjustBundle(WithLensError(problem, error), OneRound());
  return result ? result->final_cost : std::nan("");
}

// The parabola through (-step, before), (0, same), (step, after).
struct Parabola {
  double slope = 0.0, curvature = 0.0;  // at 0
};
Parabola Through(double before, double same, double after, double step) {
  return {(after - before) / (2.0 * step), (after - 2.0 * same + before) / (step * step)};
}

}  // namespace

LensCorrection CorrectedBy(const LensError& error, const CameraCalibration& calibration) {
  return {calibration.fx_px * (1.0 + error.focal), calibration.fy_px * (1.0 + error.focal),
          calibration.radial + error.radial};
}

BundleProblem WithLensError(BundleProblem problem, const LensError& error) {
  const CameraCalibration before = problem.calibration;
  problem.calibration = WithLens(before, CorrectedBy(error, before));
  if (problem.calibration.radial == before.radial) return problem;
  for (BundleObservation& observation : problem.observations) {
    const Eigen::Vector2d seen = BeforeLens(before, before.radial, observation.seen.pixel_px);
    observation.seen.pixel_px = MovedByLens(before, problem.calibration.radial, seen);
    // Else images that shrink would fit best.
    observation.seen.sigma_px *=
        Magnification(before, problem.calibration.radial, seen) / Magnification(before, before.radial, seen);
  }
  return problem;
}

std::optional<FocalEstimate> EstimateFocal(const BundleProblem& problem) {
  if (problem.points.empty()) return std::nullopt;
  const Parabola costs = Through(LeastCost(problem, {-kFocalStep, 0.0}), LeastCost(problem, {}),
                                 LeastCost(problem, {kFocalStep, 0.0}), kFocalStep);
  if (!(costs.curvature > 0.0)) return std::nullopt;  // NaN, too
  return FocalEstimate{-costs.slope / costs.curvature, 1.0 / std::sqrt(costs.curvature)};
}

std::optional<LensError> EstimateLens(const BundleProblem& problem, const LensError& known) {
  if (problem.points.empty()) return std::nullopt;
  const double same = LeastCost(problem, {});
  const double longer = LeastCost(problem, {kFocalStep, 0.0}), outward = LeastCost(problem, {0.0, kRadialStep});
  const Parabola focal = Through(LeastCost(problem, {-kFocalStep, 0.0}), same, longer, kFocalStep);
  const Parabola radial = Through(LeastCost(problem, {0.0, -kRadialStep}), same, outward, kRadialStep);
  // C(h, q) - C(h, 0) - C(0, q) + C(0, 0) = h q C''_12
  const double mixed =
      (LeastCost(problem, {kFocalStep, kRadialStep}) - longer - outward + same) / (kFocalStep * kRadialStep);

  Eigen::Matrix2d curvature{{focal.curvature, mixed}, {mixed, radial.curvature}};
  curvature = curvature / kImagesVariance +
              Eigen::Vector2d(1.0 / (kFocalSigma * kFocalSigma), 1.0 / (kRadialSigma * kRadialSigma))
                  .asDiagonal()
                  .toDenseMatrix();
  const Eigen::Vector2d slope(focal.slope / kImagesVariance + known.focal / (kFocalSigma * kFocalSigma),
                              radial.slope / kImagesVariance + known.radial / (kRadialSigma * kRadialSigma));
  if (!(curvature(0, 0) > 0.0 && curvature.determinant() > 0.0)) return std::nullopt;
  const Eigen::Vector2d error = -curvature.inverse() * slope;
  return LensError{error.x(), error.y()};
}

}  // namespace tessera
