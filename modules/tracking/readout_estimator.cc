#include "tracking/readout_estimator.h"

#include <algorithm>

#include "geometry/reprojection.h"
#include "measurement/landmark_description.h"

namespace tessera {
namespace {

constexpr double kMinReadout_s = 0.005;  // a shorter one isn't worth a risk

TimeOffsetEquations EquationsOf(const TrackedFrame& frame, const CameraMotion& motion, const MovingView& reference) {
  TimeOffsetEquations equations;
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
    equations.Add(reprojection.residual, by_pose, reprojection.by_point * shift, 2);
  }
  return equations;
}

}  // namespace

void ReadoutEstimator::Add(const TrackedFrame& frame, const CameraMotion& motion, const MovingView& reference) {
  readout_.Add(EquationsOf(frame, motion, reference), readout_s());
}

double ReadoutEstimator::readout_s() const { return std::max(0.0, readout_.value_s(kMinReadout_s)); }

}  // namespace tessera
