#include "tracking/readout_estimator.h"

#include <algorithm>

#include "geometry/reprojection.h"
#include "measurement/landmark_description.h"

namespace tessera {
namespace {

constexpr double kMinReadout_s = 0.005;  // a shorter one isn't worth a risk
constexpr double kMinShare = 0.03;       // TimeOffset::ExplainedShare of how images are read
constexpr int kMinFrames = 20;           // that have to tell it
// Of rows from the top in mono: at once, or after so many frames.
constexpr double kClearMonoShare = 0.02, kMinMonoShare = 0.005;
constexpr int kMinMonoFrames = 80;

struct Equations {
  TimeOffsetEquations down, across;
};

Equations EquationsOf(const TrackedFrame& frame, const CameraMotion& motion, const MovingView& reference) {
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
    const Eigen::Vector2d reference_pixel = camera.Project(in_reference);
    if (reference_pixel.y() < 0.0 || reference_pixel.y() > camera.height_px) continue;
    PixelObservation observation = frame.view->observation(i);
    observation.right_x_px = kNoColumn;
    const Reprojection reprojection = Reproject(camera, frame.view->baseline_m(), point, observation);
    Eigen::Matrix<double, 3, 6> by_pose;
    by_pose << reprojection.by_point, -reprojection.by_point * Skew(point);
    const Eigen::Vector3d velocity = PointVelocity(motion, point);
    const Eigen::Vector3d reference_velocity = frame_from_reference * PointVelocity(reference.motion, in_reference);
    const auto add = [&](double time, double reference_time, TimeOffsetEquations& to) {
      const Eigen::Vector3d shift = time * velocity - reference_time * reference_velocity;
      to.Add(reprojection.residual, by_pose, reprojection.by_point * shift, 2);
    };
    add(RowTime(camera, observation.pixel_px.y()), RowTime(camera, reference_pixel.y()), equations.down);
    add(ColumnTime(camera, observation.pixel_px.x()), ColumnTime(camera, reference_pixel.x()), equations.across);
  }
  return equations;
}

}  // namespace

void ReadoutEstimator::Add(const TrackedFrame& frame, const CameraMotion& motion, const MovingView& reference) {
  const Equations equations = EquationsOf(frame, motion, reference);
  const Readout used = readout();
  down_.Add(equations.down, used.down_s);
  across_.Add(equations.across, used.across_s);
  if (order_ == Order::kUnknown) order_ = FindOrder();
  const bool is_mono = frame.view->calibration().sensor == SensorType::kMono;
  const double min_mono_share = down_.num_frames() < kMinMonoFrames ? kClearMonoShare : kMinMonoShare;
  const bool is_told = !is_mono || down_.ExplainedShare() >= min_mono_share;
  rolls_ |= is_told && down_.value_s(kMinReadout_s) > 0.0;
}

ReadoutEstimator::Order ReadoutEstimator::FindOrder() const {
  if (down_.num_frames() < kMinFrames) return Order::kUnknown;
  const double by_rows = down_.ExplainedShare(), by_columns = across_.ExplainedShare();
  if (by_columns >= kMinShare && by_columns > by_rows) return Order::kAcross;
  const double down_s = down_.value_s(kMinReadout_s);
  if (!(by_rows >= kMinShare) || down_s == 0.0) return Order::kUnknown;
  return down_s < 0.0 ? Order::kUp : Order::kDown;
}

Readout ReadoutEstimator::readout() const {
  const double down_s = down_.value_s(kMinReadout_s);
  switch (order_) {
    case Order::kAcross:
      return {.across_s = across_.value_s(kMinReadout_s)};
    case Order::kUp:
      return {.down_s = std::min(0.0, down_s)};
    case Order::kDown:
    case Order::kUnknown:
      break;
  }
  return {.down_s = rolls_ ? std::max(0.0, down_s) : 0.0};
}

}  // namespace tessera
