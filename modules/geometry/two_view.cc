#include "geometry/two_view.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "geometry/epipolar.h"
#include "geometry/reprojection.h"
#include "geometry/sampling.h"
#include "geometry/triangulation.h"

namespace tessera {
namespace {

// What is the same for all candidate motions.
struct TwoViewProblem {
  std::vector<RayPair> rays;
  double limit_squared = 0.0;  // largest squared error of an inlier, one degree of freedom, in ray units
  double corner = 0.0;         // its root
  double sigma = 0.0;          // standard deviation of a ray
  TwoViewOptions options;
};

struct Candidate {
  RefinedMotion motion;
  std::vector<std::optional<Eigen::Vector3d>> points;  // by pair; nullopt: not a good point
  int num_points = 0;
  std::vector<double> errors;  // by pair: squared and truncated, in units of the limit
  double cost = 0.0;           // their sum: how ill the motion explains the pairs
};

TwoViewProblem MakeProblem(const CameraCalibration& calibration, std::span<const PixelPair> pairs,
                           const TwoViewOptions& options) {
  TwoViewProblem problem;
  problem.options = options;
  problem.sigma = options.sigma_px / calibration.fx_px;
  problem.corner = std::sqrt(kChi2LimitOfOne) * problem.sigma;  // 95 % of chi-square, 1 degree
  problem.limit_squared = problem.corner * problem.corner;
  problem.rays.reserve(pairs.size());
  for (const PixelPair& pair : pairs) {
    problem.rays.push_back({calibration.Ray(pair.first_px), calibration.Ray(pair.second_px)});
  }
  return problem;
}

// RANSAC with a truncated quadratic cost: `fit` makes a model of a sample, `error_squared` judges one pair.
template <int kSampleSize, class Fit, class Error>
std::optional<Eigen::Matrix3d> SampleModel(const TwoViewProblem& problem, uint64_t seed, double limit_squared, Fit fit,
                                           Error error_squared) {
  std::optional<Eigen::Matrix3d> best;
  double best_cost = std::numeric_limits<double>::infinity();
  std::array<RayPair, kSampleSize> sample;
  const auto try_sample = [&](const std::array<size_t, kSampleSize>& indices) {
    std::transform(indices.begin(), indices.end(), sample.begin(), [&](size_t i) { return problem.rays[i]; });
    const std::optional<Eigen::Matrix3d> model = fit(sample);
    if (!model) {
      return;
    }
    double cost = 0.0;
    for (const RayPair& pair : problem.rays) {
      cost += std::min(error_squared(*model, pair), limit_squared);
      if (cost >= best_cost) {
        break;
      }
    }
    if (cost < best_cost) {
      best_cost = cost;
      best = model;
    }
  };
  ForEachSample<kSampleSize>(seed, problem.rays.size(), problem.options.ransac_iterations, try_sample);
  return best;
}

// The point of a pair, if it lies in front of both cameras.
std::optional<Eigen::Vector3d> PointInFront(const Rigid3& motion, const RayPair& pair) {
  const std::optional<Eigen::Vector3d> point = TriangulateRays(motion, pair.first, pair.second);
  const bool is_in_front = point && point->z() > 0.0 && (motion * *point).z() > 0.0;
  return is_in_front ? point : std::nullopt;
}

// Whether a point in front of both cameras projects near both pixels, and has enough parallax.
bool IsGood(const TwoViewProblem& problem, const Rigid3& motion, const RayPair& pair, const Eigen::Vector3d& point) {
  const Eigen::Vector3d in_second = motion * point;
  const double error_first = (point.head<2>() / point.z() - pair.first.head<2>()).squaredNorm();
  const double error_second = (in_second.head<2>() / in_second.z() - pair.second.head<2>()).squaredNorm();
  const double limit = problem.limit_squared * Chi2Limit(false) / kChi2LimitOfOne;  // two degrees of freedom
  const double cosine = CosParallax(point, Eigen::Vector3d::Zero(), motion.Inverse().translation);
  return error_first <= limit && error_second <= limit && cosine <= std::cos(problem.options.min_parallax_rad);
}

// Refines the motion on the pairs that agree with it, twice, since a better motion finds more of them.
RefinedMotion RefineOnInliers(const TwoViewProblem& problem, const Rigid3& motion) {
  const DirectionPrior* prior = problem.options.prior ? &*problem.options.prior : nullptr;
  RefinedMotion refined{motion};
  for (int round = 0; round < 2; ++round) {
    const Eigen::Matrix3d essential = EssentialFromMotion(refined.second_from_first);
    std::vector<RayPair> inliers;
    for (const RayPair& pair : problem.rays) {
      const double distance = SampsonDistance(essential, pair);
      if (distance * distance <= 4.0 * problem.limit_squared) {
        inliers.push_back(pair);
      }
    }
    refined = RefineMotion(inliers, refined.second_from_first, problem.corner, prior, problem.sigma);
  }
  return refined;
}

// Squared error of a pair, in ray units: of the nearest pair that a point in front of both cameras, or at infinity,
// allows. Where the epipolar constraint puts the point behind a camera, that is the point at infinity, R x1: noise
// alone puts every other point of the sky there. (The difference of two views has twice the variance of one.)
double ErrorSquared(const Rigid3& motion, const Eigen::Matrix3d& essential, const RayPair& pair, bool is_in_front) {
  const double distance = SampsonDistance(essential, pair);
  if (is_in_front) {
    return distance * distance;
  }
  const Eigen::Vector3d at_infinity = motion.rotation * pair.first;
  if (!(at_infinity.z() > 0.0)) {
    return std::numeric_limits<double>::infinity();
  }
  const double at_infinity_squared = 0.5 * (at_infinity.hnormalized() - pair.second.hnormalized()).squaredNorm();
  return std::max(distance * distance, at_infinity_squared);
}

// Points that are too far for parallax count in the cost like others: the motion that puts most points near is not
// therefore the true one.
Candidate Evaluate(const TwoViewProblem& problem, const RefinedMotion& motion) {
  const Rigid3& second_from_first = motion.second_from_first;
  const Eigen::Matrix3d essential = EssentialFromMotion(second_from_first);
  Candidate candidate{.motion = motion};
  candidate.points.reserve(problem.rays.size());
  candidate.errors.reserve(problem.rays.size());
  for (const RayPair& pair : problem.rays) {
    const std::optional<Eigen::Vector3d> point = PointInFront(second_from_first, pair);
    const bool is_good = point && IsGood(problem, second_from_first, pair, *point);
    candidate.points.push_back(is_good ? point : std::nullopt);
    candidate.num_points += is_good ? 1 : 0;
    const double error_squared = ErrorSquared(second_from_first, essential, pair, point.has_value());
    candidate.errors.push_back(std::min(1.0, error_squared / problem.limit_squared));
    candidate.cost += candidate.errors.back();
  }
  return candidate;
}

std::vector<Rigid3> PossibleMotions(const TwoViewProblem& problem, uint64_t seed) {
  std::vector<Rigid3> motions;
  const auto essential = SampleModel<8>(problem, seed, problem.limit_squared, EssentialFromPairs,
                                        [](const Eigen::Matrix3d& e, const RayPair& pair) {
                                          const double distance = SampsonDistance(e, pair);
                                          return distance * distance;
                                        });
  if (essential) {
    motions = MotionsFromEssential(*essential);
  }
  const auto homography = SampleModel<4>(problem, seed + 1, problem.limit_squared * Chi2Limit(false) / kChi2LimitOfOne,
                                         HomographyFromPairs, TransferErrorSquared);
  if (homography) {
    const std::vector<Rigid3> more = MotionsFromHomography(*homography);
    motions.insert(motions.end(), more.begin(), more.end());
  }
  return motions;
}

// Whether two motions differ by more than the noise of one: 3 degrees of rotation or 15 of direction.
bool AreDifferent(const Rigid3& a, const Rigid3& b) {
  return LogSO3(a.rotation.conjugate() * b.rotation).norm() > 0.05 || a.translation.dot(b.translation) < 0.966;
}

// By how many standard deviations `other` explains the pairs worse than `best`.
double StandardizedDifference(const Candidate& other, const Candidate& best) {
  double sum = 0.0, sum_of_squares = 0.0;
  for (size_t i = 0; i < best.errors.size(); ++i) {
    const double difference = other.errors[i] - best.errors[i];
    sum += difference;
    sum_of_squares += difference * difference;
  }
  return sum_of_squares > 0.0 ? sum / std::sqrt(sum_of_squares) : 0.0;
}

bool HasRival(const std::vector<Candidate>& candidates, const Candidate& best, double min_z) {
  return std::any_of(candidates.begin(), candidates.end(), [&](const Candidate& other) {
    return AreDifferent(other.motion.second_from_first, best.motion.second_from_first) &&
           StandardizedDifference(other, best) < min_z;
  });
}

// Whether enough pairs moved for their points to have parallax, up to a turn that cancels half of it: a camera that
// stands still for minutes need not sample motions all the time.
bool HasMoved(const TwoViewProblem& problem) {
  const double min_cosine = std::cos(0.5 * problem.options.min_parallax_rad);
  const auto num_moved = std::count_if(problem.rays.begin(), problem.rays.end(), [&](const RayPair& pair) {
    return pair.first.dot(pair.second) < min_cosine * pair.first.norm() * pair.second.norm();
  });
  return num_moved >= problem.options.min_points;
}

}  // namespace

Result<> TwoViewOptions::Check() const {
  if (!(sigma_px > 0.0) || ransac_iterations < 1 || min_points < 8 || !(min_parallax_rad > 0.0) ||
      !(min_rival_z >= 0.0) || !(max_direction_sigma_rad > 0.0)) {
    return Failed("two-view options must be positive, and min_points at least 8");
  }
  return {};
}

std::optional<TwoViewResult> EstimateTwoView(const CameraCalibration& calibration, std::span<const PixelPair> pairs,
                                             uint64_t seed, const TwoViewOptions& options,
                                             std::span<const Rigid3> guesses) {
  if (pairs.size() < static_cast<size_t>(options.min_points)) {
    return std::nullopt;
  }
  const TwoViewProblem problem = MakeProblem(calibration, pairs, options);
  if (!HasMoved(problem)) {
    return std::nullopt;
  }
  std::vector<Rigid3> motions = PossibleMotions(problem, seed);
  motions.insert(motions.end(), guesses.begin(), guesses.end());
  std::vector<Candidate> candidates;
  for (const Rigid3& motion : motions) {
    candidates.push_back(Evaluate(problem, RefineOnInliers(problem, motion)));
  }
  const auto best = std::min_element(candidates.begin(), candidates.end(),
                                     [](const auto& a, const auto& b) { return a.cost < b.cost; });
  if (best == candidates.end()) {
    return std::nullopt;
  }
  const bool is_clear = best->num_points >= options.min_points &&
                        DirectionSigma(best->motion, problem.sigma) <= options.max_direction_sigma_rad &&
                        !HasRival(candidates, *best, options.min_rival_z);
  return TwoViewResult{best->motion.second_from_first, best->points, best->num_points, is_clear};
}

}  // namespace tessera
