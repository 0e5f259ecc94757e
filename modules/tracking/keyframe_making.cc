#include "tracking/keyframe_making.h"

#include <Eigen/LU>
#include <cmath>

#include "measurement/landmark_description.h"
#include "tracking/pair_points.h"

namespace tessera {
namespace {

constexpr double kOpenShare = 0.01;      // of a way from keyframe to keyframe
constexpr double kFamiliarShare = 0.15;  // of that way: a standard deviation an axis, as vehicles' motions know it
constexpr int kMaxSharedAtPair = 100;    // with fewer known points, a wide pair's points go to the mapper as well
constexpr int kMinKnownPoints = 60;      // a frame that sees fewer on an open way is about to lose sight of all

// Whether the images leave the length of the way from the reference keyframe open by more than kOpenShare of it.
bool IsWayOpen(const LocalizedFrame& localized) {
  if (!localized.covariance) return true;
  const Rigid3& way = localized.reference_from_camera;
  const Eigen::Vector3d way_in_camera = way.rotation.conjugate() * way.translation;
  const double variance = way_in_camera.dot(*localized.covariance * way_in_camera);  // of the length, times length^2
  return std::sqrt(variance) > kOpenShare * way_in_camera.squaredNorm();
}

// Whether the images leave the way open, and how the camera moved a moment ago says well what it is.
bool IsWayFamiliar(const KeyframeObservation& keyframe) {
  if (!keyframe.expected.is_known()) return false;
  const double variance = keyframe.expected.information.inverse().trace() / 3.0;
  return std::sqrt(variance) < kFamiliarShare * keyframe.reference_from_camera.translation.norm();
}

}  // namespace

KeyframeObservation ObserveKeyframe(KeyframeId id, const LocalizedFrame& localized, const CameraCalibration& given,
                                    const ReferenceKeyframe& reference, const MapReplica& replica) {
  const TrackedFrame& frame = localized.frame;
  KeyframeObservation keyframe;
  keyframe.id = id;
  keyframe.features = frame.view->features();
  keyframe.features.calibration = given;
  keyframe.features.calibration.radial = frame.view->calibration().radial;
  keyframe.features.calibration.right_shift = frame.view->calibration().right_shift;
  keyframe.world_from_camera = frame.world_from_camera;
  keyframe.reference = reference.id;
  keyframe.reference_from_camera = localized.reference_from_camera;
  if (IsWayOpen(localized)) {
    keyframe.expected = reference.ExpectAt(localized.reference_from_camera, keyframe.features.utime_us);
  }
  keyframe.landmarks.resize(frame.points.size());
  for (size_t i = 0; i < frame.points.size(); ++i) {
    const SeenPoint& point = frame.points[i];
    keyframe.landmarks[i] = point.id.landmark;
    if (point.id.keyframe.valid()) {
      const Sim3 other_from_world = replica.WorldFromKeyframe(point.id.keyframe).value_or(Sim3{}).Inverse();
      keyframe.shared.push_back({static_cast<int32_t>(i), point.id.keyframe, point.id.keypoint,
                                 other_from_world * point.landmark.position_in_world});
    }
  }
  return keyframe;
}

Landmark PointOf(const FrameView& view, int32_t keypoint, const Eigen::Vector3d& point_in_camera,
                 const Eigen::Matrix3d* covariance) {
  Landmark point = DescribeInCamera(view.features(), keypoint, point_in_camera);
  const double information = covariance != nullptr
                                 ? 1.0 / point.normal.dot(*covariance * point.normal)
                                 : DepthInformation(view.features(), keypoint, Rigid3::Identity(), point);
  point.depth_sigma = DepthSigma(information, point_in_camera.norm());
  return point;
}

void AddDepthPoints(KeyframeId id, const DepthPointOptions& options, TrackedFrame& frame, SentKeyframe& sent) {
  const auto sees_known = [&frame](int32_t i) { return frame.points[Index(i)].valid(); };
  for (const auto& [keypoint, point] : NewDepthPoints(frame.view->features(), sees_known, options)) {
    const Landmark in_camera = PointOf(*frame.view, keypoint, point);
    sent.points[keypoint] = in_camera;
    frame.points[Index(keypoint)] = {{{}, id, keypoint}, InWorld(Sim3::From(frame.world_from_camera), in_camera)};
  }
}

void AddPairPoints(const ReferenceKeyframe& reference, const MapReplica& replica, LocalizedFrame& localized,
                   KeyframeObservation& keyframe, SentKeyframe& sent) {
  TrackedFrame& frame = localized.frame;
  const int num_known = frame.NumPoints();
  const bool fades = num_known < kMinKnownPoints && IsWayFamiliar(keyframe);
  if (frame.view->baseline_m() > 0.0 || !reference.frame || !(localized.is_wide_step || fades)) return;
  const Sim3 world_from_reference = reference.WorldFromKeyframe(replica);
  TrackedFrame other = *reference.frame;
  other.world_from_camera = world_from_reference.Pose();
  const bool shares = localized.is_wide_step && num_known < kMaxSharedAtPair;
  const Sim3 units = Sim3::From({}, 1.0 / world_from_reference.scale);
  for (const PairPoint& point : FindPairPoints(frame, other)) {
    const Landmark in_world = InWorld(Sim3::From(frame.world_from_camera), point.in_camera);
    sent.points[point.keypoint] = InWorld(units, point.in_camera);
    frame.points[Index(point.keypoint)] = {{{}, keyframe.id, point.keypoint}, in_world};
    if (!shares) continue;
    keyframe.shared.push_back({point.keypoint, reference.id, point.other_keypoint,
                               world_from_reference.Inverse() * in_world.position_in_world});
  }
}

}  // namespace tessera
