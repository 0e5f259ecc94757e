#include "optimization/lens_estimation.h"

#include <Eigen/LU>
#include <cmath>
#include <utility>

namespace tessera {
namespace {

constexpr double kFocalStep = 0.01, kRadialStep = 0.004;    // of the parabolas
constexpr double kFocalSigma = 0.01, kRadialSigma = 0.004;  // of calibrations

// Of the area around a pixel that MovedByLens moves, as a length: how much longer it is thereafter.
double Magnification(const CameraCalibration& calibration, double radial, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d from_center = pixel - Eigen::Vector2d(calibration.cx_px, calibration.cy_px);
  const double half_width_px = 0.5 * calibration.width_px;
  const double moved_by = radial * from_center.squaredNorm() / (half_width_px * half_width_px);
  return std::sqrt((1.0 + moved_by) * (1.0 + 3.0 * moved_by));
}

// The parabola through (-step, before), (0, same), (step, after).
struct Parabola {
  double slope = 0.0, curvature = 0.0;  // at 0
};
Parabola Through(double before, double same, double after, double step) {
  return {(after - before) / (2.0 * step), (after - 2.0 * same + before) / (step * step)};
}

}  // namespace

BundleOptions LeastCostOptions() {
  BundleOptions options = GlobalBundleOptions();
  options.num_rounds = 1;
  options.function_tolerance = 1e-6;
  return options;
}

LensCorrection CorrectedBy(const LensError& error, const CameraCalibration& calibration) {
  return {calibration.fx_px * (1.0 + error.focal), calibration.fy_px * (1.0 + error.focal),
          calibration.radial + error.radial, calibration.right_shift};
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

double LensEstimator::LeastCost(int focal_steps, int radial_steps) {
  std::optional<double>& cost = least_costs_.at(static_cast<size_t>(3 * (focal_steps + 1) + radial_steps + 1));
  if (!cost) {
    const LensError error{focal_steps * kFocalStep, radial_steps * kRadialStep};
    const std::optional<BundleResult> result = AdjustBundle(WithLensError(problem_, error), LeastCostOptions());
    cost = result ? result->final_cost : std::nan("");
  }
  return *cost;
}

std::optional<FocalEstimate> LensEstimator::Focal() {
  if (problem_.points.empty()) return std::nullopt;
  const Parabola costs = Through(LeastCost(-1, 0), LeastCost(0, 0), LeastCost(1, 0), kFocalStep);
  if (!(costs.curvature > 0.0)) return std::nullopt;  // NaN, too
  return FocalEstimate{-costs.slope / costs.curvature, 1.0 / std::sqrt(costs.curvature)};
}

std::optional<LensError> LensEstimator::Lens(const LensError& known) {
  if (problem_.points.empty()) return std::nullopt;
  const double same = LeastCost(0, 0), longer = LeastCost(1, 0), outward = LeastCost(0, 1);
  const Parabola focal = Through(LeastCost(-1, 0), same, longer, kFocalStep);
  const Parabola radial = Through(LeastCost(0, -1), same, outward, kRadialStep);
  // C(h, q) - C(h, 0) - C(0, q) + C(0, 0) = h q C''_12
  const double mixed = (LeastCost(1, 1) - longer - outward + same) / (kFocalStep * kRadialStep);

  // What calibrations are wrong by, as information.
  const Eigen::Vector2d usual(1.0 / (kFocalSigma * kFocalSigma), 1.0 / (kRadialSigma * kRadialSigma));
  Eigen::Matrix2d curvature{{focal.curvature, mixed}, {mixed, radial.curvature}};
  curvature = curvature / kImagesVariance + usual.asDiagonal().toDenseMatrix();
  const Eigen::Vector2d slope(focal.slope / kImagesVariance + known.focal * usual.x(),
                              radial.slope / kImagesVariance + known.radial * usual.y());
  if (!(curvature(0, 0) > 0.0 && curvature.determinant() > 0.0)) return std::nullopt;
  const Eigen::Vector2d error = -curvature.inverse() * slope;
  return LensError{error.x(), error.y()};
}

}  // namespace tessera
