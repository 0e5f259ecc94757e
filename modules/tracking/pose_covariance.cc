#include "tracking/pose_covariance.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <vector>

#include "geometry/keypoint_noise.h"
#include "geometry/reprojection.h"

namespace tessera {
namespace {

using Vector6d = Eigen::Matrix<double, 6, 1>;

constexpr double kCell_px = 32.0;  // the width of a descriptor's patch on the finest level
constexpr int kDegreesOfFreedom = 6;
constexpr int kMinCells = 2 * kDegreesOfFreedom;

// P, in the camera's axes.
Eigen::Matrix3d CovarianceOf(const Map& map, const SeenPoint& point, const Eigen::Matrix3d& camera_from_world,
                             double focal_length_px) {
  const Landmark& landmark = point.landmark;
  const size_t num_observers = std::max<size_t>(1, map.ObservationsOf(point.id.landmark).size());
  // max_distance is the distance times the scale of the level where it was seen last.
  const double sigma_across = kKeypointSigmaPx * landmark.max_distance / focal_length_px;
  const double variance_across = sigma_across * sigma_across / static_cast<double>(num_observers);
  const Eigen::Vector3d normal = camera_from_world * landmark.normal;
  const double variance_along = landmark.depth_sigma * landmark.depth_sigma;
  return variance_across * Eigen::Matrix3d::Identity() +
         (variance_along - variance_across) * normal * normal.transpose();
}

}  // namespace

std::optional<Matrix6d> PoseCovariance(const Map& map, const TrackedFrame& frame) {
  const CameraCalibration& camera = frame.view->calibration();
  const Rigid3 camera_from_world = frame.world_from_camera.Inverse();
  const Eigen::Matrix3d rotation = camera_from_world.rotation.toRotationMatrix();
  const int num_columns = static_cast<int>(camera.width_px / kCell_px) + 1;
  const int num_rows = static_cast<int>(camera.height_px / kCell_px) + 1;
  std::vector<std::optional<Vector6d>> scores(static_cast<size_t>(num_columns) * static_cast<size_t>(num_rows));
  Matrix6d information = Matrix6d::Zero();
  for (size_t i = 0; i < frame.points.size(); ++i) {
    if (!frame.points[i].valid()) continue;
    const Eigen::Vector3d point = camera_from_world * frame.points[i].landmark.position_in_world;
    if (point.z() < kMinDepth) continue;
    const PixelObservation seen = frame.view->observation(static_cast<int>(i));
    const Reprojection at = Reproject(camera, frame.view->baseline_m(), point, seen);
    const Eigen::Matrix3d of_point = CovarianceOf(map, frame.points[i], rotation, camera.fx_px);
    const Eigen::Matrix3d weight =
        (Eigen::Matrix3d::Identity() + at.by_point * of_point * at.by_point.transpose()).inverse();
    Eigen::Matrix<double, 3, kDegreesOfFreedom> by_pose;  // the point moves by  -translation + point x rotation
    by_pose << -at.by_point, at.by_point * Skew(point);
    information += by_pose.transpose() * weight * by_pose;
    const int column = std::clamp(static_cast<int>(seen.pixel_px.x() / kCell_px), 0, num_columns - 1);
    const int row = std::clamp(static_cast<int>(seen.pixel_px.y() / kCell_px), 0, num_rows - 1);
    std::optional<Vector6d>& score = scores[static_cast<size_t>(num_columns * row + column)];
    if (!score) score = Vector6d::Zero();
    *score += by_pose.transpose() * weight * at.residual;
  }
  Matrix6d spread = Matrix6d::Zero();
  int num_cells = 0;
  for (const std::optional<Vector6d>& score : scores) {
    if (!score) continue;
    spread += *score * score->transpose();
    ++num_cells;
  }
  const Eigen::LLT<Matrix6d> factor(information);
  if (num_cells < kMinCells || factor.info() != Eigen::Success) return std::nullopt;
  const Matrix6d inverse = factor.solve(Matrix6d::Identity());
  const Matrix6d covariance = inverse * spread * inverse * (num_cells / (num_cells - double{kDegreesOfFreedom}));
  if (!covariance.allFinite()) return std::nullopt;
  return 0.5 * (covariance + covariance.transpose());
}

}  // namespace tessera
