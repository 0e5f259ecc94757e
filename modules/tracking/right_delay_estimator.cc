#include "tracking/right_delay_estimator.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <iterator>

#include "geometry/reprojection.h"
#include "measurement/right_delay.h"
#include "tracking/measured_points.h"

namespace tessera {
namespace {

constexpr double kMinDelay_s = 0.001;  // to be found
constexpr double kMinShare = 0.004;    // likewise
constexpr double kMinOfMost = 0.6;     // of what it explained at most, but for the very first frames
constexpr int kMinFrames = 20;         // that have to tell it
constexpr double kMapShare = 0.7;      // m; with 1 delays come out too short, and with 0 too long
// Of what one frame says of the delay: its motion isn't known exactly, nor is the map.
constexpr double kFrameSigma_s = 0.003;
// By each frame, of what the ones before said: the first had a map that was distorted.
constexpr double kForgotten = 0.05;
// What is usual: of the delay, and of what is left of a squint and a twist, at half the height of the image.
constexpr double kDelaySigma_s = 0.01, kShiftSigma_px = 0.5;
constexpr int kMinPoints = 50;
constexpr int kMaxPoints = 150;        // more of one frame say little more
constexpr size_t kMaxKeyframes = 300;  // older ones see few of the points

}  // namespace

void RightDelayEstimator::Add(const TrackedFrame& frame, const CameraMotion& motion, const MapReplica& replica) {
  if (frame.view->calibration().sensor != SensorType::kStereo) return;
  if (!keyframes_.empty() && !keyframes_.rbegin()->second.motion) keyframes_.rbegin()->second.motion = motion;
  taken_out_s_ = delay_s();
  const std::optional<Equations> equations = EquationsOf(frame, motion, replica);
  if (!equations) return;
  const double weight = 1.0 / (1.0 + kFrameSigma_s * kFrameSigma_s * equations->information(0, 0));
  // What was found isn't forgotten while the camera stands, which says nothing of it.
  const double memory = 1.0 - kForgotten * (is_found_ ? 1.0 - weight : 1.0);
  sum_.information = memory * sum_.information + weight * equations->information;
  sum_.right_side = memory * sum_.right_side + weight * equations->right_side;
  sum_.num_measured = memory * sum_.num_measured + weight * equations->num_measured;
  const Eigen::Vector3d sigmas(kDelaySigma_s, kShiftSigma_px, kShiftSigma_px);
  const Eigen::Matrix3d usual = sigmas.cwiseAbs2().cwiseInverse().asDiagonal();
  const Eigen::Matrix3d covariance = (sum_.information + usual).inverse();
  delay_s_ = covariance.row(0).dot(sum_.right_side);
  const double explained = delay_s_ * delay_s_ / (covariance(0, 0) * sum_.num_measured);
  const bool is_clear = ++num_frames_ >= kMinFrames && explained >= kMinShare && std::abs(delay_s_) >= kMinDelay_s;
  is_found_ = is_found_ || (is_clear && explained >= kMinOfMost * most_explained_);
  if (num_frames_ >= kMinFrames / 2) most_explained_ = std::max(most_explained_, explained);
}

void RightDelayEstimator::AddKeyframe(KeyframeId id, const std::optional<CameraMotion>& motion) {
  keyframes_[id] = {motion, motion ? taken_out_s_ : 0.0};
  if (keyframes_.size() > kMaxKeyframes) keyframes_.erase(keyframes_.begin());
}

void RightDelayEstimator::ForgetMotion() {
  if (!keyframes_.empty() && !keyframes_.rbegin()->second.motion) keyframes_.erase(std::prev(keyframes_.end()));
}

std::optional<RightDelayEstimator::Shift> RightDelayEstimator::ShiftOf(const SeenPoint& seen,
                                                                       const CameraCalibration& camera,
                                                                       const MapReplica& replica) const {
  Shift sum;
  double weight = 0.0;
  const auto add = [&](KeyframeId id) {
    const auto taken = keyframes_.find(id);
    if (taken == keyframes_.end() || !taken->second.motion) return;
    const std::optional<Sim3> world_from_keyframe = replica.WorldFromKeyframe(id);
    if (!world_from_keyframe) return;
    const Rigid3 world_from_camera = world_from_keyframe->Pose();
    const Eigen::Vector3d point = world_from_camera.Inverse() * seen.landmark.position_in_world;
    if (point.z() < kMinDepth) return;
    const double disparity_px = camera.fx_px * camera.baseline_m / point.z();
    const Eigen::Vector3d shift = disparity_px * RightColumnRate(camera, point, *taken->second.motion) *
                                  (seen.landmark.position_in_world - world_from_camera.translation);
    sum.by_delay += shift;
    sum.taken_out += taken->second.delay_s * shift;
    weight += disparity_px * disparity_px;
  };
  if (seen.id.landmark.valid()) {
    for (const Observation& observation : replica.map().ObservationsOf(seen.id.landmark)) add(observation.keyframe);
  } else {
    add(seen.id.keyframe);
  }
  if (weight == 0.0) return std::nullopt;
  return Shift{kMapShare / weight * sum.by_delay, kMapShare / weight * sum.taken_out};
}

std::optional<RightDelayEstimator::Equations> RightDelayEstimator::EquationsOf(const TrackedFrame& frame,
                                                                               const CameraMotion& motion,
                                                                               const MapReplica& replica) const {
  const CameraCalibration& camera = frame.view->calibration();
  const Rigid3 frame_from_world = frame.world_from_camera.Inverse();
  Eigen::Matrix<double, 9, 9> normal = Eigen::Matrix<double, 9, 9>::Zero();  // of p, d, c, e
  Eigen::Matrix<double, 9, 1> right_side = Eigen::Matrix<double, 9, 1>::Zero();
  double sum_of_squares = 0.0;
  int num_points = 0;
  for (const int i : MeasuredPoints(frame, kMaxPoints)) {
    const SeenPoint& seen = frame.points[Index(i)];
    const PixelObservation observation = frame.view->observation(i);
    const Eigen::Vector3d point = frame_from_world * seen.landmark.position_in_world;
    const std::optional<Shift> shift = ShiftOf(seen, camera, replica);
    if (!shift) continue;
    const Reprojection reprojection = Reproject(camera, frame.view->baseline_m(), point, observation);
    const Eigen::Matrix3d by_world_point = reprojection.by_point * frame_from_world.rotation.toRotationMatrix();
    const Eigen::Vector3d by_column(0.0, 0.0, 1.0 / observation.sigma_px);
    const Eigen::Vector3d rate = RightColumnRate(camera, point, motion) * by_column;
    const double y = 2.0 * RowTime(camera, observation.pixel_px.y());
    Eigen::Matrix<double, 3, 9> by_all;
    by_all << reprojection.by_point, -reprojection.by_point * Skew(point), by_world_point * shift->by_delay - rate,
        by_column, y * by_column;
    const Eigen::Vector3d residual = reprojection.residual + by_world_point * shift->taken_out - taken_out_s_ * rate;
    normal.noalias() += by_all.transpose() * by_all;
    right_side.noalias() += by_all.transpose() * residual;
    sum_of_squares += residual.squaredNorm();
    ++num_points;
  }
  if (num_points < kMinPoints) return std::nullopt;
  const Eigen::Matrix<double, 6, 3> elimination =
      normal.topLeftCorner<6, 6>().ldlt().solve(normal.topRightCorner<6, 3>());
  const double num_measured = 3.0 * num_points, noise = sum_of_squares / num_measured;
  Equations equations;
  equations.information = (normal.bottomRightCorner<3, 3>() - normal.bottomLeftCorner<3, 6>() * elimination) / noise;
  equations.right_side = (right_side.tail<3>() - elimination.transpose() * right_side.head<6>()) / noise;
  equations.num_measured = num_measured;
  if (!equations.information.allFinite() || !equations.right_side.allFinite()) return std::nullopt;
  return equations;
}

}  // namespace tessera
