#include "tracking/depth_delay_estimator.h"

#include <optional>

#include "geometry/reprojection.h"
#include "measurement/depth_delay.h"
#include "tracking/measured_points.h"

namespace tessera {
namespace {

constexpr double kMinDelay_s = 0.002;  // a shorter one isn't worth the work
// Motions that differ by less say too little: pixels in a hundredth of a second.
constexpr double kMinDifference_px = 0.5;
constexpr int kMaxPoints = 200;  // more of one frame say little more: its motion isn't known that well

bool DifferEnough(const TrackedFrame& frame, const CameraMotion& motion, const MovingView& reference) {
  const Eigen::Quaterniond frame_from_reference =
      frame.world_from_camera.rotation.conjugate() * reference.world_from_camera.rotation;
  const Eigen::Vector3d turn = motion.turn_rate - frame_from_reference * reference.motion.turn_rate;
  const Eigen::Vector3d step = motion.velocity - frame_from_reference * reference.motion.velocity;
  const double depth = frame.MedianDepth();
  if (depth <= 0.0) return false;
  return 0.01 * frame.view->calibration().fx_px * (turn.norm() + step.norm() / depth) > kMinDifference_px;
}

TimeOffsetEquations EquationsOf(const TrackedFrame& frame, const CameraMotion& motion, const MovingView& reference) {
  TimeOffsetEquations equations;
  const CameraCalibration& camera = frame.view->calibration();
  const double disparity_per_inverse_depth = camera.fx_px * frame.view->baseline_m();
  const Rigid3 frame_from_world = frame.world_from_camera.Inverse();
  const Rigid3 frame_from_reference = frame_from_world * reference.world_from_camera;
  const Rigid3 reference_from_frame = frame_from_reference.Inverse();
  for (const int i : MeasuredPoints(frame, kMaxPoints)) {
    const PixelObservation observation = frame.view->observation(i);
    const Eigen::Vector3d point = frame_from_world * frame.points[Index(i)].landmark.position_in_world;
    const Eigen::Vector3d in_reference = reference_from_frame * point;
    if (in_reference.z() < kMinDepth) continue;
    const std::optional<Eigen::Vector3d> surface = SurfaceAt(*frame.view, i);
    if (!surface) continue;
    const double rate = InverseDepthRate(*surface, camera.Ray(observation.pixel_px), motion);
    const double reference_rate =
        InverseDepthRate(SurfaceIn(frame_from_reference, *surface), in_reference / in_reference.z(), reference.motion);
    const Reprojection reprojection = Reproject(camera, frame.view->baseline_m(), point, observation);
    Eigen::Matrix<double, 3, 6> by_pose;
    by_pose << reprojection.by_point, -reprojection.by_point * Skew(point);
    const Eigen::Vector3d point_rate =
        -reference_rate * in_reference.z() * (frame_from_reference.rotation * in_reference);
    Eigen::Vector3d by_delay = reprojection.by_point * point_rate;
    by_delay.z() += disparity_per_inverse_depth * rate / observation.disparity_sigma_px;
    equations.Add(reprojection.residual, by_pose, by_delay, 3);
  }
  return equations;
}

}  // namespace

void DepthDelayEstimator::Add(const TrackedFrame& frame, const CameraMotion& motion, const MovingView& reference) {
  if (frame.view->calibration().sensor != SensorType::kRgbd || !DifferEnough(frame, motion, reference)) return;
  delay_.Add(EquationsOf(frame, motion, reference), delay_s());
}

double DepthDelayEstimator::delay_s() const { return delay_.value_s(kMinDelay_s); }

}  // namespace tessera
