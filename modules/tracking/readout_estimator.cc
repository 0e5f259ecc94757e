#include "tracking/readout_estimator.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "geometry/reprojection.h"
#include "measurement/landmark_description.h"

namespace tessera {
namespace {

constexpr int kMinPoints = 50;
// Of what one frame says: its motion isn't known exactly, nor is the map.
constexpr double kFrameSigma_s = 0.01;
// However many frames have been seen: what the first ones said, with a map that was distorted, is forgotten.
constexpr double kMinSigma_s = 0.001;
constexpr double kMinSigmas = 4.0;
constexpr double kMinReadout_s = 0.005;  // a shorter one isn't worth a risk

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

// Least squares over the pose and the readout's error.
struct Equations {
  Matrix6d information = Matrix6d::Zero();
  Vector6d coupling = Vector6d::Zero();  // of the pose and the readout
  Vector6d gradient = Vector6d::Zero();
  double readout_information = 0.0;
  double readout_gradient = 0.0;
  double sum_of_squares = 0.0;
  int num_points = 0;

  void Add(const Eigen::Vector3d& residual, const Eigen::Matrix<double, 3, 6>& by_pose,
           const Eigen::Vector3d& by_readout) {
    information.noalias() += by_pose.transpose() * by_pose;
    coupling.noalias() += by_pose.transpose() * by_readout;
    gradient.noalias() += by_pose.transpose() * residual;
    readout_information += by_readout.squaredNorm();
    readout_gradient += by_readout.dot(residual);
    sum_of_squares += residual.squaredNorm();
    ++num_points;
  }
};

Equations EquationsOf(const TrackedFrame& frame, const CameraMotion& motion,
                      const ReadoutEstimator::MovingView& reference) {
  Equations equations;
  const CameraCalibration& camera = frame.view->calibration();
  const Rigid3 frame_from_world = frame.world_from_camera.Inverse();
  const Rigid3 reference_from_world = reference.world_from_camera.Inverse();
  const Eigen::Quaterniond frame_from_reference = frame_from_world.rotation * reference.world_from_camera.rotation;
  for (int i = 0; i < frame.view->size(); ++i) {
    const SeenPoint& seen = frame.points[Index(i)];
    if (!seen.valid() || !HasDepth(seen.landmark, frame.world_from_camera.translation)) continue;
    const Eigen::Vector3d point = frame_from_world * seen.landmark.position_in_world;
    const Eigen::Vector3d in_reference = reference_from_world * seen.landmark.position_in_world;
    if (point.z() < kMinDepth || in_reference.z() < kMinDepth) continue;
    const double reference_y_px = camera.Project(in_reference).y();
    if (reference_y_px < 0.0 || reference_y_px > camera.height_px) continue;
    PixelObservation observation = frame.view->observation(i);
    observation.right_x_px = kNoColumn;
    const Reprojection reprojection = Reproject(camera, frame.view->baseline_m(), point, observation);
    Eigen::Matrix<double, 3, 6> by_pose;
    by_pose << reprojection.by_point, -reprojection.by_point * Skew(point);
    const Eigen::Vector3d shift =
        RowTime(camera, observation.pixel_px.y()) * PointVelocity(motion, point) -
        RowTime(camera, reference_y_px) * (frame_from_reference * PointVelocity(reference.motion, in_reference));
    equations.Add(reprojection.residual, by_pose, reprojection.by_point * shift);
  }
  return equations;
}

}  // namespace

void ReadoutEstimator::Add(const TrackedFrame& frame, const CameraMotion& motion, const MovingView& reference) {
  const Equations equations = EquationsOf(frame, motion, reference);
  if (equations.num_points < kMinPoints) return;
  const Vector6d elimination = equations.information.ldlt().solve(equations.coupling);
  const double information = equations.readout_information - equations.coupling.dot(elimination);
  const double difference_s = (equations.readout_gradient - elimination.dot(equations.gradient)) / information;
  if (!(information > 0.0) || !std::isfinite(difference_s)) return;
  const double noise = equations.sum_of_squares / (2.0 * equations.num_points);
  const double gain = variance_ / (variance_ + kFrameSigma_s * kFrameSigma_s + noise / information);
  const double change_s = readout_s() + difference_s - estimate_s_;
  estimate_s_ += gain * std::clamp(change_s, -kFrameSigma_s, kFrameSigma_s);
  variance_ = std::max((1.0 - gain) * variance_, kMinSigma_s * kMinSigma_s);
}

double ReadoutEstimator::readout_s() const {
  const bool is_known = estimate_s_ > std::max(kMinReadout_s, kMinSigmas * std::sqrt(variance_));
  return is_known ? estimate_s_ : 0.0;
}

}  // namespace tessera
