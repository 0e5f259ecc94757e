#include "optimization/focal_estimation.h"

#include <cmath>

namespace tessera {
namespace {

constexpr double kStep = 0.01;

// All observations take part, whichever focal length they would agree with.
BundleOptions OneRound() {
  BundleOptions options = GlobalBundleOptions();
  options.num_rounds = 1;
  options.function_tolerance = 1e-6;
  return options;
}

std::optional<double> LeastCost(BundleProblem problem, double error) {
  problem.calibration = WithFocal(problem.calibration, ScaledFocal(problem.calibration, error));
  const std::optional<BundleResult> result = AdjustBundle(problem, OneRound());
  return result ? std::optional(result->final_cost) : std::nullopt;
}

}  // namespace

FocalLengths ScaledFocal(const CameraCalibration& calibration, double error) {
  return {calibration.fx_px * (1.0 + error), calibration.fy_px * (1.0 + error)};
}

std::optional<FocalEstimate> EstimateFocal(const BundleProblem& problem) {
  if (problem.points.empty()) return std::nullopt;
  const std::optional<double> shorter = LeastCost(problem, -kStep);
  const std::optional<double> same = LeastCost(problem, 0.0);
  const std::optional<double> longer = LeastCost(problem, kStep);
  if (!shorter || !same || !longer) return std::nullopt;
  const double slope = (*longer - *shorter) / (2.0 * kStep);
  const double curvature = (*longer - 2.0 * *same + *shorter) / (kStep * kStep);
  if (!(curvature > 0.0)) return std::nullopt;
  return FocalEstimate{-slope / curvature, 1.0 / std::sqrt(curvature)};
}

}  // namespace tessera
