#include "tracking/pose_covariance.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

#include "geometry/pose_optimization.h"
#include "geometry/reprojection.h"
#include "measurement/landmark_view.h"

namespace tessera {
namespace {

using Vector6d = Eigen::Matrix<double, 6, 1>;

constexpr double kCell_px = 32.0;  // the width of a descriptor's patch on the finest level
constexpr int kDegreesOfFreedom = 6;
constexpr int kMinCells = 2 * kDegreesOfFreedom;
// Of t in KeptVariance: below the first, errors within the limit hardly show it; beyond the last, no noise is cut off.
constexpr double kLeastLimit = 1.0;
constexpr double kGreatestLimit = 20.0;
constexpr int kNumHalvings = 20;

// What pose optimization makes of a point.
struct Term {
  Eigen::Matrix<double, 3, kDegreesOfFreedom> by_pose;
  Eigen::Matrix3d weight;

  Matrix6d Information() const { return by_pose.transpose() * weight * by_pose; }
};

// Bounds the points' leverage, given what all of them know.
Matrix6d BoundLeverage(const Matrix6d& information, std::vector<Term>& terms) {
  const Eigen::Matrix3d known_translation = information.topLeftCorner<3, 3>().inverse();
  const double max_leverage = std::max(kMaxLeverage, 3.0 / static_cast<double>(terms.size()));
  Matrix6d bounded = Matrix6d::Zero();
  for (Term& term : terms) {
    const Matrix6d own = term.Information();
    const double leverage = (known_translation * own.topLeftCorner<3, 3>()).trace() / 3.0;
    const double bound = leverage > max_leverage ? max_leverage / leverage : 1.0;
    term.weight *= bound;
    bounded += bound * own;
  }
  return bounded;
}

size_t NumCells(const PoseInfluences& influences) {
  int num = 0;
  for (const PointInfluence& influence : influences) num = std::max(num, influence.cell + 1);
  return Index(num);
}

Matrix6d SumOfSquares(const std::vector<Vector6d>& vectors) {
  Matrix6d sum = Matrix6d::Zero();
  for (const Vector6d& vector : vectors) sum += vector * vector.transpose();
  return sum;
}

}  // namespace

std::optional<PoseInfluences> InfluencesOn(const TrackedFrame& frame) {
  const CameraCalibration& camera = frame.view->calibration();
  const Rigid3 camera_from_world = frame.world_from_camera.Inverse();
  const Eigen::Matrix3d rotation = camera_from_world.rotation.toRotationMatrix();
  const int num_columns = static_cast<int>(camera.width_px / kCell_px) + 1;
  const int num_rows = static_cast<int>(camera.height_px / kCell_px) + 1;
  std::vector<char> is_covered(Index(num_columns * num_rows));
  PoseInfluences influences;
  std::vector<Term> terms;
  std::vector<Eigen::Vector3d> residuals;
  double sum_shares = 0.0, sum_freedom = 0.0;
  Matrix6d information = Matrix6d::Zero();
  for (size_t i = 0; i < frame.points.size(); ++i) {
    if (!frame.points[i].valid()) continue;
    const Eigen::Vector3d point = camera_from_world * frame.points[i].landmark.position_in_world;
    if (point.z() < kMinDepth) continue;
    const Landmark& landmark = frame.points[i].landmark;
    const PixelObservation seen =
        SeenAt(frame.view->features(), static_cast<int32_t>(i), landmark, frame.world_from_camera.translation);
    const Reprojection at = Reproject(camera, frame.view->baseline_m(), point, seen);
    const Eigen::Vector3d by_depth = at.by_point * (rotation * (landmark.depth_sigma * landmark.normal));
    Term term;  // the point moves by  -translation + point x rotation
    term.by_pose << -at.by_point, at.by_point * Skew(point);
    term.weight = Eigen::Matrix3d::Identity() - by_depth * by_depth.transpose() / (1.0 + by_depth.squaredNorm());
    information += term.Information();
    terms.push_back(term);
    residuals.push_back(at.residual);
    sum_shares += at.residual.dot(term.weight * at.residual) / Chi2Limit(seen.has_right());
    sum_freedom += seen.has_right() ? 3.0 : 2.0;
    const int column = std::clamp(static_cast<int>(seen.pixel_px.x() / kCell_px), 0, num_columns - 1);
    const int row = std::clamp(static_cast<int>(seen.pixel_px.y() / kCell_px), 0, num_rows - 1);
    const int cell = num_columns * row + column;
    is_covered[Index(cell)] = 1;
    influences.push_back({frame.points[i].id, cell, Vector6d::Zero()});
  }
  if (terms.empty()) return std::nullopt;
  const auto num_cells = static_cast<double>(std::count(is_covered.begin(), is_covered.end(), 1));
  const Eigen::LLT<Matrix6d> factor(BoundLeverage(information, terms));
  if (num_cells < kMinCells || factor.info() != Eigen::Success) return std::nullopt;
  const auto num = static_cast<double>(terms.size());
  const double kept = KeptVariance(sum_shares / num, sum_freedom / num);
  const Matrix6d moved_by_score =
      -std::sqrt(num_cells / (num_cells - kDegreesOfFreedom)) / kept * factor.solve(Matrix6d::Identity());
  if (!moved_by_score.allFinite()) return std::nullopt;
  for (size_t i = 0; i < terms.size(); ++i) {
    influences[i].moves_by = moved_by_score * (terms[i].by_pose.transpose() * (terms[i].weight * residuals[i]));
  }
  return influences;
}

double KeptVariance(double mean_share, double freedom) {
  const double a = 0.5 * freedom;
  const auto kept = [a](double t) {
    double sum = 1.0, term = 1.0;
    for (int j = 1; term > 1e-9 * sum; ++j) sum += term *= t / (a + j);
    return 1.0 - 1.0 / sum;
  };
  // mean_share = a K(t) / t  falls as t grows.
  double least = kLeastLimit, greatest = kGreatestLimit;
  for (int i = 0; i < kNumHalvings; ++i) {
    const double t = 0.5 * (least + greatest);
    (a * kept(t) / t > mean_share ? least : greatest) = t;
  }
  return kept(least);
}

Matrix6d PoseCovariance(const PoseInfluences& influences) {
  std::vector<Vector6d> by_cell(NumCells(influences), Vector6d::Zero());
  for (const PointInfluence& influence : influences) by_cell[Index(influence.cell)] += influence.moves_by;
  return SumOfSquares(by_cell);
}

Matrix6d WayCovariance(const PoseInfluences& reference, const PoseInfluences& frame,
                       const Rigid3& frame_from_reference) {
  // What the reference has from points that the frame sees counts in the frame's cells.
  std::vector<Vector6d> by_cell(NumCells(frame), Vector6d::Zero()), shared(by_cell);
  std::vector<Vector6d> rest(NumCells(reference), Vector6d::Zero());
  for (const PointInfluence& influence : reference) rest[Index(influence.cell)] += influence.moves_by;
  std::vector<char> is_shared(reference.size());
  for (const PointInfluence& influence : frame) {
    by_cell[Index(influence.cell)] += influence.moves_by;
    const auto found = std::ranges::lower_bound(reference, influence.point, {}, &PointInfluence::point);
    if (found == reference.end() || found->point != influence.point || !influence.point.valid()) continue;
    if (std::exchange(is_shared[static_cast<size_t>(found - reference.begin())], 1) != 0) continue;
    shared[Index(influence.cell)] += found->moves_by;
    rest[Index(found->cell)] -= found->moves_by;
  }
  const Matrix6d adjoint = AdjointOf(frame_from_reference);
  for (size_t cell = 0; cell < by_cell.size(); ++cell) by_cell[cell] -= adjoint * shared[cell];
  return SumOfSquares(by_cell) + adjoint * SumOfSquares(rest) * adjoint.transpose();
}

double ErrorByCovariance(const Vector6d& d, const Matrix6d& covariance,
                         const std::optional<Eigen::Vector3d>& free_direction) {
  const Eigen::LDLT<Matrix6d> factor(covariance);
  const double all = d.dot(factor.solve(d));
  if (!free_direction) return all / kDegreesOfFreedom;
  Vector6d free = Vector6d::Zero();
  free.head<3>() = *free_direction;
  const Vector6d weighted = factor.solve(free);
  return (all - d.dot(weighted) * d.dot(weighted) / free.dot(weighted)) / (kDegreesOfFreedom - 1);
}

}  // namespace tessera
