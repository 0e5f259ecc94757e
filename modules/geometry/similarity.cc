#include "geometry/similarity.h"

#include <array>
#include <limits>
#include <stdexcept>

#include "geometry/alignment.h"
#include "geometry/sampling.h"
#include "geometry/similarity_problem.h"

namespace tessera {
namespace {

constexpr double kRoughStart = 9.0;  // on squares: three times the limit in the first round
constexpr int kRansacRounds = 2;     // of refinement for each new best

}  // namespace

Result<> SimilarityOptions::Check() const {
  if (ransac_iterations < 1 || num_rounds < 1 || max_iterations < 1) {
    return Failed("ransac_iterations, num_rounds and max_iterations must be positive");
  }
  if (min_inliers < kMinSimilarityInliers) return Failed("min_inliers must be 3 at least");
  if (!(sigma_factor > 0.0) || !(depth_sigma > 0.0) || !(max_rotation_sigma_rad > 0.0) || !(baseline_m >= 0.0)) {
    return Failed("sigma_factor, depth_sigma and max_rotation_sigma_rad must be positive, and baseline_m not negative");
  }
  if (has_scale && baseline_m > 0.0) return Failed("baseline_m must be 0 where the scale is free (has_scale)");
  return {};
}

std::optional<SimilarityEstimate> EstimateSimilarity(const CameraCalibration& calibration,
                                                     std::span<const PointPair> pairs, uint64_t seed,
                                                     const SimilarityOptions& options) {
  ThrowIfFailed<std::invalid_argument>(options.Check(), "similarity: ");
  if (pairs.size() < static_cast<size_t>(options.min_inliers)) return std::nullopt;
  SimilarityProblem problem(calibration, pairs, options);
  SimilarityEstimate best;
  int best_of_samples = 0;  // inliers of the best triple before its refinement
  ForEachSample<3>(seed, pairs.size(), options.ransac_iterations, [&](const std::array<size_t, 3>& sample) {
    std::array<Eigen::Vector3d, 3> in_first, in_second;
    for (size_t k = 0; k < 3; ++k) {
      in_first[k] = pairs[sample[k]].point_in_first;
      in_second[k] = pairs[sample[k]].point_in_second;
    }
    const std::optional<Alignment> alignment = AlignPoints(in_second, in_first, options.has_scale);
    if (!alignment || !(alignment->b_from_a.scale > 0.0)) return;
    SimilarityEstimate estimate = problem.Classify(alignment->b_from_a, 1.0);
    if (estimate.num_inliers <= best_of_samples) return;
    best_of_samples = estimate.num_inliers;
    estimate = problem.Refine(alignment->b_from_a, kRansacRounds, kRoughStart);
    if (estimate.num_inliers > best.num_inliers) best = std::move(estimate);
  });
  if (best.num_inliers < options.min_inliers) return std::nullopt;
  best.rotation_sigma_rad = problem.RotationSigma(best);
  return best.rotation_sigma_rad <= options.max_rotation_sigma_rad ? std::optional(best) : std::nullopt;
}

SimilarityEstimate RefineSimilarity(const CameraCalibration& calibration, std::span<const PointPair> pairs,
                                    const Sim3& first_from_second, const SimilarityOptions& options) {
  ThrowIfFailed<std::invalid_argument>(options.Check(), "similarity: ");
  SimilarityProblem problem(calibration, pairs, options);
  SimilarityEstimate estimate = problem.Refine(first_from_second, options.num_rounds, kRoughStart);
  if (estimate.num_inliers < kMinSimilarityInliers) {
    return {first_from_second, std::vector<char>(pairs.size(), 0), 0, std::numeric_limits<double>::infinity()};
  }
  estimate.rotation_sigma_rad = problem.RotationSigma(estimate);
  return estimate;
}

}  // namespace tessera
